//! The numbers that define what a line beside a side, and a quad, are measured by. Weights were
//! fitted to measurements made with these numbers: with others they mean nothing. So a digest of
//! all of them belongs to every network, and a network with another digest is refused
//! (`Network::check`; for the weights of the program, when it is compiled).

use crate::detect::edge_support::gradients::MIN_COS;
use serde::{Deserialize, Deserializer, Serialize, Serializer, de::Error as _};
use std::fmt;

/// Raised when the same numbers give other measurements: the order, the meaning or the computation
/// of one changed.
const VERSION: f64 = 1.0;

/// A length in pixels that grows with the quad: a share of its extent across the side, and the
/// least, px.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Length {
    /// Share of the extent.
    pub(crate) share: f64,
    /// Least length, px.
    pub(crate) least_px: f64,
}

impl Length {
    /// Length for a quad that reaches `extent_px` across the side, px.
    pub(crate) fn of(self, extent_px: f64) -> f64 {
        (self.share * extent_px).max(self.least_px)
    }
}

// The band around a side.

/// Most samples along a side: a line keeps which of them it has in a 64-bit word.
pub const MAX_BAND_SAMPLES: usize = 48;
/// Fewest samples along a side.
pub(crate) const MIN_BAND_SAMPLES: usize = 12;
/// Pixels along a side for each sample.
pub(crate) const PX_PER_SAMPLE: f64 = 2.0;
/// Sides shorter than this have no band, px.
pub(crate) const MIN_SIDE_PX: f64 = 4.0;
/// Half the width of a band, as a share of the quad's extent across the side.
pub(crate) const REACH_SHARE: f64 = 0.25;
/// Half the width of a band, smallest and largest, px.
pub(crate) const REACH_PX: (f64, f64) = (6.0, 128.0);
/// Share of the side left out at both ends: near a corner the other side's gradient mixes in.
pub(crate) const CORNER_SHARE: f64 = 0.06;
/// Smallest step height of an edge, grey levels.
pub const MIN_STEP: f32 = 4.0;
/// Smallest step heights of the edges counted further out, weak and stronger, grey levels.
pub(crate) const STEPS_OUTSIDE: [f32; 2] = [MIN_STEP, 2.0 * MIN_STEP];

// The lines in a band.

/// Most lines of a band, the best supported first.
pub(crate) const MAX_LINES: usize = 24;
/// Share of the samples that a line needs.
pub(crate) const MIN_SUPPORT: f64 = 0.4;
/// Slopes tried to each side of the supposed direction.
pub(crate) const SLOPES: usize = 8;
/// One step of slope as a share of the side, and the least step, px over the whole side.
pub(crate) const SLOPE_STEP: Length = Length { share: 0.006, least_px: 0.5 };
/// Bins to each side of a line's offset that no further line starts from.
pub(crate) const SUPPRESSED_BINS: usize = 2;
/// Lines that differ by less in offset and in slope over the whole side are one, px.
pub(crate) const SAME_LINE_PX: (f64, f64) = (1.5, 3.0);
/// Edge points within this distance of a line are its own, round by round of the fit, px.
pub(crate) const NEAR_LINE_PX: [f64; 4] = [1.6, 1.6, 1.3, 1.1];
/// No round of the fit moves a line further than this where it has points, px.
pub(crate) const FIT_REACH_PX: f32 = 5.0;
/// Fewest points of a line.
pub(crate) const MIN_LINE_POINTS: f64 = 8.0;

// Strips beside a line. Offsets in px, from the line.

/// The strips just outside and just inside, whose grey levels are compared.
pub(crate) const NEAR_STRIP_PX: (f64, f64) = (1.5, 5.0);
/// Where the wall is: from the first to the second offset outside.
pub(crate) const WALL_STRIP: (Length, Length) =
    (Length { share: 0.08, least_px: 6.0 }, Length { share: 0.2, least_px: 12.0 });
/// The strips whose roughness is measured, near the line.
pub(crate) const ROUGH_STRIP_PX: (f64, f64) = (2.5, 6.0);
/// How far the broad strips reach whose roughness is measured.
pub(crate) const BROAD_STRIP: Length = Length { share: 0.12, least_px: 8.0 };
/// Edges and rough pixels are "further out" from here.
pub(crate) const BEYOND_PX: f64 = 2.5;
/// Lines further out or further in than this are others.
pub(crate) const OTHER_LINE_PX: f64 = 1.5;
/// Strips of fewer pixels in the image say nothing.
pub(crate) const MIN_STRIP_PIXELS: usize = 20;
/// The number of lines further out is divided by this.
pub(crate) const LINES_SCALE: f64 = 5.0;
/// Added to grey levels before the logarithm is taken.
pub(crate) const GREY_OFFSET: f64 = 8.0;
/// Added to step heights before the logarithm is taken, grey levels.
pub(crate) const STEP_OFFSET: f64 = 2.0;
/// Blur: half the width of the strip on the line, and from where to where the strips beside it
/// reach.
pub(crate) const BLUR_PX: [f64; 3] = [0.6, 1.6, 2.6];
/// Added to both mean steps of the blur, grey levels.
pub(crate) const BLUR_OFFSET: f64 = 1.0;
/// Narrower strips between two lines are no shadow.
pub(crate) const MIN_SHADOW_PX: f64 = 4.0;
/// The wall beside a shadow: from here to there, outside the line.
pub(crate) const SHADOW_WALL_PX: (f64, f64) = (1.5, 8.0);
/// A shadow is this much darker than the wall, as a ratio of grey levels, and the difference from
/// it that counts as 0.
pub(crate) const SHADOW_RATIO: (f64, f64) = (0.6, 0.35);

// Corners that a line makes with the neighbouring sides.

/// From where to where along a neighbouring side its usual step is measured, as shares: of the side
/// before, and of the side after.
pub(crate) const USUAL_SHARES: [[f64; 2]; 2] = [[0.2, 0.75], [0.25, 0.8]];
/// Samples of a side's usual step.
pub(crate) const USUAL_SAMPLES: usize = 24;
/// The section of a neighbouring side before the corner, from [`CORNER_GAP_PX`] on.
pub(crate) const INWARD_SECTION: Length = Length { share: 0.07, least_px: 6.0 };
/// How far the section behind the corner reaches, px.
pub(crate) const OUTWARD_PX: f64 = 6.0;
/// What is left out on both sides of the corner, px.
pub(crate) const CORNER_GAP_PX: f64 = 1.5;
pub(crate) const SECTION_SAMPLES: usize = 10;
/// Least usual step that others are compared with, grey levels.
pub(crate) const MIN_USUAL_STEP: f64 = 2.0;
/// A step as a share of the usual one is held to this range.
pub(crate) const STEP_SHARE: (f64, f64) = (-1.0, 1.5);
/// Differences from the usual step are divided by this, grey levels.
pub(crate) const DIFFERENCE_SCALE: f64 = 20.0;

// Networks.

/// Measurements further from their mean than this many standard deviations count as this far.
pub(crate) const CLIP_DEVIATIONS: f64 = 4.0;

/// Every number above, in order.
const NUMBERS: [f64; 67] = [
    VERSION,
    MAX_BAND_SAMPLES as f64,
    MIN_BAND_SAMPLES as f64,
    PX_PER_SAMPLE,
    MIN_SIDE_PX,
    REACH_SHARE,
    REACH_PX.0,
    REACH_PX.1,
    CORNER_SHARE,
    MIN_STEP as f64,
    STEPS_OUTSIDE[0] as f64,
    STEPS_OUTSIDE[1] as f64,
    MIN_COS as f64,
    MAX_LINES as f64,
    MIN_SUPPORT,
    SLOPES as f64,
    SLOPE_STEP.share,
    SLOPE_STEP.least_px,
    SUPPRESSED_BINS as f64,
    SAME_LINE_PX.0,
    SAME_LINE_PX.1,
    NEAR_LINE_PX[0],
    NEAR_LINE_PX[1],
    NEAR_LINE_PX[2],
    NEAR_LINE_PX[3],
    FIT_REACH_PX as f64,
    MIN_LINE_POINTS,
    NEAR_STRIP_PX.0,
    NEAR_STRIP_PX.1,
    WALL_STRIP.0.share,
    WALL_STRIP.0.least_px,
    WALL_STRIP.1.share,
    WALL_STRIP.1.least_px,
    ROUGH_STRIP_PX.0,
    ROUGH_STRIP_PX.1,
    BROAD_STRIP.share,
    BROAD_STRIP.least_px,
    BEYOND_PX,
    OTHER_LINE_PX,
    MIN_STRIP_PIXELS as f64,
    LINES_SCALE,
    GREY_OFFSET,
    STEP_OFFSET,
    BLUR_PX[0],
    BLUR_PX[1],
    BLUR_PX[2],
    BLUR_OFFSET,
    MIN_SHADOW_PX,
    SHADOW_WALL_PX.0,
    SHADOW_WALL_PX.1,
    SHADOW_RATIO.0,
    SHADOW_RATIO.1,
    USUAL_SHARES[0][0],
    USUAL_SHARES[0][1],
    USUAL_SHARES[1][0],
    USUAL_SHARES[1][1],
    USUAL_SAMPLES as f64,
    INWARD_SECTION.share,
    INWARD_SECTION.least_px,
    OUTWARD_PX,
    CORNER_GAP_PX,
    SECTION_SAMPLES as f64,
    MIN_USUAL_STEP,
    STEP_SHARE.0,
    STEP_SHARE.1,
    DIFFERENCE_SCALE,
    CLIP_DEVIATIONS,
];

/// FNV-1a, 64 bits, of the numbers that define the measurements. In JSON: 16 hexadecimal digits.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct FeatureDigest(pub u64);

impl FeatureDigest {
    /// Of the measurements that this program makes.
    pub const OF_THIS_PROGRAM: Self = Self::of(&NUMBERS);

    const fn of(numbers: &[f64]) -> Self {
        let mut hash = 0xcbf2_9ce4_8422_2325_u64;
        let mut i = 0;
        while i < numbers.len() {
            let bytes = numbers[i].to_bits().to_le_bytes();
            let mut j = 0;
            while j < bytes.len() {
                hash = (hash ^ bytes[j] as u64).wrapping_mul(0x0000_0100_0000_01b3);
                j += 1;
            }
            i += 1;
        }
        Self(hash)
    }

    /// Whether both are the same; for constants.
    pub const fn is(self, other: Self) -> bool {
        self.0 == other.0
    }
}

impl fmt::Display for FeatureDigest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:016x}", self.0)
    }
}

impl fmt::Debug for FeatureDigest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "FeatureDigest({self})")
    }
}

impl Serialize for FeatureDigest {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for FeatureDigest {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let text = String::deserialize(from)?;
        let is_hex = text.len() == 16 && text.bytes().all(|b| b.is_ascii_hexdigit());
        let number = u64::from_str_radix(&text, 16).ok().filter(|_| is_hex);
        number.map(Self).ok_or_else(|| D::Error::custom(format!("`{text}` is not 16 hexadecimal digits")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    /// A number that the list leaves out could change under the weights unseen.
    #[test]
    fn every_constant_is_part_of_the_digest() {
        let source = include_str!("feature_constants.rs");
        let (head, rest) = source.split_once("const NUMBERS").unwrap();
        let list = rest.split_once("];").unwrap().0;
        let names: BTreeSet<&str> = head
            .lines()
            .filter_map(|line| {
                line.trim_start_matches("pub(crate) ").trim_start_matches("pub ").strip_prefix("const ")
            })
            .filter_map(|line| line.split(':').next())
            .collect();
        assert!(names.len() > 40, "{names:?}");
        let listed = |name: &&&str| {
            list.lines().any(|line| line.trim().split(['.', '[', ',', ' ']).next() == Some(**name))
        };
        let left_out: Vec<_> = names.iter().filter(|name| !listed(name)).collect();
        assert!(left_out.is_empty(), "not in NUMBERS: {left_out:?}");
    }

    #[test]
    fn every_number_changes_the_digest() {
        for i in 0..NUMBERS.len() {
            let mut changed = NUMBERS;
            changed[i] += 0.5;
            assert_ne!(FeatureDigest::of(&changed), FeatureDigest::OF_THIS_PROGRAM, "{i}");
        }
    }

    #[test]
    fn a_digest_is_read_as_it_is_written() {
        let text = serde_json::to_string(&FeatureDigest(0xab)).unwrap();
        assert_eq!(text, "\"00000000000000ab\"");
        assert_eq!(serde_json::from_str::<FeatureDigest>(&text).unwrap(), FeatureDigest(0xab));
        for wrong in ["\"ab\"", "\"+0000000000000ab\"", "\"zz000000000000ab\"", "171"] {
            assert!(serde_json::from_str::<FeatureDigest>(wrong).is_err(), "{wrong}");
        }
    }
}
