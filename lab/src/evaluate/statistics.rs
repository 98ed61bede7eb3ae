//! Numbers about numbers: quantiles, and 95 % confidence intervals of a share and of anything
//! computed from images.

use serde::Serialize;

/// Quantile of the standard normal distribution for 95 %, two-sided.
const Z95: f64 = 1.959_963_984_540_054;
/// Resamplings of a bootstrap.
const RESAMPLINGS: usize = 1000;
/// Halvings of the range in which a bound is looked for.
const BISECTIONS: usize = 60;
/// The same report from the same results.
const SEED: u64 = 0x5eed;

/// Bounds of a 95 % confidence interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct Interval(pub(crate) f64, pub(crate) f64);

/// The middle value; of two middle ones their mean. Sorts.
pub(crate) fn median(values: &mut [f64]) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let n = values.len();
    (n > 0).then(|| f64::midpoint(values[(n - 1) / 2], values[n / 2]))
}

/// The least value that at least `share` of the values do not exceed. Sorts.
pub(crate) fn quantile(values: &mut [f64], share: f64) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let rank = (share * values.len() as f64).ceil() as usize;
    values.get(rank.saturating_sub(1).min(values.len().saturating_sub(1))).copied()
}

/// Wilson's score interval of `hits` of `of`.
pub(crate) fn wilson(hits: usize, of: usize) -> Interval {
    if of == 0 {
        return Interval(0.0, 1.0);
    }
    let (n, p, z2) = (of as f64, hits as f64 / of as f64, Z95 * Z95);
    let centre = (p + 0.5 * z2 / n) / (1.0 + z2 / n);
    let half = Z95 / (1.0 + z2 / n) * (p * (1.0 - p) / n + 0.25 * z2 / (n * n)).sqrt();
    Interval((centre - half).max(0.0), (centre + half).min(1.0))
}

/// Exact one-sided upper bound at 95 % (Clopper and Pearson) of a share of which `hits` of `of`
/// trials are hits: the share at which as few hits occur in one case of twenty. 1 where nothing was
/// tried.
pub(crate) fn upper_bound(hits: usize, of: usize) -> f64 {
    if hits >= of {
        return 1.0;
    }
    let (mut low, mut high) = (hits as f64 / of as f64, 1.0);
    for _ in 0..BISECTIONS {
        let middle = f64::midpoint(low, high);
        if at_most(hits, of, middle) > 0.05 { low = middle } else { high = middle }
    }
    f64::midpoint(low, high)
}

/// Chance of at most `hits` of `of` where each comes with `share`.
fn at_most(hits: usize, of: usize, share: f64) -> f64 {
    let odds = (share / (1.0 - share)).ln();
    let mut term = of as f64 * (-share).ln_1p();
    let mut sum = term.exp();
    for k in 0..hits {
        term += ((of - k) as f64 / (k + 1) as f64).ln() + odds;
        sum += term.exp();
    }
    sum
}

/// Interval of a figure of several images by the percentile bootstrap: images are drawn with
/// repetition, 1000 times, a fixed seed. None when some resampling has no such figure, or there is
/// one image at most.
pub(crate) fn bootstrap<T>(images: &[T], figure: impl Fn(&[&T]) -> Option<f64>) -> Option<Interval> {
    if images.len() < 2 {
        return None;
    }
    let mut state = SEED;
    let mut figures = Vec::with_capacity(RESAMPLINGS);
    for _ in 0..RESAMPLINGS {
        let drawn: Vec<&T> =
            images.iter().map(|_| &images[(next(&mut state) % images.len() as u64) as usize]).collect();
        figures.push(figure(&drawn)?);
    }
    Some(Interval(quantile(&mut figures, 0.025)?, quantile(&mut figures, 0.975)?))
}

/// Splitmix64.
fn next(state: &mut u64) -> u64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn median_of_even_and_odd() {
        assert_eq!(median(&mut []), None);
        assert!((median(&mut [3.0, 1.0, 2.0]).unwrap() - 2.0).abs() < 1e-12);
        assert!((median(&mut [4.0, 1.0, 2.0, 3.0]).unwrap() - 2.5).abs() < 1e-12);
    }

    #[test]
    fn quantiles_are_values() {
        let mut ten: Vec<f64> = (1..=10).rev().map(f64::from).collect();
        for (share, value) in [(0.0, 1.0), (0.1, 1.0), (0.11, 2.0), (0.9, 9.0), (1.0, 10.0)] {
            assert_eq!(quantile(&mut ten, share), Some(value), "{share}");
        }
        assert_eq!(quantile(&mut [], 0.5), None);
    }

    #[test]
    fn wilson_as_in_the_tables() {
        // Newcombe 1998, Table I, method 3: 81/263, 15/148, 0/20, 1/29.
        for (hits, of, low, high) in [
            (81, 263, 0.2553, 0.3662),
            (15, 148, 0.0624, 0.1605),
            (0, 20, 0.0, 0.1611),
            (1, 29, 0.0061, 0.1718),
        ] {
            let Interval(l, h) = wilson(hits, of);
            assert!((l - low).abs() < 5e-5 && (h - high).abs() < 5e-5, "{hits}/{of}: {l} {h}");
        }
        assert_eq!(wilson(0, 0), Interval(0.0, 1.0));
    }

    #[test]
    fn exact_bounds_as_in_the_tables() {
        // Trials that show 1e-4, with 0, 1, 2, 3 and 5 hits (chi-squared quantiles over 2e-4), and
        // 1e-3 with none.
        for (hits, of, bound) in [
            (0, 29_956, 1e-4),
            (1, 47_437, 1e-4),
            (2, 62_956, 1e-4),
            (3, 77_535, 1e-4),
            (5, 105_128, 1e-4),
            (0, 2_995, 1e-3),
            (0, 10, 0.258_866),
            (3, 10, 0.606_624),
        ] {
            assert!(
                (upper_bound(hits, of) / bound - 1.0).abs() < 1e-3,
                "{hits}/{of}: {}",
                upper_bound(hits, of)
            );
        }
        assert!((upper_bound(0, 0) - 1.0).abs() < 1e-12 && (upper_bound(4, 4) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn the_bootstrap_agrees_with_the_error_of_a_mean() {
        let values: Vec<f64> = (0..400).map(|i| f64::from(i % 2)).collect();
        let mean = |v: &[&f64]| Some(v.iter().copied().sum::<f64>() / v.len() as f64);
        let Interval(low, high) = bootstrap(&values, mean).unwrap();
        // 0.5 plus and minus 1.96 * 0.5 / 20.
        assert!((low - 0.451).abs() < 0.01 && (high - 0.549).abs() < 0.01, "{low} {high}");
        assert_eq!(bootstrap(&values, mean), bootstrap(&values, mean));
        assert_eq!(bootstrap(&values[..1], mean), None);
        assert_eq!(bootstrap(&values, |_| None), None);
    }
}
