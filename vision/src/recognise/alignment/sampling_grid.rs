//! The pixels at which icons are compared, bucket by bucket, and sampling of a picture there under
//! a homography.

#![expect(
    clippy::inline_always,
    reason = "an instruction set holds only in what is inlined where it was chosen"
)]

use crate::{geometry::interpolate::cell, recognise::features::separable::LANES};
use nalgebra::Point2;

/// Fewest points of a bucket that is used.
const MIN_POINTS: usize = 9;
/// Buckets along a side are as many as leave each this many points along its side.
const MIN_POINTS_ALONG: usize = 5;

/// Which pixels are compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Pattern {
    All,
    /// Every second one along both axes.
    Fourth,
    /// As the black fields of a chessboard.
    Half,
}

/// The pixels of all buckets, one bucket after the other, each padded to a multiple of [`LANES`]
/// with its last pixel.
#[derive(Debug, Clone, Default)]
pub(crate) struct SamplingGrid {
    /// Side of the icon.
    pub(crate) size: usize,
    /// Those without enough points included.
    pub(crate) all_buckets: usize,
    pub(crate) buckets: Vec<GridBucket>,
    /// Column, row.
    pub(crate) x: Vec<f32>,
    pub(crate) y: Vec<f32>,
    /// Index into the icon.
    pub(crate) at: Vec<u32>,
    /// The same of the pixels to the left, right, above and below, on the border the pixel
    /// itself...
    pub(crate) beside: [Vec<u32>; 4],
    /// ... and what their difference along x and along y is multiplied by to be a slope.
    pub(crate) per_px: [Vec<f32>; 2],
    /// 1 for pixels, 0 for padding.
    pub(crate) real: Vec<f32>,
}

/// One bucket's part of the lattice.
#[derive(Debug, Clone, Copy)]
pub(crate) struct GridBucket {
    pub(crate) start: usize,
    /// Padding included.
    pub(crate) end: usize,
    /// Padding left out.
    pub(crate) count: usize,
}

impl SamplingGrid {
    /// Of an icon of `size`, cut into `per_side` x `per_side` buckets, without `border` pixels all
    /// around.
    pub(crate) fn new(size: usize, per_side: usize, border: usize, pattern: Pattern) -> Self {
        let step = if pattern == Pattern::Fourth { 2 } else { 1 };
        let per_side = per_side.min(size / (step * MIN_POINTS_ALONG)).max(1);
        let edge = |i: usize| i * size / per_side;
        let within = |i: usize| edge(i).max(border)..edge(i + 1).min(size.saturating_sub(border));
        let mut lattice = Self {
            size,
            all_buckets: per_side * per_side,
            buckets: vec![],
            x: vec![],
            y: vec![],
            at: vec![],
            beside: Default::default(),
            per_px: Default::default(),
            real: vec![],
        };
        for i in 0..per_side * per_side {
            let pixels: Vec<(usize, usize)> = within(i / per_side)
                .step_by(step)
                .flat_map(|y| within(i % per_side).step_by(step).map(move |x| (x, y)))
                .filter(|(x, y)| pattern != Pattern::Half || (x + y) % 2 == 0)
                .collect();
            lattice.add(&pixels);
        }
        lattice
    }

    fn add(&mut self, pixels: &[(usize, usize)]) {
        let Some(last) = pixels.last().filter(|_| pixels.len() >= MIN_POINTS) else { return };
        let (start, count) = (self.x.len(), pixels.len());
        let padding = count.next_multiple_of(LANES) - count;
        for (x, y) in pixels.iter().chain(std::iter::repeat_n(last, padding)) {
            self.x.push(*x as f32);
            self.y.push(*y as f32);
            self.at.push((y * self.size + x) as u32);
            let last = self.size - 1;
            let (left, right) = (x.saturating_sub(1), (x + 1).min(last));
            let (above, below) = (y.saturating_sub(1), (y + 1).min(last));
            for (list, (x, y)) in
                self.beside.iter_mut().zip([(left, *y), (right, *y), (*x, above), (*x, below)])
            {
                list.push((y * self.size + x) as u32);
            }
            for (list, px) in self.per_px.iter_mut().zip([right - left, below - above]) {
                list.push(1.0 / px.max(1) as f32);
            }
        }
        self.real.extend(std::iter::repeat_n(1.0, count).chain(std::iter::repeat_n(0.0, padding)));
        self.buckets.push(GridBucket { start, end: self.x.len(), count });
    }

    /// Points, padding included.
    pub(crate) fn len(&self) -> usize {
        self.x.len()
    }
}

/// A square of grey levels, `width` wide, with the icon's pixel (0, 0) at (`margin`, `margin`).
#[derive(Debug, Clone, Copy)]
pub(crate) struct PaddedIcon<'a> {
    pub(crate) pixels: &'a [f32],
    pub(crate) width: usize,
    pub(crate) margin: usize,
}

/// The homography from the square of an icon to a quad, rows of a 3 x 3 matrix.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SquareMap([f64; 9]);

/// Corners of the square of an icon.
pub(crate) fn square(size: usize) -> [Point2<f64>; 4] {
    let (low, high) = (-0.5, size as f64 - 0.5);
    [[low, low], [high, low], [high, high], [low, high]].map(Point2::from)
}

impl SquareMap {
    /// From the square of an icon of `size` to `quad`, by Heckbert's closed form. `None` where the
    /// horizon would cross it.
    pub(crate) fn new(size: usize, quad: &[Point2<f64>; 4]) -> Option<Self> {
        let [tl, tr, br, bl] = quad;
        let sum = tl - tr + (br - bl);
        let (d1, d2) = (tr - br, bl - br);
        let det = d1.perp(&d2);
        let (g, h) = (sum.perp(&d2) / det, d1.perp(&sum) / det);
        let depth = [1.0 + g, 1.0 + h, 1.0 + g + h];
        if !depth.iter().all(|d| *d > 0.0 && d.is_finite()) {
            return None;
        }
        let (a, b) = (tr - tl + tr.coords * g, bl - tl + bl.coords * h);
        let s = 1.0 / size as f64;
        let row = |x: f64, y: f64, one: f64| [x * s, y * s, one + 0.5 * s * (x + y)];
        let (r0, r1, r2) = (row(a.x, b.x, tl.x), row(a.y, b.y, tl.y), row(g, h, 1.0));
        Some(Self([r0[0], r0[1], r0[2], r1[0], r1[1], r1[2], r2[0], r2[1], r2[2]]))
    }

    /// The image of a point of the icon.
    pub(crate) fn apply(&self, p: &Point2<f64>) -> Point2<f64> {
        let m = &self.0;
        let scale = 1.0 / (m[6] * p.x + m[7] * p.y + m[8]);
        Point2::new((m[0] * p.x + m[1] * p.y + m[2]) * scale, (m[3] * p.x + m[4] * p.y + m[5]) * scale)
    }
}

/// Grey levels of `picture` where `map` takes the points (x, y), bilinearly; [`LANES`] at a time.
#[inline(always)]
pub(crate) fn sample(picture: PaddedIcon<'_>, map: &SquareMap, x: &[f32], y: &[f32], seen: &mut [f32]) {
    let PaddedIcon { pixels, width, margin } = picture;
    let m = map.0.map(|e| e as f32);
    let (offset, last) = (margin as f32, (width - 1) as f32 - 1e-3);
    let (xs, ys) = (x.as_chunks::<LANES>().0, y.as_chunks::<LANES>().0);
    for ((x, y), seen) in xs.iter().zip(ys).zip(seen.as_chunks_mut::<LANES>().0) {
        let (mut at, mut dx, mut dy) = ([0_u32; LANES], [0.0_f32; LANES], [0.0_f32; LANES]);
        for i in 0..LANES {
            let scale = 1.0 / (m[6] * x[i] + m[7] * y[i] + m[8]);
            // NaN coordinates read pixel 0, and the grey level becomes NaN.
            let u = ((m[0] * x[i] + m[1] * y[i] + m[2]) * scale + offset).clamp(0.0, last);
            let v = ((m[3] * x[i] + m[4] * y[i] + m[5]) * scale + offset).clamp(0.0, last);
            let ((column, left), (row, above)) = (cell(u), cell(v));
            (at[i], dx[i], dy[i]) = (row * width as u32 + column, u - left, v - above);
        }
        for i in 0..LANES {
            let four = &pixels[at[i] as usize..][..width + 2];
            let [a, b, c, d] = [four[0], four[1], four[width], four[width + 1]];
            let (top, bottom) = (a + dx[i] * (b - a), c + dx[i] * (d - c));
            seen[i] = top + dy[i] * (bottom - top);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::homography::Homography;

    #[test]
    fn the_closed_form_is_the_homography() {
        let quad = [[3.0, -2.0], [70.0, 4.0], [81.0, 90.0], [-6.0, 77.0]].map(Point2::from);
        let map = SquareMap::new(75, &quad).unwrap();
        let oracle = Homography::from_points(&square(75), &quad).unwrap();
        for p in [[0.0, 0.0], [74.0, 10.0], [33.3, 71.2]].map(Point2::from) {
            assert!((map.apply(&p) - oracle.apply(&p)).norm() < 1e-9);
        }
        let crossed = [[0.0, 0.0], [10.0, 0.0], [3.0, 3.0], [0.0, 10.0]].map(Point2::from);
        assert!(SquareMap::new(75, &crossed).is_none());
        assert!(SquareMap::new(75, &[Point2::new(f64::NAN, 1.0); 4]).is_none());
    }

    #[test]
    fn every_pixel_is_in_one_bucket() {
        for (size, per_side) in [(75, 5), (60, 5), (25, 5), (20, 5), (100, 10)] {
            let all = SamplingGrid::new(size, per_side, 0, Pattern::All);
            assert!(all.buckets.iter().all(|c| (c.end - c.start).is_multiple_of(LANES)));
            let real = all.at.iter().zip(&all.real).filter(|(_, r)| **r > 0.5);
            let mut at: Vec<u32> = real.map(|(at, _)| *at).collect();
            at.sort_unstable();
            assert_eq!(at, (0..(size * size) as u32).collect::<Vec<_>>(), "{size} {per_side}");
        }
        let half = SamplingGrid::new(75, 5, 2, Pattern::Half);
        assert_eq!(half.buckets.iter().map(|c| c.count).sum::<usize>(), 71 * 71 / 2 + 1);
        assert_eq!(
            SamplingGrid::new(75, 5, 0, Pattern::Fourth).buckets.iter().map(|c| c.count).sum::<usize>(),
            40 * 40
        );
    }

    #[test]
    fn samples_are_bilinear() {
        let pixels: Vec<f32> = (0..100).map(|i| (i % 10) as f32 * 3.0 + (i / 10) as f32 * 7.0).collect();
        let picture = PaddedIcon { pixels: &pixels, width: 10, margin: 2 };
        let map = SquareMap::new(4, &square(4).map(|c| c + nalgebra::Vector2::new(0.25, -0.5))).unwrap();
        let (x, y): (Vec<f32>, Vec<f32>) = (0..16).map(|i| ((i % 4) as f32, (i / 4) as f32)).unzip();
        let mut seen = [0.0; 16];
        sample(picture, &map, &x, &y, &mut seen);
        for i in 0..16 {
            assert!((seen[i] - ((x[i] + 2.25) * 3.0 + (y[i] + 1.5) * 7.0)).abs() < 1e-4);
        }
    }
}
