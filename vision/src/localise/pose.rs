//! Pose of a landmark in the camera frame from its four corners (method 13.1 to 13.5).

use crate::{detect::quads::Corners, frame::Intrinsics};
use nalgebra::{Isometry3, Matrix2, Matrix6};

/// Width and height of a landmark, in metres.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct LandmarkSize {
    /// Along the landmark's y.
    pub width_m: f64,
    /// Along the landmark's z.
    pub height_m: f64,
}

impl LandmarkSize {
    /// Smallest accepted side.
    pub const MIN_M: f64 = 0.01;
    /// Largest accepted side.
    pub const MAX_M: f64 = 100.0;
}

/// What a pose was computed from, free of lens distortion.
#[derive(Debug, Clone, PartialEq)]
pub struct Measured {
    /// Corners as a pinhole with the same K would see them, in the landmark's order.
    pub corners_px: Corners,
    /// Covariance of each of them.
    pub covariance_px2: [Matrix2<f64>; 4],
    /// The pinhole.
    pub camera: Intrinsics,
    /// The size that was assumed.
    pub size: LandmarkSize,
}

/// One minimum of the reprojection error.
#[derive(Debug, Clone, PartialEq)]
pub struct PoseSolution {
    /// Maps landmark coordinates to camera coordinates.
    pub camera_from_landmark: Isometry3<f64>,
    /// Covariance of the left perturbation (rotation vector rad, translation m), in that order, camera frame.
    pub covariance: Matrix6<f64>,
    /// Root mean square reprojection error per coordinate, in pixels.
    pub reprojection_rms_px: f64,
    /// Weighted squared residual (2 degrees of freedom).
    pub chi2: f64,
}

/// Pose of a recognised landmark: always with covariance, and with the second solution of the planar ambiguity.
#[derive(Debug, Clone, PartialEq)]
pub struct LandmarkPose {
    /// The solution of least error.
    pub best: PoseSolution,
    /// The other local minimum, where there is one.
    pub second: Option<PoseSolution>,
    /// The second cannot be told from the first by its error (ratio below 2): only a prior can decide.
    pub ambiguous: bool,
    /// The corners behind it: localisation fits the robot's pose directly to them.
    pub measured: Measured,
}
