//! What enters the pipeline: a picture, grey or in colour, and, when known, the camera's
//! intrinsics. Both are checked here, once; every later stage may rely on it.

mod image;
mod picture;
mod lens;
mod intrinsics;
mod sigmas;
mod sized;

pub use image::{FrameError, GrayImage, MAX_AREA_PX, MAX_SIDE_PX};
pub use intrinsics::{Intrinsics, IntrinsicsSigmas};
pub use lens::{DistortedPoint, Distortion, MAX_RAY_RAD};
pub use picture::{COLOUR_PLANES, Picture, PictureRef, luma};
pub use sized::PictureSizeError;

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Point2, Vector3};

    #[test]
    fn invalid_images_are_refused() {
        assert_eq!(GrayImage::new(0, 4, vec![]), Err(FrameError::Size { width: 0, height: 4 }));
        assert!(GrayImage::new(MAX_SIDE_PX, 1, vec![0; MAX_SIDE_PX]).is_ok());
        assert!(matches!(
            GrayImage::new(MAX_SIDE_PX + 1, 1, vec![0; MAX_SIDE_PX + 1]),
            Err(FrameError::Size { .. })
        ));
        assert_eq!(GrayImage::new(2, 2, vec![0; 3]), Err(FrameError::Length { actual: 3, expected: 4 }));
    }

    #[test]
    fn invalid_intrinsics_are_refused() {
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
    fn a_short_side_stays_nearly_straight() {
        // How far a vertical side at the right edge of the image leaves its chord; detection must
        // tolerate it.
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
            let px = camera.project(&p);
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
