//! Decodes images. In: encoded bytes. Out: a checked picture, grey or in colour, within limits of
//! bytes and pixels. Nothing else calls the decoders: the size is read from the header and checked
//! before any pixel is unpacked, and metadata is ignored. What is transparent is white. The grey
//! level of JPEG is its luma; the colours of PNG and of raw pixels are weighted as JPEG weights
//! them, so that all give the same grey.

mod colour;
mod file_kind;
mod huffman;
pub mod mosaic;
mod samples;

use colour::{from_rgb, from_ycbcr, plane};
use huffman::with_standard_tables;
use image::{ImageDecoder, Limits, codecs::png::PngDecoder};
use mosaic::mosaic;
use protos::{
    CheckedFrame, Code, Rejection,
    convert::{EncodedImage, Encoding, Pixels},
};
use std::io::Cursor;
use vision::frame::{MAX_SIDE_PX, Picture};
use zune_jpeg::{
    JpegDecoder,
    zune_core::{bytestream::ZCursor, colorspace::ColorSpace, options::DecoderOptions},
};

/// Most scans of a progressive JPEG; real ones have about ten.
pub const MAX_JPEG_SCANS: usize = 64;
/// Memory that a PNG may take for each pixel: 16-bit RGBA.
const PNG_BYTES_PER_PX: usize = 8;
/// Memory that a decoded picture takes for each pixel: grey and three planes of colour.
pub const PICTURE_BYTES_PER_PX: usize = 1 + vision::frame::COLOUR_PLANES;
/// Bytes before the first chunk of a PNG.
const PNG_SIGNATURE_BYTES: usize = 8;
/// Memory for a PNG's rows, palette and metadata besides its pixels.
const PNG_SPARE_BYTES: usize = 4 << 20;

/// What an image may cost.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ImageLimits {
    /// Encoded size.
    pub bytes: usize,
    /// Width times height.
    pub pixels: usize,
}

impl ImageLimits {
    /// Frames of robots: 1920 x 1200 at most.
    pub const FRAME: Self = Self {
        bytes: protos::convert::frame::MAX_FRAME_IMAGE_BYTES,
        pixels: protos::convert::frame::MAX_FRAME_PX as usize,
    };
    /// Photographs that people upload.
    pub const UPLOAD: Self = Self { bytes: 16 << 20, pixels: vision::frame::MAX_AREA_PX };
}

/// The picture of a frame; of quads, their [`mosaic()`]. Errors: over the limits, not of the
/// claimed encoding and size, or not decodable.
pub fn decode_frame(frame: &CheckedFrame, limits: ImageLimits) -> Result<Picture, Rejection> {
    let claimed = (frame.width_px as usize, frame.height_px as usize);
    match &frame.pixels {
        Pixels::Image(image) => decode_image(image, claimed, limits),
        Pixels::Quads(quads) => {
            check_size(claimed, limits)?;
            Ok(mosaic(quads, claimed, limits)?.into())
        }
    }
}

/// A picture of a claimed size. Errors: those of [`decode_frame`].
pub(super) fn decode_image(
    EncodedImage { encoding, bytes }: &EncodedImage,
    claimed: (usize, usize),
    limits: ImageLimits,
) -> Result<Picture, Rejection> {
    check_bytes(bytes, limits)?;
    check_size(claimed, limits)?;
    match encoding {
        Encoding::Gray8 => Ok(plane(claimed, bytes.to_vec())?.into()),
        Encoding::Rgb8 => from_rgb::<3>(claimed, bytes, [0, 1, 2]),
        Encoding::Bgr8 => from_rgb::<3>(claimed, bytes, [2, 1, 0]),
        Encoding::Jpeg => jpeg(bytes, Some(claimed), limits),
        Encoding::Png => png(bytes, Some(claimed), limits),
    }
}

/// The picture of an uploaded file, JPEG or PNG by its first bytes. Errors: over the limits, or not
/// decodable.
pub fn decode_upload(bytes: &[u8], limits: ImageLimits) -> Result<Picture, Rejection> {
    check_bytes(bytes, limits)?;
    match sniff(bytes) {
        Some(Encoding::Jpeg) => jpeg(bytes, None, limits),
        Some(Encoding::Png) => png(bytes, None, limits),
        _ => Err(Rejection::new(Code::WrongEncoding, "image", file_kind::not_read(bytes))),
    }
}

/// JPEG or PNG by the first bytes.
pub fn sniff(bytes: &[u8]) -> Option<Encoding> {
    if bytes.starts_with(&[0xFF, 0xD8, 0xFF]) {
        Some(Encoding::Jpeg)
    } else if bytes.starts_with(b"\x89PNG\r\n\x1a\n") {
        Some(Encoding::Png)
    } else {
        None
    }
}

fn jpeg(bytes: &[u8], claimed: Option<(usize, usize)>, limits: ImageLimits) -> Result<Picture, Rejection> {
    if sniff(bytes) != Some(Encoding::Jpeg) {
        return Err(Rejection::new(Code::WrongEncoding, "image", "claimed as JPEG, but it is none"));
    }
    // Strict: a truncated file is refused instead of filled with grey. Real cameras' files pass.
    let options = DecoderOptions::default()
        .set_strict_mode(true)
        .set_max_width(MAX_SIDE_PX)
        .set_max_height(MAX_SIDE_PX)
        .jpeg_set_max_scans(MAX_JPEG_SCANS);
    let complete = with_standard_tables(bytes);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(&*complete), options);
    decoder.decode_headers().map_err(|e| bad("JPEG", &e))?;
    let size = decoder.dimensions().ok_or_else(|| bad("JPEG", &"no size in its header"))?;
    check_claim(size, claimed)?;
    check_size(size, limits)?;
    // Luma is taken as it is in the file. Rare colour spaces (RGB, CMYK) go through RGB.
    let space = match decoder.input_colorspace() {
        Some(space @ (ColorSpace::YCbCr | ColorSpace::Luma)) => space,
        _ => ColorSpace::RGB,
    };
    decoder.set_options(options.jpeg_set_out_colorspace(space));
    let pixels = decoder.decode().map_err(|e| bad("JPEG", &e))?;
    match space {
        ColorSpace::Luma => Ok(plane(size, pixels)?.into()),
        ColorSpace::YCbCr => from_ycbcr(size, &pixels),
        _ => from_rgb::<3>(size, &pixels, [0, 1, 2]),
    }
}

fn png(bytes: &[u8], claimed: Option<(usize, usize)>, limits: ImageLimits) -> Result<Picture, Rejection> {
    if sniff(bytes) != Some(Encoding::Png) {
        return Err(Rejection::new(Code::WrongEncoding, "image", "claimed as PNG, but it is none"));
    }
    // Width and height of IHDR are checked before the decoder allocates anything.
    let word = |at: usize| bytes.get(at..at + 4).and_then(|w| w.try_into().ok()).map(u32::from_be_bytes);
    let (Some(width), Some(height)) = (word(16), word(20)) else {
        return Err(bad("PNG", &"it ends within its header"));
    };
    let size = (width as usize, height as usize);
    check_claim(size, claimed)?;
    check_size(size, limits)?;
    check_palette(bytes)?;
    let mut bounds = Limits::default();
    bounds.max_image_width = Some(MAX_SIDE_PX as u32);
    bounds.max_image_height = Some(MAX_SIDE_PX as u32);
    bounds.max_alloc = Some((size.0 * size.1 * PNG_BYTES_PER_PX + PNG_SPARE_BYTES) as u64);
    let decoder = PngDecoder::with_limits(Cursor::new(bytes), bounds).map_err(|e| bad("PNG", &e))?;
    let (width, height) = decoder.dimensions();
    check_claim((width as usize, height as usize), Some(size))?;
    let colours = decoder.color_type();
    let mut raw = vec![0; size.0 * size.1 * usize::from(colours.bytes_per_pixel())];
    decoder.read_image(&mut raw).map_err(|e| bad("PNG", &e))?;
    samples::picture(size, &raw, colours)
}

/// The decoder panics on a palette that is no whole number of colours (png 0.18.1).
fn check_palette(bytes: &[u8]) -> Result<(), Rejection> {
    let mut at = PNG_SIGNATURE_BYTES;
    while let Some(&[a, b, c, d, ref kind @ ..]) = bytes.get(at..at.saturating_add(8)) {
        let length = u32::from_be_bytes([a, b, c, d]) as usize;
        match kind {
            b"PLTE" if !length.is_multiple_of(3) => {
                return Err(bad("PNG", &format!("{length} bytes of palette are no whole colours")));
            }
            b"IDAT" => break,
            _ => {}
        }
        // Length, name and checksum.
        at = at.saturating_add(length).saturating_add(12);
    }
    Ok(())
}

fn check_bytes(bytes: &[u8], limits: ImageLimits) -> Result<(), Rejection> {
    if bytes.len() > limits.bytes {
        let detail = format!("{} bytes are more than {}", bytes.len(), limits.bytes);
        return Err(Rejection::new(Code::TooLarge, "image", detail));
    }
    Ok(())
}

fn check_size((width, height): (usize, usize), limits: ImageLimits) -> Result<(), Rejection> {
    if width == 0 || height == 0 || width > MAX_SIDE_PX || height > MAX_SIDE_PX {
        let detail = format!("{width}x{height} px: a side is outside 1 to {MAX_SIDE_PX}");
        return Err(Rejection::new(Code::OutOfRange, "image", detail));
    }
    if width * height > limits.pixels {
        let share = (limits.pixels as f64 / (width * height) as f64).sqrt();
        let [less_wide, less_high] = [width, height].map(|side| (side as f64 * share) as usize);
        let detail = format!(
            "{width}x{height} px are more than {} in all: shrink it to {less_wide}x{less_high} px or less",
            limits.pixels
        );
        return Err(Rejection::new(Code::TooLarge, "image", detail));
    }
    Ok(())
}

fn check_claim(size: (usize, usize), claimed: Option<(usize, usize)>) -> Result<(), Rejection> {
    match claimed {
        Some(claim) if claim != size => {
            let field = if claim.0 == size.0 { "height_px" } else { "width_px" };
            let detail = format!("claimed {}x{} px, the image has {}x{}", claim.0, claim.1, size.0, size.1);
            Err(Rejection::new(Code::SizeMismatch, field, detail))
        }
        _ => Ok(()),
    }
}

fn bad(kind: &str, error: &dyn std::fmt::Display) -> Rejection {
    // Some messages of the decoders end with a line break; a refusal is one line.
    let words = error.to_string().split_whitespace().collect::<Vec<_>>().join(" ");
    Rejection::new(Code::BadImage, "image", format!("{kind} cannot be decoded: {words}"))
}

#[cfg(test)]
mod tests;
