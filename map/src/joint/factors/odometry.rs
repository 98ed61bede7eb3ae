//! Odometry: the measured motion between two keyframes, with scale and drift of the drive.

use super::{Terms, dynamic, positive, terms};
use crate::{
    joint::variables::State,
    pose2::{Pose2, wrap_rad},
};
use nalgebra::{Matrix2, Matrix3, Matrix3x2, Vector2, Vector3};

/// The measured motion between two keyframes.
///
/// The scale stands on the side of the map: `d / (1 + s) - u`. The form `d - (1 + s) u` of a
/// filter's prediction makes the residuals smaller for a smaller map, and so every map too small.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OdometryMotion {
    /// Keyframe in whose frame the motion is.
    pub from: usize,
    /// The other keyframe.
    pub to: usize,
    /// Drive with its errors.
    pub drive: usize,
    /// Measured motion, `from` to `to`.
    pub motion: Pose2,
    /// Root of the information over (x, y, theta) in the frame of `from`.
    pub sqrt_information: Matrix3<f64>,
}

impl OdometryMotion {
    pub(in crate::joint) fn is_valid(&self) -> bool {
        self.motion.check().is_ok() && self.sqrt_information.iter().all(|v| v.is_finite())
    }

    pub(in crate::joint) fn linearised(&self, state: &State) -> Terms {
        let (a, b) = (&state.keyframes[self.from], &state.keyframes[self.to]);
        let errors = &state.odometry[self.drive];
        let (s, c) = a.theta_rad.sin_cos();
        let from_map = Matrix2::new(c, s, -s, c);
        let d: Vector2<f64> = from_map * (b.position() - a.position());
        let (u, kappa) = (self.motion.position(), 1.0 / (1.0 + errors.scale));
        let shift = kappa * d - u;
        let turn = b.theta_rad - a.theta_rad - self.motion.theta_rad - errors.drift_rad_per_m * u.norm();
        let residual = Vector3::new(shift.x, shift.y, wrap_rad(turn));
        let (mut by_a, mut by_b, mut by_errors) =
            (Matrix3::zeros(), Matrix3::zeros(), Matrix3x2::<f64>::zeros());
        by_a.fixed_view_mut::<2, 2>(0, 0).copy_from(&(-kappa * from_map));
        by_a.fixed_view_mut::<2, 1>(0, 2).copy_from(&(kappa * Vector2::new(d.y, -d.x)));
        by_b.fixed_view_mut::<2, 2>(0, 0).copy_from(&(kappa * from_map));
        by_errors.fixed_view_mut::<2, 1>(0, 0).copy_from(&(-kappa * kappa * d));
        (by_a[(2, 2)], by_b[(2, 2)], by_errors[(2, 1)]) = (-1.0, 1.0, -u.norm());
        let w = &self.sqrt_information;
        terms(&(w * residual), vec![dynamic(&(w * by_a)), dynamic(&(w * by_b)), dynamic(&(w * by_errors))])
    }
}

/// Prior of scale and drift: zero.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OdometryPrior {
    /// Drive.
    pub drive: usize,
    /// Standard deviation of the scale.
    pub scale_sigma: f64,
    /// Standard deviation of the drift, rad/m.
    pub drift_sigma_rad_per_m: f64,
}

impl OdometryPrior {
    pub(in crate::joint) fn is_valid(&self) -> bool {
        positive(self.scale_sigma) && positive(self.drift_sigma_rad_per_m)
    }

    pub(in crate::joint) fn linearised(&self, state: &State) -> Terms {
        let errors = &state.odometry[self.drive];
        let weights = Vector2::new(1.0 / self.scale_sigma, 1.0 / self.drift_sigma_rad_per_m);
        let residual = weights.component_mul(&Vector2::new(errors.scale, errors.drift_rad_per_m));
        terms(&residual, vec![dynamic(&Matrix2::from_diagonal(&weights))])
    }
}
