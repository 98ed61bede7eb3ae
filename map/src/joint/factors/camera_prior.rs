//! The camera as it was stated, with its standard deviations.

use super::{Terms, dynamic, positive, terms};
use crate::joint::variables::{CameraState, State};
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

/// The camera as stated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CameraPrior {
    /// Camera.
    pub camera: usize,
    /// Its stated mounting and intrinsics.
    pub stated: CameraState,
    /// Standard deviations of rotation (radians), translation (metres), focal length, centre (px)
    /// and k1.
    pub sigmas: SVector<f64, 10>,
}

impl CameraPrior {
    pub(in crate::joint) fn is_valid(&self) -> bool {
        let step = self.stated.minus(&self.stated);
        self.sigmas.iter().all(|s| positive(*s)) && step.iter().all(|v| v.is_finite())
    }

    pub(in crate::joint) fn linearised(&self, state: &State) -> Terms {
        let d = state.cameras[self.camera].minus(&self.stated);
        let weights = self.sigmas.map(|s| 1.0 / s);
        let mut by = SMatrix::<f64, 10, 10>::identity();
        let turn = Vector3::new(d[0], d[1], d[2]);
        by.fixed_view_mut::<3, 3>(0, 0).copy_from(&rotation_by_perturbation(&turn));
        let by = SMatrix::<f64, 10, 10>::from_diagonal(&weights) * by;
        terms(&d.component_mul(&weights), vec![dynamic(&by)])
    }
}

/// Derivative of `Log(Exp(d) Exp(phi))` by `d` at 0: the inverse left Jacobian of SO(3).
pub(super) fn rotation_by_perturbation(phi: &Vector3<f64>) -> Matrix3<f64> {
    let (angle, cross) = (phi.norm(), phi.cross_matrix());
    // Its limit where the quotient has no digits left.
    let second = if angle < 1e-4 {
        1.0 / 12.0
    } else {
        1.0 / (angle * angle) - (1.0 + angle.cos()) / (2.0 * angle * angle.sin())
    };
    Matrix3::identity() - 0.5 * cross + second * cross * cross
}
