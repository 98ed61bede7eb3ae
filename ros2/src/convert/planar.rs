//! Poses on the floor.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

/// `a_from_b` on the floor: position of b's origin in a, and heading of b's x axis.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PlanarPose {
    /// Position along x, metres.
    pub x_m: f64,
    /// Position along y, metres.
    pub y_m: f64,
    /// Heading, radians, counter-clockwise from x, in (-pi, pi].
    pub theta_rad: f64,
}

impl PlanarPose {
    /// The part of a pose in space that lies on the floor. Height, roll and pitch are left out.
    pub fn of(a_from_b: &Isometry3<f64>) -> Self {
        let ahead = a_from_b.rotation * Vector3::x();
        let position = a_from_b.translation.vector;
        Self { x_m: position.x, y_m: position.y, theta_rad: ahead.y.atan2(ahead.x) }
    }

    /// The same pose in space, level at height 0.
    pub fn to_isometry(self) -> Isometry3<f64> {
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), self.theta_rad);
        Isometry3::from_parts(Translation3::new(self.x_m, self.y_m, 0.0), turn)
    }
}

/// Angle between b's z axis and a's, radians, 0 to pi.
pub(super) fn tilt_rad(a_from_b: &Isometry3<f64>) -> f64 {
    (a_from_b.rotation * Vector3::z()).angle(&Vector3::z())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_planar_pose_comes_back() {
        let pose = PlanarPose { x_m: 1.0, y_m: -2.0, theta_rad: 2.5 };
        let back = PlanarPose::of(&pose.to_isometry());
        assert!((back.x_m - 1.0).abs() < 1e-12 && (back.y_m + 2.0).abs() < 1e-12);
        assert!((back.theta_rad - 2.5).abs() < 1e-12);
        assert!(tilt_rad(&pose.to_isometry()) < 1e-6);
    }

    #[test]
    fn a_slope_leaves_the_heading() {
        let slope = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), 0.1);
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 0.7);
        let pose = Isometry3::from_parts(Translation3::new(0.0, 0.0, 3.0), turn * slope);
        assert!((PlanarPose::of(&pose).theta_rad - 0.7).abs() < 1e-12);
        assert!((tilt_rad(&pose) - 0.1).abs() < 1e-12);
    }
}
