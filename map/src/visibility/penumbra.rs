//! Occlusion: the full penumbra of each obstacle, from which some part of the landmark is hidden
//! (method 12.4), as bounds over direction. Exact, not sampled.

use crate::visibility::{
    envelope::{MAX_SLOPE, Piece},
    quarter_turn::turned,
};
use nalgebra::{Point2, Vector2};

/// Obstacles nearer than this to the landmark's centre are cut there, metres.
const MIN_AHEAD_M: f64 = 1e-6;

/// The landmark's extent on the floor about the origin: half its depth along x, half its width
/// along y.
#[derive(Debug, Clone, Copy)]
pub(super) struct Footprint {
    pub half_depth_m: f64,
    pub half_width_m: f64,
}

impl Footprint {
    /// Whether the segment from a to b touches it.
    pub(super) fn touches(&self, a: &Point2<f64>, b: &Point2<f64>) -> bool {
        let (mut from, mut to) = (0.0_f64, 1.0_f64);
        for (start, end, half) in [(a.x, b.x, self.half_depth_m), (a.y, b.y, self.half_width_m)] {
            let along = end - start;
            if along.abs() < MIN_AHEAD_M * MIN_AHEAD_M {
                if start.abs() > half {
                    return false;
                }
                continue;
            }
            let (first, last) = ((-half - start) / along, (half - start) / along);
            (from, to) = (from.max(first.min(last)), to.min(first.max(last)));
        }
        from <= to
    }

    fn corners(&self) -> [Point2<f64>; 4] {
        let (x, y) = (self.half_depth_m, self.half_width_m);
        [Point2::new(x, y), Point2::new(x, -y), Point2::new(-x, y), Point2::new(-x, -y)]
    }
}

/// The near borders of one obstacle's penumbra within a quarter.
///
/// A point of the landmark is hidden behind the obstacle, between the lines from that point past
/// its ends. The corners of the landmark give the borders: every such line lies in the penumbra,
/// and its tangents are among them.
pub(super) fn penumbra(
    footprint: &Footprint,
    a: &Point2<f64>,
    b: &Point2<f64>,
    quarter: usize,
) -> Vec<Piece> {
    let turn = |v: Vector2<f64>| turned(&Point2::from(v), quarter).coords;
    let mut pieces: Vec<Piece> = straight(turn(a.coords), turn(b - a), 1.0).into_iter().collect();
    // A landmark on a wall has no depth: its corners coincide in pairs.
    let corners = footprint.corners();
    let count = if footprint.half_depth_m > 0.0 { 4 } else { 2 };
    for end in [a, b] {
        let beyond = |corner: &Point2<f64>| straight(turn(end.coords), turn(end - corner), f64::INFINITY);
        pieces.extend(corners[..count].iter().filter_map(beyond));
    }
    pieces
}

/// The part of a straight line, from a point so many times `along`, that lies in the quarter ahead.
fn straight(from: Vector2<f64>, along: Vector2<f64>, times: f64) -> Option<Piece> {
    let (mut first, mut last) = (0.0_f64, times);
    let inside = |v: &Vector2<f64>| [MAX_SLOPE * v.x - v.y, MAX_SLOPE * v.x + v.y, v.x];
    let least = [0.0, 0.0, MIN_AHEAD_M];
    for ((start, rise), least) in inside(&from).into_iter().zip(inside(&along)).zip(least) {
        let crossing = (least - start) / rise;
        if rise > 0.0 {
            first = first.max(crossing);
        } else if rise < 0.0 {
            last = last.min(crossing);
        } else if start < least {
            return None;
        }
    }
    if first >= last {
        return None;
    }
    let projected = |t: f64| {
        let v = from + along * t;
        if t.is_finite() { (v.y / v.x, 1.0 / v.x) } else { (along.y / along.x, 0.0) }
    };
    Piece::through(projected(first), projected(last))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn segments_that_touch_the_footprint() {
        let flat = Footprint { half_depth_m: 0.0, half_width_m: 0.3 };
        let deep = Footprint { half_depth_m: 0.2, half_width_m: 0.3 };
        let touch = |f: &Footprint, ax, ay, bx, by| f.touches(&Point2::new(ax, ay), &Point2::new(bx, by));
        assert!(touch(&flat, -1.0, 0.0, 1.0, 0.1) && touch(&flat, 0.0, -1.0, 0.0, 1.0));
        assert!(!touch(&flat, 0.1, -1.0, 0.1, 1.0) && !touch(&flat, 0.0, 0.31, 0.0, 1.0));
        assert!(touch(&deep, 0.1, -1.0, 0.1, 1.0) && touch(&deep, 0.0, 0.0, 0.1, 0.1));
        assert!(!touch(&deep, 0.21, -1.0, 0.21, 1.0) && !touch(&deep, 0.3, 0.29, 0.1, 0.5));
    }
}
