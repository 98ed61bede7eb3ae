//! A landmark's points and the homography in, the agreement of the patch with each of them out. No
//! keypoint is required in the patch: the descriptor is computed at the projected position.

use crate::{
    geometry::homography::Homography,
    points::{
        descriptor::{Descriptor, Window, describe},
        keypoints::{BASE_SIGMA, SCALES},
        point::{Point, SeenPatch},
    },
};
use fearless_simd::{Level, dispatch};
use nalgebra::Point2;
use serde::{Deserialize, Serialize};

/// Comparison of the patch with a landmark's point at its projected position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Check {
    /// Index of the landmark's point.
    pub taught: usize,
    /// Descriptor distance.
    pub distance: u32,
    /// Mean gradient of the patch there, in grey levels a pixel of the octave.
    pub gradient: f32,
    /// Share of other positions, in the patch and on the landmark, with a descriptor at least as
    /// similar, 0 to 1: the empirical probability of agreement by chance at this point.
    pub by_chance: f32,
    /// Distance of the landmark's point to the most similar plain structure.
    pub plain: u32,
}

/// Largest descriptor distance of an agreeing point...
const AGREEING: f32 = 90.0;
/// ... also as a share of the point's distance to plain structures: a frame must not count as a
/// picture...
const AGREEING_PLAIN: f32 = 0.7;
/// ... and nearer than all but this share of other places.
pub const AGREEING_BY_CHANCE: f32 = 0.05;
/// Below this gradient the patch has no texture that could agree or disagree.
const SILENT_GRADIENT: f32 = 0.5;
/// A point disagrees when this share of other positions is at least as similar.
const DISAGREEING_BY_CHANCE: f32 = 0.2;

impl Check {
    /// The patch agrees with the landmark here, beyond chance.
    pub fn agrees(&self) -> bool {
        let most = AGREEING.min(AGREEING_PLAIN * self.plain as f32);
        !self.is_silent() && self.distance as f32 <= most && self.by_chance <= AGREEING_BY_CHANCE
    }

    /// The patch has no texture here.
    pub fn is_silent(&self) -> bool {
        self.gradient < SILENT_GRADIENT
    }

    /// The patch has another texture here.
    pub fn disagrees(&self) -> bool {
        !self.is_silent() && self.by_chance >= DISAGREEING_BY_CHANCE
    }
}

/// Cells along a side of the table.
pub const TABLE: usize = 5;

/// Agreement of a part of the landmark.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Part {
    /// No statement: no points there, hidden by an untextured occluder, or outside the image.
    #[default]
    Silent,
    /// The picture is the taught one.
    Agrees,
    /// The picture shows something else.
    Disagrees,
}

/// Agreement of the parts of a landmark, rows from the top, in its own upright orientation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Agreement(pub [[Part; TABLE]; TABLE]);

/// Fewest points of a part that disagrees.
const MIN_DISAGREEING: usize = 2;

impl Agreement {
    /// Sums up `checks` of `taught`.
    pub fn new(checks: &[Check], taught: &[Point]) -> Self {
        let mut counts = [[[0_usize; 2]; TABLE]; TABLE];
        for check in checks {
            let [x, y] = taught[check.taught].at.map(|a| ((a * TABLE as f32) as usize).min(TABLE - 1));
            counts[y][x][0] += usize::from(check.agrees());
            counts[y][x][1] += usize::from(check.disagrees());
        }
        Self(counts.map(|row| {
            row.map(|[agreeing, disagreeing]| match (agreeing, disagreeing) {
                (0, d) if d >= MIN_DISAGREEING => Part::Disagrees,
                (a, d) if a > 0 && d <= 2 * a => Part::Agrees,
                (_, d) if d >= 2 * MIN_DISAGREEING => Part::Disagrees,
                _ => Part::Silent,
            })
        }))
    }

    /// Number of parts with the value `part`.
    pub fn count(&self, part: Part) -> usize {
        self.0.iter().flatten().filter(|p| **p == part).count()
    }

    /// Parts of the largest connected region that disagrees; parts are neighbours along rows and
    /// columns.
    pub fn largest_disagreement(&self) -> usize {
        let mut left = self.0.map(|row| row.map(|p| p == Part::Disagrees));
        let mut largest = 0;
        for start in 0..TABLE * TABLE {
            let mut open = vec![start];
            let mut size = 0;
            while let Some(i) = open.pop() {
                let (x, y) = (i % TABLE, i / TABLE);
                if !std::mem::take(&mut left[y][x]) {
                    continue;
                }
                size += 1;
                open.extend((x > 0).then(|| i - 1));
                open.extend((x + 1 < TABLE).then_some(i + 1));
                open.extend((y > 0).then(|| i - TABLE));
                open.extend((y + 1 < TABLE).then_some(i + TABLE));
            }
            largest = largest.max(size);
        }
        largest
    }
}

/// Compares every point of `taught` that the patch contains at its scale. `turned` quarters were
/// applied to the patch's points before `seen_from_taught` was found.
pub fn checks(
    seen: &SeenPatch,
    turned: usize,
    seen_from_taught: &Homography,
    taught: &[Point],
    plain: &[u32],
) -> Vec<Check> {
    let side = seen.patch.side as f32;
    let mut found = Vec::with_capacity(taught.len());
    let mut shown: Vec<Descriptor> = Vec::with_capacity(taught.len());
    for (index, point) in taught.iter().enumerate() {
        let at = Point2::new(f64::from(point.at[0]), f64::from(point.at[1]));
        if seen_from_taught.denominator(&at) <= 0.0 {
            continue;
        }
        let here = seen_from_taught.apply(&at);
        let scale = local_scale(seen_from_taught, &at);
        let sigma = point.sigma * scale as f32 * seen.patch.inner as f32;
        let Some((octave, level)) = level_of(seen, sigma) else { continue };
        let back = unturned([here.x, here.y], turned);
        let [x, y] = seen.patch.to_patch(back).map(|v| v as f32);
        let reach = REACH * sigma;
        if x < reach
            || y < reach
            || x > side - 1.0 - reach
            || y > side - 1.0 - reach
            || !seen.patch.is_seen(x, y, reach)
        {
            continue;
        }
        let (descriptor, gradient) = describe(&seen.space.octaves[octave], &Window { x, y, sigma, level });
        let descriptor = descriptor.rotated(turned);
        let distance = descriptor.distance(&point.descriptor);
        shown.push(descriptor);
        found.push(Check {
            taught: index,
            distance,
            gradient,
            by_chance: 1.0,
            plain: plain.get(index).copied().unwrap_or(0),
        });
    }
    dispatch!(Level::new(), _s => compare_elsewhere(&mut found, &shown, taught));
    found
}

/// Compares every point with every other position.
#[expect(
    clippy::inline_always,
    reason = "an instruction set holds only in what is inlined where it was chosen"
)]
#[inline(always)]
fn compare_elsewhere(found: &mut [Check], shown: &[Descriptor], taught: &[Point]) {
    for i in 0..found.len() {
        let (own, at) = (taught[found[i].taught], taught[found[i].taught].at);
        let (mut asked, mut as_similar) = (0_u32, 0_u32);
        for (j, descriptor) in shown.iter().enumerate() {
            let other = &taught[found[j].taught];
            if (other.at[0] - at[0]).abs() < ELSEWHERE && (other.at[1] - at[1]).abs() < ELSEWHERE {
                continue;
            }
            asked += 2;
            as_similar += u32::from(own.descriptor.distance(descriptor) <= found[i].distance);
            as_similar += u32::from(other.descriptor.distance(&shown[i]) <= found[i].distance);
        }
        if asked > 0 {
            found[i].by_chance = as_similar as f32 / asked as f32;
        }
    }
}

/// Positions further apart than this along an axis, in landmark units, count as different.
const ELSEWHERE: f32 = 0.1;

/// How far around a point the patch must reach, in its scales.
const REACH: f32 = 3.0;

/// Place in the patch's own landmark coordinates of one in those after `turned` quarters.
pub(crate) fn unturned([x, y]: [f64; 2], turned: usize) -> [f64; 2] {
    match turned % 4 {
        0 => [x, y],
        1 => [1.0 - y, x],
        2 => [1.0 - x, 1.0 - y],
        _ => [y, 1.0 - x],
    }
}

/// Square root of the determinant of the map's derivative.
fn local_scale(map: &Homography, at: &Point2<f64>) -> f64 {
    let d = map.denominator(at);
    (map.matrix().determinant() / (d * d * d)).abs().sqrt()
}

/// Octave and level whose smoothing is that of a keypoint of `sigma` patch pixels.
fn level_of(seen: &SeenPatch, sigma: f32) -> Option<(usize, usize)> {
    let steps = (SCALES as f32 * (sigma / BASE_SIGMA as f32).log2()).round() as i32;
    // Finer than the resolution of the patch.
    if steps < 0 {
        return None;
    }
    // Keypoints are found on levels 1 to SCALES of an octave.
    let steps = steps.max(1) as usize;
    let octave = (steps - 1) / SCALES;
    let level = steps - octave * SCALES;
    (octave < seen.space.octaves.len()).then_some((octave, level))
}
