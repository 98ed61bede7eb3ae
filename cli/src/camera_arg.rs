//! A camera on the command line: numbers, or a file, and its intrinsics for a photograph.

mod file;
pub(super) mod lens;

pub(super) use lens::{Lens, LensDifference};

use super::{
    arg_parsers::numbers,
    failure::{Class, Failure},
};
use engine::picture::upright_size;
use std::path::Path;
use vision::frame::{Distortion, Intrinsics, IntrinsicsSigmas};

/// A camera of the command line.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct CameraArg {
    /// For pictures of that size.
    intrinsics: Intrinsics,
    /// Width and height of the pictures that it was calibrated with, px; none: not stated.
    size_px: Option<[usize; 2]>,
    /// The lens that it was calibrated with, where that is known.
    lens: Option<Lens>,
}

impl CameraArg {
    /// The intrinsics, and the size of picture that they are stated to be of.
    pub(super) fn stated(&self) -> (Intrinsics, Option<[usize; 2]>) {
        (self.intrinsics, self.size_px)
    }

    /// What to say of the lens of a photograph. Error: it has another focal length than that of the
    /// calibration.
    pub(super) fn check_lens(&self, photograph: Option<&Lens>) -> Result<Option<String>, Failure> {
        let Some((known, taken)) = self.lens.as_ref().zip(photograph) else { return Ok(None) };
        match known.difference(taken) {
            None => Ok(None),
            Some(LensDifference::Camera) => Ok(Some(format!(
                "caution: the camera was calibrated with {known}, and the photograph is of {taken}."
            ))),
            Some(LensDifference::Focal) => {
                let sentence =
                    format!("--camera: it was calibrated with {known}, and the photograph is of {taken}.");
                let advice = "Each lens and each zoom has a calibration of its own: calibrate with photographs by this one.";
                Err(Failure::new(Class::Usage, "camera_lens", sentence).advise(advice))
            }
        }
    }

    /// The intrinsics for a photograph, a file's bytes: those of another scale are scaled. Errors:
    /// the photograph has other proportions than those of the calibration, or the principal point
    /// is far off its middle.
    pub(super) fn of_photograph(&self, photograph: &[u8]) -> Result<Intrinsics, Failure> {
        // Without a size in the header the server says what is wrong with the file.
        let Some(picture) = upright_size(photograph) else { return Ok(self.intrinsics) };
        self.intrinsics
            .for_picture(self.size_px, picture)
            .map_err(|error| Failure::new(Class::Usage, "camera_size", format!("--camera: {error}.")))
    }
}

/// A camera: `fx,fy,cx,cy` in pixels, with standard deviations of focal length and centre where
/// there are six numbers; or the name of a file with a calibration.
pub(super) fn camera(text: &str) -> Result<CameraArg, String> {
    let made = match (numbers(text, ','), numbers(text, ',')) {
        (Some([fx, fy, cx, cy]), _) => Intrinsics::new(fx, fy, cx, cy, Distortion::None),
        (None, Some([fx, fy, cx, cy, focal_px, center_px])) => {
            Intrinsics::new(fx, fy, cx, cy, Distortion::None)
                .and_then(|camera| camera.with_sigmas(IntrinsicsSigmas { focal_px, center_px }))
        }
        _ => return file::camera(Path::new(text)),
    };
    let intrinsics = made.map_err(|error| error.to_string())?;
    Ok(CameraArg { intrinsics, size_px: None, lens: None })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cameras_are_numbers() {
        assert!(camera("500,500,320,240").is_ok());
        assert!(camera("500,500,320").is_err() && camera("-1,500,320,240").is_err());
        let known = camera("500,500,320,240,2.5,1").unwrap();
        assert_eq!(known.intrinsics.sigmas, Some(IntrinsicsSigmas { focal_px: 2.5, center_px: 1.0 }));
        assert!(camera("500,500,320,240,2.5").is_err() && camera("500,500,320,240,126,1").is_err());
    }

    #[test]
    fn a_photograph_of_another_lens_is_refused_and_of_another_camera_told() {
        let of = |model, focal| Lens::of_photograph(&lens::tests::photograph(model, focal));
        let intrinsics = Intrinsics::new(50.0, 50.0, 31.5, 23.5, Distortion::None).unwrap();
        let camera = CameraArg { intrinsics, size_px: None, lens: of("iPhone 13", 26) };
        let said = |taken: Option<Lens>| camera.check_lens(taken.as_ref());
        assert_eq!((said(of("iPhone 13", 26)), said(None)), (Ok(None), Ok(None)));
        assert!(said(of("Pixel 7", 26)).unwrap().unwrap().contains("Pixel 7"));
        let other = said(of("iPhone 13", 13)).unwrap_err();
        assert_eq!((other.class, other.code.as_str()), (Class::Usage, "camera_lens"));
        assert!(other.sentence.contains("26 mm") && other.sentence.contains("13 mm"), "{other:?}");
    }

    #[test]
    fn a_photograph_has_the_camera_of_its_size() {
        let photograph = |w, h| engine::picture::png(w, h, &vec![0; w * h]).unwrap();
        let intrinsics = Intrinsics::new(50.0, 50.0, 31.5, 23.5, Distortion::None).unwrap();
        let stated = CameraArg { intrinsics, size_px: Some([64, 48]), lens: None };
        let fx =
            |found: Result<Intrinsics, Failure>| found.map(|k| k.fx_px).map_err(|f| (f.class, f.sentence));
        assert_eq!(fx(stated.of_photograph(&photograph(64, 48))), Ok(50.0));
        assert_eq!(fx(stated.of_photograph(&photograph(128, 96))), Ok(100.0));
        let turned = fx(stated.of_photograph(&photograph(48, 64))).unwrap_err();
        assert!(turned.0 == Class::Usage && turned.1.contains("held the other way"), "{turned:?}");
        assert!(fx(stated.of_photograph(&photograph(64, 64))).unwrap_err().1.contains("no other scale"));
        let bare = CameraArg { intrinsics, size_px: None, lens: None };
        assert_eq!(fx(bare.of_photograph(&photograph(64, 48))), Ok(50.0));
        assert!(fx(bare.of_photograph(&photograph(128, 96))).unwrap_err().1.contains("principal point"));
        assert_eq!(fx(bare.of_photograph(b"no picture")), Ok(50.0));
    }
}
