//! Camera extrinsics: the camera's pose on the robot at the time of the image, pan and tilt
//! included, with covariance (method 0.2, 13.5).

use crate::check::{self, OutOfRange};
use nalgebra::{Isometry3, Matrix3, Matrix6, Rotation3, Translation3, UnitQuaternion, Vector3, Vector6};
use std::f64::consts::PI;

/// Largest accepted distance of a camera from the robot's origin, metres.
pub const MAX_MOUNTING_M: f64 = 10.0;

/// `robot_from_camera` with the covariance of its left perturbation (rotation vector, radians;
/// translation, metres; robot frame).
#[derive(Debug, Clone, PartialEq)]
pub struct CameraExtrinsics {
    /// Maps camera coordinates (x right, y down, z forward) to robot coordinates (x forward, y
    /// left, z up).
    pub robot_from_camera: Isometry3<f64>,
    /// Covariance over (rotation, translation): rad^2, rad m, m^2.
    pub covariance: Matrix6<f64>,
}

impl CameraExtrinsics {
    /// Default standard deviation of each angle, radians: calibration and encoders (method 13.5).
    pub const DEFAULT_ANGLE_SIGMA_RAD: f64 = 0.1 * PI / 180.0;
    /// Default standard deviation of each coordinate, metres.
    pub const DEFAULT_POSITION_SIGMA_M: f64 = 0.002;

    /// Checks the transform and gives it the default covariance.
    pub fn new(robot_from_camera: Isometry3<f64>) -> Result<Self, OutOfRange> {
        Self::with_sigmas(robot_from_camera, Self::DEFAULT_ANGLE_SIGMA_RAD, Self::DEFAULT_POSITION_SIGMA_M)
    }

    /// Checks the transform; `angle_sigma_rad` in 0 to 0.2, `position_sigma_m` in 0 to 1.
    pub fn with_sigmas(
        robot_from_camera: Isometry3<f64>,
        angle_sigma_rad: f64,
        position_sigma_m: f64,
    ) -> Result<Self, OutOfRange> {
        check::within("angle_sigma_rad", angle_sigma_rad, 0.0, 0.2)?;
        check::within("position_sigma_m", position_sigma_m, 0.0, 1.0)?;
        let (a, t) = (angle_sigma_rad.powi(2), position_sigma_m.powi(2));
        let made =
            Self { robot_from_camera, covariance: Matrix6::from_diagonal(&Vector6::new(a, a, a, t, t, t)) };
        made.check()?;
        Ok(made)
    }

    /// The direction of up in the camera frame, unit length, of a robot that stands on the floor.
    pub fn camera_up(&self) -> Vector3<f64> {
        self.robot_from_camera.inverse_transform_vector(&Vector3::z())
    }

    /// Unit rotation, camera within [`MAX_MOUNTING_M`] of the robot's origin, covariance possible.
    pub fn check(&self) -> Result<(), OutOfRange> {
        let norm = self.robot_from_camera.rotation.quaternion().norm();
        check::within("robot_from_camera.rotation", norm, 1.0 - 1e-6, 1.0 + 1e-6)?;
        let t = self.robot_from_camera.translation.vector;
        for value in t.iter() {
            check::within("robot_from_camera.translation", *value, -MAX_MOUNTING_M, MAX_MOUNTING_M)?;
        }
        check::covariance("mounting.covariance", &self.covariance)
    }
}

/// A camera at `position_m` in the robot frame, turned left by `pan_rad` and up by `tilt_rad`:
/// `Rz(pan) Ry(-tilt) R_opt` (method 0.2).
pub fn pan_tilt(pan_rad: f64, tilt_rad: f64, position_m: Vector3<f64>) -> Isometry3<f64> {
    let optical = Matrix3::new(0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0);
    let rotation = Rotation3::from_axis_angle(&Vector3::z_axis(), pan_rad)
        * Rotation3::from_axis_angle(&Vector3::y_axis(), -tilt_rad)
        * Rotation3::from_matrix_unchecked(optical);
    Isometry3::from_parts(Translation3::from(position_m), UnitQuaternion::from_rotation_matrix(&rotation))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_PI_2;

    #[test]
    fn a_level_camera_looks_forward() {
        let m = pan_tilt(0.0, 0.0, Vector3::new(0.2, 0.0, 1.1));
        // Camera axes in the robot: z forward is x, x right is -y, y down is -z.
        assert!((m.rotation * Vector3::z() - Vector3::x()).norm() < 1e-12);
        assert!((m.rotation * Vector3::x() + Vector3::y()).norm() < 1e-12);
        assert!((m.rotation * Vector3::y() + Vector3::z()).norm() < 1e-12);
        assert!((m.translation.vector - Vector3::new(0.2, 0.0, 1.1)).norm() < 1e-12);
    }

    #[test]
    fn pan_goes_left_and_tilt_goes_up() {
        let left = pan_tilt(FRAC_PI_2, 0.0, Vector3::zeros()).rotation * Vector3::z();
        assert!((left - Vector3::y()).norm() < 1e-12);
        let up = pan_tilt(0.0, 0.3, Vector3::zeros()).rotation * Vector3::z();
        assert!((up - Vector3::new(0.3_f64.cos(), 0.0, 0.3_f64.sin())).norm() < 1e-12);
        // Tilt is about the panned axis: the image stays level.
        let right = pan_tilt(0.7, 0.3, Vector3::zeros()).rotation * Vector3::x();
        assert!(right.z.abs() < 1e-12);
    }

    #[test]
    fn up_in_the_camera_goes_by_tilt_and_roll_and_not_by_pan() {
        let up = |pan, tilt, roll| {
            let rolled = Isometry3::rotation(Vector3::new(0.0, 0.0, roll));
            let mounting = pan_tilt(pan, tilt, Vector3::new(0.1, 0.2, 1.0)) * rolled;
            CameraExtrinsics::new(mounting).unwrap().camera_up()
        };
        assert!((up(0.8, 0.0, 0.0) + Vector3::y()).norm() < 1e-12);
        // Rolled clockwise by a quarter, its x axis points down.
        assert!((up(0.8, 0.0, FRAC_PI_2) + Vector3::x()).norm() < 1e-12);
        assert!((up(-2.0, FRAC_PI_2, 0.3) - Vector3::z()).norm() < 1e-12);
    }

    #[test]
    fn impossible_extrinsics_are_refused() {
        let at = |x| pan_tilt(0.0, 0.0, Vector3::new(x, 0.0, 1.0));
        assert!(CameraExtrinsics::new(at(MAX_MOUNTING_M)).is_ok());
        assert_eq!(CameraExtrinsics::new(at(10.01)).unwrap_err().field, "robot_from_camera.translation");
        assert!(CameraExtrinsics::new(at(f64::NAN)).is_err());
        assert_eq!(CameraExtrinsics::with_sigmas(at(0.0), -1.0, 0.0).unwrap_err().field, "angle_sigma_rad");
    }
}
