//! `CameraInfo` as intrinsics and lens model of the image that is sent.
//!
//! Source: `ros2/common_interfaces sensor_msgs/msg/CameraInfo.msg`;
//! `ros-perception/vision_opencv image_geometry/src/pinhole_camera_model.cpp` (region of interest,
//! then binning). Pixel centres are at integers.

use crate::messages::CameraInfo;
use protos::v1;

/// How a lens bends rays; coefficients in the order of OpenCV.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LensModel {
    /// Not at all: a rectified image.
    Rectified,
    /// `plumb_bob`: k1, k2, p1, p2, k3.
    PlumbBob([f64; 5]),
    /// `rational_polynomial`: k1, k2, p1, p2, k3, k4, k5, k6.
    RationalPolynomial([f64; 8]),
    /// `equidistant` or `fisheye`: k1, k2, k3, k4.
    Equidistant([f64; 4]),
}

/// Intrinsics of an image, px.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CameraModel {
    /// Columns of the image.
    pub width_px: u32,
    /// Rows of the image.
    pub height_px: u32,
    /// Focal length along u.
    pub fx_px: f64,
    /// Focal length along v.
    pub fy_px: f64,
    /// Principal point, u.
    pub cx_px: f64,
    /// Principal point, v.
    pub cy_px: f64,
    /// The lens.
    pub lens: LensModel,
}

/// Why a calibration cannot be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum CameraError {
    /// The focal length is 0, as the definition has it for a camera that is not calibrated.
    #[error("the camera is not calibrated")]
    Uncalibrated,
    /// A number is not finite, negative, or without sense.
    #[error("`{0}` of the calibration is out of range")]
    Field(&'static str),
    /// A lens model without a use here.
    #[error("the lens model `{0}` is not known")]
    UnknownModel(String),
    /// A wrong number of coefficients for the model.
    #[error("{count} coefficients for the lens model `{model}`")]
    Coefficients {
        /// The model.
        model: String,
        /// How many there are.
        count: usize,
    },
    /// The server would refuse it: field and reason.
    #[error("{0}")]
    Refused(String),
    /// The rectified image belongs to a camera that is turned: one of a stereo pair. Its frame is
    /// another one than the header's.
    #[error("the image is rectified into a turned frame; send the raw image")]
    Turned,
}

/// Longest name of a model that an error repeats, in characters.
const MAX_MODEL_CHARS: usize = 64;

impl CameraModel {
    /// Of the raw image, with the lens.
    pub fn of_raw(info: &CameraInfo<'_>) -> Result<Self, CameraError> {
        let k = &info.k;
        Self::of(info, [k[0], k[4], k[2], k[5]], LensModel::of(info.distortion_model, &info.d)?)
    }

    /// Of the rectified image (`image_rect`), which has no lens.
    pub fn of_rectified(info: &CameraInfo<'_>) -> Result<Self, CameraError> {
        let is_unit = |(i, r): (usize, &f64)| (r - f64::from(u8::from(i % 4 == 0))).abs() <= 1e-6;
        if !info.r.iter().enumerate().all(is_unit) && info.r.iter().any(|r| r.abs() > 0.0) {
            return Err(CameraError::Turned);
        }
        let p = &info.p;
        Self::of(info, [p[0], p[5], p[2], p[6]], LensModel::Rectified)
    }

    /// As frames carry it.
    pub fn to_wire(&self) -> v1::Intrinsics {
        let mut wire = v1::Intrinsics {
            fx_px: self.fx_px,
            fy_px: self.fy_px,
            cx_px: self.cx_px,
            cy_px: self.cy_px,
            ..v1::Intrinsics::default()
        };
        match self.lens {
            LensModel::Rectified => {}
            LensModel::PlumbBob(d) => wire.plumb_bob = d.to_vec(),
            LensModel::RationalPolynomial(d) => wire.rational_polynomial = d.to_vec(),
            LensModel::Equidistant(d) => wire.equidistant = d.to_vec(),
        }
        wire
    }

    fn of(info: &CameraInfo<'_>, calibrated: [f64; 4], lens: LensModel) -> Result<Self, CameraError> {
        let [fx, fy, cx, cy] = calibrated;
        if fx.abs() + fy.abs() <= 0.0 {
            return Err(CameraError::Uncalibrated);
        }
        let checks = [
            ("fx", fx > 0.0 && fx.is_finite()),
            ("fy", fy > 0.0 && fy.is_finite()),
            ("cx", cx.is_finite()),
            ("cy", cy.is_finite()),
            ("width", info.width > 0),
            ("height", info.height > 0),
        ];
        if let Some((field, _)) = checks.iter().find(|(_, is_right)| !is_right) {
            return Err(CameraError::Field(field));
        }
        let roi = &info.roi;
        let (width, height) = if roi.width == 0 && roi.height == 0 {
            (info.width, info.height)
        } else {
            (roi.width, roi.height)
        };
        let is_inside =
            |offset: u32, size: u32, whole: u32| size > 0 && offset <= whole && size <= whole - offset;
        if !is_inside(roi.x_offset, width, info.width) || !is_inside(roi.y_offset, height, info.height) {
            return Err(CameraError::Field("roi"));
        }
        let (bx, by) = (info.binning_x.max(1), info.binning_y.max(1));
        if width < bx || height < by {
            return Err(CameraError::Field("binning"));
        }
        Ok(Self {
            width_px: width / bx,
            height_px: height / by,
            fx_px: fx / f64::from(bx),
            fy_px: fy / f64::from(by),
            cx_px: (cx - f64::from(roi.x_offset)) / f64::from(bx),
            cy_px: (cy - f64::from(roi.y_offset)) / f64::from(by),
            lens,
        })
    }
}

/// Names of a lens that bends nothing. `CameraInfo` of simulations and of rectified streams has
/// them.
const NO_LENS: [&str; 6] = ["", "none", "None", "pinhole", "perspective", "rectified"];

impl LensModel {
    /// The lens by the coefficients that are not 0, in the order of OpenCV: some drivers send
    /// `plumb_bob` with 8 coefficients, `rational_polynomial` with 5, or up to 14 (thin prism and
    /// tilt), the last ones 0. `plumb_bob` with k4 to k6 is the rational model, as OpenCV reads it.
    pub fn of(name: &str, d: &[f64]) -> Result<Self, CameraError> {
        if d.iter().any(|c| !c.is_finite()) {
            return Err(CameraError::Field("d"));
        }
        if d.is_empty() {
            return Ok(Self::Rectified);
        }
        let used = d.iter().rposition(|c| c.abs() > 0.0).map_or(0, |last| last + 1);
        let model = || name.chars().take(MAX_MODEL_CHARS).collect();
        let wrong = || CameraError::Coefficients { model: model(), count: used };
        match name {
            "plumb_bob" | "radtan" | "rational_polynomial" => match used {
                0..=5 => Ok(Self::PlumbBob(filled(d))),
                6..=8 => Ok(Self::RationalPolynomial(filled(d))),
                _ => Err(wrong()),
            },
            // Without coefficients it bends rays, too.
            "equidistant" | "fisheye" | "kannala_brandt" | "kannala_brandt4" => {
                if used <= 4 {
                    Ok(Self::Equidistant(filled(d)))
                } else {
                    Err(wrong())
                }
            }
            name if used == 0 && NO_LENS.contains(&name) => Ok(Self::Rectified),
            _ => Err(CameraError::UnknownModel(model())),
        }
    }
}

/// The first coefficients, and 0 for those that are left out.
fn filled<const N: usize>(d: &[f64]) -> [f64; N] {
    std::array::from_fn(|i| d.get(i).copied().unwrap_or(0.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::messages::RegionOfInterest;

    fn info() -> CameraInfo<'static> {
        CameraInfo {
            height: 480,
            width: 640,
            distortion_model: "plumb_bob",
            d: vec![0.1, 0.2, 0.3, 0.4, 0.5],
            k: [500.0, 0.0, 320.0, 0.0, 510.0, 240.0, 0.0, 0.0, 1.0],
            r: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
            p: [450.0, 0.0, 310.0, 0.0, 0.0, 460.0, 230.0, 0.0, 0.0, 0.0, 1.0, 0.0],
            ..CameraInfo::default()
        }
    }

    fn numbers(model: &CameraModel) -> [f64; 4] {
        [model.fx_px, model.fy_px, model.cx_px, model.cy_px]
    }

    fn near(a: [f64; 4], b: [f64; 4]) -> bool {
        a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12)
    }

    #[test]
    fn raw_and_rectified_images_have_their_own_intrinsics() {
        let raw = CameraModel::of_raw(&info()).unwrap();
        assert_eq!((raw.width_px, raw.height_px), (640, 480));
        assert!(near(numbers(&raw), [500.0, 510.0, 320.0, 240.0]));
        assert_eq!(raw.lens, LensModel::PlumbBob([0.1, 0.2, 0.3, 0.4, 0.5]));
        let rectified = CameraModel::of_rectified(&info()).unwrap();
        assert!(near(numbers(&rectified), [450.0, 460.0, 310.0, 230.0]));
        assert_eq!(rectified.lens, LensModel::Rectified);
    }

    #[test]
    fn a_part_of_the_image_and_binning_move_the_intrinsics() {
        let roi =
            RegionOfInterest { x_offset: 100, y_offset: 40, width: 320, height: 240, do_rectify: false };
        let part = CameraInfo { roi, binning_x: 2, binning_y: 4, ..info() };
        let model = CameraModel::of_raw(&part).unwrap();
        assert_eq!((model.width_px, model.height_px), (160, 60));
        assert!(near(numbers(&model), [250.0, 127.5, 110.0, 50.0]));
        let refused = |roi| CameraModel::of_raw(&CameraInfo { roi, ..info() }).unwrap_err();
        assert_eq!(refused(RegionOfInterest { x_offset: 400, ..roi }), CameraError::Field("roi"));
        assert_eq!(refused(RegionOfInterest { width: 0, ..roi }), CameraError::Field("roi"));
        assert_eq!(refused(RegionOfInterest { y_offset: u32::MAX, ..roi }), CameraError::Field("roi"));
        let binned = CameraInfo { binning_x: 641, ..info() };
        assert_eq!(CameraModel::of_raw(&binned), Err(CameraError::Field("binning")));
    }

    #[test]
    fn lenses_have_the_coefficients_of_their_model() {
        let of = |distortion_model, d: &[f64]| {
            CameraModel::of_raw(&CameraInfo { distortion_model, d: d.to_vec(), ..info() }).map(|m| m.lens)
        };
        let eight = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0];
        assert_eq!(of("plumb_bob", &eight[..4]), Ok(LensModel::PlumbBob([1.0, 2.0, 3.0, 4.0, 0.0])));
        assert_eq!(of("equidistant", &eight[..4]), Ok(LensModel::Equidistant([1.0, 2.0, 3.0, 4.0])));
        assert_eq!(of("rational_polynomial", &eight), Ok(LensModel::RationalPolynomial(eight)));
        let mut fourteen = [0.0; 14];
        fourteen[..8].copy_from_slice(&eight);
        assert_eq!(of("rational_polynomial", &fourteen), Ok(LensModel::RationalPolynomial(eight)));
        fourteen[13] = 1e-3;
        let wrong = |model: &str, count| Err(CameraError::Coefficients { model: model.into(), count });
        assert_eq!(of("rational_polynomial", &fourteen), wrong("rational_polynomial", 14));
        assert_eq!(of("equidistant", &eight[..5]), wrong("equidistant", 5));
        assert_eq!(of("", &[]), Ok(LensModel::Rectified));
        assert_eq!(of("thin_prism", &eight), Err(CameraError::UnknownModel("thin_prism".into())));
        assert_eq!(of("plumb_bob", &[f64::NAN; 5]), Err(CameraError::Field("d")));
    }

    #[test]
    fn calibrations_that_cannot_be_used_are_refused() {
        let raw = |change: fn(&mut CameraInfo<'_>)| {
            let mut changed = info();
            change(&mut changed);
            CameraModel::of_raw(&changed).unwrap_err()
        };
        assert_eq!(raw(|i| i.k = [0.0; 9]), CameraError::Uncalibrated);
        assert_eq!(raw(|i| i.k[0] = -500.0), CameraError::Field("fx"));
        assert_eq!(raw(|i| i.k[4] = f64::NAN), CameraError::Field("fy"));
        assert_eq!(raw(|i| i.k[2] = f64::INFINITY), CameraError::Field("cx"));
        assert_eq!(raw(|i| i.height = 0), CameraError::Field("height"));
        let turned = CameraInfo { r: [0.0, 1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 1.0], ..info() };
        assert_eq!(CameraModel::of_rectified(&turned), Err(CameraError::Turned));
        assert!(CameraModel::of_raw(&turned).is_ok());
        assert!(CameraModel::of_rectified(&CameraInfo { r: [0.0; 9], ..info() }).is_ok(), "never filled in");
    }
}
