//! The error that all observations of one frame share (pose, extrinsics, intrinsics), conditioned
//! on observations one by one. The sum of the squared distances of the steps is the joint
//! Mahalanobis distance of all innovations under their full covariance: Neira and Tardos 2001,
//! computed without the stacked matrix.

use nalgebra::{SMatrix, SVector};

/// Coordinates of four corners.
const CORNERS: usize = 8;
/// Common errors: pose (x, y, theta), extrinsics (rotation, translation), intrinsics (focal share,
/// cx, cy).
pub(super) const COMMON: usize = 12;

pub(super) type CornerVector = SVector<f64, CORNERS>;
pub(super) type CornerMatrix = SMatrix<f64, CORNERS, CORNERS>;
pub(super) type ByCommon = SMatrix<f64, CORNERS, COMMON>;
pub(super) type CommonVector = SVector<f64, COMMON>;
pub(super) type CommonMatrix = SMatrix<f64, COMMON, COMMON>;

/// Most linearisations of one update; with a good prior one is enough.
const MAX_ITERATIONS: usize = 5;
/// An update is linear enough when what its derivative leaves over is less than this share of a
/// standard deviation.
const LINEAR_SIGMAS: f64 = 0.1;

/// Predicted corners as a function of the common error.
pub(super) trait Prediction {
    /// Corners; `None` where one has no pixel.
    fn px(&self, error: &CommonVector) -> Option<CornerVector>;
    /// Corners and their derivative.
    fn at(&self, error: &CommonVector) -> Option<(CornerVector, ByCommon)>;
}

/// Mean and covariance of the common error (true minus assumed).
#[derive(Debug, Clone)]
pub(super) struct CommonError {
    mean: CommonVector,
    covariance: CommonMatrix,
}

/// The common error after one more observation, and the fit of that observation.
pub(super) struct Updated {
    pub error: CommonError,
    /// Squared Mahalanobis distance of this innovation given those before.
    pub distance2: f64,
    /// Natural logarithm of its density given those before, per px^8.
    pub log_density: f64,
}

impl CommonError {
    pub(super) fn new(covariance: &CommonMatrix) -> Self {
        Self { mean: CommonVector::zeros(), covariance: *covariance }
    }

    /// Conditions on observed corners with covariance `own` of the errors that are not shared: an
    /// iterated extended Kalman update, so that a neighbour of the right landmark is not ruled out
    /// by linearisation alone. `None` if it does not converge, the covariance is singular, or a
    /// number is not finite.
    pub(super) fn update(
        &self,
        predicted: &impl Prediction,
        own: &CornerMatrix,
        observed: &CornerVector,
    ) -> Option<Updated> {
        let own_factor = own.cholesky()?;
        let mut at = self.mean;
        let (mut px, mut by_common) = predicted.at(&at)?;
        for _ in 0..MAX_ITERATIONS {
            let innovation = observed - px - by_common * (self.mean - at);
            let cross = self.covariance * by_common.transpose();
            let s = by_common * cross + own;
            let factor = (0.5 * (s + s.transpose())).cholesky()?;
            let weighted = factor.solve(&innovation);
            let next = self.mean + cross * weighted;
            let left = predicted.px(&next)? - px - by_common * (next - at);
            if left.dot(&own_factor.solve(&left)) > LINEAR_SIGMAS.powi(2) {
                at = next;
                (px, by_common) = predicted.at(&at)?;
                continue;
            }
            let distance2 = innovation.dot(&weighted);
            let log_density = -0.5 * (distance2 + log_volume(factor.l_dirty()));
            let covariance = self.covariance - cross * factor.solve(&cross.transpose());
            let error = Self { mean: next, covariance: 0.5 * (covariance + covariance.transpose()) };
            let finite = distance2.is_finite() && log_density.is_finite() && distance2 >= 0.0;
            return finite.then_some(Updated { error, distance2, log_density });
        }
        None
    }
}

/// Largest possible log density of an innovation whose covariance is at least `own`.
pub(super) fn most_log_density(own: &CornerMatrix) -> Option<f64> {
    let factor = own.cholesky()?;
    let value = -0.5 * log_volume(factor.l_dirty());
    value.is_finite().then_some(value)
}

/// Logarithm of the determinant of `2 pi S` for the Cholesky factor of S.
fn log_volume(factor: &CornerMatrix) -> f64 {
    CORNERS as f64 * std::f64::consts::TAU.ln() + 2.0 * factor.diagonal().map(f64::ln).sum()
}
