//! Standard deviations of intrinsics, and the derivative of a pixel by their errors. First order:
//! one share of the focal length for fx and fy, and the principal point. Errors of the lens
//! coefficients are not modelled.

use crate::frame::{
    image::FrameError,
    intrinsics::{Intrinsics, IntrinsicsSigmas},
};
use nalgebra::{Matrix2, Matrix2x3, Point2, Vector3};

impl Intrinsics {
    /// The same camera with these standard deviations. Both finite, 0 to
    /// [`IntrinsicsSigmas::MAX_SHARE`] of fx.
    pub fn with_sigmas(self, sigmas: IntrinsicsSigmas) -> Result<Self, FrameError> {
        for (field, value) in [("focal_sigma_px", sigmas.focal_px), ("center_sigma_px", sigmas.center_px)] {
            if !(0.0..=IntrinsicsSigmas::MAX_SHARE * self.fx_px).contains(&value) {
                return Err(FrameError::Intrinsics { field, value });
            }
        }
        Ok(Self { sigmas: Some(sigmas), ..self })
    }

    /// Standard deviations of its errors: a share of the focal length, the principal point in px.
    /// Zero where none are stated.
    pub fn error_sigmas(&self) -> Vector3<f64> {
        self.sigmas
            .map_or_else(Vector3::zeros, |s| Vector3::new(s.focal_px / self.fx_px, s.center_px, s.center_px))
    }

    /// Derivative of the undistorted pixel `straight_px` (see [`Intrinsics::undistort`]) of a given
    /// raw pixel by errors of (share of the focal length, cx, cy), in pixels of this pinhole.
    /// `None` where the distortion is not invertible.
    pub fn straight_by_errors(&self, straight_px: &Point2<f64>) -> Option<Matrix2x3<f64>> {
        let bent = self.distortion.distort(&self.normalised(straight_px));
        let focal = Matrix2::new(self.fx_px, 0.0, 0.0, self.fy_px);
        let back = focal * bent.by_straight.try_inverse()?;
        let share = back * bent.point.coords;
        let center = back * Matrix2::new(1.0 / self.fx_px, 0.0, 0.0, 1.0 / self.fy_px);
        Some(-Matrix2x3::from_columns(&[share, center.column(0).into(), center.column(1).into()]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Distortion;

    #[test]
    fn derivatives_are_the_finite_differences() {
        let lenses = [
            Distortion::None,
            Distortion::PlumbBob([-0.25, 0.08, 8e-4, -6e-4, -0.01]),
            Distortion::RationalPolynomial([0.9, 0.3, 2e-4, -3e-4, 0.02, 1.2, 0.5, 0.06]),
            Distortion::Equidistant([-0.02, 0.006, -0.004, 0.001]),
        ];
        for lens in lenses {
            let camera = Intrinsics::new(520.0, 515.0, 318.0, 243.0, lens).unwrap();
            let raw = Point2::new(120.0, 400.0);
            let straight = camera.undistort(&raw).unwrap();
            let by = camera.straight_by_errors(&straight).unwrap();
            let at = |d: Vector3<f64>| {
                let (share, cx_px, cy_px) = (1.0 + d.x, camera.cx_px + d.y, camera.cy_px + d.z);
                let (fx_px, fy_px) = (camera.fx_px * share, camera.fy_px * share);
                let other = Intrinsics { fx_px, fy_px, cx_px, cy_px, ..camera };
                // The ray of the other camera, as a pixel of this one's pinhole.
                camera.pixel(&other.normalised(&other.undistort(&raw).unwrap()))
            };
            for (k, h) in [1e-6, 1e-3, 1e-3].into_iter().enumerate() {
                let mut d = Vector3::zeros();
                d[k] = h;
                let numeric = (at(d) - at(-d)) / (2.0 * h);
                let error = (numeric - by.column(k)).norm();
                assert!(error < 1e-3 * by.column(k).norm(), "{lens:?} {k}: {error}");
            }
        }
    }

    #[test]
    fn sigmas_at_their_bounds() {
        let camera = Intrinsics::new(500.0, 490.0, 320.0, 240.0, Distortion::None).unwrap();
        assert_eq!(camera.error_sigmas(), Vector3::zeros());
        let with = |focal_px, center_px| camera.with_sigmas(IntrinsicsSigmas { focal_px, center_px });
        assert_eq!(with(5.0, 2.0).unwrap().error_sigmas(), Vector3::new(0.01, 2.0, 2.0));
        assert!(with(0.0, 0.0).is_ok() && with(125.0, 125.0).is_ok());
        for (bad, field) in [
            (with(125.1, 0.0), "focal_sigma_px"),
            (with(-0.1, 0.0), "focal_sigma_px"),
            (with(f64::NAN, 0.0), "focal_sigma_px"),
            (with(0.0, 125.1), "center_sigma_px"),
            (with(0.0, f64::INFINITY), "center_sigma_px"),
        ] {
            assert!(matches!(bad, Err(FrameError::Intrinsics { field: named, .. }) if named == field));
        }
        assert!(camera.with_sigmas(IntrinsicsSigmas::usual(camera.fx_px)).is_ok());
    }
}
