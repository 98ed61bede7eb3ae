//! Normal equations of the camera and all poses; each view's six pose parameters are eliminated
//! (Schur complement).

use crate::camera_calibration::camera_model::CAMERA;
use nalgebra::{Matrix6, SMatrix, SVector, Vector6};

pub(crate) type Shared = SMatrix<f64, CAMERA, CAMERA>;

pub(crate) type SharedVector = SVector<f64, CAMERA>;

/// Normal equations with one block a view.
pub(crate) struct Normal {
    pub(crate) shared: Shared,
    pub(crate) shared_g: SharedVector,
    /// Per view: its own block, the block with the shared parameters, its gradient.
    pub(crate) views: Vec<(Matrix6<f64>, SMatrix<f64, CAMERA, 6>, Vector6<f64>)>,
}

impl Normal {
    /// The shared block with the poses eliminated, and its gradient; parameters that are not free
    /// are fixed.
    fn reduced(&self, free: [bool; CAMERA], damping: f64) -> Option<(Shared, SharedVector)> {
        let (mut a, mut g) = (self.shared, self.shared_g);
        for k in 0..CAMERA {
            a[(k, k)] *= 1.0 + damping;
        }
        for (own, cross, own_g) in &self.views {
            let inverse = damped(own, damping).cholesky()?;
            a -= cross * inverse.solve(&cross.transpose());
            g -= cross * inverse.solve(own_g);
        }
        for k in (0..CAMERA).filter(|k| !free[*k]) {
            a.fill_row(k, 0.0);
            a.fill_column(k, 0.0);
            (a[(k, k)], g[k]) = (1.0, 0.0);
        }
        Some((a, g))
    }

    pub(crate) fn step(
        &self,
        free: [bool; CAMERA],
        damping: f64,
    ) -> Option<(SharedVector, Vec<Vector6<f64>>)> {
        let (a, g) = self.reduced(free, damping)?;
        // The parameters differ by many orders of magnitude: solved with the diagonal scaled to 1.
        let scale = a.diagonal().map(|v| 1.0 / v.max(f64::MIN_POSITIVE).sqrt());
        let scaled = Shared::from_fn(|i, j| a[(i, j)] * scale[i] * scale[j]);
        let step = scaled.cholesky()?.solve(&g.component_mul(&scale)).component_mul(&scale);
        let mut steps = Vec::with_capacity(self.views.len());
        for (own, cross, own_g) in &self.views {
            steps.push(damped(own, damping).cholesky()?.solve(&(own_g - cross.transpose() * step)));
        }
        let finite = step.iter().chain(steps.iter().flatten()).all(|v| v.is_finite());
        finite.then_some((step, steps))
    }

    /// Covariance of the free parameters; zero elsewhere.
    pub(crate) fn covariance(&self, free: [bool; CAMERA]) -> Option<Shared> {
        let (a, _) = self.reduced(free, 0.0)?;
        let scale = a.diagonal().map(|v| 1.0 / v.max(f64::MIN_POSITIVE).sqrt());
        let inverse = Shared::from_fn(|i, j| a[(i, j)] * scale[i] * scale[j]).cholesky()?.inverse();
        Some(Shared::from_fn(
            |i, j| {
                if free[i] && free[j] { inverse[(i, j)] * scale[i] * scale[j] } else { 0.0 }
            },
        ))
    }
}

fn damped(own: &Matrix6<f64>, damping: f64) -> Matrix6<f64> {
    let mut h = *own;
    for k in 0..6 {
        h[(k, k)] *= 1.0 + damping;
    }
    h
}
