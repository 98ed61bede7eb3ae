//! How the pattern of a floor was found (method 1.5), for pictures of it: the lines on the floor, their families, the
//! concentration at every period. The same arithmetic as in `floor_tiling`; the detector does not ask for it.

use crate::detect::{
    segments::edge_segments::EdgeSegment,
    tiling::{
        floor_tiling::{Family, patterned_floor},
        period::concentrations,
        tiling_params::TilingParams,
    },
};
use nalgebra::Point2;

/// The floor of an image with the lines on it. Lengths are those of [`TilingParams`].
#[derive(Debug, Clone, PartialEq)]
pub struct FloorPattern {
    /// Row of the horizon in the image.
    pub horizon_px: f64,
    /// The segments that may lie on the floor.
    pub lines: Vec<LineOnFloor>,
    /// At most two families of parallel lines.
    pub families: Vec<LineFamily>,
}

/// A segment on the floor.
#[derive(Debug, Clone, PartialEq)]
pub struct LineOnFloor {
    /// Index of the segment.
    pub segment: usize,
    /// Its ends, to the right and ahead of the camera's foot.
    pub ends: [Point2<f64>; 2],
}

/// Parallel lines on the floor.
#[derive(Debug, Clone, PartialEq)]
pub struct LineFamily {
    /// Their direction, from the camera's right.
    pub direction_rad: f64,
    /// Indices of the lines.
    pub members: Vec<usize>,
    /// Indices of the lines at even distances: those that are removed.
    pub pattern: Vec<usize>,
    /// Distance of neighbouring lines and offset of one of them, across the direction; none without a pattern.
    pub period_and_phase: Option<[f64; 2]>,
    /// Each period that was tried with its concentration, 0 to 1.
    pub concentrations: Vec<(f64, f64)>,
    /// Least concentration of a pattern.
    pub least_concentration: f64,
}

/// The floor with most of a pattern among those that the image may show, whether or not `p.remove` is on; none
/// without any pattern.
pub fn floor_pattern(
    segments: &[EdgeSegment],
    image_size: (usize, usize),
    p: &TilingParams,
) -> Option<FloorPattern> {
    let (floor, reading) = patterned_floor(segments, image_size, p)?;
    let family = |f: Family| {
        let (concentrations, least_concentration) = concentrations(&f.offsets, p);
        LineFamily {
            direction_rad: f.direction_rad,
            members: f.members,
            pattern: f.pattern,
            period_and_phase: f.lattice.map(|l| [l.period(), l.phase()]),
            concentrations,
            least_concentration,
        }
    };
    Some(FloorPattern {
        horizon_px: floor.horizon_px(),
        lines: reading.lines.iter().map(|l| LineOnFloor { segment: l.segment, ends: l.ends() }).collect(),
        families: reading.families.into_iter().map(family).collect(),
    })
}
