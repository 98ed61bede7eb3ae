//! Which lens a photograph was taken with. In: a picture file. Out: what its EXIF says, and whether
//! two photographs may be of one camera.

use image::ImageDecoder as _;
use serde::{Deserialize, Serialize};
use std::{fmt, io::Cursor};

/// Tags of EXIF.
const MAKE: u16 = 0x010f;
const MODEL: u16 = 0x0110;
const EXIF_DIRECTORY: u16 = 0x8769;
const FOCAL_LENGTH_35MM: u16 = 0xa405;
/// Most entries of a directory that are read.
const MAX_ENTRIES: u16 = 512;
/// Longest name, in bytes.
const MAX_NAME_BYTES: usize = 64;
/// Largest difference of two focal lengths of one lens, as a share; they are rounded to a
/// millimetre, too.
const SAME_FOCAL: f64 = 0.06;

/// The lens and its camera, as far as they are stated.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Lens {
    /// Who made the camera.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    make: Option<String>,
    /// Which camera it is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    model: Option<String>,
    /// Focal length that a film of 36 x 24 mm would have for the same view, mm: each lens of a
    /// phone has its own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    focal_35mm: Option<u16>,
}

/// How two lenses differ.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum LensDifference {
    /// Another focal length: the intrinsics of one are not those of the other.
    Focal,
    /// Another make or model of camera.
    Camera,
}

impl Lens {
    /// That of a picture file; `None` where it states nothing.
    pub(crate) fn of_photograph(bytes: &[u8]) -> Option<Self> {
        let format = image::guess_format(bytes).ok()?;
        let mut decoder = image::ImageReader::with_format(Cursor::new(bytes), format).into_decoder().ok()?;
        Self::of_exif(&decoder.exif_metadata().ok()??)
    }

    fn of_exif(bytes: &[u8]) -> Option<Self> {
        let tiff = Tiff::open(bytes)?;
        let first = tiff.word(4)?;
        let in_exif = |tag| tiff.long(first, EXIF_DIRECTORY).and_then(|at| tiff.short(at, tag));
        let lens = Self {
            make: tiff.text(first, MAKE),
            model: tiff.text(first, MODEL),
            focal_35mm: in_exif(FOCAL_LENGTH_35MM).filter(|mm| *mm > 0),
        };
        (lens != Self::default()).then_some(lens)
    }

    /// What speaks against both being of one camera; what one does not state speaks against
    /// nothing.
    pub(crate) fn difference(&self, other: &Self) -> Option<LensDifference> {
        if let Some((a, b)) = self.focal_35mm.zip(other.focal_35mm)
            && f64::from(a.abs_diff(b)) > (SAME_FOCAL * f64::from(a.max(b))).max(1.0)
        {
            return Some(LensDifference::Focal);
        }
        let differ =
            |a: &Option<String>, b: &Option<String>| a.as_ref().zip(b.as_ref()).is_some_and(|(a, b)| a != b);
        let is_other = differ(&self.make, &other.make) || differ(&self.model, &other.model);
        is_other.then_some(LensDifference::Camera)
    }
}

impl fmt::Display for Lens {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names: Vec<&str> = [&self.make, &self.model].into_iter().flatten().map(String::as_str).collect();
        let focal = self.focal_35mm.map(|mm| format!("{mm} mm (35 mm equivalent)"));
        let camera = (!names.is_empty()).then(|| names.join(" "));
        let parts: Vec<String> = camera.into_iter().chain(focal).collect();
        f.write_str(&parts.join(", "))
    }
}

/// Directories of a TIFF file.
struct Tiff<'a> {
    bytes: &'a [u8],
    is_little: bool,
}

impl<'a> Tiff<'a> {
    fn open(bytes: &'a [u8]) -> Option<Self> {
        match bytes.get(..4)? {
            b"II*\0" => Some(Self { bytes, is_little: true }),
            b"MM\0*" => Some(Self { bytes, is_little: false }),
            _ => None,
        }
    }

    fn half(&self, at: usize) -> Option<u16> {
        let bytes = self.bytes.get(at..at.checked_add(2)?)?.try_into().ok()?;
        Some(if self.is_little { u16::from_le_bytes(bytes) } else { u16::from_be_bytes(bytes) })
    }

    fn word(&self, at: usize) -> Option<usize> {
        let bytes = self.bytes.get(at..at.checked_add(4)?)?.try_into().ok()?;
        Some(if self.is_little { u32::from_le_bytes(bytes) } else { u32::from_be_bytes(bytes) } as usize)
    }

    /// Where the entry of a tag is in the directory at `directory`.
    fn entry(&self, directory: usize, tag: u16) -> Option<usize> {
        let count = self.half(directory)?.min(MAX_ENTRIES);
        (0..usize::from(count))
            .map(|i| directory + 2 + 12 * i)
            .find(|at| self.half(*at).is_some_and(|found| found == tag))
    }

    fn short(&self, directory: usize, tag: u16) -> Option<u16> {
        self.half(self.entry(directory, tag)? + 8)
    }

    fn long(&self, directory: usize, tag: u16) -> Option<usize> {
        self.word(self.entry(directory, tag)? + 8)
    }

    /// A text, without what ends it; short ones stand in the entry itself.
    fn text(&self, directory: usize, tag: u16) -> Option<String> {
        let entry = self.entry(directory, tag)?;
        let length = self.word(entry + 4)?.min(MAX_NAME_BYTES);
        let at = if length <= 4 { entry + 8 } else { self.word(entry + 8)? };
        let bytes = self.bytes.get(at..at.checked_add(length)?)?;
        let text = String::from_utf8_lossy(bytes.split(|byte| *byte == 0).next()?).trim().to_owned();
        (!text.is_empty()).then_some(text)
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// A photograph with this EXIF: camera, and focal length.
    pub(crate) fn photograph(model: &str, focal_35mm: u16) -> Vec<u8> {
        let mut model = model.as_bytes().to_vec();
        model.push(0);
        model.resize(model.len().max(5), 0);
        let mut tiff = b"MM\0*\0\0\0\x08".to_vec();
        let entry = |tag: u16, kind: u16, count: u32, value: [u8; 4]| {
            [&tag.to_be_bytes()[..], &kind.to_be_bytes(), &count.to_be_bytes(), &value].concat()
        };
        // Two entries, then the directory of EXIF with one, then the text.
        let exif_at = 8 + 2 + 24 + 4;
        let text_at = exif_at + 2 + 12 + 4;
        tiff.extend(2_u16.to_be_bytes());
        tiff.extend(entry(MODEL, 2, model.len() as u32, (text_at as u32).to_be_bytes()));
        tiff.extend(entry(EXIF_DIRECTORY, 4, 1, (exif_at as u32).to_be_bytes()));
        tiff.extend([0; 4]);
        tiff.extend(1_u16.to_be_bytes());
        let [high, low] = focal_35mm.to_be_bytes();
        tiff.extend(entry(FOCAL_LENGTH_35MM, 3, 1, [high, low, 0, 0]));
        tiff.extend([0; 4]);
        tiff.extend(&model);
        let image = vision::frame::GrayImage::from_fn(64, 48, |u, _| u as u8);
        let jpeg = crate::pictures::jpeg(&image).unwrap();
        let length = (tiff.len() + 8) as u16;
        [&jpeg[..2], &[0xff, 0xe1], &length.to_be_bytes(), b"Exif\0\0", &tiff, &jpeg[2..]].concat()
    }

    fn lens(model: &str, focal_35mm: u16) -> Lens {
        Lens::of_photograph(&photograph(model, focal_35mm)).unwrap()
    }

    #[test]
    fn the_lens_is_read_and_compared() {
        let wide = lens("iPhone 13", 26);
        assert_eq!(wide.to_string(), "iPhone 13, 26 mm (35 mm equivalent)");
        assert_eq!(wide.difference(&wide), None);
        assert_eq!(wide.difference(&lens("iPhone 13", 27)), None, "rounded");
        assert_eq!(wide.difference(&lens("iPhone 13", 13)), Some(LensDifference::Focal));
        assert_eq!(wide.difference(&lens("Pixel 7", 26)), Some(LensDifference::Camera));
        assert_eq!(wide.difference(&lens("Pixel 7", 52)), Some(LensDifference::Focal));
        assert_eq!(lens("X1", 0).to_string(), "X1", "0 is not known");
        let unknown = Lens::default();
        assert_eq!((wide.difference(&unknown), unknown.difference(&wide)), (None, None));
        let back: Lens = serde_json::from_str(&serde_json::to_string(&wide).unwrap()).unwrap();
        assert_eq!(back, wide);
    }

    #[test]
    fn no_truncation_of_exif_panics() {
        let whole = photograph("iPhone 13", 26);
        let exif = &whole[12..12 + 80];
        for cut in 0..exif.len() {
            Lens::of_exif(&exif[..cut]);
            let mut damaged = exif.to_vec();
            damaged[cut] ^= 0xff;
            Lens::of_exif(&damaged);
        }
        assert_eq!(Lens::of_photograph(b"no picture"), None);
        assert_eq!(Lens::of_photograph(&[&whole[..2], &whole[12 + 80..]].concat()), None);
    }
}
