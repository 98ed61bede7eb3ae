//! Grey pictures of maps: PGM (text and binary) read and written here, PNG by the image library.

use super::grid::{GridError, MAX_CELLS};
use std::path::Path;

/// Largest picture file.
const MAX_FILE_BYTES: u64 = 512 << 20;

/// Grey levels, top row first; `None`: transparent.
#[derive(Debug, PartialEq)]
pub(super) struct Grey {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) levels: Vec<Option<u8>>,
}

/// Reads a PGM or PNG file.
pub(super) fn read(path: &Path) -> Result<Grey, GridError> {
    let picture = |e: String| GridError::Picture(path.display().to_string(), e);
    let size = std::fs::metadata(path).map_err(|e| picture(e.to_string()))?.len();
    if size > MAX_FILE_BYTES {
        return Err(picture(format!("more than {MAX_FILE_BYTES} bytes")));
    }
    let bytes = std::fs::read(path).map_err(|e| picture(e.to_string()))?;
    let made = if bytes.starts_with(b"P5") || bytes.starts_with(b"P2") { pgm(&bytes) } else { png(&bytes) };
    made.map_err(picture)
}

fn size(width: usize, height: usize) -> Result<(), String> {
    let cells = width.saturating_mul(height);
    if (1..=MAX_CELLS).contains(&cells) {
        Ok(())
    } else {
        Err(format!("{width} x {height} cells, 1 to {MAX_CELLS}"))
    }
}

fn png(bytes: &[u8]) -> Result<Grey, String> {
    let mut reader = image::ImageReader::new(std::io::Cursor::new(bytes))
        .with_guessed_format()
        .map_err(|e| e.to_string())?;
    let mut limits = image::Limits::default();
    limits.max_image_width = Some(1 << 16);
    limits.max_image_height = Some(1 << 16);
    limits.max_alloc = Some(8 * MAX_CELLS as u64);
    reader.limits(limits);
    let picture = reader.decode().map_err(|e| e.to_string())?.to_luma_alpha8();
    let (width, height) = (picture.width() as usize, picture.height() as usize);
    size(width, height)?;
    let levels = picture.pixels().map(|p| (p.0[1] > 0).then_some(p.0[0])).collect();
    Ok(Grey { width, height, levels })
}

/// The next number of a PGM head; comments run from `#` to the end of the line.
fn number(bytes: &[u8], at: &mut usize, what: &str) -> Result<usize, String> {
    loop {
        match bytes.get(*at) {
            Some(b'#') => {
                while bytes.get(*at).is_some_and(|b| *b != b'\n') {
                    *at += 1;
                }
            }
            Some(b) if b.is_ascii_whitespace() => *at += 1,
            _ => break,
        }
    }
    let start = *at;
    while bytes.get(*at).is_some_and(u8::is_ascii_digit) {
        *at += 1;
    }
    let digits = std::str::from_utf8(&bytes[start..*at]).unwrap_or("");
    digits.parse().map_err(|e| format!("{what}: {e}"))
}

fn pgm(bytes: &[u8]) -> Result<Grey, String> {
    let mut at = 2;
    let width = number(bytes, &mut at, "width")?;
    let height = number(bytes, &mut at, "height")?;
    let most = number(bytes, &mut at, "maximum")?;
    size(width, height)?;
    if !(1..=255).contains(&most) {
        return Err(format!("maximum {most}, 1 to 255 accepted"));
    }
    let scaled = |v: usize| Some((v.min(most) * 255 / most) as u8);
    let levels: Vec<Option<u8>> = if bytes.starts_with(b"P5") {
        let data = bytes.get(at + 1..at + 1 + width * height).ok_or("fewer pixels than the head says")?;
        data.iter().map(|b| scaled(usize::from(*b))).collect()
    } else {
        (0..width * height)
            .map(|_| number(bytes, &mut at, "pixel").map(scaled))
            .collect::<Result<_, String>>()?
    };
    Ok(Grey { width, height, levels })
}

/// A binary PGM.
pub(super) fn write(path: &Path, width: usize, height: usize, levels: &[u8]) -> std::io::Result<()> {
    let mut bytes = format!("P5\n{width} {height}\n255\n").into_bytes();
    bytes.extend_from_slice(levels);
    std::fs::write(path, bytes)
}
