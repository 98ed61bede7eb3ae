//! A quad in, its rectified square picture, the icon, out (method 4). Grey levels of the source are
//! averaged over each icon cell. The corner order defines the orientation.

use crate::{
    frame::GrayImage,
    geometry::{corners::Corners, homography::Homography, interpolate::cell},
};
use nalgebra::Point2;
use serde::{Deserialize, Serialize};

/// Smallest icon side, in pixels.
pub const MIN_ICON_SIZE: usize = 20;
/// Largest icon side, in pixels.
pub const MAX_ICON_SIZE: usize = 200;

/// A landmark's appearance, rectified to a square of `size` x `size` grey levels, upright as the
/// corners say.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "UncheckedIcon")]
pub struct Icon {
    /// Side in icon pixels.
    pub size: usize,
    /// Row-major grey levels in [0, 255]; row 0 is the top.
    pub pixels: Vec<f32>,
    /// Mean number of source pixels along an icon pixel's side; below 1 the icon is magnified.
    pub source_scale: f64,
}

/// Parameters of this stage.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct IconParams {
    /// Icon side S in pixels, [`MIN_ICON_SIZE`] to [`MAX_ICON_SIZE`].
    pub size: usize,
    /// A quad whose shortest side is below this share of S is refused.
    pub min_side_ratio: f64,
    /// Largest share of icon cells that may lie outside the image.
    pub max_outside: f64,
    /// A cell that holds fewer pixel centres than this is sampled bilinearly instead of averaged.
    pub min_cell_pixels: u32,
}

impl Default for IconParams {
    fn default() -> Self {
        Self { size: 75, min_side_ratio: 0.5, max_outside: 0.02, min_cell_pixels: 4 }
    }
}

/// Why a quad has no icon.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum IconError {
    /// The setting `size` is out of range.
    #[error("icon size {size} is outside {MIN_ICON_SIZE} to {MAX_ICON_SIZE} px")]
    Size {
        /// The setting.
        size: usize,
    },
    /// A grey level is not in [0, 255], their number is not size x size, or the scale is not
    /// positive and finite.
    #[error("icon field {field} is malformed")]
    Malformed {
        /// Name of the field.
        field: &'static str,
    },
    /// Too far away or too oblique to compare.
    #[error("shortest side is {min_side_px:.1} px, {required_px:.1} px needed")]
    TooSmall {
        /// Shortest side of the quad.
        min_side_px: f64,
        /// Side required by the parameters.
        required_px: f64,
    },
    /// Too much of the quad lies outside the image.
    #[error("{share:.3} of the quad lies outside the image")]
    Outside {
        /// Share of icon cells outside.
        share: f64,
    },
    /// The corners are too nearly collinear for a homography.
    #[error("corners are degenerate")]
    Degenerate,
}

/// A deserialised icon before its fields are checked.
#[derive(Deserialize)]
struct UncheckedIcon {
    size: usize,
    pixels: Vec<f32>,
    source_scale: f64,
}

impl TryFrom<UncheckedIcon> for Icon {
    type Error = IconError;
    fn try_from(icon: UncheckedIcon) -> Result<Self, IconError> {
        Self::new(icon.size, icon.pixels, icon.source_scale)
    }
}

impl Icon {
    /// Checks an icon from external data: `pixels` row-major, `size * size` grey levels in [0,
    /// 255].
    pub fn new(size: usize, pixels: Vec<f32>, source_scale: f64) -> Result<Self, IconError> {
        if !(MIN_ICON_SIZE..=MAX_ICON_SIZE).contains(&size) {
            return Err(IconError::Size { size });
        }
        if pixels.len() != size * size || pixels.iter().any(|g| !(0.0..=255.0).contains(g)) {
            return Err(IconError::Malformed { field: "pixels" });
        }
        if !(source_scale.is_finite() && source_scale > 0.0) {
            return Err(IconError::Malformed { field: "source_scale" });
        }
        Ok(Self { size, pixels, source_scale })
    }

    /// The icon that `corners.rotated(shift)` would give: a turn by `shift` quarters,
    /// counter-clockwise.
    #[must_use]
    pub fn rotated(&self, shift: usize) -> Self {
        let last = self.size.saturating_sub(1);
        let mut pixels = Vec::with_capacity(self.pixels.len());
        for b in 0..self.size {
            for a in 0..self.size {
                let (column, row) = match shift % 4 {
                    0 => (a, b),
                    1 => (last - b, a),
                    2 => (last - a, last - b),
                    _ => (b, last - a),
                };
                pixels.push(self.pixels[row * self.size + column]);
            }
        }
        Self { size: self.size, pixels, source_scale: self.source_scale }
    }
}

/// Rectifies what `corners_px` enclose.
pub fn icon(image: &GrayImage, corners_px: &Corners, p: &IconParams) -> Result<Icon, IconError> {
    if !(MIN_ICON_SIZE..=MAX_ICON_SIZE).contains(&p.size) {
        return Err(IconError::Size { size: p.size });
    }
    let required_px = p.min_side_ratio * p.size as f64;
    let min_side_px = corners_px.min_side_px();
    if min_side_px < required_px {
        return Err(IconError::TooSmall { min_side_px, required_px });
    }
    rectify(image, corners_px, p)
}

/// [`icon`] without the test on the size of the quad.
pub(crate) fn rectify(image: &GrayImage, corners_px: &Corners, p: &IconParams) -> Result<Icon, IconError> {
    let image_from_icon =
        Homography::square_to_quad(p.size, corners_px).map_err(|_degenerate| IconError::Degenerate)?;
    let outside = outside_cells(image, &image_from_icon, p.size) as f64 / (p.size * p.size) as f64;
    if outside > p.max_outside {
        return Err(IconError::Outside { share: outside });
    }
    let (mut pixels, counts) = cell_sums(image, corners_px, &image_from_icon, p.size)?;
    let least = p.min_cell_pixels.max(1);
    let mut sampled = vec![0.0; p.size];
    for (row, (line, counts)) in (0..).zip(pixels.chunks_exact_mut(p.size).zip(counts.chunks_exact(p.size))) {
        if counts.iter().any(|c| *c < least) {
            sample_row(image, &image_from_icon, 0, row, SAMPLES, &mut sampled);
        }
        for ((grey, count), sample) in line.iter_mut().zip(counts).zip(&sampled) {
            *grey = if *count >= least { *grey / *count as f32 } else { *sample };
        }
    }
    let source_scale = corners_px.area_px2().sqrt() / p.size as f64;
    Ok(Icon { size: p.size, pixels, source_scale })
}

/// Cells whose centre falls outside the image domain.
fn outside_cells(image: &GrayImage, image_from_icon: &Homography, size: usize) -> usize {
    let (width, height) = (image.width() as f64, image.height() as f64);
    let inside = |p: Point2<f64>| p.x >= -0.5 && p.y >= -0.5 && p.x <= width - 0.5 && p.y <= height - 0.5;
    let corners = [(0, 0), (size - 1, 0), (0, size - 1), (size - 1, size - 1)];
    // The image is convex, and so is the quad: with all four corner cells inside, so is every cell.
    if corners.iter().all(|(a, b)| inside(image_from_icon.apply(&Point2::new(*a as f64, *b as f64)))) {
        return 0;
    }
    (0..size * size)
        .filter(|i| !inside(image_from_icon.apply(&Point2::new((i % size) as f64, (i / size) as f64))))
        .count()
}

/// Sum and number of the pixels whose centres lie in each cell. A pixel centre lies in the
/// quadrilateral that a cell maps to exactly when the inverse map takes it into the cell.
fn cell_sums(
    image: &GrayImage,
    corners_px: &Corners,
    image_from_icon: &Homography,
    size: usize,
) -> Result<(Vec<f32>, Vec<u32>), IconError> {
    let icon_from_image = image_from_icon.inverse().map_err(|_degenerate| IconError::Degenerate)?;
    let h = icon_from_image.matrix();
    let mut sums = vec![0.0_f32; size * size];
    let mut counts = vec![0_u32; size * size];
    let points = corners_px.points();
    let top = points.iter().map(|p| p.y).fold(f64::INFINITY, f64::min).ceil().max(0.0);
    let bottom = points.iter().map(|p| p.y).fold(f64::NEG_INFINITY, f64::max).floor();
    let bottom = bottom.min((image.height() - 1) as f64);
    let mut row = top;
    while row <= bottom {
        if let Some((from, to)) = row_span(points, row, image.width()) {
            let start =
                [h[(0, 1)] * row + h[(0, 2)], h[(1, 1)] * row + h[(1, 2)], h[(2, 1)] * row + h[(2, 2)]];
            for u in from..=to {
                let x = u as f64;
                let scale = 1.0 / (h[(2, 0)] * x + start[2]);
                let a = (h[(0, 0)] * x + start[0]) * scale + 0.5;
                let b = (h[(1, 0)] * x + start[1]) * scale + 0.5;
                if a >= 0.0 && b >= 0.0 && a < size as f64 && b < size as f64 {
                    let cell = b as usize * size + a as usize;
                    sums[cell] += f32::from(image.at(u, row as usize));
                    counts[cell] += 1;
                }
            }
        }
        row += 1.0;
    }
    Ok((sums, counts))
}

/// First and last pixel column of the quad on image row `v`, clamped to the image.
fn row_span(points: &[Point2<f64>; 4], v: f64, width: usize) -> Option<(usize, usize)> {
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for i in 0..4 {
        let (p, q) = (points[i], points[(i + 1) % 4]);
        if (p.y <= v) == (q.y <= v) && (p.y - v).abs() > 0.0 && (q.y - v).abs() > 0.0 {
            continue;
        }
        let t = if (q.y - p.y).abs() > 0.0 { ((v - p.y) / (q.y - p.y)).clamp(0.0, 1.0) } else { 0.0 };
        let u = p.x + t * (q.x - p.x);
        low = low.min(u);
        high = high.max(u);
    }
    // One column more on both sides: the inverse map, not this, decides which pixels belong to the
    // quad.
    let low = (low.floor() - 1.0).max(0.0);
    let high = (high.ceil() + 1.0).min((width - 1) as f64);
    (low <= high).then_some((low as usize, high as usize))
}

/// Bilinear samples along each axis of a cell that is not averaged.
///
/// Departs from method 4: it takes one sample, and only in cells without any pixel centre. Between
/// one and two source pixels a cell, averaging the one or two centres that happen to fall in is
/// noisier than sampling.
const SAMPLES: usize = 2;
/// Width that a bilinear sample covers, in pixels: its kernel reaches one pixel to either side.
const SAMPLE_PX: f64 = 1.5;
/// Most samples along each axis of a cell.
const MAX_SAMPLES: usize = 4;

/// Grey levels of cells `first`, `first + 1`, ... of `row`, by samples spread over each: as many
/// along each axis as leave one for every [`SAMPLE_PX`] of the image's pixels, up to four. For the
/// surroundings of an icon.
pub(crate) fn sample_cells(
    image: &GrayImage,
    image_from_cell: &Homography,
    first: i32,
    row: i32,
    pixels_per_cell: f64,
    cells: &mut [f32],
) {
    sample_row(image, image_from_cell, first, row, samples_for(pixels_per_cell, SAMPLE_PX), cells);
}

/// Samples along each axis of a cell of so many of the image's pixels, one for every `sample_px`,
/// at most [`MAX_SAMPLES`].
pub(crate) fn samples_for(pixels_per_cell: f64, sample_px: f64) -> usize {
    ((pixels_per_cell / sample_px).ceil() as usize).clamp(1, MAX_SAMPLES)
}

/// The same with `samples` along each axis.
pub(crate) fn sample_row(
    image: &GrayImage,
    image_from_cell: &Homography,
    first: i32,
    row: i32,
    samples: usize,
    cells: &mut [f32],
) {
    fearless_simd::dispatch!(fearless_simd::Level::new(), _s => {
        sampled(image, image_from_cell, [first, row], samples, cells);
    });
}

/// Cells computed at a time, vectorised.
const ABREAST: usize = 16;

#[expect(
    clippy::inline_always,
    reason = "an instruction set holds only in what is inlined where it was chosen"
)]
#[inline(always)]
fn sampled(image: &GrayImage, map: &Homography, [first, row]: [i32; 2], samples: usize, cells: &mut [f32]) {
    let m = map.matrix();
    let (width, data) = (image.width(), image.data());
    let last = [width - 1, image.height() - 1];
    let spread = |i: usize| (i as f64 + 0.5) / samples as f64 - 0.5;
    let share = 1.0 / (samples * samples) as f32;
    for (start, cells) in (0..).step_by(ABREAST).zip(cells.chunks_mut(ABREAST)) {
        let mut sums = [0.0_f32; ABREAST];
        for i in 0..samples * samples {
            let y = f64::from(row) + spread(i / samples);
            let x = f64::from(first + start) + spread(i % samples);
            let line = [0, 1, 2].map(|r| m[(r, 0)] * x + m[(r, 1)] * y + m[(r, 2)]);
            let (mut at, mut right, mut down) = ([0_u32; ABREAST], [0_u32; ABREAST], [0_u32; ABREAST]);
            let (mut du, mut dv) = ([0.0_f32; ABREAST], [0.0_f32; ABREAST]);
            for k in 0..ABREAST {
                let step = k as f64;
                let scale = 1.0 / (line[2] + step * m[(2, 0)]);
                let u = (((line[0] + step * m[(0, 0)]) * scale) as f32).clamp(0.0, last[0] as f32);
                let v = (((line[1] + step * m[(1, 0)]) * scale) as f32).clamp(0.0, last[1] as f32);
                let ((column, left), (row, above)) = (cell(u), cell(v));
                at[k] = row * width as u32 + column;
                right[k] = u32::from(column < last[0] as u32);
                down[k] = if row < last[1] as u32 { width as u32 } else { 0 };
                (du[k], dv[k]) = (u - left, v - above);
            }
            for k in 0..ABREAST {
                let grey = |at: u32| f32::from(data[at as usize]);
                let (above, below) = (at[k], at[k] + down[k]);
                let top = grey(above) + du[k] * (grey(above + right[k]) - grey(above));
                let bottom = grey(below) + du[k] * (grey(below + right[k]) - grey(below));
                sums[k] += top + dv[k] * (bottom - top);
            }
        }
        for (cell, sum) in cells.iter_mut().zip(sums) {
            *cell = sum * share;
        }
    }
}

#[cfg(test)]
mod tests;
