//! Picture files in, pictures out, and the other way round for the demo's robots.

use anyhow::Context as _;
use engine::decode::{ImageLimits, decode_upload};
use image::ImageEncoder as _;
use std::{fs::File, io::Read as _, path::Path};
use vision::{
    detect::DetectParams,
    frame::{GrayImage, Picture},
};

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

/// Reads and decodes a PNG or JPEG file, in colour if it has any. No more of it is read than the upload limit allows.
pub fn read_picture(path: &Path) -> Result<Picture, PictureError> {
    let limits = ImageLimits::UPLOAD;
    let mut bytes = Vec::new();
    // One byte more than allowed is enough for the decoder to refuse it.
    File::open(path)?.take(limits.bytes as u64 + 1).read_to_end(&mut bytes)?;
    decode_upload(&bytes, limits).map_err(|refused| PictureError::Refused(refused.detail))
}

/// Whether a file's name ends like that of a picture that can be read.
pub fn is_picture(path: &Path) -> bool {
    path.extension().is_some_and(|e| ["png", "jpg", "jpeg"].iter().any(|known| e.eq_ignore_ascii_case(known)))
}

/// Detection parameters from a JSON file that names only what differs from the defaults; no file, the defaults.
pub fn detect_params(file: Option<&Path>) -> anyhow::Result<DetectParams> {
    let Some(path) = file else { return Ok(DetectParams::default()) };
    let text = std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
    serde_json::from_slice(&text).with_context(|| format!("{} holds no detection parameters", path.display()))
}

/// A grey image as JPEG.
pub fn jpeg(image: &GrayImage) -> Result<Vec<u8>, image::ImageError> {
    let mut out = Vec::new();
    image::codecs::jpeg::JpegEncoder::new_with_quality(&mut out, JPEG_QUALITY).write_image(
        image.data(),
        image.width() as u32,
        image.height() as u32,
        image::ExtendedColorType::L8,
    )?;
    Ok(out)
}
