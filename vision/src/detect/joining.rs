//! Straight fragments in, fragments of one line joined out (method 1.3): corners, junctions and clutter break sides
//! that the next stages want whole.

use super::segments::SegmentParams;
use crate::geometry::line::{LineFit, LineSums};
use nalgebra::{Point2, Vector2};

/// Side of a grid cell in which ends are looked up.
const CELL_PX: f64 = 16.0;
/// Most fragments that take part, the longest first; the rest stays as it is.
const MAX_FRAGMENTS: usize = 8192;
/// Rounds of joining; each at least halves what still has a partner.
const MAX_ROUNDS: usize = 8;

/// A straight run of edge points, with all sums that a refit needs.
#[derive(Debug, Clone)]
pub(crate) struct Fragment {
    /// Points the line is fitted on.
    pub(crate) sums: LineSums,
    pub(crate) fit: LineFit,
    /// Sum of the gradients; tells the bright side.
    pub(crate) gradient: Vector2<f64>,
    /// Sum of the gradients' magnitudes over `points` points.
    pub(crate) magnitude: f64,
    pub(crate) points: usize,
    /// Ends, on the fitted line; the bright side is on the right from `p` to `q`.
    pub(crate) p: Point2<f64>,
    pub(crate) q: Point2<f64>,
    pub(crate) chain: usize,
}

impl Fragment {
    /// None when the points have no line.
    pub(crate) fn new(
        sums: LineSums,
        gradient: Vector2<f64>,
        magnitude: f64,
        points: usize,
        ends: &[Point2<f64>],
        chain: usize,
    ) -> Option<Self> {
        let mut fit = sums.fit()?;
        if fit.line.normal.dot(&gradient) < 0.0 {
            fit.line = fit.line.flipped();
        }
        let d = fit.line.direction();
        let along = |p: &&Point2<f64>| d.dot(&p.coords);
        let first = ends.iter().min_by(|a, b| along(a).total_cmp(&along(b)))?;
        let last = ends.iter().max_by(|a, b| along(a).total_cmp(&along(b)))?;
        let (p, q) = (fit.line.project(first), fit.line.project(last));
        Some(Self { sums, fit, gradient, magnitude, points, p, q, chain })
    }

    pub(crate) fn length_px(&self) -> f64 {
        (self.q - self.p).norm()
    }

    /// Both as one, if they follow one line closely enough.
    fn joined(&self, other: &Self, p: &SegmentParams) -> Option<Self> {
        let (da, db) = (self.fit.line.direction(), other.fit.line.direction());
        let max_sin = p.join_angle_deg.to_radians().sin();
        if da.dot(&db) <= 0.0 || da.perp(&db).abs() > max_sin {
            return None;
        }
        let (long, short) = if self.length_px() >= other.length_px() { (self, other) } else { (other, self) };
        let ends = [self.p, self.q, other.p, other.q];
        let joint = Self::new(
            self.sums + other.sums,
            self.gradient + other.gradient,
            self.magnitude + other.magnitude,
            self.points + other.points,
            &ends,
            long.chain,
        )?;
        // The short one lies beside neither the long one nor the common line.
        let lateral = [short.p, short.q].iter().map(|e| long.fit.line.distance(e).abs()).fold(0.0, f64::max);
        let residual = ends.iter().map(|e| joint.fit.line.distance(e).abs()).fold(0.0, f64::max);
        let gap = joint.length_px() - self.length_px() - other.length_px();
        let close = gap <= p.join_gap_share * joint.length_px() && gap > -p.join_lateral_px * 2.0;
        (close && lateral <= p.join_lateral_px && residual <= p.join_lateral_px).then_some(joint)
    }
}

/// Joins fragments until nothing fits. Deterministic: longest first, then by index.
pub(crate) fn join(mut fragments: Vec<Fragment>, p: &SegmentParams) -> Vec<Fragment> {
    sort(&mut fragments);
    let rest = fragments.split_off(fragments.len().min(MAX_FRAGMENTS));
    for _ in 0..MAX_ROUNDS {
        let before = fragments.len();
        fragments = join_once(&fragments, p);
        if fragments.len() == before {
            break;
        }
        sort(&mut fragments);
    }
    fragments.extend(rest);
    fragments
}

fn sort(fragments: &mut [Fragment]) {
    // Stable: equal lengths keep the order of their chains.
    fragments.sort_by(|a, b| b.length_px().total_cmp(&a.length_px()));
}

/// One round: every fragment takes, at each end, the nearest fitting fragment that is not longer than itself.
fn join_once(fragments: &[Fragment], p: &SegmentParams) -> Vec<Fragment> {
    let grid = Grid::new(fragments);
    let mut taken = vec![false; fragments.len()];
    let mut joined = Vec::with_capacity(fragments.len());
    for i in 0..fragments.len() {
        if std::mem::replace(&mut taken[i], true) {
            continue;
        }
        let mut whole = fragments[i].clone();
        // gap <= share * (long + short + gap) with short <= long.
        let share = p.join_gap_share.clamp(0.0, 0.5);
        let reach = 2.0 * share / (1.0 - share) * whole.length_px() + CELL_PX;
        let d = whole.fit.line.direction();
        for (end, outward) in [(whole.p, -d), (whole.q, d)] {
            let mut step = 0.0;
            while step <= reach {
                let near = grid.near(end + outward * step);
                let found =
                    near.filter(|&j| !taken[j]).filter_map(|j| Some((j, whole.joined(&fragments[j], p)?)));
                let best =
                    found.max_by(|a, b| b.1.length_px().total_cmp(&a.1.length_px()).then(b.0.cmp(&a.0)));
                if let Some((j, joint)) = best {
                    taken[j] = true;
                    whole = joint;
                    break;
                }
                step += CELL_PX;
            }
        }
        joined.push(whole);
    }
    joined
}

/// Ends of fragments by cell, in one sorted list.
struct Grid {
    ends: Vec<(i64, i64, usize)>,
}

impl Grid {
    fn new(fragments: &[Fragment]) -> Self {
        let cell = |e: &Point2<f64>, i| {
            let (u, v) = Self::cell(e);
            (v, u, i)
        };
        let mut ends: Vec<_> =
            fragments.iter().enumerate().flat_map(|(i, f)| [cell(&f.p, i), cell(&f.q, i)]).collect();
        ends.sort_unstable();
        Self { ends }
    }

    fn cell(p: &Point2<f64>) -> (i64, i64) {
        ((p.x / CELL_PX).floor() as i64, (p.y / CELL_PX).floor() as i64)
    }

    /// Fragments with an end in the cell of `p` or one beside it.
    fn near(&self, p: Point2<f64>) -> impl Iterator<Item = usize> {
        let (u, v) = Self::cell(&p);
        (v - 1..=v + 1).flat_map(move |row| {
            let from = self.ends.partition_point(|e| (e.0, e.1) < (row, u - 1));
            self.ends[from..].iter().take_while(move |e| e.0 == row && e.1 <= u + 1).map(|e| e.2)
        })
    }
}
