//! Uploaded pictures. In: bytes of a file. Out: a picture, upright by the orientation that the file
//! states. Also grey images to PNG, for pages. [`super::decode`] decodes and holds the limits.

use crate::frame::decode::{self, ImageLimits};
use image::{
    DynamicImage, ExtendedColorType, ImageDecoder, ImageEncoder,
    codecs::{jpeg::JpegDecoder, png::PngEncoder},
    metadata::Orientation,
};
use protos::{
    Rejection,
    convert::{Encoding, image_header},
};
use std::io::Cursor;
use vision::frame::{GrayImage, Picture};

/// `png` or `jpeg`, by the first bytes.
pub fn kind(bytes: &[u8]) -> Option<&'static str> {
    match decode::sniff(bytes)? {
        Encoding::Jpeg => Some("jpeg"),
        Encoding::Png => Some("png"),
        Encoding::Gray8 | Encoding::Rgb8 | Encoding::Bgr8 => None,
    }
}

/// Width and height of a picture file as [`decode()`] turns it, px; `None` if its header says none.
pub fn upright_size(bytes: &[u8]) -> Option<[usize; 2]> {
    let (_, width, height) = image_header(bytes)?;
    let (width, height) = (width as usize, height as usize);
    let is_turned = matches!(
        orientation(bytes),
        Orientation::Rotate90
            | Orientation::Rotate270
            | Orientation::Rotate90FlipH
            | Orientation::Rotate270FlipH
    );
    Some(if is_turned { [height, width] } else { [width, height] })
}

/// Decodes an uploaded picture and turns it upright. Errors: those of [`decode::decode_upload`].
pub fn decode(bytes: &[u8], limits: ImageLimits) -> Result<Picture, Rejection> {
    let picture = decode::decode_upload(bytes, limits)?;
    match orientation(bytes) {
        Orientation::NoTransforms => Ok(picture),
        orientation => Ok(picture.map(|plane| turned(plane, orientation))),
    }
}

/// The orientation that a JPEG file states; PNG states none.
fn orientation(bytes: &[u8]) -> Orientation {
    let read = || JpegDecoder::new(Cursor::new(bytes)).and_then(|mut decoder| decoder.orientation());
    if decode::sniff(bytes) == Some(Encoding::Jpeg) {
        read().unwrap_or(Orientation::NoTransforms)
    } else {
        Orientation::NoTransforms
    }
}

fn turned(plane: &GrayImage, orientation: Orientation) -> GrayImage {
    let (width, height) = (plane.width() as u32, plane.height() as u32);
    let turned = image::GrayImage::from_raw(width, height, plane.data().to_vec()).and_then(|buffer| {
        let mut image = DynamicImage::ImageLuma8(buffer);
        image.apply_orientation(orientation);
        let turned = image.into_luma8();
        let (width, height) = (turned.width() as usize, turned.height() as usize);
        GrayImage::new(width, height, turned.into_raw()).ok()
    });
    // A turned plane has as many pixels as before, so there is always one.
    turned.unwrap_or_else(|| plane.clone())
}

/// A grey picture as PNG.
pub fn png(width: usize, height: usize, grey: &[u8]) -> Result<Vec<u8>, image::ImageError> {
    let mut out = Vec::new();
    PngEncoder::new(&mut out).write_image(grey, width as u32, height as u32, ExtendedColorType::L8)?;
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn jpeg(pixel: fn(u32) -> [u8; 3]) -> Vec<u8> {
        let mut jpeg = Cursor::new(Vec::new());
        let image = image::RgbImage::from_fn(32, 16, |x, _| image::Rgb(pixel(x)));
        image.write_to(&mut jpeg, image::ImageFormat::Jpeg).unwrap();
        jpeg.into_inner()
    }

    #[test]
    fn a_phone_held_upright_gives_an_upright_picture() {
        // An Exif segment with orientation 6: turn by a quarter, clockwise.
        let noted = |jpeg: &[u8]| {
            let tiff = b"Exif\0\0MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0";
            let head = [0xff, 0xd8, 0xff, 0xe1, 0, (tiff.len() + 2) as u8];
            [&head[..], tiff, &jpeg[2..]].concat()
        };
        let grey = jpeg(|x| [(x * 8) as u8; 3]);
        let plain = decode(&grey, ImageLimits::UPLOAD).unwrap();
        assert_eq!((plain.width(), plain.height()), (32, 16));
        let upright = decode(&noted(&grey), ImageLimits::UPLOAD).unwrap();
        assert_eq!((upright.width(), upright.height()), (16, 32));
        assert_eq!([upright_size(&grey), upright_size(&noted(&grey))], [Some([32, 16]), Some([16, 32])]);
        assert!(upright.grey().at(8, 31) > upright.grey().at(8, 0));
        assert_eq!(kind(&noted(&grey)), Some("jpeg"));
        // Every plane is turned.
        let red = noted(&jpeg(|x| [(x * 8) as u8, 100, 100]));
        let upright = decode(&red, ImageLimits::UPLOAD).unwrap();
        let [red, ..] = upright.colour().unwrap();
        assert_eq!((red.width(), red.height()), (16, 32));
        assert!(red.at(8, 31) > 200 && red.at(8, 0) < 50);
    }

    #[test]
    fn png_comes_back() {
        let grey: Vec<u8> = (0..12).map(|i| i * 20).collect();
        let bytes = png(4, 3, &grey).unwrap();
        assert_eq!(decode(&bytes, ImageLimits::UPLOAD).unwrap().grey().data(), grey);
        assert_eq!(kind(&bytes), Some("png"));
        assert_eq!(kind(b"GIF89a"), None);
    }
}
