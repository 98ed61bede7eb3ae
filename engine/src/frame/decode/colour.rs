//! Interleaved pixels to a picture. In: pixels of red, green and blue in some order, or of luma and
//! chroma. Out: a grey plane and three planes of colour. Grey is weighted as JPEG weights it, so
//! that all encodings give the same grey.

use protos::{Code, Rejection};
use vision::frame::{FrameError, GrayImage, Picture};

/// Bits behind the point of [`from_ycbcr`]'s weights.
const BITS: u32 = 14;

/// A picture of pixels of `N` bytes; `places` are those of red, green and blue in a pixel. Error:
/// not as many pixels as the size says.
pub(super) fn from_rgb<const N: usize>(
    size: (usize, usize),
    pixels: &[u8],
    places: [usize; 3],
) -> Result<Picture, Rejection> {
    let (pixels, _) = pixels.as_chunks::<N>();
    let plane = |place: usize| plane(size, pixels.iter().map(|pixel| pixel[place]).collect());
    let [red, green, blue] = places.map(plane);
    Picture::from_colour([red?, green?, blue?]).map_err(|error| bad(&error))
}

/// A picture of pixels of Y, Cb and Cr (JFIF: ITU-R BT.601, full range). Y is the grey level.
/// Error: as [`from_rgb`].
pub(super) fn from_ycbcr(size: (usize, usize), pixels: &[u8]) -> Result<Picture, Rejection> {
    let weight = |x: f64| (x * f64::from(1 << BITS)).round() as i32;
    let (red_cr, green_cb, green_cr, blue_cb) =
        (weight(1.402), weight(-0.344_136), weight(-0.714_136), weight(1.772));
    let (pixels, _) = pixels.as_chunks::<3>();
    let grey = plane(size, pixels.iter().map(|[y, ..]| *y).collect())?;
    // Planes of a grey picture in a colour file: nothing to convert.
    if pixels.iter().all(|[_, cb, cr]| (*cb, *cr) == (128, 128)) {
        return Ok(grey.into());
    }
    let shifted = |[y, cb, cr]: &[u8; 3], by_cb: i32, by_cr: i32| {
        let chroma = (i32::from(*cb) - 128) * by_cb + (i32::from(*cr) - 128) * by_cr;
        (i32::from(*y) + ((chroma + (1 << (BITS - 1))) >> BITS)).clamp(0, 255) as u8
    };
    let of = |by_cb, by_cr| plane(size, pixels.iter().map(|pixel| shifted(pixel, by_cb, by_cr)).collect());
    let planes = [of(0, red_cr)?, of(green_cb, green_cr)?, of(blue_cb, 0)?];
    Picture::with_colour(grey, planes).map_err(|error| bad(&error))
}

/// A plane of pixels. Error: not as many as the size says.
pub(super) fn plane((width, height): (usize, usize), data: Vec<u8>) -> Result<GrayImage, Rejection> {
    GrayImage::new(width, height, data).map_err(|error| bad(&error))
}

fn bad(error: &FrameError) -> Rejection {
    Rejection::new(Code::BadImage, "image", error.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn luma_and_chroma_give_the_colours_of_the_formula() {
        let levels = [0_u8, 1, 60, 127, 128, 129, 200, 254, 255];
        let count = levels.len().pow(3);
        let triples: Vec<u8> =
            (0..count).flat_map(|i| [i / 81, i / 9 % 9, i % 9].map(|at| levels[at])).collect();
        let picture = from_ycbcr((count, 1), &triples).unwrap();
        let planes = picture.colour().unwrap();
        for (i, pixel) in triples.as_chunks::<3>().0.iter().enumerate() {
            let [y, cb, cr] = pixel.map(f64::from);
            let exact = [
                y + 1.402 * (cr - 128.0),
                y - 0.344_136 * (cb - 128.0) - 0.714_136 * (cr - 128.0),
                y + 1.772 * (cb - 128.0),
            ];
            assert_eq!(picture.grey().at(i, 0), pixel[0]);
            for (plane, exact) in planes.iter().zip(exact) {
                let off = (f64::from(plane.at(i, 0)) - exact.clamp(0.0, 255.0)).abs();
                assert!(off <= 0.51, "{pixel:?}: {off}");
            }
        }
    }

    #[test]
    fn pixels_without_chroma_are_a_grey_picture() {
        let picture = from_ycbcr((2, 1), &[7, 128, 128, 9, 128, 128]).unwrap();
        assert_eq!(picture, GrayImage::new(2, 1, vec![7, 9]).unwrap().into());
        assert!(from_ycbcr((2, 1), &[7, 128, 128, 9, 128, 129]).unwrap().colour().is_some());
        assert!(from_ycbcr((2, 1), &[7, 128, 128]).is_err());
    }
}
