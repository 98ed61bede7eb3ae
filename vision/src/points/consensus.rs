//! Tentative matches in, the homography that most of them agree on out. Deterministic: hypotheses
//! come from pairs of the best matches, in their order.
//!
//! A patch is rectified already, so that a pair of matches (a scale along each axis and a
//! translation) starts close enough for the refits, which free the affine and then the perspective
//! part.

use crate::{
    geometry::homography::Homography,
    points::{matching::Match, point::Point},
};
use fearless_simd::{Level, dispatch};
use nalgebra::{Matrix3, Point2};

/// Matches that pairs are drawn from, the best first.
pub const MAX_PAIRED: usize = 30;
/// Pairs closer than this along an axis, in landmark units, do not determine its scale.
const MIN_BASE: f32 = 0.1;
/// Largest residual of a match with a hypothesis, in landmark units.
const ROUGH: f64 = 0.06;
/// Largest residual of a match with the homography, in landmark units.
pub const TOLERANCE: f64 = 0.03;
/// Fewest matches of an affine refit and of a homography.
const MIN_AFFINE: usize = 4;
const MIN_HOMOGRAPHY: usize = 8;
/// Hypotheses that are refitted.
const MAX_REFITTED: usize = 4;
/// Bounds of the area of the landmark in the patch's quad.
const AREA: [f64; 2] = [0.25, 4.0];
/// Matches closer than this, in landmark units, count once.
const APART: f32 = 0.025;

/// A position on the landmark and its position in the patch.
type Pair = (Point2<f64>, Point2<f64>);

/// The homography with its inliers.
#[derive(Debug, Clone, PartialEq)]
pub struct Consensus {
    /// Maps landmark coordinates to the patch's landmark coordinates.
    pub seen_from_taught: Homography,
    /// Indices into the matches.
    pub inliers: Vec<usize>,
    /// Inliers at different places.
    pub distinct: usize,
}

/// The homography that most of `matches` agree on.
pub fn consensus(seen: &[Point], taught: &[Point], matches: &[Match], least: usize) -> Option<Consensus> {
    let pairs: Vec<Pair> =
        matches.iter().map(|m| (point(taught[m.taught].at), point(seen[m.seen].at))).collect();
    let mut starts = dispatch!(Level::new(), _s => supported(&pairs, least));
    starts.sort_by_key(|start| std::cmp::Reverse(start.0));
    let mut best: Option<Consensus> = None;
    let mut tried: Vec<[f64; 4]> = Vec::new();
    for (_, map) in starts {
        if tried.iter().any(|t| t.iter().zip(&map).all(|(a, b)| (a - b).abs() < 0.03)) {
            continue;
        }
        if tried.len() == MAX_REFITTED {
            break;
        }
        tried.push(map);
        let Some(found) = refitted(map, &pairs, taught, matches) else { continue };
        if best.as_ref().is_none_or(|b| found.distinct > b.distinct) {
            best = Some(found);
        }
    }
    best
}

/// Rough hypotheses with at least `least` matches.
#[expect(
    clippy::inline_always,
    reason = "an instruction set holds only in what is inlined where it was chosen"
)]
#[inline(always)]
fn supported(pairs: &[Pair], least: usize) -> Vec<(usize, [f64; 4])> {
    let column = |of: &dyn Fn(&Pair) -> f64| -> Vec<f32> { pairs.iter().map(|p| of(p) as f32).collect() };
    let (tx, ty) = (column(&|p| p.0.x), column(&|p| p.0.y));
    let (sx, sy) = (column(&|p| p.1.x), column(&|p| p.1.y));
    let n = pairs.len();
    let (tx, ty, sx, sy) = (&tx[..n], &ty[..n], &sx[..n], &sy[..n]);
    let mut starts: Vec<(usize, [f64; 4])> = Vec::new();
    let rough = ROUGH as f32;
    for i in 0..n.min(MAX_PAIRED) {
        for j in 0..i {
            let Some(map) = from_pair(&pairs[i], &pairs[j]) else { continue };
            let [a, b, c, d] = map.map(|m| m as f32);
            let mut count = 0_u32;
            for k in 0..n {
                let (ex, ey) = (a * tx[k] + b - sx[k], c * ty[k] + d - sy[k]);
                count += u32::from(ex.abs() < rough) & u32::from(ey.abs() < rough);
            }
            if count as usize >= least.max(MIN_AFFINE) {
                starts.push((count as usize, map));
            }
        }
    }
    starts
}

fn point(at: [f32; 2]) -> Point2<f64> {
    Point2::new(f64::from(at[0]), f64::from(at[1]))
}

/// Scale and shift along x, then along y.
fn from_pair(a: &Pair, b: &Pair) -> Option<[f64; 4]> {
    let along = |i: usize| {
        let base = a.0[i] - b.0[i];
        (base.abs() > f64::from(MIN_BASE)).then(|| {
            let scale = (a.1[i] - b.1[i]) / base;
            (scale, f64::midpoint(a.1[i] + b.1[i], -scale * (a.0[i] + b.0[i])))
        })
    };
    let (x, y) = match (along(0), along(1)) {
        (Some(x), Some(y)) => (x, y),
        // Along one axis only: the other has the same scale.
        (Some(x), None) => (x, (x.0, shift(x.0, a, b, 1))),
        (None, Some(y)) => ((y.0, shift(y.0, a, b, 0)), y),
        (None, None) => return None,
    };
    let sane = |s: f64| (0.5..=2.0).contains(&s);
    (sane(x.0) && sane(y.0)).then_some([x.0, x.1, y.0, y.1])
}

fn shift(scale: f64, a: &Pair, b: &Pair, i: usize) -> f64 {
    f64::midpoint(a.1[i] - scale * a.0[i], b.1[i] - scale * b.0[i])
}

fn refitted(start: [f64; 4], pairs: &[Pair], taught: &[Point], matches: &[Match]) -> Option<Consensus> {
    let matrix = Matrix3::new(start[0], 0.0, start[1], 0.0, start[2], start[3], 0.0, 0.0, 1.0);
    let mut map = Homography::from_matrix(matrix)?;
    let mut inliers = within(&map, pairs, ROUGH);
    let mut best: Option<Consensus> = None;
    for step in 0..5 {
        if inliers.len() < MIN_AFFINE {
            break;
        }
        let from: Vec<Point2<f64>> = inliers.iter().map(|i| pairs[*i].0).collect();
        let to: Vec<Point2<f64>> = inliers.iter().map(|i| pairs[*i].1).collect();
        let fitted = if inliers.len() >= MIN_HOMOGRAPHY {
            Homography::fit(&from, &to).ok()
        } else {
            affine(&from, &to)
        };
        let Some(fitted) = fitted else { break };
        map = fitted;
        let tolerance = if step == 0 { 0.75 * ROUGH } else { TOLERANCE };
        inliers = within(&map, pairs, tolerance);
        if step == 0 || !is_sane(&map) {
            continue;
        }
        let distinct = distinct(&inliers, taught, matches);
        if best.as_ref().is_none_or(|b| distinct > b.distinct) {
            best = Some(Consensus { seen_from_taught: map, inliers: inliers.clone(), distinct });
        }
    }
    best
}

fn within(map: &Homography, pairs: &[Pair], tolerance: f64) -> Vec<usize> {
    (0..pairs.len())
        .filter(|i| {
            let (t, s) = &pairs[*i];
            map.denominator(t) > 0.0 && (map.apply(t) - s).norm() < tolerance
        })
        .collect()
}

/// Least squares.
fn affine(from: &[Point2<f64>], to: &[Point2<f64>]) -> Option<Homography> {
    let mut normal = Matrix3::zeros();
    let (mut right_x, mut right_y) = (nalgebra::Vector3::zeros(), nalgebra::Vector3::zeros());
    for (f, t) in from.iter().zip(to) {
        let row = nalgebra::Vector3::new(f.x, f.y, 1.0);
        normal += row * row.transpose();
        right_x += row * t.x;
        right_y += row * t.y;
    }
    let inverse = normal.try_inverse()?;
    let (x, y) = (inverse * right_x, inverse * right_y);
    Homography::from_matrix(Matrix3::new(x[0], x[1], x[2], y[0], y[1], y[2], 0.0, 0.0, 1.0))
}

/// Whether the mapped corners of the landmark are a convex quad of the same orientation and about
/// the same size.
fn is_sane(map: &Homography) -> bool {
    let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(Point2::from);
    if corners.iter().any(|c| map.denominator(c) <= 0.0) {
        return false;
    }
    let c = corners.map(|c| map.apply(&c));
    let convex = (0..4).all(|i| {
        let turn = (c[(i + 1) % 4] - c[i]).perp(&(c[(i + 2) % 4] - c[(i + 1) % 4]));
        turn > 0.05
    });
    let area = 0.5 * (c[2] - c[0]).perp(&(c[3] - c[1]));
    convex && (AREA[0]..=AREA[1]).contains(&area)
}

/// How many of `inliers` lie at different positions on the landmark.
pub fn distinct(inliers: &[usize], taught: &[Point], matches: &[Match]) -> usize {
    let mut places: Vec<[f32; 2]> = Vec::with_capacity(inliers.len());
    for i in inliers {
        let at = taught[matches[*i].taught].at;
        if places.iter().all(|p| (p[0] - at[0]).abs() > APART || (p[1] - at[1]).abs() > APART) {
            places.push(at);
        }
    }
    places.len()
}
