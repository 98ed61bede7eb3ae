//! Walls as segments on the floor, and their intersections with rays.

use nalgebra::{Point2, Vector2};

/// An opaque wall over the whole height.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WallSegment {
    /// First end, metres, map frame.
    pub a_m: Point2<f64>,
    /// Second end, metres; the room is on the left of a to b.
    pub b_m: Point2<f64>,
}

impl WallSegment {
    /// Distance between the ends, metres.
    pub fn length_m(&self) -> f64 {
        (self.b_m - self.a_m).norm()
    }

    /// Unit vector from a to b.
    pub fn direction(&self) -> Vector2<f64> {
        let d = self.b_m - self.a_m;
        d / d.norm().max(f64::MIN_POSITIVE)
    }

    /// Unit normal into the room.
    pub fn normal(&self) -> Vector2<f64> {
        let d = self.direction();
        Vector2::new(-d.y, d.x)
    }
}

/// Distance along a unit direction to the nearest wall within `max_m`, from either side of it,
/// metres.
pub(crate) fn range(
    walls: &[WallSegment],
    from_m: &Point2<f64>,
    direction: &Vector2<f64>,
    max_m: f64,
) -> Option<f64> {
    first_hit(walls, from_m, direction, max_m).map(|(range_m, _)| range_m)
}

/// As [`range`], with the wall.
pub(crate) fn first_hit<'a>(
    walls: &'a [WallSegment],
    from_m: &Point2<f64>,
    direction: &Vector2<f64>,
    max_m: f64,
) -> Option<(f64, &'a WallSegment)> {
    let hit = |w: &WallSegment| {
        let (along, to_a) = (w.b_m - w.a_m, w.a_m - from_m);
        let cross = direction.perp(&along);
        if cross.abs() < 1e-12 {
            return None;
        }
        let (r, k) = (to_a.perp(&along) / cross, to_a.perp(direction) / cross);
        (r > 1e-9 && r < max_m && (0.0..=1.0).contains(&k)).then_some(r)
    };
    walls.iter().filter_map(|w| Some((hit(w)?, w))).min_by(|a, b| a.0.total_cmp(&b.0))
}
