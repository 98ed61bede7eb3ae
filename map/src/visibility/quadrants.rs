//! Bounds in all directions about a landmark: four quadrants, each with its own axis, so that no
//! slope exceeds one.

use crate::visibility::{
    envelope::{Envelope, Piece},
    limits::Limits,
    occlusion_edges::{MIN_NEAR_M, occlusion_edges},
    penumbra::{Footprint, penumbra},
    quarter_turn::turned,
};
use nalgebra::Point2;
use std::f64::consts::FRAC_PI_2;

/// The bounds of one quarter.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Quadrant {
    /// Farthest visible distance; nothing is visible where it is not defined.
    pub far: Envelope,
    /// Nearest visible distance; defined wherever `far` is.
    pub near: Envelope,
}

/// The bounds of all quadrants, the first ahead, the others to the left. `obstacles` in the
/// landmark's frame.
pub(super) fn quadrants(
    limits: &Limits,
    footprint: &Footprint,
    obstacles: &[(Point2<f64>, Point2<f64>)],
) -> [Quadrant; 4] {
    std::array::from_fn(|quarter| {
        let occlusion_edges = occlusion_edges(limits, quarter as f64 * FRAC_PI_2);
        if occlusion_edges.open.is_empty() {
            return Quadrant::default();
        }
        let mut far: Vec<Piece> = occlusion_edges.far;
        far.extend(obstacles.iter().flat_map(|(a, b)| penumbra(footprint, a, b, quarter)));
        Quadrant {
            far: Envelope::upper(far).within(&occlusion_edges.open),
            near: Envelope::upper(occlusion_edges.near),
        }
    })
}

/// Whether a point about the origin is within the bounds.
pub(super) fn contains(quadrants: &[Quadrant; 4], q: &Point2<f64>) -> bool {
    let quarter = match (q.x.abs() >= q.y.abs(), q.x >= 0.0, q.y >= 0.0) {
        (true, true, _) => 0,
        (false, _, true) => 1,
        (true, false, _) => 2,
        (false, _, false) => 3,
    };
    let q = turned(q, quarter);
    // The centre itself counts as the point next to it.
    let ahead = q.x.max(2.0 * MIN_NEAR_M);
    let (slope, inverse) = (q.y / ahead, 1.0 / ahead);
    let Quadrant { far, near } = &quadrants[quarter];
    far.at(slope).is_some_and(|far| inverse >= far) && near.at(slope).is_none_or(|near| inverse <= near)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::visibility::quarter_turn::turned_back;

    #[test]
    fn each_quarter_is_bounded_about_its_axis() {
        for quarter in 0..4 {
            let angle = quarter as f64 * FRAC_PI_2 + 0.3;
            let p = Point2::new(2.0 * angle.cos(), 2.0 * angle.sin());
            let t = turned(&p, quarter);
            assert!((t - Point2::new(2.0 * 0.3_f64.cos(), 2.0 * 0.3_f64.sin())).norm() < 1e-12);
            assert!((turned_back(&t, quarter) - p).norm() < 1e-12);
        }
    }
}
