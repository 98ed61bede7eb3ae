//! Intrinsics of a camera: focal length, principal point, lens distortion, and their standard
//! deviations.

use crate::frame::{image::FrameError, lens::Distortion};
use nalgebra::{Matrix2, Matrix3, Point2, Vector3};
use serde::{Deserialize, Serialize};

/// Standard deviations of intrinsics, as a calibration states them. fx and fy err together: of a
/// calibration their errors are almost fully correlated.
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
    /// Default for the principal point, as a share of the focal length: 2 px at 640 x 480. Its
    /// error acts mostly like a rotation of the camera, and so is part of the calibrated
    /// extrinsics.
    pub const USUAL_CENTER_SHARE: f64 = 0.003;
    /// Largest accepted, as a share of the focal length: beyond it the first-order model does not
    /// hold.
    pub const MAX_SHARE: f64 = 0.25;

    /// Defaults for a camera of this focal length.
    pub fn usual(focal_px: f64) -> Self {
        let (focal, center) = (Self::USUAL_FOCAL_SHARE * focal_px, Self::USUAL_CENTER_SHARE * focal_px);
        Self { focal_px: focal, center_px: center }
    }
}

/// Steps from the middle to a corner in which a model is looked at for poles.
const POLE_STEPS: usize = 256;

/// How much farther out than without a lens a corner may lie, where a model has large coefficients:
/// before a pole it goes to infinity.
const SANE_GROWTH: std::ops::RangeInclusive<f64> = 0.5..=2.0;

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
    /// Largest distortion coefficient whose model is taken without a look at it. Larger ones are of
    /// rational models whose numerator and denominator nearly cancel: calibrations of long lenses
    /// give thousands.
    pub const LARGE_COEFFICIENT: f64 = 100.0;
    /// Largest accepted distortion coefficient.
    pub const MAX_COEFFICIENT: f64 = 1e6;

    /// Checks that every number is finite, focal lengths lie in 10 to 100 000 px, the principal
    /// point within +-20 000 px and distortion coefficients within +-[`Self::LARGE_COEFFICIENT`];
    /// or within +-[`Self::MAX_COEFFICIENT`] if the model is invertible at the corners of a picture
    /// with the principal point in its middle.
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
            check("distortion", *value, -Self::MAX_COEFFICIENT, Self::MAX_COEFFICIENT)?;
        }
        let made = Self { fx_px, fy_px, cx_px, cy_px, distortion, sigmas: None };
        let large = distortion.coefficients().iter().find(|value| value.abs() > Self::LARGE_COEFFICIENT);
        match large {
            Some(&value) if !made.is_invertible() => {
                Err(FrameError::Intrinsics { field: "distortion", value })
            }
            _ => Ok(made),
        }
    }

    /// Whether the distortion is invertible at the corners of a picture with the principal point in
    /// its middle.
    fn is_invertible(&self) -> bool {
        let (right, below) = (2.0 * self.cx_px, 2.0 * self.cy_px);
        let corners = [[0.0, 0.0], [right, 0.0], [right, below], [0.0, below]];
        // A pole is narrow: the picture must grow outwards in small steps.
        let grows = |corner: Point2<f64>| {
            let radius = |i: usize| {
                let share = i as f64 / POLE_STEPS as f64;
                self.distortion.distort(&Point2::from(corner.coords * share)).point.coords.norm()
            };
            let share = radius(POLE_STEPS) / corner.coords.norm();
            (0..POLE_STEPS).all(|i| radius(i + 1) > radius(i)) && SANE_GROWTH.contains(&share)
        };
        let straight =
            |corner: &[f64; 2]| self.distortion.undistort(&self.normalised(&Point2::from(*corner)));
        corners.iter().all(|corner| straight(corner).is_some_and(grows))
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

    /// The pixel where an undistorted pinhole with the same K would see what this camera sees at
    /// `px`. `None` where the distortion is not invertible: see [`Distortion::undistort`].
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Of a report on a long lens: k4 to k6 nearly cancel k1 to k3.
    const LONG_LENS: [f64; 8] = [-13.2, -98.0, 1e-4, -2e-4, 1357.8, -13.1, -102.4, 1383.1];

    #[test]
    fn large_coefficients_are_used_where_the_model_is_sane() {
        let camera = |fx: f64, k| Intrinsics::new(fx, fx, 960.0, 600.0, Distortion::RationalPolynomial(k));
        // Half a picture's diagonal is 0.19 of the focal length; the model has its pole at 0.28.
        assert!(camera(6000.0, LONG_LENS).is_ok());
        let refused = Err(FrameError::Intrinsics { field: "distortion", value: 1357.8 });
        for fx in [100.0, 400.0, 1500.0] {
            assert_eq!(camera(fx, LONG_LENS), refused, "{fx}");
        }
        assert!(camera(6000.0, [2e6; 8]).is_err());
    }
}
