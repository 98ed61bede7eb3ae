//! A camera on the command line: numbers, or a file, and its intrinsics for a photograph.

mod file;

use super::{
    arg_parsers::numbers,
    failure::{Class, Failure},
};
use engine::picture::upright_size;
use std::path::Path;
use vision::frame::{Distortion, Intrinsics, IntrinsicsSigmas};

/// A camera of the command line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct CameraArg {
    /// For pictures of that size.
    intrinsics: Intrinsics,
    /// Width and height of the pictures that it was calibrated with, px; none: not stated.
    size_px: Option<[usize; 2]>,
}

impl CameraArg {
    /// The intrinsics, and the size of picture that they are stated to be of.
    pub(super) fn stated(self) -> (Intrinsics, Option<[usize; 2]>) {
        (self.intrinsics, self.size_px)
    }

    /// The intrinsics for a photograph, a file's bytes: those of another scale are scaled. Errors: the photograph has other
    /// proportions than those of the calibration, or the principal point is far off its middle.
    pub(super) fn of_photograph(&self, photograph: &[u8]) -> Result<Intrinsics, Failure> {
        // Without a size in the header the server says what is wrong with the file.
        let Some(picture) = upright_size(photograph) else { return Ok(self.intrinsics) };
        self.intrinsics
            .for_picture(self.size_px, picture)
            .map_err(|error| Failure::new(Class::Usage, "camera_size", format!("--camera: {error}.")))
    }
}

/// A camera: `fx,fy,cx,cy` in pixels, with standard deviations of focal length and centre where there are six numbers; or
/// the name of a file with a calibration.
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
    Ok(CameraArg { intrinsics, size_px: None })
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
    fn a_photograph_has_the_camera_of_its_size() {
        let photograph = |w, h| engine::picture::png(w, h, &vec![0; w * h]).unwrap();
        let intrinsics = Intrinsics::new(50.0, 50.0, 31.5, 23.5, Distortion::None).unwrap();
        let stated = CameraArg { intrinsics, size_px: Some([64, 48]) };
        let fx =
            |found: Result<Intrinsics, Failure>| found.map(|k| k.fx_px).map_err(|f| (f.class, f.sentence));
        assert_eq!(fx(stated.of_photograph(&photograph(64, 48))), Ok(50.0));
        assert_eq!(fx(stated.of_photograph(&photograph(128, 96))), Ok(100.0));
        let turned = fx(stated.of_photograph(&photograph(48, 64))).unwrap_err();
        assert!(turned.0 == Class::Usage && turned.1.contains("held the other way"), "{turned:?}");
        assert!(fx(stated.of_photograph(&photograph(64, 64))).unwrap_err().1.contains("no other scale"));
        let bare = CameraArg { intrinsics, size_px: None };
        assert_eq!(fx(bare.of_photograph(&photograph(64, 48))), Ok(50.0));
        assert!(fx(bare.of_photograph(&photograph(128, 96))).unwrap_err().1.contains("principal point"));
        assert_eq!(fx(bare.of_photograph(b"no picture")), Ok(50.0));
    }
}
