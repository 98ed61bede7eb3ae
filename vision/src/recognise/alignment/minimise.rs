//! Iterative alignment of a quad's corners: damped least squares over normalised buckets, each
//! weighted by its correlation, so that covered parts have little influence.

#![expect(
    clippy::inline_always,
    reason = "an instruction set holds only in what is inlined where it was chosen"
)]

use crate::recognise::alignment::{
    certainty::corner_covariances,
    cost::{Cost, dot},
    sampling_grid::{SamplingGrid, SquareMap, square},
};
use nalgebra::{Const, DimMin, Matrix2, Point2, SMatrix, SVector, Vector2};

/// A rejected step is not retried with more damping if it was shorter than this many times
/// [`Limits::settled_px`].
const HARDLY_WRONG: f64 = 5.0;
/// Share of the mean diagonal element that is added to each.
const LEAST_DAMPING: f64 = 1e-3;
/// Damping at which a rejected step ends the iteration.
const MOST_DAMPING: f64 = 1.0;

/// Result of the iteration: the corners and the similarity there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct LmResult {
    pub(crate) corners: [Point2<f64>; 4],
    /// Mean squared correlation of the buckets.
    pub(crate) likeness: f64,
    /// Covariances of the corners, in squared pixels of the icon, where all eight coordinates
    /// moved.
    pub(crate) covariances: Option<[Matrix2<f64>; 4]>,
}

/// Limits of the displacement and the number of steps.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Limits {
    /// Largest displacement from the corner of the square, in pixels of the icon, along either
    /// axis.
    pub(crate) shift_px: f64,
    pub(crate) steps: usize,
    /// A step of less than this, in pixels of the icon, is the last.
    pub(crate) settled_px: f64,
}

/// Moves the corners of the icon, beginning at `start`; `sample` reads the picture at the grid's
/// points under a map. `None` when the buckets do not determine the corners.
///
/// Levenberg-Marquardt: a rejected step is retried with more damping. Inverse compositional (Baker
/// and Matthews 2004): the derivatives of the cost are computed once, not at every step.
#[inline(always)]
pub(crate) fn minimise<const D: usize>(
    cost: &Cost<D>,
    lattice: &SamplingGrid,
    mut sample: impl FnMut(&SquareMap, &mut [f32]),
    start: [Point2<f64>; 4],
    limits: Limits,
) -> Option<LmResult>
where
    Const<D>: DimMin<Const<D>, Output = Const<D>>,
{
    let square = square(lattice.size);
    let mut damping = LEAST_DAMPING;
    let mut map = SquareMap::new(lattice.size, &start)?;
    let mut seen = vec![0.0; lattice.len()];
    let (mut corners, mut here) = (start, Equations::new(cost, lattice, &mut sample, &map, -1.0, &mut seen));
    for _ in 0..limits.steps {
        let step = corner_moves(&here.step(damping)?);
        // Inverse composition: the map is composed with the inverse of the template's step.
        let moved: [Point2<f64>; 4] = std::array::from_fn(|i| map.apply(&(square[i] + step[i])));
        let shift = moved.iter().zip(&square).map(|(m, s)| (m - s).amax()).fold(0.0, f64::max);
        let next = (shift <= limits.shift_px).then(|| SquareMap::new(lattice.size, &moved)).flatten();
        let length_px = step.iter().map(Vector2::amax).fold(0.0, f64::max);
        let next =
            next.map(|m| (m, Equations::new(cost, lattice, &mut sample, &m, here.objective, &mut seen)));
        match next {
            Some((there, equations)) if equations.objective > here.objective => {
                (map, corners, here) = (there, moved, equations);
                damping = LEAST_DAMPING.max(damping / 10.0);
                if length_px < limits.settled_px {
                    break;
                }
            }
            _ if damping > MOST_DAMPING || length_px < HARDLY_WRONG * limits.settled_px => break,
            _ => damping *= 10.0,
        }
    }
    let terms: Vec<_> =
        here.terms.iter().map(|s| (cost.buckets[s.bucket].normal * s.weight, s.gradient)).collect();
    let covariances = corner_covariances(&terms);
    Some(LmResult { corners, likeness: here.likeness / lattice.all_buckets as f64, covariances })
}

/// Moves of TL, TR, BR, BL: from those of the left, right, top and bottom sides, or as they are.
fn corner_moves<const D: usize>(step: &SVector<f64, D>) -> [Vector2<f64>; 4] {
    if D == 4 {
        let (left, right, top, bottom) = (step[0], step[1], step[2], step[3]);
        [[left, top], [right, top], [right, bottom], [left, bottom]].map(Vector2::from)
    } else {
        std::array::from_fn(|i| Vector2::new(step[2 * i], step[2 * i + 1]))
    }
}

/// Contribution of one bucket to the normal equations.
struct BucketTerm<const D: usize> {
    bucket: usize,
    weight: f64,
    /// Contribution to the right-hand side.
    gradient: SVector<f64, D>,
}

/// Normal equations of the parameters, and the similarity of picture and template.
struct Equations<const D: usize> {
    normal: SMatrix<f64, D, D>,
    right: SVector<f64, D>,
    /// Contribution of each bucket.
    terms: Vec<BucketTerm<D>>,
    /// The objective, weighted correlation: a partly covered bucket has far less weight than an
    /// uncovered one.
    objective: f64,
    /// Squared correlations of the buckets, added up.
    likeness: f64,
}

impl<const D: usize> Equations<D>
where
    Const<D>: DimMin<Const<D>, Output = Const<D>>,
{
    /// The similarity at `map`, and the normal equations there if it exceeds `least`.
    #[inline(always)]
    fn new(
        cost: &Cost<D>,
        lattice: &SamplingGrid,
        sample: &mut impl FnMut(&SquareMap, &mut [f32]),
        map: &SquareMap,
        least: f64,
        seen: &mut [f32],
    ) -> Self {
        let mut sum = Self {
            normal: SMatrix::zeros(),
            right: SVector::zeros(),
            terms: vec![],
            objective: 0.0,
            likeness: 0.0,
        };
        sample(map, seen);
        let mut weighted = Vec::with_capacity(cost.buckets.len());
        for (i, bucket) in cost.buckets.iter().enumerate() {
            let part = bucket.cells.start..bucket.cells.end;
            let (seen, real) = (&seen[part.clone()], &lattice.real[part.clone()]);
            let mean = dot(seen, real) / bucket.cells.count as f32;
            let norm = squares(seen, real, mean).sqrt();
            if norm.is_nan() || norm <= 0.0 {
                continue;
            }
            let correlation = dot(seen, &cost.values[part]) / norm;
            if correlation > 0.0 {
                let correlation = f64::from(correlation);
                let weight = correlation * correlation * correlation;
                sum.objective += weight * correlation;
                sum.likeness += correlation * correlation;
                weighted.push((i, norm, weight));
            }
        }
        if sum.objective <= least {
            return sum;
        }
        for (i, norm, weight) in weighted {
            let bucket = &cost.buckets[i];
            let part = bucket.cells.start..bucket.cells.end;
            sum.normal += bucket.normal * weight;
            let mut gradient = SVector::zeros();
            for d in 0..D {
                // Slopes have mean 0: the mean of the grey levels cancels.
                let level = f64::from(dot(&cost.slopes[d][part.clone()], &seen[part.clone()]) / norm);
                gradient[d] = weight * (bucket.level[d] - level);
            }
            sum.right += gradient;
            sum.terms.push(BucketTerm { bucket: i, weight, gradient });
        }
        sum
    }

    /// Solves the normal equations. Damping keeps undetermined parameters at zero.
    fn step(&self, damping: f64) -> Option<SVector<f64, D>> {
        let mut normal = self.normal;
        let damping = damping * normal.trace() / D as f64;
        if damping <= 0.0 || !damping.is_finite() {
            return None;
        }
        for i in 0..D {
            normal[(i, i)] += damping;
        }
        let step = normal.cholesky().map(|factor| factor.solve(&self.right));
        step.filter(|step| step.iter().all(|s| s.is_finite()))
    }
}

/// Sum of the squared deviations from `mean`, padding left out.
#[inline(always)]
fn squares(seen: &[f32], real: &[f32], mean: f32) -> f32 {
    const LANES: usize = crate::recognise::features::separable::LANES;
    let mut sums = [0.0_f32; LANES];
    for (s, r) in seen.as_chunks::<LANES>().0.iter().zip(real.as_chunks::<LANES>().0) {
        for i in 0..LANES {
            let d = (s[i] - mean) * r[i];
            sums[i] += d * d;
        }
    }
    sums.iter().sum()
}
