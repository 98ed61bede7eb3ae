//! Intrinsics of a camera: focal length, principal point, lens distortion, and their standard deviations.

use crate::frame::{image::FrameError, lens::Distortion};
use nalgebra::{Matrix2, Matrix3, Point2, Vector3};
use serde::{Deserialize, Serialize};

/// Standard deviations of intrinsics, as a calibration states them. fx and fy err together: of a calibration their
/// errors are almost fully correlated.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct IntrinsicsSigmas {
    /// Of the focal length along u; that along v errs by the same share.
    pub focal_px: f64,
    /// Of each coordinate of the principal point.
    pub center_px: f64,
}

impl IntrinsicsSigmas {
    /// Default for the focal length, as a share of it. Calibrations state 0.1 to 0.5 %, and
    /// two of them of the same pictures differ by as much as 0.6 %: docs/EVALUATION.md, "Cameras".
    pub const USUAL_FOCAL_SHARE: f64 = 0.005;
    /// Default for the principal point, as a share of the focal length: 2 px at 640 x 480. Its error acts mostly
    /// like a rotation of the camera, and so is part of the calibrated extrinsics.
    pub const USUAL_CENTER_SHARE: f64 = 0.003;
    /// Largest accepted, as a share of the focal length: beyond it the first-order model does not hold.
    pub const MAX_SHARE: f64 = 0.25;

    /// Defaults for a camera of this focal length.
    pub fn usual(focal_px: f64) -> Self {
        let (focal, center) = (Self::USUAL_FOCAL_SHARE * focal_px, Self::USUAL_CENTER_SHARE * focal_px);
        Self { focal_px: focal, center_px: center }
    }
}

/// A calibrated camera: zero skew, pixel (0, 0) at the centre of the top-left pixel.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Intrinsics {
    /// Focal length along u, in pixels; positive.
    pub fx_px: f64,
    /// Focal length along v, in pixels; positive.
    pub fy_px: f64,
    /// Principal point, column.
    pub cx_px: f64,
    /// Principal point, row.
    pub cy_px: f64,
    /// Lens distortion.
    #[serde(default)]
    pub distortion: Distortion,
    /// Standard deviations of the rest; none: not stated, and taken as exact.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sigmas: Option<IntrinsicsSigmas>,
}

impl Intrinsics {
    /// Checks that every number is finite, focal lengths lie in 10 to 100 000 px, the principal point within
    /// +-20 000 px and distortion coefficients within +-100.
    pub fn new(
        fx_px: f64,
        fy_px: f64,
        cx_px: f64,
        cy_px: f64,
        distortion: Distortion,
    ) -> Result<Self, FrameError> {
        let check = |field, value: f64, low: f64, high: f64| {
            if value.is_finite() && (low..=high).contains(&value) {
                Ok(())
            } else {
                Err(FrameError::Intrinsics { field, value })
            }
        };
        check("fx_px", fx_px, 10.0, 1e5)?;
        check("fy_px", fy_px, 10.0, 1e5)?;
        check("cx_px", cx_px, -2e4, 2e4)?;
        check("cy_px", cy_px, -2e4, 2e4)?;
        for value in distortion.coefficients() {
            check("distortion", *value, -100.0, 100.0)?;
        }
        Ok(Self { fx_px, fy_px, cx_px, cy_px, distortion, sigmas: None })
    }

    /// The 3x3 matrix K.
    pub fn matrix(&self) -> Matrix3<f64> {
        Matrix3::new(self.fx_px, 0.0, self.cx_px, 0.0, self.fy_px, self.cy_px, 0.0, 0.0, 1.0)
    }

    /// Pixel of a point in camera coordinates (z > 0), distortion included.
    pub fn project(&self, p_camera: &Vector3<f64>) -> Point2<f64> {
        let straight = Point2::new(p_camera.x / p_camera.z, p_camera.y / p_camera.z);
        self.pixel(&self.distortion.distort(&straight).point)
    }

    /// The pixel where an undistorted pinhole with the same K would see what this camera sees at `px`. `None` where
    /// the distortion is not invertible: see [`Distortion::undistort`].
    pub fn undistort(&self, px: &Point2<f64>) -> Option<Point2<f64>> {
        if self.distortion == Distortion::None {
            return Some(*px);
        }
        Some(self.pixel(&self.distortion.undistort(&self.normalised(px))?))
    }

    /// As [`Intrinsics::undistort`], with the derivative by `px`, for the covariance of a corner.
    pub fn undistort_with(&self, px: &Point2<f64>) -> Option<(Point2<f64>, Matrix2<f64>)> {
        if self.distortion == Distortion::None {
            return Some((*px, Matrix2::identity()));
        }
        let straight = self.distortion.undistort(&self.normalised(px))?;
        let back = self.distortion.distort(&straight).by_straight.try_inverse()?;
        let focal = Matrix2::new(self.fx_px, 0.0, 0.0, self.fy_px);
        let inverse = Matrix2::new(1.0 / self.fx_px, 0.0, 0.0, 1.0 / self.fy_px);
        Some((self.pixel(&straight), focal * back * inverse))
    }

    pub(crate) fn pixel(&self, normalised: &Point2<f64>) -> Point2<f64> {
        Point2::new(self.fx_px * normalised.x + self.cx_px, self.fy_px * normalised.y + self.cy_px)
    }

    pub(crate) fn normalised(&self, px: &Point2<f64>) -> Point2<f64> {
        Point2::new((px.x - self.cx_px) / self.fx_px, (px.y - self.cy_px) / self.fy_px)
    }
}
