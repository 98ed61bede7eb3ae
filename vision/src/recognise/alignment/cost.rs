//! The target of an alignment, bucket by bucket: a template's grey levels of mean 0 and norm 1, and
//! their derivatives by the corners. `settle` moves the corners.

#![expect(
    clippy::inline_always,
    reason = "an instruction set holds only in what is inlined where it was chosen"
)]

use crate::recognise::{
    alignment::sampling_grid::{GridBucket, SamplingGrid},
    features::separable::LANES,
};
use nalgebra::{SMatrix, SVector};

/// A template on a lattice, with `D` ways to move: 4 for the sides, 8 for the coordinates of the
/// corners.
#[derive(Debug, Clone)]
pub(crate) struct Cost<const D: usize> {
    /// Grey levels, zeros for padding and for flat buckets.
    pub(crate) values: Vec<f32>,
    /// Buckets that are not flat, with the products that do not change from step to step.
    pub(crate) buckets: Vec<Bucket<D>>,
    /// Derivatives of the grey levels by each parameter, likewise.
    pub(crate) slopes: [Vec<f32>; D],
}

#[derive(Debug, Clone)]
pub(crate) struct Bucket<const D: usize> {
    pub(crate) cells: GridBucket,
    /// Products of the derivatives.
    pub(crate) normal: SMatrix<f64, D, D>,
    /// Products of the derivatives with the template's grey levels.
    pub(crate) level: SVector<f64, D>,
}

/// A picture's grey levels on a lattice, of mean 0 and norm 1 in every bucket.
#[derive(Debug, Clone)]
pub(crate) struct Levels {
    /// Grey levels; zeros for padding and for flat buckets.
    values: Vec<f32>,
    /// Buckets that are not flat, and the norms that their grey levels were divided by.
    buckets: Vec<(GridBucket, f32)>,
}

impl Levels {
    /// Of the smoothed icon `smooth`. A bucket with a standard deviation below `min_deviation` is
    /// flat and ignored.
    #[inline(always)]
    pub(crate) fn new(lattice: &SamplingGrid, smooth: &[f32], min_deviation: f32) -> Self {
        let mut values: Vec<f32> = lattice.at.iter().map(|at| smooth[*at as usize]).collect();
        let mut buckets = Vec::with_capacity(lattice.buckets.len());
        for cells in &lattice.buckets {
            let own = &mut values[cells.start..cells.end];
            let real = &lattice.real[cells.start..cells.end];
            buckets.extend(normalise(own, real, cells.count, min_deviation).map(|norm| (*cells, norm)));
        }
        Self { values, buckets }
    }
}

/// Derivatives of points by the corners: left, right, top, bottom side along their normals, or x
/// and y of TL, TR, BR, BL. The derivative of the homography, exact at the square itself. In:
/// slopes along x and along y of [`LANES`] pixels at `s` and `t` of the way across and down. Out:
/// their change with each way to move.
#[inline(always)]
fn moved<const D: usize>([gx, gy]: [[f32; LANES]; 2], s: [f32; LANES], t: [f32; LANES]) -> [[f32; LANES]; D] {
    let mut ways = [[0.0; LANES]; D];
    for i in 0..LANES {
        let (s, t, gx, gy) = (s[i], t[i], gx[i], gy[i]);
        if D == 4 {
            let [left, right, top, bottom] = [(1.0 - s) * gx, s * gx, (1.0 - t) * gy, t * gy];
            (ways[0][i], ways[1][i], ways[2][i], ways[3][i]) = (left, right, top, bottom);
            continue;
        }
        let corners = [(1.0 - s) * (1.0 - t), s * (1.0 - t), s * t, (1.0 - s) * t];
        // Moving one corner alone also bends lines, so it moves points along the other axis, too.
        let (bend_x, bend_y) = (s * (1.0 - s) * gx, t * (1.0 - t) * gy);
        for (k, along) in corners.into_iter().enumerate() {
            let sign = if k % 2 == 0 { -1.0 } else { 1.0 };
            ways[2 * k][i] = along * gx + sign * bend_y;
            ways[2 * k + 1][i] = along * gy + sign * bend_x;
        }
    }
    ways
}

impl<const D: usize> Cost<D> {
    /// Of the smoothed icon `smooth`. A bucket with a standard deviation below `min_deviation` is
    /// flat and ignored.
    #[inline(always)]
    pub(crate) fn new(lattice: &SamplingGrid, smooth: &[f32], min_deviation: f32) -> Self {
        let levels = Levels::new(lattice, smooth, min_deviation);
        Self::with_slopes(lattice, &levels, &levels, smooth)
    }

    /// `levels` with the gradients of `smooth`, the picture at its present position, instead of the
    /// template's: those bias the step where one of the two is blurred more.
    #[inline(always)]
    pub(crate) fn with_slopes_of(lattice: &SamplingGrid, levels: &Levels, smooth: &[f32]) -> Self {
        Self::with_slopes(lattice, levels, &Levels::new(lattice, smooth, 0.0), smooth)
    }

    /// Slopes of `smooth`, whose grey levels are `own`.
    #[inline(always)]
    fn with_slopes(lattice: &SamplingGrid, levels: &Levels, own: &Levels, smooth: &[f32]) -> Self {
        let mut slopes = std::array::from_fn(|_| vec![0.0; lattice.len()]);
        for (cells, norm) in &own.buckets {
            add_slopes(&mut slopes, lattice, smooth, *cells, &own.values, *norm);
        }
        let of = |(cells, _): &(GridBucket, f32)| Bucket::new(*cells, &levels.values, &slopes);
        let buckets = levels.buckets.iter().map(of).collect();
        Self { values: levels.values.clone(), buckets, slopes }
    }
}

/// Slopes of one bucket, whose normalised grey levels and norm are known.
#[inline(always)]
fn add_slopes<const D: usize>(
    slopes: &mut [Vec<f32>; D],
    lattice: &SamplingGrid,
    smooth: &[f32],
    cells: GridBucket,
    values: &[f32],
    norm: f32,
) {
    let scale = 1.0 / lattice.size as f32;
    for start in (cells.start..cells.end).step_by(LANES) {
        let (mut g, mut s, mut t) = ([[0.0; LANES]; 2], [0.0; LANES], [0.0; LANES]);
        for i in 0..LANES {
            let of = |list: &[u32]| smooth[list[start + i] as usize];
            let [left, right, above, below] = &lattice.beside;
            let real = lattice.real[start + i] / norm;
            g[0][i] = real * (of(right) - of(left)) * lattice.per_px[0][start + i];
            g[1][i] = real * (of(below) - of(above)) * lattice.per_px[1][start + i];
            s[i] = (lattice.x[start + i] + 0.5) * scale;
            t[i] = (lattice.y[start + i] + 0.5) * scale;
        }
        for (slope, way) in slopes.iter_mut().zip(moved::<D>(g, s, t)) {
            slope[start..start + LANES].copy_from_slice(&way);
        }
    }
    let part = cells.start..cells.end;
    let (values, real) = (&values[part.clone()], &lattice.real[part.clone()]);
    for slope in slopes {
        let slope = &mut slope[part.clone()];
        let mean = dot(slope, real) / cells.count as f32;
        // Normalisation removes the component that only scales the grey levels.
        let along = dot(slope, values);
        for ((s, v), r) in slope.iter_mut().zip(values).zip(real) {
            *s -= mean * r + along * v;
        }
    }
}

impl<const D: usize> Bucket<D> {
    /// Computes the products.
    #[inline(always)]
    fn new(cells: GridBucket, values: &[f32], slopes: &[Vec<f32>; D]) -> Self {
        let part = cells.start..cells.end;
        let mut bucket = Self { cells, normal: SMatrix::zeros(), level: SVector::zeros() };
        for i in 0..D {
            let slope = &slopes[i][part.clone()];
            bucket.level[i] = f64::from(dot(slope, &values[part.clone()]));
            for (j, other) in slopes.iter().enumerate().take(i + 1) {
                let product = f64::from(dot(slope, &other[part.clone()]));
                bucket.normal[(i, j)] = product;
                bucket.normal[(j, i)] = product;
            }
        }
        bucket
    }
}

/// To mean 0 and norm 1, padding to 0; what the norm was. All zeros and `None` when the standard
/// deviation is below `min_deviation` or there is none.
#[inline(always)]
fn normalise(values: &mut [f32], real: &[f32], count: usize, min_deviation: f32) -> Option<f32> {
    let n = count as f32;
    let mean = dot(values, real) / n;
    for (v, r) in values.iter_mut().zip(real) {
        *v = (*v - mean) * r;
    }
    let square = dot(values, values);
    let seen = square > 0.0 && square.is_finite() && (square / n).sqrt() >= min_deviation;
    let scale = if seen { 1.0 / square.sqrt() } else { 0.0 };
    for v in values.iter_mut() {
        *v = if seen { *v * scale } else { 0.0 };
    }
    seen.then(|| square.sqrt())
}

/// Sum of products, by [`LANES`] partial sums: the same on every instruction set.
#[inline(always)]
pub(crate) fn dot(a: &[f32], b: &[f32]) -> f32 {
    let mut sums = [0.0_f32; LANES];
    for (x, y) in a.as_chunks::<LANES>().0.iter().zip(b.as_chunks::<LANES>().0) {
        for i in 0..LANES {
            sums[i] += x[i] * y[i];
        }
    }
    let mut width = LANES / 2;
    while width > 0 {
        for i in 0..width {
            sums[i] += sums[i + width];
        }
        width /= 2;
    }
    sums[0]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recognise::alignment::sampling_grid::{PaddedIcon, Pattern, SquareMap, sample, square};

    fn waves(x: i32, y: i32) -> f32 {
        let (x, y) = (f64::from(x), f64::from(y));
        (120.0 + 50.0 * (0.25 * x + 0.08 * y).sin() + 40.0 * (0.2 * y - 0.15 * x).cos()) as f32
    }

    #[test]
    fn slopes_are_the_finite_differences() {
        let lattice = SamplingGrid::new(75, 5, 4, Pattern::Fourth);
        let pixels: Vec<f32> = (0..75 * 75).map(|i| waves(i % 75, i / 75)).collect();
        let cost = Cost::<8>::new(&lattice, &pixels, 1.0);
        assert_eq!(cost.buckets.len(), 25);
        // The picture with 10 px around, and one corner moved there and back.
        let wide: Vec<f32> = (0..95 * 95).map(|i| waves((i % 95) - 10, (i / 95) - 10)).collect();
        let picture = PaddedIcon { pixels: &wide, width: 95, margin: 10 };
        for way in 0..8 {
            let seen = |by: f64| {
                let mut corners = square(75);
                corners[way / 2][way % 2] += by;
                let mut seen = vec![0.0; lattice.len()];
                sample(picture, &SquareMap::new(75, &corners).unwrap(), &lattice.x, &lattice.y, &mut seen);
                for c in &lattice.buckets {
                    normalise(&mut seen[c.start..c.end], &lattice.real[c.start..c.end], c.count, 0.0)
                        .unwrap();
                }
                seen
            };
            let (ahead, behind) = (seen(0.5), seen(-0.5));
            let slope = &cost.slopes[way];
            let error: f32 =
                slope.iter().zip(ahead.iter().zip(&behind)).map(|(s, (a, b))| (s - (a - b)).powi(2)).sum();
            let all: f32 = slope.iter().map(|s| s * s).sum();
            assert!(error < 0.02 * all, "way {way}: {error} of {all}");
        }
    }

    #[test]
    fn sides_are_sums_of_corners() {
        let lattice = SamplingGrid::new(25, 5, 1, Pattern::All);
        let pixels: Vec<f32> = (0..625).map(|i| waves(3 * (i % 25), 3 * (i / 25))).collect();
        let (sides, corners) =
            (Cost::<4>::new(&lattice, &pixels, 1.0), Cost::<8>::new(&lattice, &pixels, 1.0));
        for (side, [a, b]) in [[0, 6], [2, 4], [1, 3], [5, 7]].into_iter().enumerate() {
            for i in 0..lattice.len() {
                let sum = corners.slopes[a][i] + corners.slopes[b][i];
                assert!((sides.slopes[side][i] - sum).abs() < 1e-5);
            }
        }
    }

    #[test]
    fn flat_buckets_are_ignored() {
        let lattice = SamplingGrid::new(75, 5, 0, Pattern::All);
        let pixels: Vec<f32> =
            (0..75 * 75).map(|i| if i % 75 < 15 { waves(i % 75, i / 75) } else { 80.0 }).collect();
        let cost = Cost::<4>::new(&lattice, &pixels, 1.0);
        assert_eq!(cost.buckets.len(), 5);
        assert!(Cost::<4>::new(&lattice, &vec![f32::NAN; 5625], 1.0).buckets.is_empty());
    }
}
