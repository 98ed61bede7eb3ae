//! Encoding and size of an image file, from its first bytes. Nothing is decoded.

use crate::v1;

/// Encoding, width and height in pixels; `None` for what is no JPEG or PNG, or ends before it says
/// its size.
pub fn image_header(image: &[u8]) -> Option<(v1::ImageEncoding, u32, u32)> {
    if image.starts_with(b"\x89PNG\r\n\x1a\n") {
        png_size(image).map(|(width, height)| (v1::ImageEncoding::Png, width, height))
    } else if image.starts_with(&[0xFF, 0xD8]) {
        jpeg_size(image).map(|(width, height)| (v1::ImageEncoding::Jpeg, width, height))
    } else {
        None
    }
}

fn png_size(image: &[u8]) -> Option<(u32, u32)> {
    if image.get(12..16)? != b"IHDR" {
        return None;
    }
    let word = |at: usize| Some(u32::from_be_bytes(image.get(at..at + 4)?.try_into().ok()?));
    Some((word(16)?, word(20)?))
}

/// Walks the segments up to the start of frame (SOF0 to SOF15 without DHT, JPG and DAC).
fn jpeg_size(image: &[u8]) -> Option<(u32, u32)> {
    let mut at = 2;
    loop {
        while *image.get(at)? == 0xFF && *image.get(at + 1)? == 0xFF {
            at += 1;
        }
        if *image.get(at)? != 0xFF {
            return None;
        }
        let marker = *image.get(at + 1)?;
        let half = |i: usize| Some(u32::from(u16::from_be_bytes([*image.get(i)?, *image.get(i + 1)?])));
        match marker {
            0xC0..=0xC3 | 0xC5..=0xC7 | 0xC9..=0xCB | 0xCD..=0xCF => {
                return Some((half(at + 7)?, half(at + 5)?));
            }
            // Markers without a length.
            0x01 | 0xD0..=0xD8 => at += 2,
            // End of image or start of scan before any size.
            0xD9 | 0xDA => return None,
            _ => at += 2 + half(at + 2)? as usize,
        }
    }
}
