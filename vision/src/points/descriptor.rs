//! A keypoint and the smoothed pictures in, its descriptor out: upright histograms of gradients, 4 x 4 cells of 8
//! directions, kept as 2 bits a value.
//!
//! Each value of the histogram is compared with two thresholds and stored as the two answers, so that the Hamming
//! distance of two descriptors is the L1 distance of their values on three levels.

use super::keypoints::Octave;
use fearless_simd::{Level, dispatch};
use std::sync::LazyLock;

/// Cells along a side.
const CELLS: usize = 4;
/// Directions of a cell.
const DIRECTIONS: usize = 8;
/// Values of a histogram.
pub const VALUES: usize = CELLS * CELLS * DIRECTIONS;
/// 64-bit words of a descriptor.
pub const WORDS: usize = 2 * VALUES / 64;
/// 64-bit words of the first bits.
const HALF_WORDS: usize = WORDS / 2;
/// Largest distance of two descriptors.
pub const MAX_DISTANCE: u32 = 2 * VALUES as u32;
/// Side of a cell, in scales of the keypoint.
const CELL_SIGMAS: f32 = 3.0;
/// Samples along a side of the window of `CELLS + 1` cells.
const SAMPLES: usize = 20;
/// Values of a unit histogram above which its bits are set.
const THRESHOLDS: [f32; 2] = [0.055, 0.12];
/// A value of the histogram before square roots is at most this share of its norm.
const CLIP: f32 = 0.2;

/// The picture round a keypoint: two bits for each of the 128 values, all first bits before all second ones.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Descriptor(pub [u64; WORDS]);

impl Descriptor {
    /// Hamming distance, 0 to [`MAX_DISTANCE`].
    #[inline]
    pub fn distance(&self, other: &Self) -> u32 {
        self.0.iter().zip(&other.0).map(|(a, b)| (a ^ b).count_ones()).sum()
    }

    /// The descriptor after the patch was turned counter-clockwise by `shift` quarters: what
    /// [`Icon::rotated`](crate::icon::Icon::rotated) would give.
    #[must_use]
    pub fn rotated(&self, shift: usize) -> Self {
        let shift = shift % 4;
        if shift == 0 {
            return *self;
        }
        let last = CELLS - 1;
        let mut out = [0; WORDS];
        for half in 0..2 {
            // A cell is one byte, its directions the bits.
            let cells = &self.0[half * HALF_WORDS..][..HALF_WORDS];
            for cell in 0..CELLS * CELLS {
                let (column, row) = (cell % CELLS, cell / CELLS);
                // Where the cell goes to: the inverse of where each comes from.
                let (column, row) = match shift {
                    1 => (row, last - column),
                    2 => (last - column, last - row),
                    _ => (last - row, column),
                };
                let to = row * CELLS + column;
                let byte = (cells[cell / 8] >> (8 * (cell % 8))) as u8;
                let turned = byte.rotate_right((shift * DIRECTIONS / 4) as u32);
                out[half * HALF_WORDS + to / 8] |= u64::from(turned) << (8 * (to % 8));
            }
        }
        Self(out)
    }
}

/// Where a descriptor is taken from.
#[derive(Debug, Clone, Copy)]
pub struct Window {
    /// Centre in patch pixels.
    pub x: f32,
    /// See `x`.
    pub y: f32,
    /// Scale in patch pixels.
    pub sigma: f32,
    /// Which of the octave's pictures.
    pub level: usize,
}

/// The descriptor of `window` on its octave, and the mean gradient there, in grey levels a pixel of the octave.
pub fn describe(octave: &Octave, window: &Window) -> (Descriptor, f32) {
    let line = &*LINE;
    dispatch!(Level::new(), _s => {
        let (values, gradient) = histogram(octave, window, line);
        (quantised(&values), gradient)
    })
}

/// One row of cells, with a cell of padding at both ends.
type Row = [[f32; DIRECTIONS]; CELLS + 2];

/// A line of samples, the same for rows and columns and for every window: where each lies from the centre, in cells; the
/// cell, padding included, that it lies in or behind; its share of the next cell; its weight.
struct Line {
    from_centre: [f32; SAMPLES],
    cell: [usize; SAMPLES],
    next: [f32; SAMPLES],
    weight: [f32; SAMPLES],
}

static LINE: LazyLock<Line> = LazyLock::new(|| {
    let half = CELLS as f32 * 0.5;
    // Place in cells, -0.5 to CELLS + 0.5; cell centres at halves.
    let place = |i: usize| (i as f32 + 0.5) / SAMPLES as f32 * (CELLS + 1) as f32 - 0.5;
    let from_centre: [f32; SAMPLES] = std::array::from_fn(|i| place(i) - half);
    Line {
        from_centre,
        cell: std::array::from_fn(|i| (place(i) + 0.5) as usize),
        next: std::array::from_fn(|i| (place(i) + 0.5).fract()),
        weight: from_centre.map(|s| (-s * s / (2.0 * half * half)).exp()),
    }
});

/// The unit histogram of a window, after square roots, and the mean gradient.
#[expect(
    clippy::inline_always,
    reason = "an instruction set holds only in what is inlined where it was chosen"
)]
#[inline(always)]
fn histogram(octave: &Octave, window: &Window, line: &Line) -> ([f32; VALUES], f32) {
    let picture = &octave.levels[window.level];
    let n = octave.side;
    let (x, y, sigma) = (window.x / octave.step, window.y / octave.step, window.sigma / octave.step);
    // Pixels of the samples and their neighbours, repeated beyond the border of the picture.
    let pixel = |centre: f32, i: usize, beside: i32| {
        let at = (centre + line.from_centre[i] * CELL_SIGMAS * sigma).round() as i32 + beside;
        at.clamp(0, n as i32 - 1) as usize
    };
    let columns = [-1, 0, 1].map(|b| std::array::from_fn::<usize, SAMPLES, _>(|i| pixel(x, i, b)));
    let mut cells: [Row; CELLS + 2] = Default::default();
    let (mut sum, mut weights) = (0.0, 0.0);
    for j in 0..SAMPLES {
        let [above, own, below] = [-1, 0, 1].map(|b| &picture[pixel(y, j, b) * n..][..n]);
        let mut row: Row = Default::default();
        for i in 0..SAMPLES {
            let weight = line.weight[i] * line.weight[j];
            let gx = weight * (own[columns[2][i]] - own[columns[0][i]]);
            let gy = weight * (below[columns[1][i]] - above[columns[1][i]]);
            let length = (gx * gx + gy * gy).sqrt();
            sum += length;
            weights += weight;
            let votes = votes(gx, gy, length);
            let (cell, next) = (line.cell[i], line.next[i]);
            for k in 0..DIRECTIONS {
                row[cell][k] += (1.0 - next) * votes[k];
                row[cell + 1][k] += next * votes[k];
            }
        }
        let (cell, next) = (line.cell[j], line.next[j]);
        for (column, votes) in row.iter().enumerate() {
            for k in 0..DIRECTIONS {
                cells[cell][column][k] += (1.0 - next) * votes[k];
                cells[cell + 1][column][k] += next * votes[k];
            }
        }
    }
    let mut values = [0.0; VALUES];
    for (i, values) in values.as_chunks_mut::<DIRECTIONS>().0.iter_mut().enumerate() {
        *values = cells[i / CELLS + 1][i % CELLS + 1];
    }
    (normalised(values), 0.5 * sum / weights)
}

/// A share of each direction in a gradient of `length`: a lobe of 45 degrees to either side.
#[inline(always)]
fn votes(gx: f32, gy: f32, length: f32) -> [f32; DIRECTIONS] {
    const HALF: f32 = std::f32::consts::FRAC_1_SQRT_2;
    const COS: [f32; DIRECTIONS] = [1.0, HALF, 0.0, -HALF, -1.0, -HALF, 0.0, HALF];
    const SIN: [f32; DIRECTIONS] = [0.0, HALF, 1.0, HALF, 0.0, -HALF, -1.0, -HALF];
    std::array::from_fn(|k| (gx * COS[k] + gy * SIN[k] - HALF * length).max(0.0))
}

/// To norm 1, clipped, then square roots of shares: norm 1 again.
fn normalised(mut values: [f32; VALUES]) -> [f32; VALUES] {
    let norm = values.iter().map(|v| v * v).sum::<f32>().sqrt();
    let most = CLIP * norm;
    let mut sum = 0.0;
    for v in &mut values {
        *v = v.min(most);
        sum += *v;
    }
    for v in &mut values {
        *v = if sum > 0.0 { (*v / sum).sqrt() } else { 0.0 };
    }
    values
}

fn quantised(values: &[f32; VALUES]) -> Descriptor {
    let mut words = [0; WORDS];
    for (half, threshold) in THRESHOLDS.iter().enumerate() {
        for (i, v) in values.iter().enumerate() {
            let bit = half * VALUES + i;
            words[bit / 64] |= u64::from(v > threshold) << (bit % 64);
        }
    }
    Descriptor(words)
}
