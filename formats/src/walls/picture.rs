//! Pictures of grid maps: PGM and PPM (text and binary, 8 and 16 bit), PNG, BMP and JPEG, with
//! limits checked before any pixel is decoded. WebP and TIFF, which `nav2_map_server` reads as
//! well, would be two more decoders with their own dependencies, for files that any program saves
//! as PNG.

use super::grid::{GridError, MAX_CELLS};
use image::{ColorType, DynamicImage, ImageDecoder as _, ImageFormat, ImageReader, Limits};
use std::{
    io::{Cursor, Read as _},
    path::Path,
};

/// Largest picture file.
const MAX_FILE_BYTES: u64 = 512 << 20;
/// Most bytes of a sample times channels: colour and opacity of 16 bit.
const MAX_PIXEL_BYTES: u64 = 8;

/// A pixel as `map_server` reads it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Pixel {
    /// Mean of the colours, 0 (black) to 1 (white).
    pub(super) brightness: f64,
    /// 0 (transparent) to 1; `None` where the picture has no such channel.
    pub(super) opacity: Option<f64>,
}

#[derive(Debug)]
enum Samples {
    Bytes(Vec<u8>),
    Words(Vec<u16>),
}

/// A decoded picture.
#[derive(Debug)]
pub(super) struct Picture {
    pub(super) width: usize,
    pub(super) height: usize,
    /// 1 or 3 colours; opacity after them makes it 2 or 4.
    channels: usize,
    samples: Samples,
}

impl Picture {
    /// Reads a file.
    pub(super) fn read(path: &Path) -> Result<Self, GridError> {
        let named = |problem: String| GridError::Picture { name: path.display().to_string(), problem };
        let bytes = bounded(path, MAX_FILE_BYTES).map_err(named)?;
        Self::decode(&bytes, MAX_CELLS).map_err(named)
    }

    fn decode(bytes: &[u8], max_cells: usize) -> Result<Self, String> {
        let format = match bytes {
            [b'P', b'2' | b'3' | b'5' | b'6', ..] => ImageFormat::Pnm,
            [0x89, b'P', b'N', b'G', ..] => ImageFormat::Png,
            [b'B', b'M', ..] => ImageFormat::Bmp,
            [0xff, 0xd8, 0xff, ..] => ImageFormat::Jpeg,
            [b'R', b'I', b'F', b'F', ..] => return Err(other("WebP")),
            [b'I', b'I', b'*', 0, ..] | [b'M', b'M', 0, b'*', ..] => return Err(other("TIFF")),
            [b'G', b'I', b'F', ..] => return Err(other("GIF")),
            _ => return Err("none of PGM, PPM, PNG, BMP and JPEG".to_owned()),
        };
        let mut decoder =
            ImageReader::with_format(Cursor::new(bytes), format).into_decoder().map_err(|e| e.to_string())?;
        let (width, height) = decoder.dimensions();
        let (width, height) = (width as usize, height as usize);
        if !(1..=max_cells).contains(&width.saturating_mul(height)) {
            return Err(format!("{width} x {height} cells, 1 to {max_cells} are read"));
        }
        if !is_long_enough(bytes, decoder.color_type(), width * height) {
            return Err("fewer pixels than the head says".to_owned());
        }
        let mut limits = Limits::no_limits();
        limits.max_alloc = Some(MAX_PIXEL_BYTES * max_cells as u64 + (64 << 20));
        decoder.set_limits(limits).map_err(|e| e.to_string())?;
        let image = DynamicImage::from_decoder(decoder).map_err(|e| e.to_string())?;
        let channels = usize::from(image.color().channel_count());
        let samples = match image {
            DynamicImage::ImageLuma16(b) => Samples::Words(b.into_raw()),
            DynamicImage::ImageLumaA16(b) => Samples::Words(b.into_raw()),
            DynamicImage::ImageRgb16(b) => Samples::Words(b.into_raw()),
            DynamicImage::ImageRgba16(b) => Samples::Words(b.into_raw()),
            other => Samples::Bytes(other.into_bytes()),
        };
        Ok(Self { width, height, channels, samples })
    }

    /// The pixel in column `x` of row `y`, the top row first.
    pub(super) fn pixel(&self, x: usize, y: usize) -> Pixel {
        let first = (y * self.width + x) * self.channels;
        let sample = |k: usize| match &self.samples {
            Samples::Bytes(bytes) => f64::from(bytes[first + k]) / 255.0,
            Samples::Words(words) => f64::from(words[first + k]) / 65535.0,
        };
        let has_opacity = self.channels.is_multiple_of(2);
        let brightness =
            if self.channels < 3 { sample(0) } else { (sample(0) + sample(1) + sample(2)) / 3.0 };
        Pixel { brightness, opacity: has_opacity.then(|| sample(self.channels - 1)) }
    }

    /// The picture as an 8 bit PNG, grey, with its opacity where it has one.
    pub(super) fn grey_png(&self) -> Result<Vec<u8>, GridError> {
        let has_opacity = self.channels.is_multiple_of(2);
        let byte = |share: f64| (share * 255.0).round() as u8;
        let mut grey = Vec::with_capacity(self.width * self.height * if has_opacity { 2 } else { 1 });
        for y in 0..self.height {
            for x in 0..self.width {
                let pixel = self.pixel(x, y);
                grey.push(byte(pixel.brightness));
                grey.extend(pixel.opacity.map(byte));
            }
        }
        png(&grey, (self.width, self.height), if has_opacity { ColorType::La8 } else { ColorType::L8 })
    }
}

fn other(kind: &str) -> String {
    format!("{kind} is not read: save it as PNG, and name that in the .yaml")
}

/// Encodes 8 bit samples as PNG.
pub(super) fn png(
    samples: &[u8],
    (width, height): (usize, usize),
    colour: ColorType,
) -> Result<Vec<u8>, GridError> {
    let mut bytes = Cursor::new(Vec::new());
    image::write_buffer_with_format(
        &mut bytes,
        samples,
        width as u32,
        height as u32,
        colour,
        ImageFormat::Png,
    )
    .map_err(|e| GridError::Picture { name: "PNG".to_owned(), problem: e.to_string() })?;
    Ok(bytes.into_inner())
}

/// Whether a PGM can hold its pixels, so that a short file with a large head costs no memory.
fn is_long_enough(bytes: &[u8], colour: ColorType, pixels: usize) -> bool {
    match bytes {
        [b'P', b'5' | b'6', ..] => bytes.len() > pixels.saturating_mul(usize::from(colour.bytes_per_pixel())),
        // A digit and a separator each.
        [b'P', b'2', ..] => bytes.len() > pixels.saturating_mul(2) - 1,
        [b'P', b'3', ..] => bytes.len() > pixels.saturating_mul(6) - 1,
        // Rows of a bit a pixel at least, but for those that are run lengths.
        [b'B', b'M', ..] => bytes.len() > pixels / 256,
        _ => true,
    }
}

/// The bytes of a file of at most `max` bytes.
fn bounded(path: &Path, max: u64) -> Result<Vec<u8>, String> {
    let mut bytes = Vec::new();
    let file = std::fs::File::open(path).map_err(|e| e.to_string())?;
    file.take(max + 1).read_to_end(&mut bytes).map_err(|e| e.to_string())?;
    if bytes.len() as u64 > max { Err(format!("more than {max} bytes")) } else { Ok(bytes) }
}

/// Writes a binary PGM.
pub(super) fn write_pgm(path: &Path, width: usize, height: usize, levels: &[u8]) -> std::io::Result<()> {
    let mut bytes = format!("P5\n{width} {height}\n255\n").into_bytes();
    bytes.extend_from_slice(levels);
    std::fs::write(path, bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decoded(bytes: &[u8]) -> Picture {
        Picture::decode(bytes, 16).unwrap()
    }

    fn brightness(bytes: &[u8]) -> Vec<u8> {
        let p = decoded(bytes);
        let all = (0..p.height).flat_map(|y| (0..p.width).map(move |x| (x, y)));
        all.map(|(x, y)| (p.pixel(x, y).brightness * 255.0).round() as u8).collect()
    }

    #[test]
    fn every_pgm_says_the_same() {
        for bytes in [
            &b"P5\n# made by hand\n2 2\n255\n\x00\xfe\xcd\x80"[..],
            b"P2 2 2 255 0 254 205 128",
            b"P2\r\n2 2\r\n255\r\n0 254\r\n205 128\r\n",
            b"P5\n2 2\n65535\n\x00\x00\xfe\xfe\xcd\xcd\x80\x80",
            b"P2\n2 2\n65535\n0 65278 52685 32896\n",
        ] {
            assert_eq!(brightness(bytes), [0, 254, 205, 128], "{:?}", String::from_utf8_lossy(bytes));
        }
        assert_eq!(brightness(b"P2 2 1 100 0 50"), [0, 128], "another white than 255");
    }

    #[test]
    fn other_pictures_of_nav2_say_the_same() {
        let grey = image::GrayImage::from_raw(2, 2, vec![0, 254, 205, 128]).unwrap();
        let rgb = DynamicImage::ImageLuma8(grey).into_rgb8();
        let written = |format| {
            let mut bytes = Cursor::new(Vec::new());
            rgb.write_to(&mut bytes, format).unwrap();
            bytes.into_inner()
        };
        for format in [ImageFormat::Bmp, ImageFormat::Png] {
            assert_eq!(brightness(&written(format)), [0, 254, 205, 128], "{format:?}");
        }
        assert_eq!(brightness(b"P3 2 2 255 0 0 0 254 254 254 205 205 205 128 128 128\n"), [0, 254, 205, 128]);
        let ppm = b"P6 2 2 255\n\x00\x00\x00\xfe\xfe\xfe\xcd\xcd\xcd\x80\x80\x80";
        assert_eq!(brightness(ppm), [0, 254, 205, 128]);
        let mut jpeg = Cursor::new(Vec::new());
        image::RgbImage::from_pixel(2, 2, image::Rgb([200; 3]))
            .write_to(&mut jpeg, ImageFormat::Jpeg)
            .unwrap();
        assert!(brightness(&jpeg.into_inner()).iter().all(|level| level.abs_diff(200) <= 2));
        for (bytes, words) in [
            (&b"RIFF\x10\0\0\0WEBPVP8 "[..], "WebP"),
            (b"II*\0\x08\0\0\0", "TIFF"),
            (b"MM\0*\0\0\0\x08", "TIFF"),
            (b"GIF89a", "GIF"),
            (b"P4 2 2\n\0", "none of PGM"),
            (b"", "none of PGM"),
        ] {
            assert!(Picture::decode(bytes, 16).unwrap_err().contains(words), "{words}");
        }
    }

    #[test]
    fn a_png_is_the_mean_of_its_colours_and_its_opacity() {
        let encode = |samples: &[u8], colour| png(samples, (2, 1), colour).unwrap();
        assert_eq!(brightness(&encode(&[7, 200], ColorType::L8)), [7, 200]);
        let rgb = encode(&[0, 30, 60, 255, 255, 255], ColorType::Rgb8);
        assert_eq!(brightness(&rgb), [30, 255]);
        assert_eq!(decoded(&rgb).pixel(0, 0).opacity, None);
        for clear in [
            encode(&[0, 255, 255, 51], ColorType::La8),
            encode(&[0, 0, 0, 255, 255, 255, 255, 51], ColorType::Rgba8),
        ] {
            assert_eq!(brightness(&clear), [0, 255]);
            assert_eq!(decoded(&clear).pixel(0, 0).opacity, Some(1.0));
            assert_eq!(decoded(&clear).pixel(1, 0).opacity, Some(0.2));
            // As an underlay both are what they were.
            assert_eq!(decoded(&decoded(&clear).grey_png().unwrap()).pixel(1, 0).opacity, Some(0.2));
        }
    }

    #[test]
    fn pictures_are_bounded_in_cells_and_bytes() {
        let black = |w: usize, h: usize| {
            let mut bytes = format!("P5 {w} {h} 255\n").into_bytes();
            bytes.resize(bytes.len() + w * h, 0);
            bytes
        };
        assert!(Picture::decode(&black(4, 4), 16).is_ok());
        assert!(Picture::decode(&black(17, 1), 16).unwrap_err().contains("17 x 1 cells"));
        let large = png(&[0; 25], (5, 5), ColorType::L8).unwrap();
        assert!(Picture::decode(&large, 25).is_ok());
        assert!(Picture::decode(&large, 24).unwrap_err().contains("5 x 5 cells"));
        for head in ["P5 4294967295 4294967295 255\n", "P5 8000 8000 255\n", "P2 8000 8000 255\n1 2 3"] {
            assert!(Picture::decode(head.as_bytes(), MAX_CELLS).is_err(), "{head}");
        }
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("m.pgm");
        std::fs::write(&path, [0; 10]).unwrap();
        assert_eq!(bounded(&path, 10).unwrap().len(), 10);
        assert_eq!(bounded(&path, 9).unwrap_err(), "more than 9 bytes");
    }

    proptest::proptest! {
        #[test]
        fn no_bytes_are_a_panic(kind in 0..3_usize, at in 0..64_usize, byte: u8, cut in 0..64_usize) {
            let mut bytes = match kind {
                0 => b"P5\n# c\n3 2\n255\n\x00\xfe\xcd\x00\x01\x02".to_vec(),
                1 => b"P2\n3 2\n65535\n0 1 2 3 4 65535\n".to_vec(),
                _ => png(&[9; 8], (2, 1), ColorType::Rgba8).unwrap(),
            };
            let at = at % bytes.len();
            bytes[at] = byte;
            bytes.truncate(bytes.len() - cut % bytes.len());
            // An answer, whichever.
            Picture::decode(&bytes, 64).ok();
        }
    }
}
