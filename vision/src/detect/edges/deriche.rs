//! Grey image in, the two gradient planes out (method 1.1): the recursive filter of Canny and
//! Deriche.
//!
//! Departs from method 1.1 in the form, not in the result: instead of a causal plus an anticausal
//! recursion for each of smoothing and derivative, one causal recursion after one anticausal,
//! `C = 1 / ((1 - q z^-1)^2 (1 - q z)^2)`, along rows and columns. Of it smoothing is
//! `s1 C[n-1] + s0 C[n] + s1 C[n+1]` and the derivative `d (C[n+1] - C[n-1])`, so both gradients
//! are 3x3 stencils of one plane: half the arithmetic, a third of the memory. Rows are filtered
//! [`LANES`] at a time, columns all at once; no thresholds here.

#![expect(
    clippy::inline_always,
    reason = "an instruction set holds only in what is inlined where it was chosen"
)]

use crate::{
    detect::edges::row_transpose::{Column, LANES, columns, numbers, store_rows},
    frame::GrayImage,
};
use fearless_simd::{Simd, f32x16, prelude::*};

/// Range of alpha in which the f32 recursion keeps its accuracy.
const ALPHA_RANGE: (f32, f32) = (0.25, 4.0);

/// Coefficients of the filter for one alpha.
#[derive(Debug, Clone, Copy)]
struct Deriche {
    /// Feedback 2q and -q^2 of one recursion.
    feedback: [f32; 2],
    /// Response of one recursion to a constant 1.
    steady: f32,
    /// Start values of the second recursion one and two samples beyond the end, for a deviation of
    /// 1 from the steady state in the last and last but one sample of the first.
    beyond: [[f32; 2]; 2],
    /// s1 / s0.
    side: f32,
    /// Scale that makes the peak response to a step the step's height, applied to the image.
    scale: f32,
}

impl Deriche {
    fn new(alpha: f32) -> Self {
        let a = f64::from(alpha.clamp(ALPHA_RANGE.0, ALPHA_RANGE.1));
        let q = (-a).exp();
        let r = q * q;
        let k = (1.0 - q).powi(2) / (1.0 + 2.0 * a * q - r);
        let (s0, s1) = (k * (1.0 - 4.0 * a * r - r * r), k * q * ((a - 1.0) + r * (a + 1.0)));
        let d = (1.0 - q).powi(2) * (1.0 - r);
        // The deviation goes on as q^j (e0 + j (e0 - q e1)); the second recursion weights it by
        // (m + 1) q^m.
        let (sum, ramp) = ((1.0 - r).powi(-2), 2.0 * r * (1.0 - r).powi(-3));
        let beyond = |i: i32| {
            let j = f64::from(i);
            [q.powi(i) * ((1.0 + j) * sum + ramp), -q.powi(i + 1) * (j * sum + ramp)].map(|w| w as f32)
        };
        Self {
            feedback: [(2.0 * q) as f32, -r as f32],
            steady: (1.0 - q).powi(-2) as f32,
            beyond: [beyond(1), beyond(2)],
            side: (s1 / s0) as f32,
            scale: (d * s0) as f32,
        }
    }

    #[inline(always)]
    fn next<S: Simd>(&self, x: f32x16<S>, p1: f32x16<S>, p2: f32x16<S>) -> f32x16<S> {
        (x + p2 * self.feedback[1]) + p1 * self.feedback[0]
    }

    /// Both recursions along [`LANES`] rows, scaled. `lines` becomes the columns from -1 to the
    /// width inclusive.
    #[inline(always)]
    fn along_rows<S: Simd>(&self, s: S, rows: &[&[u8]; LANES], lines: &mut Vec<Column>) {
        let width = rows[0].len();
        let column = |u: usize| f32x16::load_array(s, rows.map(|row| f32::from(row[u]))) * self.scale;
        let (left, right) = (column(0) * self.steady, column(width - 1) * self.steady);
        lines.resize(width + 2, Column::default());
        left.store_slice(&mut lines[0].0);
        let (mut p1, mut p2) = (left, left);
        let (tiles, rest) = lines[1..=width].as_chunks_mut::<LANES>();
        let tiled = tiles.len() * LANES;
        for (i, tile) in tiles.iter_mut().enumerate() {
            for (x, line) in columns(s, rows, i * LANES).into_iter().zip(tile) {
                (p1, p2) = (self.next(numbers(x) * self.scale, p1, p2), p1);
                p1.store_slice(&mut line.0);
            }
        }
        for (u, line) in (tiled..).zip(rest) {
            (p1, p2) = (self.next(column(u), p1, p2), p1);
            p1.store_slice(&mut line.0);
        }
        let (e0, e1) = (p1 - right, p2 - right);
        let beyond = |[w0, w1]: [f32; 2]| right * self.steady + (e0 * w0 + e1 * w1);
        let (mut p1, mut p2) = (beyond(self.beyond[0]), beyond(self.beyond[1]));
        p1.store_slice(&mut lines[width + 1].0);
        for line in lines[..=width].iter_mut().rev() {
            (p1, p2) = (self.next(f32x16::from_slice(s, &line.0), p1, p2), p1);
            p1.store_slice(&mut line.0);
        }
    }

    /// One step of a recursion across rows.
    #[inline(always)]
    fn across<S: Simd>(&self, s: S, [x, p1, p2]: [&[f32]; 3], out: &mut [f32]) {
        let [ahead, back] = self.feedback;
        let n = out.len();
        let (x, p1, p2) = (&x[..n], &p1[..n], &p2[..n]);
        for u in vectors::<S>(n) {
            let next = (load(s, x, u) + load(s, p2, u) * back) + load(s, p1, u) * ahead;
            next.store_slice(&mut out[u..u + S::f32s::LEN]);
        }
        for u in rest::<S>(n) {
            out[u] = (x[u] + p2[u] * back) + p1[u] * ahead;
        }
    }

    /// Rows -2 and -1 of the second recursion, from the first row of the image and rows 0 and 1 of
    /// the first recursion.
    fn above(&self, first: &[f32], g: [&[f32]; 2], out: [&mut [f32]; 2]) {
        let [far, near] = out;
        for (u, x) in first.iter().enumerate() {
            let steady = x * self.steady;
            let (e0, e1) = (g[0][u] - steady, g[1][u] - steady);
            let beyond = |[w0, w1]: [f32; 2]| steady * self.steady + (e0 * w0 + e1 * w1);
            (near[u], far[u]) = (beyond(self.beyond[0]), beyond(self.beyond[1]));
        }
    }

    /// Gradients of one row from three rows of the filtered plane, which stand out by one column on
    /// both sides.
    #[inline(always)]
    fn stencil<S: Simd>(&self, s: S, rows: [&[f32]; 3], [gx, gy]: Planes) {
        let n = gx.len();
        let [above, level, below] = rows.map(|row| &row[..n + 2]);
        let side = self.side;
        for u in vectors::<S>(n) {
            let (al, ac, ar) = (load(s, above, u), load(s, above, u + 1), load(s, above, u + 2));
            let (bl, bc, br) = (load(s, below, u), load(s, below, u + 1), load(s, below, u + 2));
            let x = (load(s, level, u + 2) - load(s, level, u)) + ((ar - al) + (br - bl)) * side;
            let y = (bc - ac) + ((bl - al) + (br - ar)) * side;
            x.store_slice(&mut gx[u..u + S::f32s::LEN]);
            y.store_slice(&mut gy[u..u + S::f32s::LEN]);
        }
        for u in rest::<S>(n) {
            let ([al, ac, ar], [bl, bc, br]) =
                ([above[u], above[u + 1], above[u + 2]], [below[u], below[u + 1], below[u + 2]]);
            gx[u] = (level[u + 2] - level[u]) + ((ar - al) + (br - bl)) * side;
            gy[u] = (bc - ac) + ((bl - al) + (br - ar)) * side;
        }
    }
}

/// Where the whole vectors of a row of `n` start.
#[inline(always)]
pub(crate) fn vectors<S: Simd>(n: usize) -> impl Iterator<Item = usize> {
    (0..n / S::f32s::LEN).map(|i| i * S::f32s::LEN)
}

/// The samples of a row of `n` after the whole vectors.
#[inline(always)]
pub(crate) fn rest<S: Simd>(n: usize) -> std::ops::Range<usize> {
    n / S::f32s::LEN * S::f32s::LEN..n
}

#[inline(always)]
pub(crate) fn load<S: Simd>(s: S, row: &[f32], u: usize) -> S::f32s {
    S::f32s::from_slice(s, &row[u..u + S::f32s::LEN])
}

/// Working memory of the filter of one plane, reused from image to image.
#[derive(Debug, Clone, Default)]
pub(crate) struct FilterMemory {
    lines: Vec<Column>,
    /// Sixteen filtered rows.
    rows: Vec<f32>,
    /// The anticausal recursion up the columns, with two more rows below.
    plane: Vec<f32>,
    /// The first filtered row.
    first: Vec<f32>,
    /// Three rows of the whole filter's output.
    ring: [Vec<f32>; 3],
}

/// The two gradient planes being filled, row-major.
pub(crate) type Planes<'a> = [&'a mut [f32]; 2];

/// Receives the gradient rows while they are in the cache.
pub(crate) trait GradientRows<S: Simd> {
    /// Row `v` is done; `planes` hold all rows up to it.
    fn row(&mut self, s: S, v: usize, planes: [&[f32]; 2]);
}

/// Fills the planes (gx, gy) in grey levels of step height, pointing to the brighter side, from the
/// top row down. The image is continued by its border pixels.
#[inline(always)]
pub(crate) fn gradients<S: Simd>(
    s: S,
    image: &GrayImage,
    alpha: f32,
    memory: &mut FilterMemory,
    [gx, gy]: Planes,
    visitor: &mut impl GradientRows<S>,
) {
    let (width, filter) = (image.width(), PlaneFilter::new(alpha));
    filter.start(s, image, memory);
    for v in 0..image.height() {
        let row = v * width..(v + 1) * width;
        filter.row(s, v, memory, [&mut gx[row.clone()], &mut gy[row.clone()]]);
        visitor.row(s, v, [&gx[..row.end], &gy[..row.end]]);
    }
}

/// The filter of one plane, whose gradient rows are asked for one after the other.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PlaneFilter(Deriche);

impl PlaneFilter {
    pub(crate) fn new(alpha: f32) -> Self {
        Self(Deriche::new(alpha))
    }

    /// All but the recursion down the columns, of which the rows above the first are prepared.
    #[inline(always)]
    pub(crate) fn start<S: Simd>(&self, s: S, image: &GrayImage, memory: &mut FilterMemory) {
        let n = image.width() + 2;
        upwards(s, image, &self.0, memory);
        let FilterMemory { plane, first, ring, .. } = memory;
        for row in ring.iter_mut() {
            row.resize(n, 0.0);
        }
        let [far, near, next] = ring;
        self.0.above(first, [&plane[..n], &plane[n..2 * n]], [far, near]);
        self.0.across(s, [&plane[..n], near, far], next);
        ring.rotate_left(1);
    }

    /// The gradients of row `v`; rows are asked for from the first to the last, each once.
    #[inline(always)]
    pub(crate) fn row<S: Simd>(&self, s: S, v: usize, memory: &mut FilterMemory, out: Planes) {
        let FilterMemory { plane, ring, .. } = memory;
        let n = out[0].len() + 2;
        let [p2, p1, next] = ring;
        self.0.across(s, [&plane[(v + 1) * n..(v + 2) * n], p1, p2], next);
        self.0.stencil(s, [p2, p1, next], out);
        ring.rotate_left(1);
    }
}

/// Filters along the rows, and up the columns with the anticausal recursion.
#[inline(always)]
fn upwards<S: Simd>(s: S, image: &GrayImage, filter: &Deriche, memory: &mut FilterMemory) {
    let (width, height) = (image.width(), image.height());
    let n = width + 2;
    let FilterMemory { lines, rows, plane, first, .. } = memory;
    rows.resize(LANES * n, 0.0);
    plane.resize((height + 2) * n, 0.0);
    let row = |v: usize| &image.data()[v * width..(v + 1) * width];
    let mut bottom = height;
    while bottom > 0 {
        let top = bottom.saturating_sub(LANES);
        // Lanes past the bottom repeat the last row; they are not read.
        filter.along_rows(s, &std::array::from_fn(|i| row((top + i).min(bottom - 1))), lines);
        store_rows(s, lines, rows);
        if bottom == height {
            let last = &rows[(bottom - 1 - top) * n..][..n];
            let below = &mut plane[height * n..];
            below.iter_mut().zip(last.iter().chain(last)).for_each(|(to, x)| *to = x * filter.steady);
        }
        for v in (top..bottom).rev() {
            let (out, below) = plane[v * n..].split_at_mut(n);
            filter.across(s, [&rows[(v - top) * n..], below, &below[n..]], out);
        }
        bottom = top;
    }
    first.clear();
    first.extend_from_slice(&rows[..n]);
}

#[cfg(test)]
#[path = "deriche_tests.rs"]
pub(crate) mod tests;
