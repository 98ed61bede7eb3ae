//! Gradient rows in, the pixels out whose magnitude no neighbour along the gradient exceeds (method
//! 1.2). Sees each row while it is in the cache; keeps the magnitudes of three rows. Thresholds for
//! whole edges are not applied here.

#![expect(
    clippy::inline_always,
    reason = "an instruction set holds only in what is inlined where it was chosen"
)]

use crate::detect::edges::deriche::{GradientRows, load, rest, vectors};
use fearless_simd::{Select, Simd, prelude::*};

/// Rim of the image in which no edge is reported: the filter runs over the continued border there.
pub(crate) const BORDER_PX: usize = 2;
/// Relative difference below which two neighbouring magnitudes are a tie, won by the darker pixel.
const TIE: f32 = 1e-4;
/// Most lanes of a vector of f32.
const MAX_LANES: usize = 16;

/// A pixel of an edge: row-major index, and length of the gradient.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Maximum {
    pub(crate) at: u32,
    pub(crate) magnitude: f32,
}

/// The maxima, with working memory reused from image to image.
#[derive(Debug, Clone, Default)]
pub(crate) struct Maxima {
    /// Row-major, none within [`BORDER_PX`] of the rim.
    pub(crate) found: Vec<Maximum>,
    low: f32,
    height: usize,
    /// Magnitudes of the last three rows.
    ring: [Vec<f32>; 3],
}

impl Maxima {
    /// Clears the maxima and prepares for an image of this size, pixels of at least `low`.
    pub(crate) fn restart(&mut self, width: usize, height: usize, low: f32) {
        self.found.clear();
        for row in &mut self.ring {
            row.resize(width, 0.0);
        }
        (self.low, self.height) = (low, height);
    }
}

impl<S: Simd> GradientRows<S> for Maxima {
    #[inline(always)]
    fn row(&mut self, s: S, v: usize, [gx, gy]: [&[f32]; 2]) {
        self.ring.rotate_left(1);
        let [up, mid, down] = &mut self.ring;
        let width = down.len();
        let start = gx.len() - width;
        let (x, y) = (&gx[start..], &gy[start..][..width]);
        for u in vectors::<S>(width) {
            let (x, y) = (load(s, x, u), load(s, y, u));
            (x * x + y * y).sqrt().store_slice(&mut down[u..u + S::f32s::LEN]);
        }
        for u in rest::<S>(width) {
            down[u] = (x[u] * x[u] + y[u] * y[u]).sqrt();
        }
        if v <= BORDER_PX || v >= self.height - (BORDER_PX - 1) || width < 2 * BORDER_PX {
            return;
        }
        let start = start - width;
        let scan =
            Scan { magnitudes: [up, mid, down], gradient: [&gx[start..][..width], &gy[start..][..width]] };
        scan.maxima(s, self.low, start, &mut self.found);
    }
}

/// Three rows of magnitudes, and the gradient of the middle one.
struct Scan<'a> {
    magnitudes: [&'a [f32]; 3],
    gradient: [&'a [f32]; 2],
}

impl Scan<'_> {
    #[inline(always)]
    fn maxima<S: Simd>(&self, s: S, low: f32, start: usize, found: &mut Vec<Maximum>) {
        let lanes = S::f32s::LEN;
        let end = self.gradient[0].len() - BORDER_PX;
        let mut u = BORDER_PX;
        while u < end {
            let bits = if u + lanes <= end {
                let scan = Scan {
                    magnitudes: self.magnitudes.map(|row| &row[u - 1..][..lanes + 2]),
                    gradient: self.gradient.map(|row| &row[u..u + lanes]),
                };
                scan.among(s, low)
            } else {
                // The rest of a row is continued by zeros, which are no maxima.
                let mut magnitudes = [[0.0; MAX_LANES + 2]; 3];
                let mut gradient = [[0.0; MAX_LANES]; 2];
                for (to, from) in magnitudes.iter_mut().zip(self.magnitudes) {
                    to[..end + 2 - u].copy_from_slice(&from[u - 1..][..end + 2 - u]);
                }
                for (to, from) in gradient.iter_mut().zip(self.gradient) {
                    to[..end - u].copy_from_slice(&from[u..end]);
                }
                let magnitudes = magnitudes.each_ref().map(|row| &row[..lanes + 2]);
                let scan = Scan { magnitudes, gradient: gradient.each_ref().map(|row| &row[..lanes]) };
                scan.among(s, low) & ((1 << (end - u)) - 1)
            };
            let mut left = bits;
            while left != 0 {
                let at = u + left.trailing_zeros() as usize;
                found.push(Maximum { at: (start + at) as u32, magnitude: self.magnitudes[1][at] });
                left &= left - 1;
            }
            u += lanes;
        }
    }

    /// Which pixels of one vector are maxima of at least `low`, one bit each. Magnitudes stand out
    /// by one on each side.
    #[inline(always)]
    fn among<S: Simd>(&self, s: S, low: f32) -> u64 {
        let m = |row: usize, u: usize| load(s, self.magnitudes[row], u);
        let centre = m(1, 1);
        let strong = centre.simd_ge(low);
        if !strong.any_true() {
            return 0;
        }
        let [gx, gy] = self.gradient.map(|row| load(s, row, 0));
        let (ax, ay) = (gx.abs(), gy.abs());
        let (left, up, flat) = (gx.simd_lt(0.0), gy.simd_lt(0.0), ax.simd_gt(ay));
        // The gradient leaves the pixel between a straight and a diagonal neighbour, and enters it
        // opposite.
        let ((above_l, above_r), (below_l, below_r)) = ((m(0, 0), m(0, 2)), (m(2, 0), m(2, 2)));
        let (ahead_l, ahead_r) = (up.select(above_l, below_l), up.select(above_r, below_r));
        let (behind_l, behind_r) = (up.select(below_l, above_l), up.select(below_r, above_r));
        let diagonal = [left.select(behind_r, behind_l), left.select(ahead_l, ahead_r)];
        let (above, below, before, after) = (m(0, 1), m(2, 1), m(1, 0), m(1, 2));
        let straight = [
            flat.select(left.select(after, before), up.select(below, above)),
            flat.select(left.select(before, after), up.select(above, below)),
        ];
        let (major, minor) = (ax.max(ay), ax.min(ay));
        // Both sides times `major`: no division.
        let centre = centre * major;
        let behind = straight[0] * (major - minor) + diagonal[0] * minor;
        let ahead = straight[1] * (major - minor) + diagonal[1] * minor;
        // A step between two pixels gives two equal maxima; rounding must not let both or neither
        // win.
        let maximum = (centre * (1.0 - TIE)).simd_gt(behind) & centre.simd_ge(ahead * (1.0 - TIE));
        (maximum & strong).to_bitmask()
    }
}
