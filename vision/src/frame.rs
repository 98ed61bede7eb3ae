//! What enters the pipeline: a grey image and, when known, the camera's intrinsics. Both are checked here, once;
//! every later stage may rely on it.

mod lens;
mod sigmas;
pub use lens::{Bent, Distortion, MAX_RAY_RAD};
pub use sigmas::IntrinsicsSigmas;

use nalgebra::{Matrix2, Matrix2x3, Matrix3, Point2, Vector3};
use serde::{Deserialize, Serialize};

/// Largest accepted image side, in pixels.
pub const MAX_SIDE_PX: usize = 8192;
/// Largest accepted image area, in pixels.
pub const MAX_AREA_PX: usize = 16 * 1024 * 1024;

/// Why an image or a camera cannot be used. `field` names the offending input.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FrameError {
    /// Width or height is zero or beyond the limit.
    #[error(
        "image of {width}x{height} px is outside 1x1 to {MAX_SIDE_PX} px a side and {MAX_AREA_PX} px in all"
    )]
    Size {
        /// Claimed width in pixels.
        width: usize,
        /// Claimed height in pixels.
        height: usize,
    },
    /// The buffer does not hold width x height bytes.
    #[error("image data has {actual} bytes, {expected} expected")]
    Length {
        /// Bytes given.
        actual: usize,
        /// Bytes that width x height ask for.
        expected: usize,
    },
    /// A camera parameter is not finite or not in its range.
    #[error("camera parameter {field} = {value} is out of range")]
    Intrinsics {
        /// Name of the parameter.
        field: &'static str,
        /// Its value.
        value: f64,
    },
}

/// An 8-bit grey image, row-major without padding. Pixel (u, v) is `data[v * width + u]`; its centre has the integer
/// coordinates (u, v).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct GrayImage {
    width: usize,
    height: usize,
    data: Vec<u8>,
}

impl GrayImage {
    /// Checks size and length. `data` has exactly `width * height` bytes.
    pub fn new(width: usize, height: usize, data: Vec<u8>) -> Result<Self, FrameError> {
        if width == 0
            || height == 0
            || width > MAX_SIDE_PX
            || height > MAX_SIDE_PX
            || width * height > MAX_AREA_PX
        {
            return Err(FrameError::Size { width, height });
        }
        if data.len() != width * height {
            return Err(FrameError::Length { actual: data.len(), expected: width * height });
        }
        Ok(Self { width, height, data })
    }

    /// Builds an image from a function of (u, v). Panics on a size outside the limits: for generated images only.
    pub fn from_fn(width: usize, height: usize, mut f: impl FnMut(usize, usize) -> u8) -> Self {
        let data = (0..width * height).map(|i| f(i % width, i / width)).collect();
        Self::new(width, height, data).expect("generated image within the limits")
    }

    /// Width in pixels.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Height in pixels.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Row-major grey levels.
    pub fn data(&self) -> &[u8] {
        &self.data
    }

    /// Grey level at column `u`, row `v`.
    pub fn at(&self, u: usize, v: usize) -> u8 {
        self.data[v * self.width + u]
    }

    /// Bilinear grey level at `p_px`, coordinates clamped to the image.
    pub fn sample(&self, u_px: f64, v_px: f64) -> f32 {
        let u = u_px.clamp(0.0, (self.width - 1) as f64);
        let v = v_px.clamp(0.0, (self.height - 1) as f64);
        let (u0, v0) = (u as usize, v as usize);
        let (u1, v1) = ((u0 + 1).min(self.width - 1), (v0 + 1).min(self.height - 1));
        let (a, b) = ((u - u0 as f64) as f32, (v - v0 as f64) as f32);
        let at = |u, v| f32::from(self.at(u, v));
        (at(u0, v0) * (1.0 - a) + at(u1, v0) * a) * (1.0 - b) + (at(u0, v1) * (1.0 - a) + at(u1, v1) * a) * b
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
    /// How surely the rest is known; none: not stated, and taken as exact.
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
        self.pixel(&self.distortion.bend(&straight).point)
    }

    /// As [`Intrinsics::project`], with the derivative by the point.
    pub fn project_with(&self, p_camera: &Vector3<f64>) -> (Point2<f64>, Matrix2x3<f64>) {
        let inverse = 1.0 / p_camera.z;
        let straight = Point2::new(p_camera.x * inverse, p_camera.y * inverse);
        let bent = self.distortion.bend(&straight);
        let perspective = Matrix2x3::new(1.0, 0.0, -straight.x, 0.0, 1.0, -straight.y) * inverse;
        let focal = Matrix2::new(self.fx_px, 0.0, 0.0, self.fy_px);
        (self.pixel(&bent.point), focal * bent.by_straight * perspective)
    }

    /// The pixel where an undistorted pinhole with the same K would see what this camera sees at `px`. `None` where the
    /// lens cannot be undone: see [`Distortion::straighten`].
    pub fn undistort(&self, px: &Point2<f64>) -> Option<Point2<f64>> {
        if self.distortion == Distortion::None {
            return Some(*px);
        }
        Some(self.pixel(&self.distortion.straighten(&self.normalised(px))?))
    }

    /// As [`Intrinsics::undistort`], with the derivative by `px`: what turns the covariance of a corner.
    pub fn undistort_with(&self, px: &Point2<f64>) -> Option<(Point2<f64>, Matrix2<f64>)> {
        if self.distortion == Distortion::None {
            return Some((*px, Matrix2::identity()));
        }
        let straight = self.distortion.straighten(&self.normalised(px))?;
        let back = self.distortion.bend(&straight).by_straight.try_inverse()?;
        let focal = Matrix2::new(self.fx_px, 0.0, 0.0, self.fy_px);
        let inverse = Matrix2::new(1.0 / self.fx_px, 0.0, 0.0, 1.0 / self.fy_px);
        Some((self.pixel(&straight), focal * back * inverse))
    }

    fn pixel(&self, normalised: &Point2<f64>) -> Point2<f64> {
        Point2::new(self.fx_px * normalised.x + self.cx_px, self.fy_px * normalised.y + self.cy_px)
    }

    fn normalised(&self, px: &Point2<f64>) -> Point2<f64> {
        Point2::new((px.x - self.cx_px) / self.fx_px, (px.y - self.cy_px) / self.fy_px)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn refuses_what_is_not_an_image() {
        assert_eq!(GrayImage::new(0, 4, vec![]), Err(FrameError::Size { width: 0, height: 4 }));
        assert!(GrayImage::new(MAX_SIDE_PX, 1, vec![0; MAX_SIDE_PX]).is_ok());
        assert!(matches!(
            GrayImage::new(MAX_SIDE_PX + 1, 1, vec![0; MAX_SIDE_PX + 1]),
            Err(FrameError::Size { .. })
        ));
        assert_eq!(GrayImage::new(2, 2, vec![0; 3]), Err(FrameError::Length { actual: 3, expected: 4 }));
    }

    #[test]
    fn refuses_cameras_that_cannot_be() {
        assert!(matches!(
            Intrinsics::new(f64::NAN, 500.0, 0.0, 0.0, Distortion::None),
            Err(FrameError::Intrinsics { field: "fx_px", .. })
        ));
        assert!(matches!(
            Intrinsics::new(500.0, -1.0, 0.0, 0.0, Distortion::None),
            Err(FrameError::Intrinsics { field: "fy_px", .. })
        ));
        assert!(matches!(
            Intrinsics::new(
                500.0,
                500.0,
                0.0,
                0.0,
                Distortion::PlumbBob([0.0, f64::INFINITY, 0.0, 0.0, 0.0])
            ),
            Err(FrameError::Intrinsics { field: "distortion", .. })
        ));
    }

    #[test]
    fn bilinear_sample_interpolates_and_clamps() {
        let image = GrayImage::new(2, 2, vec![0, 100, 200, 100]).unwrap();
        assert!((image.sample(0.5, 0.5) - 100.0).abs() < 1e-4);
        assert!((image.sample(0.25, 0.0) - 25.0).abs() < 1e-4);
        assert!((image.sample(-3.0, 9.0) - 200.0).abs() < 1e-4);
    }

    fn lenses() -> [Intrinsics; 4] {
        [
            Distortion::None,
            Distortion::PlumbBob([-0.28, 0.09, 1e-3, -5e-4, -0.01]),
            Distortion::RationalPolynomial([0.9, 0.3, 2e-4, -3e-4, 0.02, 1.2, 0.5, 0.06]),
            Distortion::Equidistant([-0.02, 0.006, -0.004, 0.001]),
        ]
        .map(|lens| Intrinsics::new(520.0, 518.0, 318.0, 243.0, lens).unwrap())
    }

    #[test]
    fn undistort_inverts_project() {
        for camera in lenses() {
            let pinhole = Intrinsics { distortion: Distortion::None, ..camera };
            for p in [[0.3, -0.2, 1.0], [-0.5, 0.35, 1.2], [0.0, 0.0, 2.0]] {
                let p = Vector3::from(p);
                let back = camera.undistort(&camera.project(&p)).unwrap();
                assert!((back - pinhole.project(&p)).norm() < 1e-6);
            }
        }
    }

    #[test]
    fn a_short_side_is_hardly_bent() {
        // What the search for quads must bear: how far a vertical side at the right edge of the image leaves its chord.
        let lens = Distortion::PlumbBob([-0.28, 0.09, 0.0, 0.0, 0.0]);
        let camera = Intrinsics::new(520.0, 520.0, 319.5, 239.5, lens).unwrap();
        let middle = camera.undistort(&Point2::new(619.5, 239.5)).unwrap();
        for (length, arrow) in [(100.0, 0.8), (200.0, 3.1)] {
            let end = camera.undistort(&Point2::new(619.5, 239.5 + 0.5 * length)).unwrap();
            // The straight side through the middle, as far up as the end.
            let x = (middle.x - 319.5) / 520.0;
            let y = (end.y - 239.5) / 520.0;
            let bent = 619.5 - camera.project(&Vector3::new(x, y, 1.0)).x;
            assert!((bent - arrow).abs() < 0.1, "{length}: {bent}");
        }
    }

    #[test]
    fn derivatives_are_the_finite_differences() {
        for camera in lenses() {
            let p = Vector3::new(-0.5, 0.35, 1.2);
            let (px, by_point) = camera.project_with(&p);
            assert!((px - camera.project(&p)).norm() < 1e-12);
            for k in 0..3 {
                let mut d = Vector3::zeros();
                d[k] = 1e-6;
                let numeric = (camera.project(&(p + d)) - camera.project(&(p - d))) / 2e-6;
                assert!((numeric - by_point.column(k)).norm() < 1e-5, "{camera:?} {k}");
            }
            let (straight, by_px) = camera.undistort_with(&px).unwrap();
            assert!((straight - camera.undistort(&px).unwrap()).norm() < 1e-12);
            for k in 0..2 {
                let mut d = nalgebra::Vector2::zeros();
                d[k] = 1e-3;
                let at = |d| camera.undistort(&(px + d)).unwrap();
                assert!(((at(d) - at(-d)) / 2e-3 - by_px.column(k)).norm() < 1e-6, "{camera:?} {k}");
            }
        }
    }
}
