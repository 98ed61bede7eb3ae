//! Two icons in, bucketed correlation C^r out (method 6.1). Buckets are normalised once for each
//! icon, so that a comparison is 25 dot products at the default parameters.

use crate::{icon::Icon, recognise::features::separable::LANES};
use serde::{Deserialize, Serialize};

/// Most buckets along a side, whatever the parameters say.
pub const MAX_BUCKETS_PER_SIDE: usize = 10;
/// Parameters of this stage.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CorrelationParams {
    /// Buckets along each side of the icon, 1 to [`MAX_BUCKETS_PER_SIDE`].
    pub buckets_per_side: usize,
    /// C^r is 1 minus this greatest of the bucket correlations, counted from 1.
    pub rank: usize,
    /// A bucket with a smaller standard deviation, in grey levels, correlates with nothing.
    pub min_deviation: f64,
}

impl Default for CorrelationParams {
    fn default() -> Self {
        Self { buckets_per_side: 5, rank: 12, min_deviation: 1.0 }
    }
}

impl CorrelationParams {
    /// Buckets along a side, within the limits.
    pub fn per_side(&self) -> usize {
        self.buckets_per_side.clamp(1, MAX_BUCKETS_PER_SIDE)
    }

    /// The rank k, within the number of buckets.
    pub fn rank(&self) -> usize {
        self.rank.clamp(1, self.per_side() * self.per_side())
    }
}

/// The buckets of an icon, row by row, each of zero mean and norm 1 (all zeros when it is flat),
/// one after the other.
#[derive(Debug, Clone, PartialEq)]
pub struct Buckets {
    per_side: usize,
    stride: usize,
    values: Vec<f32>,
}

impl Buckets {
    /// Cuts and normalises `icon`. With a size that does not divide, buckets differ by a pixel.
    pub fn new(icon: &Icon, p: &CorrelationParams) -> Self {
        let per_side = p.per_side();
        let edge = |i: usize| i * icon.size / per_side;
        let longest = icon.size.div_ceil(per_side);
        let stride = (longest * longest).next_multiple_of(LANES);
        let mut values = vec![0.0; stride * per_side * per_side];
        for (i, out) in values.chunks_exact_mut(stride).enumerate() {
            let (row, column) = (i / per_side, i % per_side);
            let mut n = 0;
            for y in edge(row)..edge(row + 1) {
                for x in edge(column)..edge(column + 1) {
                    out[n] = icon.pixels[y * icon.size + x];
                    n += 1;
                }
            }
            normalise(&mut out[..n], p.min_deviation);
        }
        Self { per_side, stride, values }
    }

    /// Numbers in each bucket, padding included.
    pub fn stride(&self) -> usize {
        self.stride
    }

    /// All buckets, each [`Buckets::stride`] long.
    pub fn values(&self) -> &[f32] {
        &self.values
    }
}

/// To mean 0 and norm 1, or to all zeros below `min_deviation`.
fn normalise(values: &mut [f32], min_deviation: f64) {
    let n = values.len().max(1) as f64;
    let mean = values.iter().map(|v| f64::from(*v)).sum::<f64>() / n;
    let square = values.iter().map(|v| (f64::from(*v) - mean).powi(2)).sum::<f64>();
    let flat = !(square.is_finite() && (square / n).sqrt() >= min_deviation && square > 0.0);
    let scale = if flat { 0.0 } else { 1.0 / square.sqrt() };
    for v in values {
        *v = if flat { 0.0 } else { ((f64::from(*v) - mean) * scale) as f32 };
    }
}

/// Zero-mean normalised correlation of two normalised buckets, by [`LANES`] partial sums.
pub(crate) fn dot(a: &[f32], b: &[f32]) -> f32 {
    let mut sums = [0.0_f32; LANES];
    for (x, y) in a.chunks_exact(LANES).zip(b.chunks_exact(LANES)) {
        for i in 0..LANES {
            sums[i] += x[i] * y[i];
        }
    }
    sums.iter().sum()
}

/// The correlation of every bucket pair, row by row; `None` when the icons were cut differently.
pub fn bucket_correlations(a: &Buckets, b: &Buckets) -> Option<Vec<f32>> {
    if a.per_side != b.per_side || a.stride != b.stride {
        return None;
    }
    Some(
        a.values
            .chunks_exact(a.stride)
            .zip(b.values.chunks_exact(b.stride))
            .map(|(x, y)| dot(x, y))
            .collect(),
    )
}

/// `1 - kth greatest` of `correlations`, in [0, 2].
pub(crate) fn ranked(correlations: &mut [f32], rank: usize) -> f64 {
    if correlations.is_empty() {
        return 2.0;
    }
    let index = rank.clamp(1, correlations.len()) - 1;
    let (_, kth, _) = correlations.select_nth_unstable_by(index, |x, y| y.total_cmp(x));
    (1.0 - f64::from(*kth)).clamp(0.0, 2.0)
}

/// C^r when it is at most `limit`, else `None`; `None` also for icons cut differently. Counts
/// buckets instead of ranking them, and stops as soon as the rest cannot reach the rank: unrelated
/// icons cost half the dot products.
pub(crate) fn correlation_within(a: &Buckets, b: &Buckets, rank: usize, limit: f64) -> Option<f64> {
    if a.per_side != b.per_side || a.stride != b.stride {
        return None;
    }
    // Rounding of the limit must not lose a distance equal to it.
    let floor = (1.0 - limit) as f32 - 1e-6;
    let total = a.per_side * a.per_side;
    let mut all = [0.0; MAX_BUCKETS_PER_SIDE * MAX_BUCKETS_PER_SIDE];
    let mut reached = 0;
    for (i, (x, y)) in a.values.chunks_exact(a.stride).zip(b.values.chunks_exact(b.stride)).enumerate() {
        all[i] = dot(x, y);
        reached += usize::from(all[i] >= floor);
        if reached + total - 1 - i < rank {
            return None;
        }
    }
    Some(ranked(&mut all[..total], rank)).filter(|d| *d <= limit)
}

/// C^r of two icons by their buckets, in [0, 2]: 0 for the same picture under any gain and offset.
/// Icons of different sizes or bucket numbers have the largest distance: 2.
pub fn correlation(a: &Buckets, b: &Buckets, p: &CorrelationParams) -> f64 {
    bucket_correlations(a, b).map_or(2.0, |mut all| ranked(&mut all, p.rank()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn made(size: usize, f: impl Fn(usize, usize) -> f32) -> Buckets {
        let pixels = (0..size * size).map(|i| f(i % size, i / size)).collect();
        Buckets::new(&Icon { size, pixels, source_scale: 1.0 }, &CorrelationParams::default())
    }

    fn texture(x: usize, y: usize) -> f32 {
        ((x * 7919 + y * 104_729 + x * y * 31) % 101) as f32
    }

    #[test]
    fn invariant_to_gain_and_offset_and_largest_for_the_negative() {
        let p = CorrelationParams::default();
        let plain = made(75, texture);
        assert!(correlation(&plain, &plain, &p) < 1e-6);
        assert!(correlation(&plain, &made(75, |x, y| 0.3 * texture(x, y) + 90.0), &p) < 1e-5);
        assert!((correlation(&plain, &made(75, |x, y| 200.0 - texture(x, y)), &p) - 2.0).abs() < 1e-5);
        assert!((correlation(&plain, &made(75, |_, _| 80.0), &p) - 1.0).abs() < 1e-9);
    }

    #[test]
    fn rank_counts_buckets() {
        // n equal buckets, the others negated: C^r is 0 while rank <= n and 2 beyond.
        let plain = made(75, texture);
        for equal in [1, 11, 12, 13, 24] {
            let mixed =
                made(
                    75,
                    |x, y| {
                        if (y / 15) * 5 + x / 15 < equal { texture(x, y) } else { 150.0 - texture(x, y) }
                    },
                );
            for rank in [1, 11, 12, 13, 25] {
                let p = CorrelationParams { rank, ..CorrelationParams::default() };
                let expected = if rank <= equal { 0.0 } else { 2.0 };
                assert!((correlation(&plain, &mixed, &p) - expected).abs() < 1e-5, "{equal} {rank}");
            }
        }
    }

    #[test]
    fn equals_the_naive_sums() {
        let other = |x: usize, y: usize| texture(x + 3, y) * 0.6 + texture(x, y) * 0.4;
        let (a, b) = (made(73, texture), made(73, other));
        let mut naive = Vec::new();
        for i in 0..25 {
            let (mut xs, mut ys) = (Vec::new(), Vec::new());
            for y in (i / 5) * 73 / 5..(i / 5 + 1) * 73 / 5 {
                for x in (i % 5) * 73 / 5..(i % 5 + 1) * 73 / 5 {
                    xs.push(f64::from(texture(x, y)));
                    ys.push(f64::from(other(x, y)));
                }
            }
            let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
            let (mx, my) = (mean(&xs), mean(&ys));
            let sum =
                |f: &dyn Fn(f64, f64) -> f64| xs.iter().zip(&ys).map(|(x, y)| f(x - mx, y - my)).sum::<f64>();
            naive.push(sum(&|x, y| x * y) / (sum(&|x, _| x * x) * sum(&|_, y| y * y)).sqrt());
        }
        naive.sort_by(|x, y| y.total_cmp(x));
        let actual = correlation(&a, &b, &CorrelationParams::default());
        assert!((actual - (1.0 - naive[11])).abs() < 1e-5, "{actual} {}", 1.0 - naive[11]);
    }

    #[test]
    fn a_flat_bucket_correlates_with_nothing() {
        // Standard deviation 1 is kept, anything less is flat.
        let striped = |height: f32| made(75, move |x, _| 100.0 + if x % 2 == 0 { height } else { -height });
        let ours = striped(20.0);
        let all = |b: &Buckets| bucket_correlations(&ours, b).unwrap();
        assert!(all(&striped(1.01)).iter().all(|c| *c > 0.999));
        assert!(all(&striped(0.99)).iter().all(|c| c.abs() < 1e-9));
    }

    #[test]
    fn icons_of_other_sizes_have_the_largest_distance() {
        assert!(
            (correlation(&made(75, texture), &made(50, texture), &CorrelationParams::default()) - 2.0).abs()
                < 1e-9
        );
    }

    proptest! {
        #[test]
        fn symmetric_and_in_range(
            a in proptest::collection::vec(0.0..255.0_f32, 400),
            b in proptest::collection::vec(0.0..255.0_f32, 400),
            rank in 0_usize..200,
            buckets_per_side in 0_usize..30,
        ) {
            let p = CorrelationParams { buckets_per_side, rank, ..CorrelationParams::default() };
            let buckets = |pixels| Buckets::new(&Icon { size: 20, pixels, source_scale: 1.0 }, &p);
            let (a, b) = (buckets(a), buckets(b));
            let (ab, ba) = (correlation(&a, &b, &p), correlation(&b, &a, &p));
            prop_assert!((ab - ba).abs() < 1e-9);
            prop_assert!((0.0..=2.0).contains(&ab));
            // A greater rank asks more buckets to agree.
            let stricter = CorrelationParams { rank: rank + 1, ..p };
            prop_assert!(correlation(&a, &b, &stricter) >= ab);
        }
    }
}
