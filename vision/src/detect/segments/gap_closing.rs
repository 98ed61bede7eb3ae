//! Runs of edge pixels in, runs joined over small gaps and straight through junctions out (method
//! 1.2).
//!
//! Departs from method 1.2, where chains stop at junctions: a side that another edge touches would
//! break into pieces. The two runs of a junction that agree in tangent and polarity are joined, the
//! others end there.

use crate::detect::edges::edge_map::EdgeMap;
use nalgebra::Vector2;

/// Parameters of this stage.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ChainParams {
    /// Largest number of missing pixels between two chain ends that are joined; 0 to 8.
    pub max_gap_px: u32,
    /// Largest angle between the tangents of two ends that are joined, degrees.
    pub max_bend_deg: f64,
    /// Chains with fewer points are dropped.
    pub min_points: usize,
}

impl Default for ChainParams {
    fn default() -> Self {
        Self { max_gap_px: 2, max_bend_deg: 30.0, min_points: 10 }
    }
}

/// A traced run of pixels, before gaps are closed: row-major indices in a buffer shared by all
/// runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct PixelRun {
    pub(crate) start: usize,
    pub(crate) end: usize,
    pub(crate) closed: bool,
}

/// Pixels over which the tangent at an end is taken.
const TANGENT_PX: usize = 6;
/// Largest accepted `max_gap_px`.
const MAX_GAP_PX: u32 = 8;

/// One end of a run. End `2 i` is the start of run i, `2 i + 1` its end.
struct End {
    id: usize,
    u: i32,
    v: i32,
    /// Unit vector out of the run.
    outward: Vector2<f64>,
    gradient: Vector2<f32>,
}

/// Hands every joined run to `emit`: pixel indices in order, and whether it is closed. Closest ends
/// are joined first.
pub(crate) fn bridged(
    edges: &EdgeMap,
    p: &ChainParams,
    pixels: &[u32],
    runs: &[PixelRun],
    mut emit: impl FnMut(&[u32], bool),
) {
    let links = links(edges, p, pixels, runs);
    let mut used = vec![false; runs.len()];
    let mut joined = Vec::new();
    // First the runs that have a free end, then what forms rings.
    for ring in [false, true] {
        for run in 0..runs.len() {
            let entry = match (links[2 * run], links[2 * run + 1]) {
                _ if used[run] => continue,
                (None, _) => 2 * run,
                (_, None) => 2 * run + 1,
                _ if ring => 2 * run,
                _ => continue,
            };
            joined.clear();
            let mut at = entry;
            loop {
                used[at / 2] = true;
                let PixelRun { start, end, .. } = runs[at / 2];
                // Two runs that end in one junction share its pixel.
                let shared = joined.last() == Some(&pixels[if at % 2 == 0 { start } else { end - 1 }]);
                let skip = usize::from(shared);
                if at % 2 == 0 {
                    joined.extend_from_slice(&pixels[start + skip..end]);
                } else {
                    joined.extend(pixels[start..end].iter().rev().skip(skip));
                }
                match links[at ^ 1] {
                    Some(next) if !used[next / 2] => at = next,
                    _ => break,
                }
            }
            emit(&joined, ring || runs[run].closed);
        }
    }
}

/// For every end, the end it is joined to.
fn links(edges: &EdgeMap, p: &ChainParams, pixels: &[u32], runs: &[PixelRun]) -> Vec<Option<usize>> {
    let ends = ends(edges, pixels, runs);
    let reach = p.max_gap_px.min(MAX_GAP_PX) as i32 + 1;
    let min_cos = p.max_bend_deg.to_radians().cos();
    let mut candidates = Vec::new();
    // Where the neighbours start, for every row of the neighbourhood: the ends are in order, so it
    // only moves on.
    let mut firsts = [0; MAX_GAP_PX as usize + 2];
    for (i, a) in ends.iter().enumerate() {
        for (dv, first) in (0..=reach).zip(&mut firsts) {
            *first += ends[*first..].iter().take_while(|b| (b.v, b.u) < (a.v + dv, a.u - reach)).count();
            let near = &ends[(*first).max(i + 1)..];
            for b in near.iter().take_while(|b| b.v == a.v + dv && b.u <= a.u + reach) {
                if let Some(cost) = cost(a, b, min_cos) {
                    candidates.push((cost, a.id.min(b.id), a.id.max(b.id)));
                }
            }
        }
    }
    candidates.sort_unstable_by(|x, y| x.0.total_cmp(&y.0).then((x.1, x.2).cmp(&(y.1, y.2))));
    let mut links = vec![None; 2 * runs.len()];
    for (_, a, b) in candidates {
        if links[a].is_none() && links[b].is_none() {
            (links[a], links[b]) = (Some(b), Some(a));
        }
    }
    links
}

/// Distance and bend of a bridge, smaller is better; None when it is none.
fn cost(a: &End, b: &End, min_cos: f64) -> Option<f64> {
    let straight = -a.outward.dot(&b.outward);
    if a.id / 2 == b.id / 2 || straight < min_cos || a.gradient.dot(&b.gradient) <= 0.0 {
        return None;
    }
    let gap = Vector2::new(f64::from(b.u - a.u), f64::from(b.v - a.v));
    // Over one pixel the direction of the gap says nothing; over more it has to agree too.
    let ahead = (a.outward - b.outward).dot(&gap) >= gap.norm() * std::f64::consts::SQRT_2;
    (gap.norm() < 1.0 || ahead).then_some(gap.norm() + 4.0 * (1.0 - straight))
}

/// The ends of open runs, sorted by row, then column.
fn ends(edges: &EdgeMap, pixels: &[u32], runs: &[PixelRun]) -> Vec<End> {
    let width = edges.width();
    let end = |id: usize, tip: usize, base: usize| {
        let (tip, base) = (pixels[tip] as usize, pixels[base] as usize);
        let (u, v) = ((tip % width) as i32, (tip / width) as i32);
        let outward =
            Vector2::new(f64::from(u - (base % width) as i32), f64::from(v - (base / width) as i32));
        End { id, u, v, outward: outward.normalize(), gradient: edges.gradient(tip % width, tip / width) }
    };
    let mut ends = Vec::with_capacity(2 * runs.len());
    for (i, run) in runs.iter().enumerate().filter(|(_, run)| !run.closed) {
        let reach = TANGENT_PX.min(run.end - run.start - 1);
        // A loop that ends where it starts may give no tangent.
        ends.extend(
            [end(2 * i, run.start, run.start + reach), end(2 * i + 1, run.end - 1, run.end - 1 - reach)]
                .into_iter()
                .filter(|e| e.outward.x.is_finite()),
        );
    }
    ends.sort_unstable_by_key(|e| (e.v, e.u, e.id));
    ends
}
