//! The lines beside the sides of a quad in, 28 features of each out: of the band beside the line,
//! and of the two corners that it makes with the neighbouring sides.

use crate::detect::{
    border_model::{
        feature_constants::{
            BEYOND_PX, BLUR_OFFSET, BLUR_PX, BROAD_STRIP, CORNER_GAP_PX, DIFFERENCE_SCALE, GREY_OFFSET,
            INWARD_SECTION, LINES_SCALE, MIN_SHADOW_PX, MIN_STEP, MIN_STRIP_PIXELS, MIN_USUAL_STEP,
            NEAR_STRIP_PX, OTHER_LINE_PX, OUTWARD_PX, ROUGH_STRIP_PX, SECTION_SAMPLES, SHADOW_RATIO,
            SHADOW_WALL_PX, STEP_OFFSET, STEP_SHARE, USUAL_SAMPLES, USUAL_SHARES, WALL_STRIP,
        },
        side_band::{AlongLine, Band},
        side_lines::SideLine,
    },
    edge_support::{fixed_point::Fixed, gradients::Gradients},
};
use nalgebra::{Point2, Vector2};

/// Features of a line from its band alone.
pub(crate) const BAND_FEATURES: usize = 20;
/// Features of the two corners it makes.
pub(crate) const CORNER_FEATURES: usize = 8;
/// Number of features of a line.
pub const SIDE_FEATURES: usize = BAND_FEATURES + CORNER_FEATURES;
/// Features of the line of a side.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct SideMeasurement {
    /// Of the band beside the line, then of its two corners: see `Sides::band_features` and
    /// `Sides::corner_features`.
    pub features: [f64; SIDE_FEATURES],
    /// Tones, compared between the sides only.
    pub tones: LogGreyLevels,
}

/// Tones beside a line: logs of grey levels, 8 added.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct LogGreyLevels {
    /// Further outside, on the wall.
    pub wall: f64,
    /// Just outside.
    pub outside: f64,
    /// Just inside.
    pub inside: f64,
    /// Log of the step in grey levels, 2 added, positive where it is brighter outside; times the
    /// agreement of its signs.
    pub step: f64,
}

pub(crate) fn joined(band: &[f64; BAND_FEATURES], corners: &[f64; CORNER_FEATURES]) -> [f64; SIDE_FEATURES] {
    let mut features = [0.0; SIDE_FEATURES];
    features[..BAND_FEATURES].copy_from_slice(band);
    features[BAND_FEATURES..].copy_from_slice(corners);
    features
}

/// The ends of the line chosen for each side.
pub(crate) type Ends = [[Point2<f64>; 2]; 4];
/// The sides that each side meets, the one before it and the one after it, with their mean steps.
pub(crate) type CornerNeighbours = [[Option<Neighbour>; 2]; 4];

/// A side relative to one that it meets.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Neighbour {
    ends: [Point2<f64>; 2],
    along: Vector2<f64>,
    /// Mean step over most of its length, away from the corner.
    usual: f64,
}

/// A quad's sides with the bands around them.
pub(crate) struct Sides<'a> {
    g: &'a Gradients<'a>,
    corners: [Point2<f64>; 4],
    extent_px: [f64; 4],
    bands: [Option<Band>; 4],
}

impl<'a> Sides<'a> {
    pub(crate) fn new(g: &'a Gradients<'a>, corners: &[Point2<f64>; 4]) -> Self {
        let length = |i: usize| (corners[(i + 1) % 4] - corners[i % 4]).norm();
        let extent_px: [f64; 4] = std::array::from_fn(|i| length(i + 1).min(length(i + 3)));
        let bands = std::array::from_fn(|i| Band::new(g, &corners[i], &corners[(i + 1) % 4], extent_px[i]));
        Self { g, corners: *corners, extent_px, bands }
    }

    pub(crate) fn lines(&self, side: usize) -> &[SideLine] {
        self.bands[side].as_ref().map_or(&[], |b| &b.lines)
    }

    pub(crate) fn line_ends(&self, side: usize, line: usize) -> [Point2<f64>; 2] {
        match &self.bands[side] {
            Some(band) => band.ends(&band.lines[line]),
            None => [self.corners[side], self.corners[(side + 1) % 4]],
        }
    }

    /// The line nearest to the side itself.
    pub(crate) fn nearest(&self, side: usize) -> Option<usize> {
        let lines = self.lines(side);
        let far = |l: &SideLine| l.offset_px.abs() + l.slope_px.abs();
        (0..lines.len()).min_by(|a, b| far(&lines[*a]).total_cmp(&far(&lines[*b])).then(a.cmp(b)))
    }

    /// The chosen lines; a side without one stays.
    pub(crate) fn ends(&self, chosen: &[Option<usize>; 4]) -> Ends {
        std::array::from_fn(|i| match chosen[i] {
            Some(line) => self.line_ends(i, line),
            None => [self.corners[i], self.corners[(i + 1) % 4]],
        })
    }

    /// What each side meets when these lines are chosen. `earlier`: what they met before, and the
    /// sides whose line is another since.
    pub(crate) fn met(
        &self,
        chosen: &[Option<usize>; 4],
        earlier: Option<(&CornerNeighbours, &[bool; 4])>,
    ) -> CornerNeighbours {
        let ends = self.ends(chosen);
        let neighbour = |ends: [Point2<f64>; 2], shares: [f64; 2]| {
            let along = (ends[1] - ends[0]).try_normalize(1e-9)?;
            let [p, q] = shares.map(|share| ends[0] + (ends[1] - ends[0]) * share);
            Some(Neighbour { ends, along, usual: step_along(self.g, &p, &q, USUAL_SAMPLES).0 })
        };
        std::array::from_fn(|i| {
            std::array::from_fn(|which| {
                let side = (i + [3, 1][which]) % 4;
                match earlier {
                    Some((met, changed)) if !changed[side] => met[i][which],
                    _ => neighbour(ends[side], USUAL_SHARES[which]),
                }
            })
        })
    }

    /// 0 support, 1 agreement of the signs of its steps, 2 log of the step; roughness of the strips
    /// beside it: 3 just outside, 4 further outside, 5 and 6 the same inside; log ratio of grey
    /// just outside to the wall further out, 7 signed and 8 absolute, 9 and 10 the same of just
    /// inside; 11 log of blur; 12 weight of the heaviest line further out and 13 further in, 14
    /// largest support further out, 15 number of lines further out; share of samples with an edge
    /// further out, 16 weak and 17 stronger; 18 how much the strip to the next line inside looks
    /// like a shadow on the wall, 19 the strip from the next line outside.
    pub(crate) fn band_features(&self, side: usize, line: usize) -> ([f64; BAND_FEATURES], LogGreyLevels) {
        let Some(band) = &self.bands[side] else { return ([0.0; BAND_FEATURES], LogGreyLevels::default()) };
        let (c, extent) = (band.lines[line], self.extent_px[side]);
        let broad = BROAD_STRIP.of(extent);
        let along = band.along_line(&c);
        let rough = |range| roughness(&along, range);
        let (near, far) = NEAR_STRIP_PX;
        let inside = level(&along, (-far, -near));
        let outside = level(&along, NEAR_STRIP_PX).or(inside).unwrap_or(0.0);
        let wall = level(&along, (WALL_STRIP.0.of(extent), WALL_STRIP.1.of(extent))).unwrap_or(outside);
        let inside = inside.unwrap_or(outside);
        let darker = |grey: f64| ((grey + GREY_OFFSET) / (wall + GREY_OFFSET)).ln();
        let (out_ratio, in_ratio) = (darker(outside), darker(inside));
        let outer = || band.lines.iter().filter(|l| l.offset_px > c.offset_px + OTHER_LINE_PX);
        let inner = || band.lines.iter().filter(|l| l.offset_px < c.offset_px - OTHER_LINE_PX);
        let weight = |l: &SideLine| l.support * (l.step + STEP_OFFSET).ln();
        let most = |a: f64, b: f64| a.max(b);
        let next_in = inner().max_by(|a, b| a.offset_px.total_cmp(&b.offset_px));
        let next_out = outer().min_by(|a, b| a.offset_px.total_cmp(&b.offset_px));
        let [weak, stronger] = along.edges_outside(BEYOND_PX);
        let log = |grey: f64| (grey + GREY_OFFSET).ln();
        let tones = LogGreyLevels {
            wall: log(wall),
            outside: log(outside),
            inside: log(inside),
            step: c.sign * (c.step + STEP_OFFSET).ln(),
        };
        let features = [
            c.support,
            c.sign.abs(),
            (c.step + STEP_OFFSET).ln(),
            rough(ROUGH_STRIP_PX),
            rough((BEYOND_PX, broad)),
            rough((-ROUGH_STRIP_PX.1, -ROUGH_STRIP_PX.0)),
            rough((-broad, -BEYOND_PX)),
            out_ratio,
            out_ratio.abs(),
            in_ratio,
            in_ratio.abs(),
            blur(&along),
            outer().map(weight).fold(0.0, most),
            inner().map(weight).fold(0.0, most),
            outer().map(|l| l.support).fold(0.0, most),
            outer().count() as f64 / LINES_SCALE,
            weak,
            stronger,
            next_in.map_or(0.0, |i| shadow(&along, c.offset_px - i.offset_px)),
            next_out.map_or(0.0, |o| shadow(&band.along_line(o), o.offset_px - c.offset_px)),
        ];
        (features, tones)
    }

    /// Steps of the two neighbouring sides at the corners with a line, as a share of their steps
    /// along their own length: at the border of an object they exist just before the corner and not
    /// just after. Of the two: 0 smallest and 1 mean step inwards, 2 smallest support inwards, 3
    /// largest step outwards, 4 largest and 5 mean support outwards, 6 largest difference of the
    /// inward step from the side's own, 7 mean step outwards.
    pub(crate) fn corner_features(
        &self,
        side: usize,
        line: usize,
        met: &[Option<Neighbour>; 2],
    ) -> [f64; CORNER_FEATURES] {
        let own = self.line_ends(side, line);
        let section = INWARD_SECTION.of(self.extent_px[side]);
        let at_corner = |neighbour: &Option<Neighbour>, before: bool| {
            let Neighbour { ends, along, usual } = (*neighbour)?;
            let corner = meet(&own, &ends)?;
            // Along the neighbour away from the corner, into the quad, in the direction of its
            // side.
            let between = |a: f64, b: f64| {
                let (p, q) = if before { (-b, -a) } else { (a, b) };
                step_along(
                    self.g,
                    &(corner + along * p.min(q)),
                    &(corner + along * p.max(q)),
                    SECTION_SAMPLES,
                )
            };
            let share = |step: f64| {
                let usual = if usual.abs() > MIN_USUAL_STEP { usual } else { MIN_USUAL_STEP.copysign(usual) };
                (step / usual).clamp(STEP_SHARE.0, STEP_SHARE.1)
            };
            let (inner, outer) = (between(CORNER_GAP_PX, section), between(-CORNER_GAP_PX, -OUTWARD_PX));
            Some([
                share(inner.0),
                inner.1,
                share(outer.0),
                outer.1,
                (inner.0 - usual).abs() / DIFFERENCE_SCALE,
            ])
        };
        let [Some(a), Some(b)] = [at_corner(&met[0], true), at_corner(&met[1], false)] else {
            return [0.0; CORNER_FEATURES];
        };
        [
            a[0].min(b[0]),
            f64::midpoint(a[0], b[0]),
            a[1].min(b[1]),
            a[2].max(b[2]),
            a[3].max(b[3]),
            f64::midpoint(a[3], b[3]),
            a[4].max(b[4]),
            f64::midpoint(a[2], b[2]),
        ]
    }
}

/// Share of a strip that is textured.
fn roughness(along: &AlongLine, range_px: (f64, f64)) -> f64 {
    let (in_image, rough) = along.rough(range_px);
    if in_image > MIN_STRIP_PIXELS { rough as f64 / in_image as f64 } else { 0.0 }
}

/// Median grey level of a strip.
fn level(along: &AlongLine, range_px: (f64, f64)) -> Option<f64> {
    /// Grey levels that are passed over together.
    const TOGETHER: usize = 16;
    // Two counts of each level: a pixel is mostly as grey as the one before it, and would wait for
    // its count.
    let mut counts = [[0_u16; 256]; 2];
    let in_image = along.levels(range_px, |levels| {
        for (i, level) in levels.iter().enumerate() {
            counts[i % 2][usize::from(*level)] += 1;
        }
    });
    if in_image <= MIN_STRIP_PIXELS {
        return None;
    }
    let mut left = in_image as u32 / 2;
    let count = |level: usize| u32::from(counts[0][level]) + u32::from(counts[1][level]);
    let mut first = 0;
    while first < 256 - TOGETHER {
        let together: u32 = (first..first + TOGETHER).map(count).sum();
        if together > left {
            break;
        }
        (first, left) = (first + TOGETHER, left - together);
    }
    (first..256)
        .find(|level| {
            let n = count(*level);
            let found = n > left;
            left -= n.min(left);
            found
        })
        .map(|level| level as f64)
}

/// Log of the step 2 px beside the line over the step on it: high for a soft edge.
fn blur(along: &AlongLine) -> f64 {
    let mean = |range| {
        let mut sum = 0.0;
        let in_image = along.steps(range, |steps| steps.iter().for_each(|s| sum += f64::from(s.abs())));
        if in_image > 0 { sum / in_image as f64 } else { 0.0 }
    };
    let [on, from, to] = BLUR_PX;
    let beside = mean((from, to)) + mean((-to, -from));
    ((beside + BLUR_OFFSET) / (mean((-on, on)) + BLUR_OFFSET)).ln()
}

/// How much the strip of some width inside a line looks like a shadow on the wall outside: uniform,
/// at about 0.6 of its grey level.
fn shadow(along: &AlongLine, width_px: f64) -> f64 {
    if width_px < MIN_SHADOW_PX {
        return 0.0;
    }
    let between = (SHADOW_WALL_PX.0 - width_px, -SHADOW_WALL_PX.0);
    let (Some(within), Some(wall)) = (level(along, between), level(along, SHADOW_WALL_PX)) else {
        return 0.0;
    };
    let ratio = within / (wall + 1.0);
    let (usual, spread) = SHADOW_RATIO;
    (1.0 - roughness(along, between)) * (1.0 - (ratio - usual).abs() / spread).max(0.0)
}

/// Mean signed step across the line from `p` to `q`, the strongest within a pixel that follows it,
/// and the share of samples that have one. Samples outside the image count 0.
fn step_along(g: &Gradients, p: &Point2<f64>, q: &Point2<f64>, samples: usize) -> (f64, f64) {
    let Some(along) = (q - p).try_normalize(1e-6) else { return (0.0, 0.0) };
    let across = Vector2::new(along.y, -along.x);
    let normal = across.cast().into();
    let stride = (q - p) / samples as f64;
    let (start, stride, across) =
        (Fixed::point(&(p + stride * 0.5)), Fixed::step(&stride), Fixed::step(&across));
    let (mut sum, mut with) = (0.0, 0_usize);
    for i in 0..samples as i64 {
        let foot = start.on(stride, i);
        let mut best = 0.0_f32;
        for offset in [-1, 0, 1] {
            let step = g.step_following(foot.on(across, offset), normal).unwrap_or(0.0);
            if step.abs() > best.abs() {
                best = step;
            }
        }
        sum += f64::from(best);
        with += usize::from(best.abs() > MIN_STEP);
    }
    (sum / samples as f64, with as f64 / samples as f64)
}

fn meet(a: &[Point2<f64>; 2], b: &[Point2<f64>; 2]) -> Option<Point2<f64>> {
    let (along_a, along_b) = (a[1] - a[0], b[1] - b[0]);
    let determinant = along_a.perp(&along_b);
    if determinant.abs() < 1e-6 {
        return None;
    }
    Some(a[0] + along_a * ((b[0] - a[0]).perp(&along_b) / determinant))
}

pub(crate) fn meet_all(ends: &Ends) -> Option<[Point2<f64>; 4]> {
    let mut corners = [Point2::origin(); 4];
    for i in 0..4 {
        corners[i] = meet(&ends[(i + 3) % 4], &ends[i])?;
    }
    Some(corners)
}

#[cfg(test)]
mod tests;
