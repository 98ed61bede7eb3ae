//! The threshold tau of one landmark (method 8).
//!
//! In: distances of the landmark's own icons and of the negatives. Out: the tau of least weighted
//! cost of false positives and false negatives, with its error rates.

use crate::model::threshold::{LimitedBy, Threshold, ThresholdError};
use serde::{Deserialize, Serialize};

/// With fewer negatives than this the absolute cap counts as one of them.
pub const FEW_NEGATIVES: usize = 100;

/// Costs closer than this are equal: rounding must not move tau to the right.
const COST_TIE: f64 = 1e-9;

/// How tau is chosen.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ThresholdParams {
    /// Cost of a false positive in false negatives (lambda / mu); the paper's 6.
    pub false_positive_weight: f64,
    /// tau stays below this share of the smallest negative distance while there are no false
    /// positives.
    pub nearest_share: f64,
    /// Whether tau stays below that share and the absolute cap; otherwise it is that of least cost,
    /// as in the paper.
    pub limited: bool,
}

impl Default for ThresholdParams {
    fn default() -> Self {
        Self { false_positive_weight: 6.0, nearest_share: 0.9, limited: true }
    }
}

/// Weighted empirical cost `S(tau)` with lambda = `weight`, mu = 1. `S` of method 8.
pub fn cost(tau: f64, positives: &[f64], negatives: &[f64], weight: f64) -> f64 {
    weight * share(negatives, |d| d < tau) + share(positives, |d| d >= tau)
}

/// Midpoint of the leftmost interval of least cost (A18). Distances are 0 or more; infinite ones
/// are never accepted.
pub fn minimise(positives: &[f64], negatives: &[f64], weight: f64) -> Result<f64, ThresholdError> {
    check(positives)?;
    if positives.is_empty() {
        return Err(ThresholdError::NoPositive);
    }
    if negatives.is_empty() {
        return Err(ThresholdError::NoNegative);
    }
    check(negatives)?;
    if positives.iter().all(|d| d.is_infinite()) {
        return Err(ThresholdError::NothingFinite);
    }
    let (n_positive, n_negative) = (positives.len() as f64, negatives.len() as f64);
    let mut all: Vec<(f64, bool)> = positives.iter().map(|d| (*d, true)).collect();
    all.extend(negatives.iter().map(|d| (*d, false)));
    all.retain(|(d, _)| d.is_finite());
    all.sort_by(|a, b| a.0.total_cmp(&b.0));

    // tau = 0: nothing accepted, every own icon missed. Only a strictly lower cost replaces it.
    let (mut best_tau, mut best_cost) = (0.0, 1.0);
    let (mut below_positive, mut below_negative) = (0.0, 0.0);
    for (i, (d, own)) in all.iter().enumerate() {
        if *own {
            below_positive += 1.0;
        } else {
            below_negative += 1.0;
        }
        let next = all.get(i + 1).map_or(beyond(*d), |n| n.0);
        if next <= *d {
            continue;
        }
        let cost = weight * below_negative / n_negative + 1.0 - below_positive / n_positive;
        if cost < best_cost - COST_TIE {
            (best_tau, best_cost) = (f64::midpoint(*d, next), cost);
        }
    }
    if best_tau > 0.0 { Ok(best_tau) } else { Err(ThresholdError::Overlap) }
}

/// The tau in use: [`minimise`], then limited to `nearest_share` of the nearest negative where the
/// optimum has no false positive, and below `cap` always, unless `p` lifts both. With fewer than
/// [`FEW_NEGATIVES`] the cap counts as one more of them: the sample of negatives is small, and a
/// distractor as near as the cap may exist.
// Departs from method 8 twice. There n- = 0 gives no threshold; here the cap, measured on real
// distractors, replaces it. There small sets use the crossing of two normal curves; H^r has
// infinite values and both classes have long tails towards each other, where the fitted curves
// underestimate the errors.
pub fn threshold(
    positives: &[f64],
    negatives: &[f64],
    cap: f64,
    p: &ThresholdParams,
) -> Result<Threshold, ThresholdError> {
    let stand_in = (negatives.len() < FEW_NEGATIVES).then_some(cap);
    let against: Vec<f64> = negatives.iter().copied().chain(stand_in).collect();
    let mut tau = minimise(positives, &against, p.false_positive_weight)?;
    let mut limited_by = LimitedBy::Cost;
    let nearest = against.iter().copied().fold(f64::INFINITY, f64::min);
    if p.limited && nearest > tau && p.nearest_share * nearest < tau {
        (tau, limited_by) = (p.nearest_share * nearest, LimitedBy::NearestNegative);
    }
    if p.limited && cap < tau {
        (tau, limited_by) = (cap, LimitedBy::AbsoluteCap);
    }
    Ok(Threshold {
        tau,
        false_positive_rate: share(negatives, |d| d < tau),
        false_negative_rate: share(positives, |d| d >= tau),
        positives: positives.len(),
        negatives: negatives.len(),
        limited_by,
    })
}

/// The upper end of the interval that begins at the largest distance.
fn beyond(largest: f64) -> f64 {
    1.2 * largest + f64::MIN_POSITIVE
}

fn share(distances: &[f64], is: impl Fn(f64) -> bool) -> f64 {
    distances.iter().filter(|d| is(**d)).count() as f64 / distances.len().max(1) as f64
}

fn check(distances: &[f64]) -> Result<(), ThresholdError> {
    if distances.iter().any(|d| d.is_nan() || *d < 0.0) { Err(ThresholdError::NotADistance) } else { Ok(()) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const OWN: [f64; 5] = [1.0, 2.0, 2.5, 4.0, 6.0];
    const OTHERS: [f64; 6] = [3.0, 5.0, 7.0, 8.0, 9.0, 10.0];

    /// Golden values of method 8.
    #[test]
    fn golden_example() {
        let tau = minimise(&OWN, &OTHERS, 6.0).unwrap();
        assert!((tau - 2.75).abs() < 1e-12);
        assert!((cost(tau, &OWN, &OTHERS, 6.0) - 0.4).abs() < 1e-12);
        let capped = threshold(&OWN, &OTHERS, 100.0, &ThresholdParams::default()).unwrap();
        assert!((capped.tau - 2.7).abs() < 1e-12, "0.9 of the nearest negative");
        assert_eq!(capped.limited_by, LimitedBy::NearestNegative);
        assert_eq!((capped.positives, capped.negatives), (5, 6));
        assert!((capped.false_negative_rate - 0.4).abs() < 1e-12 && capped.false_positive_rate < 1e-12);
    }

    #[test]
    fn degenerate_input_gives_typed_errors() {
        assert_eq!(minimise(&[], &OTHERS, 6.0), Err(ThresholdError::NoPositive));
        assert_eq!(minimise(&OWN, &[], 6.0), Err(ThresholdError::NoNegative));
        assert_eq!(minimise(&[f64::NAN], &OTHERS, 6.0), Err(ThresholdError::NotADistance));
        assert_eq!(minimise(&OWN, &[-1.0], 6.0), Err(ThresholdError::NotADistance));
        assert_eq!(minimise(&[f64::INFINITY], &OTHERS, 6.0), Err(ThresholdError::NothingFinite));
        assert_eq!(minimise(&[5.0, 6.0], &[1.0, 2.0], 6.0), Err(ThresholdError::Overlap));
        assert_eq!(minimise(&[5.0], &[5.0], 6.0), Err(ThresholdError::Overlap));
        assert_eq!(minimise(&[0.0], &[0.0], 6.0), Err(ThresholdError::Overlap));
    }

    #[test]
    fn the_cap_replaces_missing_negatives() {
        let p = ThresholdParams::default();
        // Half way between the largest own distance and the cap.
        let alone = threshold(&OWN, &[], 7.0, &p).unwrap();
        assert!((alone.tau - 6.3).abs() < 1e-12 && alone.limited_by == LimitedBy::NearestNegative);
        assert!((threshold(&OWN, &[], 10.0, &p).unwrap().tau - 8.0).abs() < 1e-12);
        assert_eq!(alone.negatives, 0);
        // Own distances beyond the cap are false negatives.
        let short = threshold(&OWN, &[], 3.0, &p).unwrap();
        assert!((short.tau - 2.7).abs() < 1e-12 && (short.false_negative_rate - 0.4).abs() < 1e-12);
        assert_eq!(threshold(&[5.0], &[], 3.0, &p), Err(ThresholdError::Overlap));
        // With enough negatives the cap is only a bound.
        let few = threshold(&OWN, &[14.0; FEW_NEGATIVES - 1], 8.0, &p).unwrap();
        let many = threshold(&OWN, &[14.0; FEW_NEGATIVES], 8.0, &p).unwrap();
        assert!((few.tau - 7.0).abs() < 1e-12 && (many.tau - 8.0).abs() < 1e-12);
        assert_eq!(many.limited_by, LimitedBy::AbsoluteCap);
        // Without limits least cost decides alone; the cap still stands in for negatives.
        let free = ThresholdParams { limited: false, ..p };
        let many = threshold(&OWN, &[14.0; FEW_NEGATIVES], 8.0, &free).unwrap();
        assert!((many.tau - 10.0).abs() < 1e-12 && many.limited_by == LimitedBy::Cost);
        assert!((threshold(&OWN, &[], 7.0, &free).unwrap().tau - 6.5).abs() < 1e-12);
    }

    #[test]
    fn infinite_distances_are_never_accepted() {
        let tau = minimise(&[1.0, 2.0, f64::INFINITY], &[f64::INFINITY], 6.0).unwrap();
        assert!(tau > 2.0 && tau.is_finite());
        assert!((cost(tau, &[1.0, f64::INFINITY], &[f64::INFINITY], 6.0) - 0.5).abs() < 1e-12);
    }

    fn distances(max: usize) -> impl Strategy<Value = Vec<f64>> {
        // A coarse grid, so that ties between and within the classes are common.
        proptest::collection::vec((0u32..40).prop_map(|d| f64::from(d) * 0.25), 1..max)
    }

    proptest! {
        /// Oracle: the cost at every interval, counted anew (O(n^2)).
        #[test]
        fn no_interval_has_a_lower_cost(own in distances(30), others in distances(30), weight in 0.5f64..8.0) {
            let mut all: Vec<f64> = own.iter().chain(&others).copied().collect();
            all.sort_by(f64::total_cmp);
            all.push(20.0);
            let candidates: Vec<f64> = all.windows(2).filter(|w| w[1] > w[0]).map(|w| f64::midpoint(w[0], w[1])).collect();
            let least = candidates.iter().map(|t| cost(*t, &own, &others, weight)).fold(1.0, f64::min);
            match minimise(&own, &others, weight) {
                Ok(tau) => {
                    prop_assert!(cost(tau, &own, &others, weight) <= least + 1e-9);
                    // Leftmost: every interval to the left costs more.
                    for t in candidates.iter().filter(|t| **t < tau - 1e-9) {
                        prop_assert!(cost(*t, &own, &others, weight) > least + 1e-10);
                    }
                }
                Err(error) => {
                    prop_assert_eq!(error, ThresholdError::Overlap);
                    prop_assert!(least >= 1.0 - 1e-9);
                }
            }
        }

        #[test]
        fn more_negatives_never_raise_tau(own in distances(20), extra in 0.0f64..12.0) {
            let p = ThresholdParams::default();
            if let (Ok(before), Ok(after)) =
                (threshold(&own, &[11.0, 12.0], 100.0, &p), threshold(&own, &[11.0, 12.0, extra], 100.0, &p))
                && after.false_positive_rate < 1e-12 && before.false_positive_rate < 1e-12
            {
                prop_assert!(after.tau <= before.tau + 1e-12);
            }
        }
    }
}
