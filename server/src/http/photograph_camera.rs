//! The camera of an uploaded picture. In: the part `intrinsics` of a form: `Intrinsics` of frames
//! as JSON, with the size of the pictures that they are of (`width_px`, `height_px`) where that is
//! known. Out: intrinsics of the picture that came.

use super::{error::ApiError, extract::json};
use protos::{Code, Rejection, convert::geometry, v1};
use serde::Deserialize;
use vision::frame::{Intrinsics, PictureSizeError};

#[derive(Deserialize)]
struct Body {
    #[serde(flatten)]
    camera: v1::Intrinsics,
    #[serde(default)]
    width_px: Option<u16>,
    #[serde(default)]
    height_px: Option<u16>,
}

/// A checked camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PhotographCamera {
    camera: Intrinsics,
    size_px: Option<[usize; 2]>,
}

impl PhotographCamera {
    pub(super) fn read(part: &[u8]) -> Result<Self, ApiError> {
        let body: Body = json(part, "intrinsics")?;
        let camera = geometry::intrinsics(&body.camera).map_err(|r| r.inside("intrinsics"))?;
        let size_px = match (body.width_px, body.height_px) {
            (None, None) => None,
            (Some(width @ 1..), Some(height @ 1..)) => Some([usize::from(width), usize::from(height)]),
            (None | Some(0), _) => {
                return Err(ApiError::invalid("out_of_range", "intrinsics.width_px", SIDES));
            }
            (_, None | Some(0)) => {
                return Err(ApiError::invalid("out_of_range", "intrinsics.height_px", SIDES));
            }
        };
        Ok(Self { camera, size_px })
    }

    /// The intrinsics for a picture of this width and height.
    pub(super) fn of_picture(&self, picture: [usize; 2]) -> Result<Intrinsics, Rejection> {
        self.camera.for_picture(self.size_px, picture).map_err(|error| {
            let (code, field) = match &error {
                PictureSizeError::Turned(..) | PictureSizeError::Aspect(..) => {
                    (Code::SizeMismatch, "intrinsics.width_px")
                }
                PictureSizeError::Centre(..) => (Code::OutOfRange, "intrinsics.cx_px"),
            };
            Rejection::new(code, field, error.to_string())
        })
    }
}

const SIDES: &str = "width_px and height_px are those of one picture: both from 1, or neither";

#[cfg(test)]
mod tests {
    use super::*;

    fn of(size: &str, picture: [usize; 2]) -> Result<f64, (Code, String)> {
        let part = format!(r#"{{"fx_px": 600, "fy_px": 600, "cx_px": 319.5, "cy_px": 239.5{size}}}"#);
        let camera = PhotographCamera::read(part.as_bytes()).unwrap().of_picture(picture);
        camera.map(|camera| camera.fx_px).map_err(|refused| (refused.code, refused.field))
    }

    #[test]
    fn a_picture_of_another_size_has_scaled_intrinsics_or_is_refused() {
        let stated = r#", "width_px": 640, "height_px": 480"#;
        assert_eq!(of(stated, [640, 480]), Ok(600.0));
        assert_eq!(of(stated, [320, 240]), Ok(300.0));
        let mismatch = Err((Code::SizeMismatch, "intrinsics.width_px".to_owned()));
        assert_eq!(of(stated, [480, 640]), mismatch);
        assert_eq!(of(stated, [640, 360]), mismatch);
        assert_eq!(of("", [640, 480]), Ok(600.0));
        assert_eq!(of("", [1280, 960]), Err((Code::OutOfRange, "intrinsics.cx_px".to_owned())));
        for half in [r#", "width_px": 640"#, r#", "height_px": 480"#, r#", "width_px": 0, "height_px": 480"#]
        {
            let part = format!(r#"{{"fx_px": 600, "fy_px": 600{half}}}"#);
            assert!(PhotographCamera::read(part.as_bytes()).is_err(), "{half}");
        }
    }
}
