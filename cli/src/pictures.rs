//! Picture files in, pictures out, and the other way round for the demo's robots.

use crate::camera_arg::Lens;
use anyhow::Context as _;
use engine::{decode::ImageLimits, picture};
use image::{ImageDecoder as _, ImageEncoder as _};
use protos::convert::frame::MAX_ENCODED_IMAGE_BYTES;
use serde_json::Value;
use std::{
    fs::File,
    io::{Cursor, Read as _},
    path::Path,
};
use vision::{
    detect::DetectParams,
    frame::{GrayImage, Picture},
    params::preset::Preset,
};

/// Quality of photographs that are made smaller before they are sent.
const PHOTOGRAPH_QUALITY: u8 = 95;
/// Largest file of a photograph: one of 200 megapixels has about 60 MB.
const MAX_PHOTOGRAPH_BYTES: u64 = 256 << 20;
/// Most pixels of a photograph that is made smaller: phones have up to 200 million.
const MAX_PHOTOGRAPH_PX: u64 = 220_000_000;
/// Quality of rendered photographs.
const PHOTOGRAPH_SAMPLE_QUALITY: u8 = 92;
/// Quality of the demo's JPEG frames: a VGA frame stays below one zenoh batch.
const JPEG_QUALITY: u8 = 85;

/// Why a picture file cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum PictureError {
    /// The file cannot be opened or read.
    #[error("{0}")]
    Read(#[from] std::io::Error),
    /// The decoder refuses it: the reason.
    #[error("{0}")]
    Refused(String),
}

/// The grey levels of a PNG or JPEG file, see [`read_picture`].
pub fn read(path: &Path) -> Result<GrayImage, PictureError> {
    Ok(read_picture(path)?.into_grey())
}

/// Reads and decodes a photograph, in colour if it has any, and turns it upright as the server
/// does, by the orientation that it states: corners are of the upright picture, and of the smaller
/// one where [`photograph`] makes it smaller.
pub fn read_picture(path: &Path) -> Result<Picture, PictureError> {
    let Sent { bytes, .. } = photograph(path)?;
    picture::decode(&bytes, ImageLimits::UPLOAD).map_err(|refused| PictureError::Refused(refused.detail))
}

/// A photograph as it is sent.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Sent {
    /// PNG or JPEG within the server's limits, where that could be made of the file.
    pub bytes: Vec<u8>,
    /// Width and height before and after it was made smaller.
    pub shrunk: Option<[[u32; 2]; 2]>,
    /// What the file says of its lens.
    pub(crate) lens: Option<Lens>,
}

/// Reads a photograph. One of more bytes or pixels than a server takes is made smaller, and a BMP
/// file is made a JPEG, upright. What cannot be decoded stays as it is: the server says what is
/// wrong with it.
pub fn photograph(path: &Path) -> Result<Sent, PictureError> {
    let mut bytes = Vec::new();
    File::open(path)?.take(MAX_PHOTOGRAPH_BYTES).read_to_end(&mut bytes)?;
    let lens = Lens::of_photograph(&bytes);
    let sent = fitted(&bytes, ImageLimits::UPLOAD);
    Ok(Sent { lens, ..sent.unwrap_or(Sent { bytes, shrunk: None, lens: None }) })
}

/// Reads a photograph as a robot sends it: upright, for frames are not turned by what their file
/// states, and no larger than the largest frame. What cannot be decoded stays as it is.
pub fn frame(path: &Path) -> Result<Sent, PictureError> {
    let mut bytes = Vec::new();
    File::open(path)?.take(MAX_PHOTOGRAPH_BYTES).read_to_end(&mut bytes)?;
    let limits = ImageLimits { bytes: MAX_ENCODED_IMAGE_BYTES, ..ImageLimits::FRAME };
    let turned = is_turned(&bytes);
    let fitted = if turned { made(&bytes, limits) } else { fitted(&bytes, limits) };
    let lens = Lens::of_photograph(&bytes);
    Ok(Sent { lens, ..fitted.unwrap_or(Sent { bytes, shrunk: None, lens: None }) })
}

/// Whether a file states that its picture is to be turned.
fn is_turned(bytes: &[u8]) -> bool {
    let decoder = image::guess_format(bytes)
        .ok()
        .and_then(|format| image::ImageReader::with_format(Cursor::new(bytes), format).into_decoder().ok());
    let orientation = decoder.and_then(|mut decoder| decoder.orientation().ok());
    orientation.is_some_and(|orientation| orientation != image::metadata::Orientation::NoTransforms)
}

/// The photograph within the limits; `None` if it is, or cannot be decoded.
fn fitted(bytes: &[u8], limits: ImageLimits) -> Option<Sent> {
    let format = image::guess_format(bytes).ok()?;
    let decoder = image::ImageReader::with_format(Cursor::new(bytes), format).into_decoder().ok()?;
    let (width, height) = decoder.dimensions();
    let is_large = bytes.len() > limits.bytes || pixels([width, height]) > limits.pixels as u64;
    if is_large || format == image::ImageFormat::Bmp { made(bytes, limits) } else { None }
}

fn pixels([width, height]: [u32; 2]) -> u64 {
    u64::from(width) * u64::from(height)
}

/// A JPEG of the photograph, upright and with no more pixels than the limits say; `None` if it
/// cannot be decoded.
fn made(bytes: &[u8], limits: ImageLimits) -> Option<Sent> {
    let format = image::guess_format(bytes).ok()?;
    let mut decoder = image::ImageReader::with_format(Cursor::new(bytes), format).into_decoder().ok()?;
    let (width, height) = decoder.dimensions();
    if pixels([width, height]) > MAX_PHOTOGRAPH_PX {
        return None;
    }
    let orientation = decoder.orientation().unwrap_or(image::metadata::Orientation::NoTransforms);
    let mut picture = image::DynamicImage::from_decoder(decoder).ok()?;
    picture.apply_orientation(orientation);
    let before = [picture.width(), picture.height()];
    let share = (limits.pixels as f64 / pixels(before) as f64).sqrt().min(1.0);
    let after = before.map(|side| (f64::from(side) * share) as u32);
    if after != before {
        picture = picture.thumbnail_exact(after[0], after[1]);
    }
    let mut sent = Vec::new();
    let encoder = image::codecs::jpeg::JpegEncoder::new_with_quality(&mut sent, PHOTOGRAPH_QUALITY);
    picture.into_rgb8().write_with_encoder(encoder).ok()?;
    Some(Sent { bytes: sent, shrunk: (after != before).then_some([before, after]), lens: None })
}

/// Whether a file's name ends like that of a picture that can be read.
pub fn is_picture(path: &Path) -> bool {
    path.extension()
        .is_some_and(|e| ["png", "jpg", "jpeg", "bmp"].iter().any(|known| e.eq_ignore_ascii_case(known)))
}

/// Detection parameters of `preset`, changed by a JSON file that names only what differs.
pub fn detect_params(preset: Preset, file: Option<&Path>) -> anyhow::Result<DetectParams> {
    let Some(path) = file else { return Ok(preset.params().detect) };
    let text = std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
    let holds_none = || format!("{} holds no detection parameters", path.display());
    // For unknown names and wrong kinds, with their line.
    serde_json::from_slice::<DetectParams>(&text).with_context(holds_none)?;
    let mut all = serde_json::to_value(preset.params().detect)?;
    merge(&mut all, serde_json::from_slice(&text)?);
    serde_json::from_value(all).with_context(holds_none)
}

/// Puts what `changes` names in the place of what `all` has.
fn merge(all: &mut Value, changes: Value) {
    match (all, changes) {
        (Value::Object(all), Value::Object(changes)) => {
            for (name, change) in changes {
                merge(all.entry(name).or_insert(Value::Null), change);
            }
        }
        (all, change) => *all = change,
    }
}

/// A grey image as JPEG, as phones compress: for photographs to learn from.
pub fn photograph_jpeg(image: &GrayImage) -> Result<Vec<u8>, image::ImageError> {
    encoded(image, PHOTOGRAPH_SAMPLE_QUALITY)
}

/// A grey image as JPEG.
pub fn jpeg(image: &GrayImage) -> Result<Vec<u8>, image::ImageError> {
    encoded(image, JPEG_QUALITY)
}

fn encoded(image: &GrayImage, quality: u8) -> Result<Vec<u8>, image::ImageError> {
    let mut out = Vec::new();
    image::codecs::jpeg::JpegEncoder::new_with_quality(&mut out, quality).write_image(
        image.data(),
        image.width() as u32,
        image.height() as u32,
        image::ExtendedColorType::L8,
    )?;
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{DynamicImage, ImageFormat, RgbImage};

    fn file(format: ImageFormat) -> Vec<u8> {
        let mut bytes = Cursor::new(Vec::new());
        let picture = RgbImage::from_fn(80, 60, |x, _| image::Rgb([x as u8 * 3, 90, 90]));
        DynamicImage::ImageRgb8(picture).write_to(&mut bytes, format).unwrap();
        bytes.into_inner()
    }

    /// An Exif segment with orientation 6: turn by a quarter, clockwise.
    fn portrait(jpeg: &[u8]) -> Vec<u8> {
        let tiff = b"Exif\0\0MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0";
        let head = [0xff, 0xd8, 0xff, 0xe1, 0, (tiff.len() + 2) as u8];
        [&head[..], tiff, &jpeg[2..]].concat()
    }

    #[test]
    fn photographs_are_turned_upright_for_every_command() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("p.jpg");
        std::fs::write(&path, portrait(&file(ImageFormat::Jpeg))).unwrap();
        let gray = read(&path).unwrap();
        assert_eq!((gray.width(), gray.height()), (60, 80));
        assert!(gray.at(30, 79) > gray.at(30, 0));
        std::fs::write(&path, b"\0\0\0\x18ftypheic").unwrap();
        assert!(read(&path).unwrap_err().to_string().contains("HEIC"));
    }

    #[test]
    fn frames_are_upright_and_no_larger_than_the_largest() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("p.jpg");
        let sent = |bytes: &[u8]| {
            std::fs::write(&path, bytes).unwrap();
            frame(&path).unwrap()
        };
        // Small, and turned: pixels of a frame are as they are seen.
        let turned = sent(&portrait(&file(ImageFormat::Jpeg)));
        assert_eq!((picture::upright_size(&turned.bytes), turned.shrunk), (Some([60, 80]), None));
        assert!(!is_turned(&turned.bytes));
        // As it is.
        let plain = file(ImageFormat::Jpeg);
        assert_eq!(sent(&plain), Sent { bytes: plain, shrunk: None, lens: None });
        let mut large = Cursor::new(Vec::new());
        DynamicImage::ImageLuma8(image::GrayImage::new(2400, 1800))
            .write_to(&mut large, ImageFormat::Jpeg)
            .unwrap();
        let Sent { bytes, shrunk, .. } = sent(&portrait(&large.into_inner()));
        let Some([before, [width, height]]) = shrunk else { panic!("not made smaller") };
        assert_eq!(
            (before, picture::upright_size(&bytes)),
            ([1800, 2400], Some([width as usize, height as usize]))
        );
        assert!(width * height <= protos::convert::frame::MAX_FRAME_PX && width > 1300, "{width}x{height}");
    }

    #[test]
    fn large_photographs_are_made_smaller_and_bmp_is_sent_as_jpeg() {
        let limits = |pixels| ImageLimits { bytes: 1 << 20, pixels };
        for format in [ImageFormat::Png, ImageFormat::Jpeg] {
            assert_eq!(fitted(&file(format), limits(80 * 60)), None, "{format:?}");
            let sent = fitted(&file(format), limits(1200)).unwrap();
            assert_eq!(sent.shrunk, Some([[80, 60], [40, 30]]), "{format:?}");
            assert_eq!(picture::upright_size(&sent.bytes), Some([40, 30]));
        }
        let turned = fitted(&portrait(&file(ImageFormat::Jpeg)), limits(1200)).unwrap();
        assert_eq!(turned.shrunk, Some([[60, 80], [30, 40]]));
        assert_eq!(picture::upright_size(&turned.bytes), Some([30, 40]));
        let bmp = fitted(&file(ImageFormat::Bmp), limits(80 * 60)).unwrap();
        assert_eq!((picture::kind(&bmp.bytes), bmp.shrunk), (Some("jpeg"), None));
        // Too many bytes of few pixels.
        let heavy = fitted(&file(ImageFormat::Png), ImageLimits { bytes: 10, pixels: 80 * 60 });
        assert_eq!(heavy.unwrap().shrunk, None);
        assert_eq!(fitted(b"RIFF\0\0\0\0WEBP", limits(9)), None);
    }
}
