//! Images as rows of grey levels or colours, and the compression of compressed ones.
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
    /// `yuv422` (`uyvy`) and `yuv422_yuy2` (`yuyv`): two bytes a pixel, luma and one of Cb and Cr, which two pixels share.
    Yuv422 {
        /// Place of the luma in a pixel, 0 or 1.
        luma: usize,
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
            "yuv422" | "uyvy" => Some(Self::Yuv422 { luma: 1 }),
            "yuv422_yuy2" | "yuyv" => Some(Self::Yuv422 { luma: 0 }),
            _ => None,
        }
    }

    fn bytes(self) -> usize {
        match self {
            Self::Gray8 => 1,
            Self::Gray16 { .. } | Self::Yuv422 { .. } => 2,
            Self::Colour { bytes, .. } => bytes,
        }
    }

    /// Luma as JPEG has it (ITU-R BT.601), in the fixed point of the server's decoder (`vision/src/frame/picture.rs`): a raw
    /// image gives the grey of its PNG.
    fn gray(self, pixel: &[u8]) -> u8 {
        match self {
            Self::Gray8 => pixel[0],
            Self::Gray16 { is_big_endian } => pixel[usize::from(!is_big_endian)],
            Self::Yuv422 { luma } => pixel[luma],
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
        self.rows().flat_map(|row| row.chunks_exact(bytes).map(|pixel| self.layout.gray(pixel))).collect()
    }

    /// Pixels of red, green and blue, row-major without padding; none of a grey image.
    pub fn to_rgb8(&self) -> Option<Vec<u8>> {
        let bytes = self.layout.bytes();
        match self.layout {
            PixelLayout::Gray8 | PixelLayout::Gray16 { .. } => None,
            PixelLayout::Colour { places, .. } => {
                let pixels = self.rows().flat_map(|row| row.chunks_exact(bytes));
                Some(pixels.flat_map(|pixel| places.map(|place| pixel[place])).collect())
            }
            PixelLayout::Yuv422 { luma } => {
                let pairs = self.rows().flat_map(|row| row.chunks(2 * bytes));
                Some(pairs.flat_map(|pair| rgb_of_pair(pair, luma)).collect())
            }
        }
    }

    fn rows(&self) -> impl Iterator<Item = &'a [u8]> {
        let row_bytes = self.width * self.layout.bytes();
        self.data.chunks(self.step).map(move |row| &row[..row_bytes])
    }
}

/// No colour, as Cb or Cr.
const NO_CHROMA: u8 = 128;

/// Red, green and blue of two pixels that share Cb and Cr, or of a last one without Cr. As of JPEG (ITU-R BT.601, full
/// range), so that the grey of the colours is the luma.
fn rgb_of_pair(pair: &[u8], luma: usize) -> impl Iterator<Item = u8> {
    let chroma =
        |pixel: usize| f32::from(pair.get(2 * pixel + 1 - luma).copied().unwrap_or(NO_CHROMA)) - 128.0;
    let (cb, cr) = (chroma(0), chroma(1));
    let levels = pair.chunks_exact(2).map(move |pixel| f32::from(pixel[luma]));
    let colours = move |y: f32| [y + 1.402 * cr, y - 0.344_136 * cb - 0.714_136 * cr, y + 1.772 * cb];
    // Casts saturate.
    levels.flat_map(move |y| colours(y).map(|level| level.round() as u8))
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
    fn colours_stay_and_padding_is_left_out() {
        let rgb = |encoding, width, step, data: &[u8]| {
            ImageRows::of(&image(encoding, width, 2, step, data)).unwrap().to_rgb8()
        };
        assert_eq!(rgb("rgb8", 1, 4, &[1, 2, 3, 99, 4, 5, 6]), Some(vec![1, 2, 3, 4, 5, 6]));
        assert_eq!(rgb("bgr8", 1, 3, &[3, 2, 1, 6, 5, 4]), Some(vec![1, 2, 3, 4, 5, 6]));
        assert_eq!(rgb("bgra8", 1, 4, &[3, 2, 1, 9, 6, 5, 4, 9]), Some(vec![1, 2, 3, 4, 5, 6]));
        assert_eq!(rgb("mono8", 1, 1, &[1, 2]), None);
        assert_eq!(rgb("mono16", 1, 2, &[1, 2, 3, 4]), None);
        // Cb 128, Cr 228 of two pixels: red above luma by 140, green below by 71; held to 0 to 255.
        let row = [128, 100, 228, 150];
        let pixels = [240, 29, 100, 255, 79, 150];
        assert_eq!(rgb("uyvy", 2, 4, &row.repeat(2)), Some(pixels.repeat(2)));
        let row = [100, 128, 150, 228];
        assert_eq!(rgb("yuv422_yuy2", 2, 4, &row.repeat(2)), Some(pixels.repeat(2)));
        // Three columns: the last pixel has Cb alone.
        let row = [128, 100, 228, 150, 128, 60];
        assert_eq!(rgb("yuv422", 3, 6, &row.repeat(2)).unwrap()[6..9], [60, 60, 60]);
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
