//! Errors that a simulated robot makes in its intrinsics and extrinsics. A covariance can only be
//! evaluated where the errors that it states are made.

use map::{check::OutOfRange, extrinsics::CameraExtrinsics};
use nalgebra::{Isometry3, Vector6};
use vision::{
    frame::{Intrinsics, IntrinsicsSigmas},
    pose::reprojection::perturbed,
    random::Random,
};

/// The errors of one robot, the same in every picture.
#[derive(Debug, Clone)]
pub struct SimulatedRobotErrors {
    /// The intrinsics that it states.
    pub camera: Intrinsics,
    /// Error of the extrinsics: left perturbation (rotation, translation; rad and m), robot frame.
    extrinsics_error: Vector6<f64>,
}

impl SimulatedRobotErrors {
    /// A robot without errors. It states exact intrinsics, and the usual covariances for the rest.
    pub fn none(camera: &Intrinsics) -> Self {
        Self { camera: *camera, extrinsics_error: Vector6::zeros() }
    }

    /// A robot with errors as large as it states: those of a usual calibration and of default
    /// extrinsics.
    pub fn drawn(camera: &Intrinsics, seed: u64) -> Self {
        let mut random = Random::new(seed);
        let sigmas = IntrinsicsSigmas::usual(camera.fx_px);
        let usual = camera.with_sigmas(sigmas).unwrap_or(*camera);
        let e = usual.error_sigmas().map(|s| s * random.normal());
        let (fx_px, fy_px) = (camera.fx_px * (1.0 + e.x), camera.fy_px * (1.0 + e.x));
        let stated =
            Intrinsics { fx_px, fy_px, cx_px: camera.cx_px + e.y, cy_px: camera.cy_px + e.z, ..usual };
        let (a, t) = (CameraExtrinsics::DEFAULT_ANGLE_SIGMA_RAD, CameraExtrinsics::DEFAULT_POSITION_SIGMA_M);
        let extrinsics_error = Vector6::new(a, a, a, t, t, t).map(|s| s * random.normal());
        Self { camera: stated, extrinsics_error }
    }

    /// Without errors if `exact`.
    pub fn of(camera: &Intrinsics, exact: bool, seed: u64) -> Self {
        if exact { Self::none(camera) } else { Self::drawn(camera, seed) }
    }

    /// The extrinsics that it states.
    pub fn extrinsics(&self, robot_from_camera: &Isometry3<f64>) -> Result<CameraExtrinsics, OutOfRange> {
        let (turn, shift) = (
            self.extrinsics_error.fixed_rows::<3>(0).into(),
            self.extrinsics_error.fixed_rows::<3>(3).into(),
        );
        CameraExtrinsics::new(perturbed(robot_from_camera, &turn, &shift))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use vision::frame::Distortion;

    #[test]
    fn errors_are_as_large_as_they_are_said_to_be() {
        let camera = Intrinsics::new(500.0, 500.0, 320.0, 240.0, Distortion::None).unwrap();
        let seat = Isometry3::translation(0.1, 0.0, 1.2);
        let n = 500_u32;
        let (mut focal, mut turn) = (0.0, 0.0);
        for seed in 0..n {
            let robot = SimulatedRobotErrors::drawn(&camera, u64::from(seed));
            focal += ((robot.camera.fx_px / 500.0 - 1.0) / IntrinsicsSigmas::USUAL_FOCAL_SHARE).powi(2);
            let angle = robot.extrinsics(&seat).unwrap().robot_from_camera.rotation.angle();
            turn += (angle / CameraExtrinsics::DEFAULT_ANGLE_SIGMA_RAD).powi(2);
            assert!(robot.camera.sigmas.is_some());
        }
        let of = |sum: f64| sum / f64::from(n);
        assert!((0.8..1.2).contains(&of(focal)) && (2.6..3.4).contains(&of(turn)), "{focal} {turn}");
        let exact = SimulatedRobotErrors::none(&camera);
        assert_eq!((exact.extrinsics(&seat).unwrap().robot_from_camera, exact.camera), (seat, camera));
    }
}
