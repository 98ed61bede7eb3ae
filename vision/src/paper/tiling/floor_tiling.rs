//! Removes the segments of a regularly patterned floor (method 1.5). Joints of tiles make corners
//! and parallels, hence quads that are no landmarks. They are evenly spaced on the floor; direction
//! alone does not tell, since posters and floors share vanishing points. In: segments, not the
//! image. Out: segments that stay and those removed.

use crate::{
    detect::segments::edge_segments::EdgeSegment,
    paper::tiling::{
        floor::{Floor, FloorLine},
        period::Lattice,
        tiling_params::TilingParams,
    },
};

/// Segments with the tiling set apart; both in the order they came in.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Untiled {
    /// What later stages work on.
    pub kept: Vec<EdgeSegment>,
    /// Lines of the floor's pattern.
    pub removed: Vec<EdgeSegment>,
}

/// Directions at least this far apart make two families when nothing says that they are square.
const MIN_FAMILY_GAP_DEG: f64 = 30.0;
/// Bins of the accumulator of directions.
const BIN_DEG: f64 = 2.0;

/// Sets the lines of regular patterns on the floor apart. Leaves everything in `kept` when
/// `p.remove` is off.
pub fn remove_floor_tiling(
    segments: Vec<EdgeSegment>,
    image_size: (usize, usize),
    p: &TilingParams,
) -> Untiled {
    let is_tiling = if p.remove { patterned_floor(&segments, image_size, p) } else { Vec::new() };
    let mut untiled = Untiled::default();
    for (i, segment) in segments.into_iter().enumerate() {
        let gone = is_tiling.get(i).copied().unwrap_or(false);
        if gone { &mut untiled.removed } else { &mut untiled.kept }.push(segment);
    }
    untiled
}

/// Of the floors that the image may show the one with most of a pattern, the first of equals: of
/// each segment, whether it is part of that. Empty without any.
fn patterned_floor(segments: &[EdgeSegment], image_size: (usize, usize), p: &TilingParams) -> Vec<bool> {
    let (mut best, mut most) = (Vec::new(), 0);
    for floor in Floor::possible(segments, image_size, p) {
        let is_tiling = patterned(&floor, segments, p);
        let count = is_tiling.iter().filter(|t| **t).count();
        if count > most {
            (most, best) = (count, is_tiling);
        }
    }
    best
}

/// Of each segment, whether it is part of a pattern of this floor.
fn patterned(floor: &Floor, segments: &[EdgeSegment], p: &TilingParams) -> Vec<bool> {
    let lines: Vec<FloorLine> =
        segments.iter().enumerate().filter_map(|(i, s)| floor.line(i, s, p)).collect();
    let mut is_tiling = vec![false; segments.len()];
    for direction_rad in families(&lines, floor.square()) {
        for line in evenly_spaced(&lines, direction_rad, p) {
            is_tiling[lines[line].segment] = true;
        }
    }
    is_tiling
}

/// Directions of the two families, [0, pi). On a floor of known scale they are at right angles;
/// otherwise the second is the strongest one well apart from the first.
fn families(lines: &[FloorLine], square: bool) -> Vec<f64> {
    if square {
        let first = peak(lines, 90, |_| true);
        return first
            .map_or(Vec::new(), |d| vec![d, (d + 90.0) % 180.0])
            .iter()
            .map(|d| d.to_radians())
            .collect();
    }
    let Some(first) = peak(lines, 180, |_| true) else { return Vec::new() };
    let apart = |d: f64| {
        let gap = (d - first).abs();
        gap.min(180.0 - gap) >= MIN_FAMILY_GAP_DEG
    };
    let second = peak(lines, 180, apart);
    std::iter::once(first).chain(second).map(f64::to_radians).collect()
}

/// Middle of the fullest bin of the accumulator of directions, degrees below `turn_deg`: lengths
/// add up, neighbouring bins count by half. The first of equals.
fn peak(lines: &[FloorLine], turn_deg: usize, allowed: impl Fn(f64) -> bool) -> Option<f64> {
    let bins = (turn_deg as f64 / BIN_DEG) as usize;
    let mut weights = vec![0.0; bins];
    for line in lines {
        let bin = (line.direction_rad.to_degrees() / BIN_DEG) as usize % bins;
        weights[bin] += line.length;
    }
    let smooth = |i: usize| weights[i] + 0.5 * (weights[(i + 1) % bins] + weights[(i + bins - 1) % bins]);
    let middle = |i: usize| (i as f64 + 0.5) * BIN_DEG;
    let candidates = (0..bins).filter(|i| allowed(middle(*i)) && smooth(*i) > 0.0);
    let best = candidates.fold(None, |best: Option<usize>, i| match best {
        Some(b) if smooth(b) >= smooth(i) => Some(b),
        _ => Some(i),
    });
    best.map(middle)
}

/// Indices of the evenly spaced lines along a direction that is known to within a bin of the
/// accumulator; empty unless there are enough.
fn evenly_spaced(lines: &[FloorLine], direction_rad: f64, p: &TilingParams) -> Vec<usize> {
    let off = |line: &FloorLine, from: f64| {
        let turn = (line.direction_rad - from).rem_euclid(std::f64::consts::PI);
        if turn > std::f64::consts::FRAC_PI_2 { turn - std::f64::consts::PI } else { turn }
    };
    let tolerance_rad = p.family_deg.to_radians();
    let members = |from: f64, reach_rad: f64| {
        (0..lines.len()).filter(move |i| off(&lines[*i], from).abs() <= reach_rad)
    };
    // The bin is coarse: the direction is the members' mean, from the members of that mean.
    let mut direction_rad = direction_rad;
    for _ in 0..3 {
        let reach = tolerance_rad + (0.5 * BIN_DEG).to_radians();
        let (mut turn, mut weight) = (0.0, 0.0);
        for line in members(direction_rad, reach).map(|i| &lines[i]) {
            turn += line.length * off(line, direction_rad);
            weight += line.length;
        }
        if weight <= 0.0 {
            return Vec::new();
        }
        direction_rad += turn / weight;
    }
    let members: Vec<usize> = members(direction_rad, tolerance_rad).collect();
    let offset = |i: &usize| (lines[*i].offset_along(direction_rad), lines[*i].length);
    let offsets: Vec<(f64, f64)> = members.iter().map(offset).collect();
    Lattice::find(&offsets, p).map_or_else(Vec::new, |lattice| pattern(&lattice, &members, &offsets, p))
}

/// The members at places of the lattice; empty unless they lie at enough different ones.
fn pattern(lattice: &Lattice, members: &[usize], offsets: &[(f64, f64)], p: &TilingParams) -> Vec<usize> {
    let fits = |offset: f64| lattice.residual(offset) < p.max_residual;
    let mut places: Vec<i64> = offsets.iter().filter(|o| fits(o.0)).map(|o| lattice.index(o.0)).collect();
    places.sort_unstable();
    places.dedup();
    if places.len() < p.min_lines {
        return Vec::new();
    }
    members.iter().zip(offsets).filter(|(_, o)| fits(o.0)).map(|(i, _)| *i).collect()
}

#[cfg(test)]
mod tests;
