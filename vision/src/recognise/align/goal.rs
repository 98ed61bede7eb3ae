//! What a picture shall look like, bucket by bucket, and how that changes with its corners: a template's grey levels of
//! mean 0 and norm 1, and their slopes. The template stays where it is; moving is `settle`'s.

#![expect(
    clippy::inline_always,
    reason = "an instruction set holds only in what is inlined where it was chosen"
)]

use super::{
    super::correlation::LANES,
    lattice::{Cells, Lattice},
};
use nalgebra::{SMatrix, SVector};

/// A template on a lattice, with `D` ways to move: 4 for the sides, 8 for the coordinates of the corners.
#[derive(Debug, Clone)]
pub(super) struct Goal<const D: usize> {
    /// Grey levels, zeros for padding and for buckets with nothing to see.
    pub(super) values: Vec<f32>,
    /// Buckets in which there is something to see, with what does not change from step to step.
    pub(super) buckets: Vec<Bucket<D>>,
    /// Change of the grey levels with each way to move, likewise.
    pub(super) slopes: [Vec<f32>; D],
}

#[derive(Debug, Clone)]
pub(super) struct Bucket<const D: usize> {
    pub(super) cells: Cells,
    /// Products of the slopes.
    pub(super) normal: SMatrix<f64, D, D>,
    /// Of the slopes with the template's grey levels.
    pub(super) level: SVector<f64, D>,
}

/// How a point moves along x and y with each way to move, left, right, top, bottom side or x and y of TL, TR, BR, BL: the
/// derivative of the homography, exact at the square itself. Moving one corner alone also bends lines, so it moves
/// points along the other axis, too.
#[inline(always)]
fn moves<const D: usize>(s: f32, t: f32) -> [[f32; 2]; D] {
    let mut all = [[0.0; 2]; D];
    if D == 4 {
        all.copy_from_slice(&[[1.0 - s, 0.0], [s, 0.0], [0.0, 1.0 - t], [0.0, t]]);
        return all;
    }
    let corners = [(1.0 - s) * (1.0 - t), s * (1.0 - t), s * t, (1.0 - s) * t];
    let bend = [s * (1.0 - s), t * (1.0 - t)];
    for (i, way) in all.iter_mut().enumerate() {
        let sign = if (i / 2) % 2 == 0 { -1.0 } else { 1.0 };
        let (along, across) = (corners[(i / 2) % 4], sign * bend[1 - i % 2]);
        *way = if i % 2 == 0 { [along, across] } else { [across, along] };
    }
    all
}

impl<const D: usize> Goal<D> {
    /// Of the smoothed icon `smooth`. A bucket whose grey levels deviate by less than `min_deviation` says nothing.
    #[inline(always)]
    pub(super) fn new(lattice: &Lattice, smooth: &[f32], min_deviation: f32) -> Self {
        let mut values = vec![0.0; lattice.len()];
        let mut goal = Self {
            values: vec![],
            buckets: vec![],
            slopes: std::array::from_fn(|_| vec![0.0; lattice.len()]),
        };
        for cells in &lattice.buckets {
            let at = &lattice.at[cells.start..cells.end];
            let own = &mut values[cells.start..cells.end];
            for (value, at) in own.iter_mut().zip(at) {
                *value = smooth[*at as usize];
            }
            let Some(norm) =
                normalise(own, &lattice.real[cells.start..cells.end], cells.count, min_deviation)
            else {
                continue;
            };
            goal.add_slopes(lattice, smooth, *cells, &values, norm);
            goal.buckets.push(Bucket { cells: *cells, normal: SMatrix::zeros(), level: SVector::zeros() });
        }
        goal.values = values;
        goal.multiply();
        goal
    }

    /// The same goal with the slopes of `smooth`, the picture itself as it lies now, instead of the template's: those
    /// would pull where one of the two is softer.
    #[inline(always)]
    pub(super) fn with_slopes_of(&self, lattice: &Lattice, smooth: &[f32]) -> Self {
        let theirs = Self::new(lattice, smooth, 0.0);
        let mut goal =
            Self { values: self.values.clone(), buckets: self.buckets.clone(), slopes: theirs.slopes };
        goal.multiply();
        goal
    }

    /// Slopes of one bucket, whose normalised grey levels and norm are known.
    #[inline(always)]
    fn add_slopes(&mut self, lattice: &Lattice, smooth: &[f32], cells: Cells, values: &[f32], norm: f32) {
        let size = lattice.size;
        let (scale, part) = (1.0 / size as f32, cells.start..cells.end);
        for i in part.clone() {
            let at = lattice.at[i] as usize;
            let (x, y) = (at % size, at / size);
            let (left, right) = (usize::from(x > 0), usize::from(x + 1 < size));
            let (up, down) = (usize::from(y > 0), usize::from(y + 1 < size));
            let real = lattice.real[i] / norm;
            let gx = real * (smooth[at + right] - smooth[at - left]) / (left + right) as f32;
            let gy = real * (smooth[at + down * size] - smooth[at - up * size]) / (up + down) as f32;
            let ways = moves::<D>((x as f32 + 0.5) * scale, (y as f32 + 0.5) * scale);
            for (slope, [dx, dy]) in self.slopes.iter_mut().zip(ways) {
                slope[i] = dx * gx + dy * gy;
            }
        }
        let (values, real) = (&values[part.clone()], &lattice.real[part.clone()]);
        for slope in &mut self.slopes {
            let slope = &mut slope[part.clone()];
            let mean = dot(slope, real) / cells.count as f32;
            // What only scales the grey levels is lost when they are normalised.
            let along = dot(slope, values);
            for ((s, v), r) in slope.iter_mut().zip(values).zip(real) {
                *s -= mean * r + along * v;
            }
        }
    }

    /// Works out the products.
    #[inline(always)]
    fn multiply(&mut self) {
        for bucket in &mut self.buckets {
            let part = bucket.cells.start..bucket.cells.end;
            for i in 0..D {
                let slope = &self.slopes[i][part.clone()];
                bucket.level[i] = f64::from(dot(slope, &self.values[part.clone()]));
                for j in 0..=i {
                    let product = f64::from(dot(slope, &self.slopes[j][part.clone()]));
                    bucket.normal[(i, j)] = product;
                    bucket.normal[(j, i)] = product;
                }
            }
        }
    }
}

/// To mean 0 and norm 1, padding to 0; what the norm was. All zeros and `None` when the standard deviation is below
/// `min_deviation` or there is none.
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
pub(super) fn dot(a: &[f32], b: &[f32]) -> f32 {
    let mut sums = [0.0_f32; LANES];
    for (x, y) in a.as_chunks::<LANES>().0.iter().zip(b.as_chunks::<LANES>().0) {
        for i in 0..LANES {
            sums[i] += x[i] * y[i];
        }
    }
    let mut half = [0.0_f32; LANES / 2];
    for i in 0..LANES / 2 {
        half[i] = sums[i] + sums[i + LANES / 2];
    }
    half.iter().sum()
}

#[cfg(test)]
mod tests {
    use super::super::lattice::{Pattern, Picture, SquareMap, sample, square};
    use super::*;

    fn waves(x: i32, y: i32) -> f32 {
        let (x, y) = (f64::from(x), f64::from(y));
        (120.0 + 50.0 * (0.25 * x + 0.08 * y).sin() + 40.0 * (0.2 * y - 0.15 * x).cos()) as f32
    }

    #[test]
    fn slopes_are_the_finite_differences() {
        let lattice = Lattice::new(75, 5, 4, Pattern::Fourth);
        let pixels: Vec<f32> = (0..75 * 75).map(|i| waves(i % 75, i / 75)).collect();
        let goal = Goal::<8>::new(&lattice, &pixels, 1.0);
        assert_eq!(goal.buckets.len(), 25);
        // The picture with 10 px around, and one corner moved there and back.
        let wide: Vec<f32> = (0..95 * 95).map(|i| waves((i % 95) - 10, (i / 95) - 10)).collect();
        let picture = Picture { pixels: &wide, width: 95, margin: 10 };
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
            let slope = &goal.slopes[way];
            let error: f32 =
                slope.iter().zip(ahead.iter().zip(&behind)).map(|(s, (a, b))| (s - (a - b)).powi(2)).sum();
            let all: f32 = slope.iter().map(|s| s * s).sum();
            assert!(error < 0.02 * all, "way {way}: {error} of {all}");
        }
    }

    #[test]
    fn sides_are_sums_of_corners() {
        let lattice = Lattice::new(25, 5, 1, Pattern::All);
        let pixels: Vec<f32> = (0..625).map(|i| waves(3 * (i % 25), 3 * (i / 25))).collect();
        let (sides, corners) =
            (Goal::<4>::new(&lattice, &pixels, 1.0), Goal::<8>::new(&lattice, &pixels, 1.0));
        for (side, [a, b]) in [[0, 6], [2, 4], [1, 3], [5, 7]].into_iter().enumerate() {
            for i in 0..lattice.len() {
                let sum = corners.slopes[a][i] + corners.slopes[b][i];
                assert!((sides.slopes[side][i] - sum).abs() < 1e-5);
            }
        }
    }

    #[test]
    fn flat_buckets_say_nothing() {
        let lattice = Lattice::new(75, 5, 0, Pattern::All);
        let pixels: Vec<f32> =
            (0..75 * 75).map(|i| if i % 75 < 15 { waves(i % 75, i / 75) } else { 80.0 }).collect();
        let goal = Goal::<4>::new(&lattice, &pixels, 1.0);
        assert_eq!(goal.buckets.len(), 5);
        assert!(Goal::<4>::new(&lattice, &vec![f32::NAN; 5625], 1.0).buckets.is_empty());
    }
}
