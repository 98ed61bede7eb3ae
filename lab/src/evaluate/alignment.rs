//! Laying a map on the truth: the rigid motion that fits best.

use map::{
    place::LandmarkPlace,
    pose2::{Pose2, wrap_rad},
};
use nalgebra::{Matrix2, Matrix6, Point2, Vector2};

/// `there_from_here` of two lists of the same points, by least squares; the identity for none.
pub(crate) fn laid_on(here: &[Point2<f64>], there: &[Point2<f64>]) -> Pose2 {
    let mean = |points: &[Point2<f64>]| {
        points.iter().map(|p| p.coords).sum::<Vector2<f64>>() / points.len().max(1) as f64
    };
    let (from, to) = (mean(here), mean(there));
    let (mut dot, mut perp) = (0.0, 0.0);
    for (a, b) in here.iter().zip(there) {
        let (a, b) = (a.coords - from, b.coords - to);
        (dot, perp) = (dot + a.dot(&b), perp + a.perp(&b));
    }
    let turn = Pose2::new(0.0, 0.0, perp.atan2(dot));
    let shift = to - turn.apply(&from.into()).coords;
    Pose2::new(shift.x, shift.y, turn.theta_rad)
}

/// A place in the frame that its map is laid in.
pub(crate) fn moved(place: &LandmarkPlace, laid: &Pose2) -> LandmarkPlace {
    let at = laid.apply(&Point2::new(place.x_m, place.y_m));
    let (s, c) = laid.theta_rad.sin_cos();
    let mut turn = Matrix6::identity();
    turn.fixed_view_mut::<2, 2>(0, 0).copy_from(&Matrix2::new(c, -s, s, c));
    LandmarkPlace {
        x_m: at.x,
        y_m: at.y,
        theta_rad: wrap_rad(place.theta_rad + laid.theta_rad),
        covariance: turn * place.covariance * turn.transpose(),
        ..*place
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_moved_map_is_laid_back() {
        let there = [[0.0, 0.0], [4.0, 1.0], [3.0, -2.0]].map(Point2::from);
        let truth = Pose2::new(2.0, -1.0, 2.5);
        let here = there.map(|p| truth.inverse().apply(&p));
        assert!(laid_on(&here, &there).minus(&truth).norm() < 1e-12);
        // A point that is off by 3 draws the others by a third of it.
        let mut off = there;
        off[0].y += 3.0;
        let to_mean = laid_on(&there, &off).apply(&Point2::new(7.0 / 3.0, -1.0 / 3.0));
        assert!((to_mean - Point2::new(7.0 / 3.0, 2.0 / 3.0)).norm() < 1e-12);
        assert_eq!(laid_on(&[], &[]), Pose2::default());
    }
}
