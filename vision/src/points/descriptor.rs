//! A keypoint and the smoothed pictures in, its descriptor out: upright histograms of gradients, 4 x 4 cells of 8
//! directions, kept as 2 bits a value.
//!
//! Each value of the histogram is compared with two thresholds and stored as the two answers, so that the Hamming
//! distance of two descriptors is the L1 distance of their values on three levels.

use super::keypoints::Octave;
use fearless_simd::{Level, dispatch};

/// Cells along a side.
const CELLS: usize = 4;
/// Directions of a cell.
const DIRECTIONS: usize = 8;
/// Values of a histogram.
pub const VALUES: usize = CELLS * CELLS * DIRECTIONS;
/// 64-bit words of a descriptor.
pub const WORDS: usize = 2 * VALUES / 64;
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
        let mut out = [0; WORDS];
        for value in 0..VALUES {
            let (cell, direction) = (value / DIRECTIONS, value % DIRECTIONS);
            let (column, row) = (cell % CELLS, cell / CELLS);
            let last = CELLS - 1;
            // Where the value goes to: the inverse of where each comes from.
            let (column, row) = match shift % 4 {
                0 => (column, row),
                1 => (row, last - column),
                2 => (last - column, last - row),
                _ => (last - row, column),
            };
            let direction = (direction + DIRECTIONS - (shift % 4) * DIRECTIONS / 4) % DIRECTIONS;
            let to = (row * CELLS + column) * DIRECTIONS + direction;
            for bit in 0..2 {
                let (from, to) = (bit * VALUES + value, bit * VALUES + to);
                out[to / 64] |= ((self.0[from / 64] >> (from % 64)) & 1) << (to % 64);
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
    dispatch!(Level::new(), _s => {
        let (values, gradient) = histogram(octave, window);
        (quantised(&values), gradient)
    })
}

/// The unit histogram of a window, after square roots, and the mean gradient.
#[expect(
    clippy::inline_always,
    reason = "an instruction set holds only in what is inlined where it was chosen"
)]
#[inline(always)]
fn histogram(octave: &Octave, window_of: &Window) -> ([f32; VALUES], f32) {
    let picture = &octave.levels[window_of.level];
    let n = octave.side as i32;
    let (x, y, sigma) = (window_of.x / octave.step, window_of.y / octave.step, window_of.sigma / octave.step);
    let mut sum = 0.0;
    let mut weights = 0.0;
    let cell = CELL_SIGMAS * sigma;
    let window = (CELLS + 1) as f32;
    let at = |u: i32, v: i32| picture[(v.clamp(0, n - 1) * n + u.clamp(0, n - 1)) as usize];
    let mut cells = [[0.0_f32; DIRECTIONS]; (CELLS + 2) * (CELLS + 2)];
    for j in 0..SAMPLES {
        // Place in cells, -0.5 to CELLS + 0.5; cell centres at halves.
        let t = (j as f32 + 0.5) / SAMPLES as f32 * window - 0.5;
        let v = (y + (t - CELLS as f32 * 0.5) * cell).round() as i32;
        for i in 0..SAMPLES {
            let s = (i as f32 + 0.5) / SAMPLES as f32 * window - 0.5;
            let u = (x + (s - CELLS as f32 * 0.5) * cell).round() as i32;
            let (gx, gy) = (at(u + 1, v) - at(u - 1, v), at(u, v + 1) - at(u, v - 1));
            let far = (s - CELLS as f32 * 0.5).powi(2) + (t - CELLS as f32 * 0.5).powi(2);
            let weight = (-far / (2.0 * (CELLS as f32 * 0.5).powi(2))).exp();
            let votes = votes(gx * weight, gy * weight);
            sum += weight * (gx * gx + gy * gy).sqrt();
            weights += weight;
            // One cell of padding all around takes what lies outside.
            let (a, b) = (s + 0.5, t + 0.5);
            let (column, row) = (a as usize, b as usize);
            let (fa, fb) = (a - column as f32, b - row as f32);
            let to = row * (CELLS + 2) + column;
            let shares = [
                (to, (1.0 - fa) * (1.0 - fb)),
                (to + 1, fa * (1.0 - fb)),
                (to + CELLS + 2, (1.0 - fa) * fb),
                (to + CELLS + 3, fa * fb),
            ];
            for (to, share) in shares {
                for k in 0..DIRECTIONS {
                    cells[to][k] += share * votes[k];
                }
            }
        }
    }
    let mut values = [0.0; VALUES];
    for (i, values) in values.as_chunks_mut::<DIRECTIONS>().0.iter_mut().enumerate() {
        *values = cells[(i / CELLS + 1) * (CELLS + 2) + i % CELLS + 1];
    }
    (normalised(values), 0.5 * sum / weights)
}

/// A gradient's share of each direction: a lobe of 45 degrees to either side.
#[inline]
fn votes(gx: f32, gy: f32) -> [f32; DIRECTIONS] {
    const HALF: f32 = std::f32::consts::FRAC_1_SQRT_2;
    const COS: [f32; DIRECTIONS] = [1.0, HALF, 0.0, -HALF, -1.0, -HALF, 0.0, HALF];
    const SIN: [f32; DIRECTIONS] = [0.0, HALF, 1.0, HALF, 0.0, -HALF, -1.0, -HALF];
    let norm = HALF * (gx * gx + gy * gy).sqrt();
    std::array::from_fn(|k| (gx * COS[k] + gy * SIN[k] - norm).max(0.0))
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
