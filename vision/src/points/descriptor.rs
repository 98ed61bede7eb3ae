//! A keypoint and the smoothed pictures in, its descriptor out: upright histograms of gradients, 4
//! x 4 cells of 8 directions, kept as 2 bits a value.
//!
//! Each value of the histogram is compared with two thresholds and stored as the two answers, so
//! that the Hamming distance of two descriptors is the L1 distance of their values on three levels.

use crate::points::keypoints::Octave;
use fearless_simd::{Level, Simd, dispatch, f32x8, prelude::*};
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
/// Samples along a cell, and along a side of the window of `CELLS + 1` cells.
const PER_CELL: usize = 4;
const SAMPLES: usize = PER_CELL * (CELLS + 1);
/// The same, padded to whole vectors with weight 0.
const PADDED: usize = 32;
/// Values of a unit histogram above which its bits are set.
const THRESHOLDS: [f32; 2] = [0.055, 0.12];
/// A value of the histogram before square roots is at most this share of its norm.
const CLIP: f32 = 0.2;

/// The picture round a keypoint: two bits for each of the 128 values, all first bits before all
/// second ones.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Descriptor(pub [u64; WORDS]);

impl Descriptor {
    /// Hamming distance, 0 to [`MAX_DISTANCE`].
    #[inline]
    pub fn distance(&self, other: &Self) -> u32 {
        self.0.iter().zip(&other.0).map(|(a, b)| (a ^ b).count_ones()).sum()
    }

    /// The first bits of all values: each is at least the lower threshold.
    #[inline]
    pub fn half(&self) -> [u64; HALF_WORDS] {
        [self.0[0], self.0[1]]
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
                // The destination of the cell: the inverse of the source map.
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

/// The window of a descriptor.
#[derive(Debug, Clone, Copy)]
pub struct Window {
    /// Centre in patch pixels.
    pub x: f32,
    /// Centre row in patch pixels.
    pub y: f32,
    /// Scale in patch pixels.
    pub sigma: f32,
    /// Which of the octave's pictures.
    pub level: usize,
}

/// The descriptor of `window` on its octave, and the mean gradient there, in grey levels a pixel of
/// the octave.
pub fn describe(octave: &Octave, window: &Window) -> (Descriptor, f32) {
    describe_stretched(octave, window, [1.0, 1.0])
}

/// The same of a window whose sides are longer than its scale says by the factors `stretch`: what
/// [`describe`] would give after the picture was shrunk by them.
pub fn describe_stretched(octave: &Octave, window: &Window, stretch: [f32; 2]) -> (Descriptor, f32) {
    let line = &*LINE;
    dispatch!(Level::new(), s => {
        let (values, gradient) = histogram(s, octave, window, stretch, line);
        (quantised(&values), gradient)
    })
}

/// A line of samples, the same for rows and columns and for every window: where each lies from the
/// centre, in cells, and its weight. Samples lie between the centres of one cell and the next,
/// padding included, [`PER_CELL`] in a row.
struct Line {
    from_centre: [f32; PADDED],
    weight: [f32; PADDED],
    /// Sum of the weights of a window.
    weights: f32,
}

/// Shares of the next cell.
const NEXT: [f32; PER_CELL] = [0.125, 0.375, 0.625, 0.875];

static LINE: LazyLock<Line> = LazyLock::new(|| {
    let half = CELLS as f32 * 0.5;
    // Place in cells, -0.5 to CELLS + 0.5; cell centres at halves.
    let place = |i: usize| (i as f32 + 0.5) / SAMPLES as f32 * (CELLS + 1) as f32 - 0.5;
    let from_centre: [f32; PADDED] = std::array::from_fn(|i| place(i.min(SAMPLES - 1)) - half);
    let bell =
        |i: usize| if i < SAMPLES { (-from_centre[i].powi(2) / (2.0 * half * half)).exp() } else { 0.0 };
    let weight: [f32; PADDED] = std::array::from_fn(bell);
    Line { from_centre, weight, weights: weight.iter().sum::<f32>().powi(2) }
});

/// The unit histogram of a window, after square roots, and the mean gradient.
#[expect(
    clippy::inline_always,
    reason = "an instruction set holds only in what is inlined where it was chosen"
)]
#[inline(always)]
fn histogram<S: Simd>(
    s: S,
    octave: &Octave,
    window: &Window,
    [across, down]: [f32; 2],
    line: &Line,
) -> ([f32; VALUES], f32) {
    let picture = &octave.levels[window.level];
    let (n, height) = (octave.width, octave.height);
    let (x, y, sigma) = (window.x / octave.step, window.y / octave.step, window.sigma / octave.step);
    // Pixels of the samples and their neighbours, repeated beyond the border of the picture.
    let nearest = |centre: f32, i: usize, stretch: f32| {
        centre + line.from_centre[i] * CELL_SIGMAS * sigma * stretch + 0.5
    };
    let pixel = |nearest: f32, beside: f32, side: usize| {
        (nearest.floor() + beside).clamp(0.0, (side - 1) as f32) as u32
    };
    let (mut left, mut middle, mut right) = ([0; PADDED], [0; PADDED], [0; PADDED]);
    for i in 0..PADDED {
        let at = nearest(x, i, across);
        (left[i], middle[i], right[i]) = (pixel(at, -1.0, n), pixel(at, 0.0, n), pixel(at, 1.0, n));
    }
    let mut cells = [[f32x8::splat(s, 0.0); CELLS + 2]; CELLS + 2];
    let mut lengths = [0.0; PADDED];
    for j in 0..SAMPLES {
        let at = nearest(y, j, down);
        let [above, own, below] =
            [-1.0, 0.0, 1.0].map(|b| &picture[pixel(at, b, height) as usize * n..][..n]);
        let [mut gx, mut gy, mut length] = [[0.0; PADDED]; 3];
        for i in 0..SAMPLES {
            gx[i] = own[right[i] as usize] - own[left[i] as usize];
            gy[i] = below[middle[i] as usize] - above[middle[i] as usize];
        }
        for i in 0..PADDED {
            let weight = line.weight[i] * line.weight[j];
            (gx[i], gy[i]) = (weight * across * gx[i], weight * down * gy[i]);
            length[i] = (gx[i] * gx[i] + gy[i] * gy[i]).sqrt();
            lengths[i] += length[i];
        }
        let mut row = [f32x8::splat(s, 0.0); CELLS + 2];
        for cell in 0..=CELLS {
            let mut next = f32x8::splat(s, 0.0);
            for (i, share) in (cell * PER_CELL..).zip(NEXT) {
                let votes = votes(s, gx[i], gy[i], length[i]);
                row[cell] += votes * (1.0 - share);
                next += votes * share;
            }
            row[cell + 1] = next;
        }
        let (cell, next) = (j / PER_CELL, NEXT[j % PER_CELL]);
        for column in 0..CELLS + 2 {
            cells[cell][column] += row[column] * (1.0 - next);
            cells[cell + 1][column] += row[column] * next;
        }
    }
    let mut values = [0.0; VALUES];
    for (i, values) in values.as_chunks_mut::<DIRECTIONS>().0.iter_mut().enumerate() {
        cells[i / CELLS + 1][i % CELLS + 1].store_slice(values);
    }
    (normalised(&values), 0.5 * lengths.iter().sum::<f32>() / line.weights)
}

/// A share of each direction in a gradient of `length`: a lobe of 45 degrees to either side.
#[inline(always)]
fn votes<S: Simd>(s: S, gx: f32, gy: f32, length: f32) -> f32x8<S> {
    const HALF: f32 = std::f32::consts::FRAC_1_SQRT_2;
    const COS: [f32; DIRECTIONS] = [1.0, HALF, 0.0, -HALF, -1.0, -HALF, 0.0, HALF];
    const SIN: [f32; DIRECTIONS] = [0.0, HALF, 1.0, HALF, 0.0, -HALF, -1.0, -HALF];
    let (cos, sin) = (f32x8::from_slice(s, &COS), f32x8::from_slice(s, &SIN));
    (cos * gx + sin * gy - f32x8::splat(s, HALF * length)).max(0.0)
}

/// Sum over all values, by as many partial sums as there are in two vectors.
#[expect(clippy::inline_always, reason = "as above")]
#[inline(always)]
fn sum(values: &[f32; VALUES], of: impl Fn(f32) -> f32) -> f32 {
    let mut sums = [0.0; 2 * DIRECTIONS];
    for part in values.as_chunks::<{ 2 * DIRECTIONS }>().0 {
        for (sum, v) in sums.iter_mut().zip(part) {
            *sum += of(*v);
        }
    }
    sums.iter().sum()
}

/// To norm 1, clipped, then square roots of shares: norm 1 again.
#[expect(clippy::inline_always, reason = "as above")]
#[inline(always)]
fn normalised(values: &[f32; VALUES]) -> [f32; VALUES] {
    let most = CLIP * sum(values, |v| v * v).sqrt();
    let clipped = values.map(|v| v.min(most));
    let sum = sum(&clipped, |v| v);
    let scale = if sum > 0.0 { 1.0 / sum } else { 0.0 };
    let mut out = [0.0; VALUES];
    for (out, v) in out.iter_mut().zip(&clipped) {
        *out = (v * scale).sqrt();
    }
    out
}

#[expect(clippy::inline_always, reason = "as above")]
#[inline(always)]
fn quantised(values: &[f32; VALUES]) -> Descriptor {
    let mut words = [0; WORDS];
    for (half, threshold) in words.chunks_exact_mut(HALF_WORDS).zip(THRESHOLDS) {
        let mut above = [0_u8; VALUES];
        for (above, v) in above.iter_mut().zip(values) {
            *above = u8::from(*v > threshold);
        }
        for (word, bytes) in half.iter_mut().zip(above.chunks_exact(64)) {
            // The lowest bits of eight bytes become one byte.
            let eight =
                |bytes: &[u8; 8]| u64::from_le_bytes(*bytes).wrapping_mul(0x0102_0408_1020_4080) >> 56;
            let bytes = bytes.as_chunks::<8>().0.iter().enumerate();
            *word = bytes.fold(0, |word, (i, bytes)| word | eight(bytes) << (8 * i));
        }
    }
    Descriptor(words)
}
