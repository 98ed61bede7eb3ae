//! Uploaded pictures: bytes in, grey image out, turned the way a viewer shows it. The format is what the bytes say;
//! size and memory are checked from the header, before anything is decoded.

use image::{
    DynamicImage, ExtendedColorType, ImageDecoder, ImageEncoder, Limits,
    codecs::{
        jpeg::JpegDecoder,
        png::{PngDecoder, PngEncoder},
    },
    metadata::Orientation,
};
use protos::{Code, Rejection};
use std::io::Cursor;
use vision::frame::{GrayImage, MAX_SIDE_PX};

/// Bytes that decoding may take for each pixel of the limit: four channels of 8 bits.
const BYTES_PER_PX: u64 = 4;

/// The two formats that robots and people send.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// PNG.
    Png,
    /// JPEG.
    Jpeg,
}

impl Kind {
    /// What the first bytes say.
    pub fn sniff(bytes: &[u8]) -> Option<Self> {
        if bytes.starts_with(b"\x89PNG\r\n\x1a\n") {
            Some(Self::Png)
        } else if bytes.starts_with(&[0xff, 0xd8, 0xff]) {
            Some(Self::Jpeg)
        } else {
            None
        }
    }

    /// `png` or `jpeg`.
    pub fn word(self) -> &'static str {
        match self {
            Self::Png => "png",
            Self::Jpeg => "jpeg",
        }
    }
}

/// Decodes a picture of at most `max_pixels`. `field` names it in refusals.
pub fn decode(bytes: &[u8], max_pixels: usize, field: &str) -> Result<(Kind, GrayImage), Rejection> {
    let bad = |detail: String| Rejection::new(Code::BadImage, field, detail);
    let kind = Kind::sniff(bytes).ok_or_else(|| bad("neither PNG nor JPEG".into()))?;
    let mut limits = Limits::default();
    limits.max_alloc = Some(max_pixels as u64 * BYTES_PER_PX);
    let image = match kind {
        Kind::Png => {
            let decoder =
                PngDecoder::with_limits(Cursor::new(bytes), limits).map_err(|e| bad(e.to_string()))?;
            whole(decoder, max_pixels, field)
        }
        Kind::Jpeg => {
            let decoder = JpegDecoder::new(Cursor::new(bytes)).map_err(|e| bad(e.to_string()))?;
            whole(decoder, max_pixels, field)
        }
    }?;
    let gray = image.into_luma8();
    let (width, height) = (gray.width() as usize, gray.height() as usize);
    let gray = GrayImage::new(width, height, gray.into_raw()).map_err(|e| bad(e.to_string()))?;
    Ok((kind, gray))
}

/// A grey picture as PNG.
pub fn png(width: usize, height: usize, grey: &[u8]) -> Result<Vec<u8>, image::ImageError> {
    let mut out = Vec::new();
    PngEncoder::new(&mut out).write_image(grey, width as u32, height as u32, ExtendedColorType::L8)?;
    Ok(out)
}

fn whole(mut decoder: impl ImageDecoder, max_pixels: usize, field: &str) -> Result<DynamicImage, Rejection> {
    let (width, height) = decoder.dimensions();
    let pixels = u64::from(width) * u64::from(height);
    if width as usize > MAX_SIDE_PX || height as usize > MAX_SIDE_PX || pixels > max_pixels as u64 {
        let detail = format!("{width}x{height} px; at most {max_pixels} px and {MAX_SIDE_PX} px a side");
        return Err(Rejection::new(Code::TooLarge, field, detail));
    }
    if decoder.total_bytes() > max_pixels as u64 * BYTES_PER_PX {
        return Err(Rejection::new(Code::TooLarge, field, "too many bits for each pixel at this size"));
    }
    let orientation = decoder.orientation().unwrap_or(Orientation::NoTransforms);
    let mut image = DynamicImage::from_decoder(decoder)
        .map_err(|e| Rejection::new(Code::BadImage, field, e.to_string()))?;
    image.apply_orientation(orientation);
    Ok(image)
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{ImageFormat, RgbImage};

    fn encoded(width: u32, height: u32, format: ImageFormat) -> Vec<u8> {
        let mut bytes = Cursor::new(Vec::new());
        RgbImage::from_fn(width, height, |x, _| image::Rgb([(x * 8) as u8; 3]))
            .write_to(&mut bytes, format)
            .unwrap();
        bytes.into_inner()
    }

    #[test]
    fn both_formats_decode_to_grey() {
        for (format, kind) in [(ImageFormat::Png, Kind::Png), (ImageFormat::Jpeg, Kind::Jpeg)] {
            let (found, gray) = decode(&encoded(32, 16, format), 512, "image").unwrap();
            assert_eq!((found, gray.width(), gray.height()), (kind, 32, 16));
            assert!(gray.at(20, 8).abs_diff(160) < 4);
        }
    }

    #[test]
    fn size_is_checked_at_the_bound_before_decoding() {
        let png = encoded(32, 16, ImageFormat::Png);
        assert!(decode(&png, 512, "image").is_ok());
        assert_eq!(decode(&png, 511, "image").unwrap_err().code, Code::TooLarge);
        // A header that claims 65 500 x 65 500.
        let mut jpeg = encoded(32, 16, ImageFormat::Jpeg);
        let sof = jpeg.windows(2).position(|w| w == [0xff, 0xc0]).unwrap();
        jpeg[sof + 5..sof + 9].copy_from_slice(&[0xff, 0xdc, 0xff, 0xdc]);
        assert!(decode(&jpeg, 1 << 20, "image").is_err());
    }

    #[test]
    fn what_is_no_picture_is_refused_by_name() {
        let png = encoded(32, 16, ImageFormat::Png);
        for bytes in [&b"GIF89a"[..], &[], &png[..30], &png[..png.len() / 2]] {
            let refusal = decode(bytes, 512, "image").unwrap_err();
            assert_eq!((refusal.code, refusal.field.as_str()), (Code::BadImage, "image"));
        }
    }

    #[test]
    fn a_phone_held_upright_gives_an_upright_picture() {
        let jpeg = encoded(32, 16, ImageFormat::Jpeg);
        // An Exif segment with orientation 6: turn by a quarter, clockwise.
        let tiff = b"Exif\0\0MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0";
        let mut turned = vec![0xff, 0xd8, 0xff, 0xe1, 0, (tiff.len() + 2) as u8];
        turned.extend(tiff);
        turned.extend(&jpeg[2..]);
        let (_, gray) = decode(&turned, 512, "image").unwrap();
        assert_eq!((gray.width(), gray.height()), (16, 32));
        assert!(gray.at(8, 31) > gray.at(8, 0));
    }
}
