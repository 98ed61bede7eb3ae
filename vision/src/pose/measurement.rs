//! Corners of a landmark in; checked, undistorted corners out: the measurement that a pose is
//! computed from.

use crate::{
    frame::{Distortion, FrameError, Intrinsics},
    geometry::{corner_covariance::CornerCovariance, corners::Corners},
};
use nalgebra::{Matrix2, Matrix2x3};

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

/// The undistorted measurement of a pose.
#[derive(Debug, Clone, PartialEq)]
pub struct PoseMeasurement {
    /// Corners as a pinhole with the same K would see them, in the landmark's order.
    pub corners_px: Corners,
    /// Their joint covariance.
    pub covariance_px2: CornerCovariance,
    /// The pinhole.
    pub camera: Intrinsics,
    /// Derivative of each corner by errors of the camera's (share of the focal length, cx, cy).
    pub by_camera: [Matrix2x3<f64>; 4],
    /// The size that was assumed.
    pub size: LandmarkSize,
}

/// Largest accepted corner coordinate, in pixels: four times the largest image.
pub const MAX_CORNER_PX: f64 = 32_768.0;

/// Smallest accepted standard deviation of a corner: finer than any detector.
pub const MIN_CORNER_SIGMA_PX: f64 = 1e-4;

/// Largest accepted standard deviation of a corner.
pub const MAX_CORNER_SIGMA_PX: f64 = 1e4;

/// Why there is no pose.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PoseError {
    /// A side of the landmark is not finite or not in [`LandmarkSize::MIN_M`] to
    /// [`LandmarkSize::MAX_M`].
    #[error("{field} = {value} is out of range")]
    Size {
        /// `width_m` or `height_m`.
        field: &'static str,
        /// Its value.
        value: f64,
    },
    /// The intrinsics are impossible.
    #[error(transparent)]
    Camera(#[from] FrameError),
    /// A corner lies beyond [`MAX_CORNER_PX`].
    #[error("corner {corner} lies beyond {MAX_CORNER_PX} px")]
    Corner {
        /// Its index, TL TR BR BL.
        corner: usize,
    },
    /// A covariance is not symmetric, or a standard deviation is not in [`MIN_CORNER_SIGMA_PX`] to
    /// [`MAX_CORNER_SIGMA_PX`].
    #[error("covariance of corner {corner} is impossible")]
    Covariance {
        /// Its index, TL TR BR BL.
        corner: usize,
    },
    /// The distortion is not invertible at a corner, or the undistorted corners are not a quad.
    #[error("the lens distortion is not invertible at the corners")]
    Distortion,
    /// The corners do not determine a pose in front of the camera.
    #[error("the corners do not determine a pose")]
    Degenerate,
}

/// Checks the input and undistorts the corners.
pub(crate) fn measured(
    corners: &Corners,
    covariance_px2: &CornerCovariance,
    size: LandmarkSize,
    camera: &Intrinsics,
) -> Result<PoseMeasurement, PoseError> {
    for (field, value) in [("width_m", size.width_m), ("height_m", size.height_m)] {
        if !(LandmarkSize::MIN_M..=LandmarkSize::MAX_M).contains(&value) {
            return Err(PoseError::Size { field, value });
        }
    }
    let UndistortedCorners { corners_px, covariance_px2, camera, by_camera } =
        straightened(corners, covariance_px2, camera)?;
    Ok(PoseMeasurement { corners_px, covariance_px2, camera, by_camera, size })
}

/// Undistorted corners.
#[derive(Debug, Clone, PartialEq)]
pub struct UndistortedCorners {
    /// As a pinhole with the same K would see them.
    pub corners_px: Corners,
    /// Their joint covariance.
    pub covariance_px2: CornerCovariance,
    /// The pinhole.
    pub camera: Intrinsics,
    /// See [`Intrinsics::straight_by_errors`].
    pub by_camera: [Matrix2x3<f64>; 4],
}

/// Corners and covariances as the pinhole of the same K would have them, and that pinhole. Checks
/// camera, corners and covariances.
pub fn straightened(
    corners: &Corners,
    covariance_px2: &CornerCovariance,
    camera: &Intrinsics,
) -> Result<UndistortedCorners, PoseError> {
    let c = Intrinsics::new(camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px, camera.distortion)?;
    let c = camera.sigmas.map_or(Ok(c), |sigmas| c.with_sigmas(sigmas))?;
    let mut by_camera = [Matrix2x3::zeros(); 4];
    let (mut straight, mut derivatives) = (*corners.points(), [Matrix2::identity(); 4]);
    for (corner, (p, derivative)) in straight.iter_mut().zip(&mut derivatives).enumerate() {
        if p.x.abs() > MAX_CORNER_PX || p.y.abs() > MAX_CORNER_PX {
            return Err(PoseError::Corner { corner });
        }
        if !is_corner_covariance(&covariance_px2.of(corner)) {
            return Err(PoseError::Covariance { corner });
        }
        if c.distortion != Distortion::None {
            (*p, *derivative) = c.undistort_with(p).ok_or(PoseError::Distortion)?;
            let own = *derivative * covariance_px2.of(corner) * derivative.transpose();
            if !is_corner_covariance(&own) {
                return Err(PoseError::Distortion);
            }
        }
        by_camera[corner] = c.straight_by_errors(p).ok_or(PoseError::Distortion)?;
    }
    let corners_px = Corners::new(straight).map_err(|_folded| PoseError::Distortion)?;
    let camera = Intrinsics { distortion: Distortion::None, ..c };
    let covariance_px2 =
        if c.distortion == Distortion::None { *covariance_px2 } else { covariance_px2.mapped(&derivatives) };
    Ok(UndistortedCorners { corners_px, covariance_px2, camera, by_camera })
}

/// Symmetric, with both standard deviations in range.
pub(crate) fn is_corner_covariance(s: &Matrix2<f64>) -> bool {
    let symmetric = (s.m12 - s.m21).abs() <= 1e-6 * (s.m11 + s.m22);
    let (mean, spread) = (0.5 * (s.m11 + s.m22), (0.5 * (s.m11 - s.m22)).hypot(s.m12));
    // NaN fails every comparison.
    symmetric && mean - spread >= MIN_CORNER_SIGMA_PX.powi(2) && mean + spread <= MAX_CORNER_SIGMA_PX.powi(2)
}
