//! Points of a patch and of a landmark in, tentative matches out: mutual nearest neighbours within
//! a gate of place and scale, clearly nearer than the next neighbour elsewhere.

use crate::points::point::Point;
use fearless_simd::{Level, dispatch};

/// Gates of a match.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MatchGate {
    /// Largest difference of place along an axis, in landmark units.
    pub place: f32,
    /// Largest ratio of scales.
    pub scale: f32,
    /// Largest descriptor distance.
    pub distance: u32,
    /// A match is nearer than this share of the next neighbour elsewhere.
    pub ratio: f32,
}

/// Neighbours nearer to each other than this, in landmark units, count as the same position.
const SAME_PLACE: f32 = 0.04;

/// A tentative match.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Match {
    /// Index of the patch's point.
    pub seen: usize,
    /// Index of the landmark's point.
    pub taught: usize,
    /// Descriptor distance.
    pub distance: u32,
    /// Distance over that of the next neighbour elsewhere; 1 at most.
    pub ratio: f32,
}

/// Matches of `seen` with `taught`, best ratio first.
pub fn matches(seen: &[Point], taught: &[Point], gate: &MatchGate) -> Vec<Match> {
    dispatch!(Level::new(), _s => search(seen, taught, gate))
}

#[expect(
    clippy::inline_always,
    reason = "an instruction set holds only in what is inlined where it was chosen"
)]
#[inline(always)]
fn search(seen: &[Point], taught: &[Point], gate: &MatchGate) -> Vec<Match> {
    let column = |of: fn(&Point) -> f32| -> Vec<f32> { taught.iter().map(of).collect() };
    let (x, y, sigma) = (column(|p| p.at[0]), column(|p| p.at[1]), column(|p| p.sigma));
    let mut near = vec![0_u8; taught.len()];
    let mut best_of_taught: Vec<(u32, usize)> = vec![(u32::MAX, 0); taught.len()];
    let mut found = Vec::new();
    for (s, point) in seen.iter().enumerate() {
        let (mut best, mut next): ((u32, usize), u32) = ((u32::MAX, 0), u32::MAX);
        for (near, ((x, y), sigma)) in near.iter_mut().zip(x.iter().zip(&y).zip(&sigma)) {
            *near = u8::from((x - point.at[0]).abs() <= gate.place)
                & u8::from((y - point.at[1]).abs() <= gate.place)
                & u8::from(point.sigma <= sigma * gate.scale)
                & u8::from(*sigma <= point.sigma * gate.scale);
        }
        for (t, _) in near.iter().enumerate().filter(|(_, near)| **near != 0) {
            let other = &taught[t];
            let d = point.descriptor.distance(&other.descriptor);
            if d < best_of_taught[t].0 {
                best_of_taught[t] = (d, s);
            }
            if d < best.0 {
                if best.0 < next && elsewhere(&taught[best.1], other) {
                    next = best.0;
                }
                best = (d, t);
            } else if d < next && elsewhere(&taught[best.1], other) {
                next = d;
            }
        }
        if best.0 > gate.distance {
            continue;
        }
        let ratio = if next == u32::MAX { 0.9 } else { best.0 as f32 / next as f32 };
        if ratio < gate.ratio {
            found.push(Match { seen: s, taught: best.1, distance: best.0, ratio });
        }
    }
    found.retain(|m| best_of_taught[m.taught].1 == m.seen);
    found.sort_by(|a, b| a.ratio.total_cmp(&b.ratio).then(a.seen.cmp(&b.seen)));
    found
}

fn elsewhere(a: &Point, b: &Point) -> bool {
    (a.at[0] - b.at[0]).abs() > SAME_PLACE || (a.at[1] - b.at[1]).abs() > SAME_PLACE
}
