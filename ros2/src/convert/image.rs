//! Images as rows of grey levels or colours, and the compression of compressed ones.
//!
//! Source: `ros2/common_interfaces sensor_msgs/include/sensor_msgs/image_encodings.hpp`;
//! `ros-perception/image_transport_plugins compressed_image_transport/src`.

mod bayer;
mod wide;

use crate::messages::{CompressedImage, Image};
use bayer::rgb_of_bayer;
use std::borrow::Cow;
use wide::narrowed;

/// What a pixel is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PixelLayout {
    /// `mono8`, `8UC1`, `mono16`.
    Gray,
    /// Samples of red, green and blue at these places of a pixel of so many: `rgb8`, `bgra8`,
    /// `rgb16` ...
    Colour {
        /// Places of red, green and blue.
        places: [usize; 3],
        /// Samples of a pixel.
        samples: usize,
    },
    /// One colour a pixel, in squares of four: `bayer_rggb8` ...
    Bayer {
        /// Column and row of red in the square.
        red: [usize; 2],
    },
    /// `yuv422` (`uyvy`) and `yuv422_yuy2` (`yuyv`): two bytes a pixel, luma and one of Cb and Cr,
    /// which two pixels share.
    Yuv422 {
        /// Place of the luma in a pixel, 0 or 1.
        luma: usize,
    },
    /// `nv12` and `nv21`: rows of luma, then half as many of Cb and Cr, which squares of four
    /// pixels share.
    Yuv420 {
        /// Place of Cb in a pair, 0 or 1.
        cb: usize,
    },
}

impl PixelLayout {
    /// With whether its samples have 16 bits.
    fn of(encoding: &str) -> Option<(Self, bool)> {
        let colour = |places, samples| Self::Colour { places, samples };
        Some(match encoding {
            "mono8" | "8UC1" => (Self::Gray, false),
            "mono16" => (Self::Gray, true),
            "rgb8" => (colour([0, 1, 2], 3), false),
            "bgr8" | "8UC3" => (colour([2, 1, 0], 3), false),
            "rgba8" => (colour([0, 1, 2], 4), false),
            "bgra8" | "8UC4" => (colour([2, 1, 0], 4), false),
            "rgb16" => (colour([0, 1, 2], 3), true),
            "bgr16" | "16UC3" => (colour([2, 1, 0], 3), true),
            "rgba16" => (colour([0, 1, 2], 4), true),
            "bgra16" | "16UC4" => (colour([2, 1, 0], 4), true),
            "bayer_rggb8" => (Self::Bayer { red: [0, 0] }, false),
            "bayer_grbg8" => (Self::Bayer { red: [1, 0] }, false),
            "bayer_gbrg8" => (Self::Bayer { red: [0, 1] }, false),
            "bayer_bggr8" => (Self::Bayer { red: [1, 1] }, false),
            "bayer_rggb16" => (Self::Bayer { red: [0, 0] }, true),
            "bayer_grbg16" => (Self::Bayer { red: [1, 0] }, true),
            "bayer_gbrg16" => (Self::Bayer { red: [0, 1] }, true),
            "bayer_bggr16" => (Self::Bayer { red: [1, 1] }, true),
            "yuv422" | "uyvy" => (Self::Yuv422 { luma: 1 }, false),
            "yuv422_yuy2" | "yuyv" => (Self::Yuv422 { luma: 0 }, false),
            "nv12" => (Self::Yuv420 { cb: 0 }, false),
            "nv21" => (Self::Yuv420 { cb: 1 }, false),
            _ => return None,
        })
    }

    fn samples(self) -> usize {
        match self {
            Self::Gray | Self::Bayer { .. } | Self::Yuv420 { .. } => 1,
            Self::Yuv422 { .. } => 2,
            Self::Colour { samples, .. } => samples,
        }
    }
}

/// Luma as JPEG has it (ITU-R BT.601), in the fixed point of the server's decoder
/// (`vision/src/frame/picture.rs`): a raw image gives the grey of its PNG.
fn luma([r, g, b]: [u8; 3]) -> u8 {
    ((19_595 * u32::from(r) + 38_470 * u32::from(g) + 7_471 * u32::from(b) + 32_768) >> 16) as u8
}

/// Why an image cannot be used.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ImageError {
    /// An encoding without a use here: depth, floating point.
    #[error("images of encoding `{0}` are not read")]
    Encoding(String),
    /// No pixel.
    #[error("an image of {width} x {height}")]
    Empty {
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
    },
    /// Pixels that share colours are in squares or pairs.
    #[error("an image of {width} x {height}: encoding `{encoding}` has even sides")]
    Odd {
        /// The encoding.
        encoding: String,
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
    },
    /// A row is longer than the step.
    #[error("rows of {row} bytes in a step of {step}")]
    Step {
        /// Bytes of a row.
        row: u64,
        /// The step.
        step: u32,
    },
    /// Fewer bytes than rows need.
    #[error("{needed} bytes of pixels needed, {given} given")]
    Short {
        /// Bytes that the rows need.
        needed: u64,
        /// Bytes that there are.
        given: usize,
    },
    /// Neither JPEG nor PNG.
    #[error("compressed images of format `{0}` are not read")]
    Format(String),
}

/// Longest text of a message that an error repeats, in characters.
const MAX_TEXT_CHARS: usize = 64;

/// The rows of an image whose sizes agree. No pixel has been touched.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ImageRows<'a> {
    width: usize,
    height: usize,
    layout: PixelLayout,
    /// Of samples of 16 bits: whether the high byte comes first.
    is_big_endian: Option<bool>,
    step: usize,
    data: &'a [u8],
}

impl<'a> ImageRows<'a> {
    /// Compares sizes and encoding.
    pub fn of(image: &Image<'a>) -> Result<Self, ImageError> {
        let Image { width, height, step, data, .. } = *image;
        let layout = PixelLayout::of(image.encoding);
        let (layout, is_wide) = layout.ok_or_else(|| ImageError::Encoding(short(image.encoding)))?;
        if width == 0 || height == 0 {
            return Err(ImageError::Empty { width, height });
        }
        let is_shared = matches!(layout, PixelLayout::Yuv420 { .. } | PixelLayout::Bayer { .. });
        if is_shared && (!width.is_multiple_of(2) || !height.is_multiple_of(2)) {
            return Err(ImageError::Odd { encoding: short(image.encoding), width, height });
        }
        let row = u64::from(width) * layout.samples() as u64 * (1 + u64::from(is_wide));
        if row > u64::from(step) {
            return Err(ImageError::Step { row, step });
        }
        let has_chroma_rows = matches!(layout, PixelLayout::Yuv420 { .. });
        let rows = u64::from(height) + if has_chroma_rows { u64::from(height / 2) } else { 0 };
        // Some drivers leave out the padding of the last row.
        let needed = (rows - 1) * u64::from(step) + row;
        if needed > data.len() as u64 {
            return Err(ImageError::Short { needed, given: data.len() });
        }
        Ok(Self {
            width: width as usize,
            height: height as usize,
            layout,
            is_big_endian: is_wide.then_some(image.is_bigendian != 0),
            step: step as usize,
            data: &data[..needed as usize],
        })
    }

    /// What a pixel is.
    pub fn layout(&self) -> PixelLayout {
        self.layout
    }

    /// Grey pixels, row-major without padding: at most as many as there are bytes.
    pub fn to_gray8(&self) -> Vec<u8> {
        let samples = self.samples();
        match self.layout {
            PixelLayout::Gray => samples.into_owned(),
            PixelLayout::Yuv420 { .. } => samples[..self.width * self.height].to_vec(),
            PixelLayout::Yuv422 { luma } => samples.chunks_exact(2).map(|pixel| pixel[luma]).collect(),
            PixelLayout::Colour { places, samples: n } => {
                samples.chunks_exact(n).map(|pixel| luma(places.map(|place| pixel[place]))).collect()
            }
            PixelLayout::Bayer { red } => {
                rgb_of_bayer(&samples, [self.width, self.height], red).map(luma).collect()
            }
        }
    }

    /// Pixels of red, green and blue, row-major without padding; none of a grey image.
    pub fn to_rgb8(&self) -> Option<Vec<u8>> {
        let samples = self.samples();
        match self.layout {
            PixelLayout::Gray => None,
            PixelLayout::Colour { places, samples: n } => {
                Some(samples.chunks_exact(n).flat_map(|pixel| places.map(|place| pixel[place])).collect())
            }
            PixelLayout::Bayer { red } => {
                Some(rgb_of_bayer(&samples, [self.width, self.height], red).flatten().collect())
            }
            PixelLayout::Yuv422 { luma } => {
                let pairs = samples.chunks(2 * self.width).flat_map(|row| row.chunks(4));
                Some(pairs.flat_map(|pair| rgb_of_pair(pair, luma)).collect())
            }
            PixelLayout::Yuv420 { cb } => {
                let (levels, chroma) = samples.split_at(self.width * self.height);
                let rows = levels.chunks(self.width).enumerate();
                let pixel = |y: usize, x: usize, level: u8| {
                    let pair = y / 2 * self.width + x / 2 * 2;
                    rgb(level, chroma[pair + cb], chroma[pair + 1 - cb])
                };
                let row = |(y, row): (usize, &'_ [u8])| {
                    row.iter().enumerate().flat_map(|(x, level)| pixel(y, x, *level)).collect::<Vec<_>>()
                };
                Some(rows.flat_map(row).collect())
            }
        }
    }

    /// The samples of all rows without padding, 8 bits each.
    fn samples(&self) -> Cow<'a, [u8]> {
        let bytes = if self.is_big_endian.is_some() { 2 } else { 1 };
        let row_bytes = self.width * self.layout.samples() * bytes;
        if bytes == 1 && row_bytes == self.step {
            return Cow::Borrowed(self.data);
        }
        let rows = self.data.chunks(self.step).flat_map(|row| row[..row_bytes].iter().copied());
        let samples: Vec<u8> = rows.collect();
        let Some(is_big_endian) = self.is_big_endian else { return Cow::Owned(samples) };
        let colours = match self.layout {
            PixelLayout::Colour { samples, .. } => (samples, 3),
            _ => (1, 1),
        };
        Cow::Owned(narrowed(&samples, is_big_endian, colours))
    }
}

/// No colour, as Cb or Cr.
const NO_CHROMA: u8 = 128;

/// Red, green and blue of two pixels that share Cb and Cr, or of a last one without Cr.
fn rgb_of_pair(pair: &[u8], luma: usize) -> impl Iterator<Item = u8> {
    let chroma = |pixel: usize| pair.get(2 * pixel + 1 - luma).copied().unwrap_or(NO_CHROMA);
    let (cb, cr) = (chroma(0), chroma(1));
    pair.chunks_exact(2).flat_map(move |pixel| rgb(pixel[luma], cb, cr))
}

/// As of JPEG (ITU-R BT.601, full range), so that the grey of the colours is the luma.
fn rgb(y: u8, cb: u8, cr: u8) -> [u8; 3] {
    let [y, cb, cr] = [f32::from(y), f32::from(cb) - 128.0, f32::from(cr) - 128.0];
    // Casts saturate.
    [y + 1.402 * cr, y - 0.344_136 * cb - 0.714_136 * cr, y + 1.772 * cb].map(|level| level.round() as u8)
}

/// How a compressed image is compressed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Compression {
    /// JPEG.
    Jpeg,
    /// PNG.
    Png,
}

impl Compression {
    /// By the first bytes, for drivers write `format` in many ways; depth images are refused by it.
    pub fn of(image: &CompressedImage<'_>) -> Result<Self, ImageError> {
        match image.data {
            _ if image.format.contains("compressedDepth") => Err(ImageError::Format(short(image.format))),
            [0xff, 0xd8, 0xff, ..] => Ok(Self::Jpeg),
            [0x89, b'P', b'N', b'G', ..] => Ok(Self::Png),
            _ => Err(ImageError::Format(short(image.format))),
        }
    }
}

fn short(text: &str) -> String {
    text.chars().take(MAX_TEXT_CHARS).collect()
}

#[cfg(test)]
mod tests;
