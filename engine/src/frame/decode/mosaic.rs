//! The image of a frame of which a robot sent quads alone. In: patches. Out: a grey image of the
//! frame's size with their pixels, plain elsewhere, so that what follows is the same as for a whole
//! frame. Colour serves the detection, which the robot has done.

use super::{ImageLimits, colour::plane, decode_image};
use protos::{Rejection, convert::CheckedQuad};
use vision::frame::GrayImage;

/// Grey level where nothing is known.
pub const UNKNOWN_GREY: u8 = 128;

/// The patches of `quads` at their places in an image of `size` px. Errors: those of the decoder,
/// with the patch.
pub fn mosaic(
    quads: &[CheckedQuad],
    (width, height): (usize, usize),
    limits: ImageLimits,
) -> Result<GrayImage, Rejection> {
    let mut data = vec![UNKNOWN_GREY; width * height];
    for (i, CheckedQuad { patch, .. }) in quads.iter().enumerate() {
        let claimed = (patch.width_px as usize, patch.height_px as usize);
        let pixels = decode_image(&patch.image, claimed, limits);
        let pixels = pixels.map_err(|r| r.inside(&format!("quads[{i}].patch")))?.into_grey();
        let (left, top) = (patch.left_px as usize, patch.top_px as usize);
        for (row, line) in (top..).zip(pixels.data().chunks_exact(claimed.0)) {
            let from = row * width + left;
            data[from..from + claimed.0].copy_from_slice(line);
        }
    }
    plane((width, height), data)
}

#[cfg(test)]
mod tests {
    use super::*;
    use protos::{CheckedFrame, Code, convert::Pixels, v1};

    fn found(left_px: u32, top_px: u32, grey: u8) -> v1::FoundQuad {
        let at = |u: f64, v: f64| v1::Point { u_px: f64::from(left_px) + u, v_px: f64::from(top_px) + v };
        let corners = vec![at(0.0, 0.0), at(2.0, 0.0), at(2.0, 1.0), at(0.0, 1.0)];
        let (width_px, height_px, encoding) = (3, 2, v1::ImageEncoding::Gray8.into());
        let image = vec![grey; 6].into();
        v1::FoundQuad {
            border: Some(v1::Border { corners }),
            patch: Some(v1::Patch { left_px, top_px, width_px, height_px, encoding, image }),
            ..v1::FoundQuad::default()
        }
    }

    fn of(quads: Vec<v1::FoundQuad>) -> Result<GrayImage, Rejection> {
        let message = v1::Quads { width_px: 8, height_px: 5, quads, ..v1::Quads::default() };
        let Pixels::Quads(quads) = CheckedFrame::try_from(message).unwrap().pixels else { panic!("quads") };
        mosaic(&quads, (8, 5), ImageLimits::FRAME)
    }

    #[test]
    fn patches_lie_where_they_were_cut_out() {
        let image = of(vec![found(0, 0, 10), found(5, 3, 20)]).unwrap();
        let known = |u, v| {
            if u < 3 && v < 2 {
                10
            } else if u >= 5 && v >= 3 {
                20
            } else {
                UNKNOWN_GREY
            }
        };
        assert_eq!(image, GrayImage::from_fn(8, 5, known));
        assert_eq!(of(Vec::new()).unwrap(), GrayImage::from_fn(8, 5, |_, _| UNKNOWN_GREY));
    }

    #[test]
    fn a_patch_that_cannot_be_decoded_is_named() {
        let mut broken = found(0, 0, 1);
        broken.patch.as_mut().unwrap().encoding = v1::ImageEncoding::Png.into();
        let refusal = of(vec![found(5, 3, 2), broken]).unwrap_err();
        assert_eq!((refusal.code, refusal.field.as_str()), (Code::WrongEncoding, "quads[1].patch.image"));
    }
}
