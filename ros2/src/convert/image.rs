//! Images as grey rows, and the compression of compressed ones.
//!
//! Source: `ros2/common_interfaces sensor_msgs/include/sensor_msgs/image_encodings.hpp`;
//! `ros-perception/image_transport_plugins compressed_image_transport/src`.

use crate::messages::{CompressedImage, Image};

/// What a pixel is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PixelLayout {
    /// `mono8`, `8UC1`.
    Gray8,
    /// `mono16`; the flag says whether the high byte comes first.
    Gray16 {
        /// Whether the high byte comes first.
        is_big_endian: bool,
    },
    /// Bytes of red, green and blue at these places of a pixel of so many bytes: `rgb8`, `bgra8` ...
    Colour {
        /// Places of red, green and blue.
        places: [usize; 3],
        /// Bytes of a pixel.
        bytes: usize,
    },
    /// `yuv422` (`uyvy`) and `yuv422_yuy2` (`yuyv`): two bytes a pixel, luma at this place.
    Luma {
        /// Place of the luma.
        place: usize,
    },
}

impl PixelLayout {
    fn of(image: &Image<'_>) -> Option<Self> {
        let colour = |places, bytes| Some(Self::Colour { places, bytes });
        match image.encoding {
            "mono8" | "8UC1" => Some(Self::Gray8),
            "mono16" => Some(Self::Gray16 { is_big_endian: image.is_bigendian != 0 }),
            "rgb8" => colour([0, 1, 2], 3),
            "bgr8" | "8UC3" => colour([2, 1, 0], 3),
            "rgba8" => colour([0, 1, 2], 4),
            "bgra8" | "8UC4" => colour([2, 1, 0], 4),
            "yuv422" | "uyvy" => Some(Self::Luma { place: 1 }),
            "yuv422_yuy2" | "yuyv" => Some(Self::Luma { place: 0 }),
            _ => None,
        }
    }

    fn bytes(self) -> usize {
        match self {
            Self::Gray8 => 1,
            Self::Gray16 { .. } | Self::Luma { .. } => 2,
            Self::Colour { bytes, .. } => bytes,
        }
    }

    /// Luma as JPEG has it (ITU-R BT.601), in the fixed point of the server's decoder (`engine/src/decode.rs`): a raw image
    /// gives the grey of its PNG.
    fn gray(self, pixel: &[u8]) -> u8 {
        match self {
            Self::Gray8 => pixel[0],
            Self::Gray16 { is_big_endian } => pixel[usize::from(!is_big_endian)],
            Self::Luma { place } => pixel[place],
            Self::Colour { places, .. } => {
                let [r, g, b] = places.map(|place| u32::from(pixel[place]));
                ((19_595 * r + 38_470 * g + 7_471 * b + 32_768) >> 16) as u8
            }
        }
    }
}

/// Why an image cannot be used.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ImageError {
    /// An encoding without a use here: depth, Bayer patterns, floating point.
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
    layout: PixelLayout,
    step: usize,
    data: &'a [u8],
}

impl<'a> ImageRows<'a> {
    /// Compares sizes and encoding.
    pub fn of(image: &Image<'a>) -> Result<Self, ImageError> {
        let Image { width, height, step, data, .. } = *image;
        let layout = PixelLayout::of(image).ok_or_else(|| ImageError::Encoding(short(image.encoding)))?;
        if width == 0 || height == 0 {
            return Err(ImageError::Empty { width, height });
        }
        let row = u64::from(width) * layout.bytes() as u64;
        if row > u64::from(step) {
            return Err(ImageError::Step { row, step });
        }
        // Some drivers leave out the padding of the last row.
        let needed = u64::from(height - 1) * u64::from(step) + row;
        if needed > data.len() as u64 {
            return Err(ImageError::Short { needed, given: data.len() });
        }
        Ok(Self { width: width as usize, layout, step: step as usize, data: &data[..needed as usize] })
    }

    /// What a pixel is.
    pub fn layout(&self) -> PixelLayout {
        self.layout
    }

    /// Grey pixels, row-major without padding: at most as many as there are bytes.
    pub fn to_gray8(&self) -> Vec<u8> {
        let bytes = self.layout.bytes();
        let rows = self.data.chunks(self.step).map(|row| &row[..self.width * bytes]);
        rows.flat_map(|row| row.chunks_exact(bytes).map(|pixel| self.layout.gray(pixel))).collect()
    }
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
mod tests {
    use super::*;

    fn image<'a>(encoding: &'a str, width: u32, height: u32, step: u32, data: &'a [u8]) -> Image<'a> {
        Image { height, width, encoding, step, data, ..Image::default() }
    }

    #[test]
    fn pixels_become_grey_and_padding_is_left_out() {
        let gray = |image: &Image<'_>| ImageRows::of(image).unwrap().to_gray8();
        assert_eq!(gray(&image("mono8", 2, 2, 3, &[1, 2, 99, 3, 4])), [1, 2, 3, 4]);
        assert_eq!(gray(&image("mono16", 1, 2, 2, &[1, 2, 3, 4])), [2, 4]);
        let big = Image { is_bigendian: 1, ..image("mono16", 1, 2, 2, &[1, 2, 3, 4]) };
        assert_eq!(gray(&big), [1, 3]);
        assert_eq!(gray(&image("yuv422", 2, 1, 4, &[9, 1, 9, 2])), [1, 2]);
        assert_eq!(gray(&image("yuv422_yuy2", 2, 1, 4, &[1, 9, 2, 9])), [1, 2]);
        let red = [76, 76, 76];
        assert_eq!(gray(&image("rgb8", 1, 1, 3, &[255, 0, 0]))[0], red[0]);
        assert_eq!(gray(&image("bgr8", 1, 1, 3, &[0, 0, 255]))[0], red[1]);
        assert_eq!(gray(&image("bgra8", 1, 1, 4, &[0, 0, 255, 255]))[0], red[2]);
        assert_eq!(gray(&image("rgba8", 1, 1, 4, &[255, 255, 255, 0])), [255]);
    }

    #[test]
    fn sizes_that_do_not_agree_are_refused() {
        let of = |w, h, step, data: &[u8]| ImageRows::of(&image("rgb8", w, h, step, data)).unwrap_err();
        assert_eq!(of(2, 1, 5, &[0; 6]), ImageError::Step { row: 6, step: 5 });
        assert_eq!(of(2, 2, 6, &[0; 11]), ImageError::Short { needed: 12, given: 11 });
        assert_eq!(of(0, 2, 6, &[0; 12]), ImageError::Empty { width: 0, height: 2 });
        let huge = of(u32::MAX / 3, u32::MAX, u32::MAX, &[0; 12]);
        assert!(matches!(huge, ImageError::Short { .. }));
        assert!(matches!(of(u32::MAX, 1, u32::MAX, &[]), ImageError::Step { .. }));
        let depth = ImageRows::of(&image("16UC1", 1, 1, 2, &[0; 2]));
        assert_eq!(depth, Err(ImageError::Encoding("16UC1".into())));
    }

    #[test]
    fn compression_is_told_by_the_bytes() {
        let of =
            |format, data| Compression::of(&CompressedImage { format, data, ..CompressedImage::default() });
        assert_eq!(of("rgb8; jpeg compressed bgr8", &[0xff, 0xd8, 0xff, 0xe0]), Ok(Compression::Jpeg));
        assert_eq!(of("", b"\x89PNG\r\n"), Ok(Compression::Png));
        assert_eq!(of("webp", b"RIFF"), Err(ImageError::Format("webp".into())));
        assert!(of("16UC1; compressedDepth png", b"\x89PNG").is_err());
        assert!(of("jpeg", &[]).is_err());
    }
}
