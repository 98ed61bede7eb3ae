//! Accepted landmarks in, the paper's probabilities and entropies out (method 10), and the calibrated confidence of
//! an identity. `verdict` decides which landmarks are accepted.

use crate::recognise::{
    decision::{
        confidence_weights,
        measures::{MEASURES, measures},
        result::MatchCandidate,
    },
    distance_kind::DistanceKind,
};

/// The paper's m with the printed 1/(N+1), natural logarithm: `1 - ln K / (N+1)` for K of N accepted.
pub fn entropy_m(accepted: usize, landmarks: usize) -> f64 {
    1.0 - (accepted.max(1) as f64).ln() / (landmarks as f64 + 1.0)
}

/// The same with the factor that normalises: `1 - ln K / ln(N+1)`, in (0, 1].
pub fn entropy_norm(accepted: usize, landmarks: usize) -> f64 {
    if accepted <= 1 { 1.0 } else { 1.0 - (accepted as f64).ln() / (landmarks as f64 + 1.0).ln() }
}

/// `P(C_l | Q)` of one landmark: an equal share for each accepted one.
pub fn probability(is_accepted: bool, accepted: usize) -> f64 {
    if is_accepted { 1.0 / accepted.max(1) as f64 } else { 0.0 }
}

/// Probability that the identity of candidate `best` is right: a logistic model over [`measures`], fitted to
/// labelled answers (`waymark-lab train confidence`), one per deciding distance. It never rises with any measure.
/// Calibration: docs/EVALUATION.md. 0 without such a candidate.
pub fn confidence(candidates: &[MatchCandidate], best: usize, landmarks: usize, kind: DistanceKind) -> f64 {
    let weights = match kind {
        DistanceKind::Both => &confidence_weights::BOTH,
        DistanceKind::Correlation => &confidence_weights::CORRELATION,
        DistanceKind::Hausdorff => &confidence_weights::HAUSDORFF,
    };
    measures(candidates, best, landmarks).map_or(0.0, |m| chance(weights, &m))
}

/// The logistic model: the last weight is the intercept.
pub fn chance(weights: &[f64; MEASURES + 1], measures: &[f64; MEASURES]) -> f64 {
    let odds = weights[MEASURES] + weights.iter().zip(measures).map(|(w, m)| w * m).sum::<f64>();
    1.0 / (1.0 + (-odds).exp())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::landmark_id::LandmarkId;

    #[test]
    fn entropies_equal_the_papers_table() {
        for (n, k, paper, norm) in [
            (4, 2, 0.8614, 0.5693),
            (4, 4, 0.7227, 0.1386),
            (10, 2, 0.9370, 0.7109),
            (10, 10, 0.7907, 0.0397),
            (20, 3, 0.9477, 0.6392),
            (20, 20, 0.8573, 0.0160),
        ] {
            assert!((entropy_m(k, n) - paper).abs() < 5e-5, "{n} {k}");
            assert!((entropy_norm(k, n) - norm).abs() < 5e-5, "{n} {k}");
        }
        for (n, k) in [(0, 0), (1, 1), (7, 0), (7, 1)] {
            assert!((entropy_m(k, n) - 1.0).abs() < 1e-15 && (entropy_norm(k, n) - 1.0).abs() < 1e-15);
        }
    }

    #[test]
    fn equal_the_sum_over_all_probabilities() {
        // Oracle: Eq. of method 10 term by term, the empty class included.
        for (n, k) in [(5, 1), (5, 3), (40, 17)] {
            let p: Vec<f64> = (0..=n).map(|l| probability(l < k, k)).collect();
            assert!((p.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            let sum: f64 = p.iter().filter(|p| **p > 0.0).map(|p| p * p.ln()).sum();
            assert!((entropy_m(k, n) - (1.0 + sum / (n as f64 + 1.0))).abs() < 1e-12);
            assert!((entropy_norm(k, n) - (1.0 + sum / (n as f64 + 1.0).ln())).abs() < 1e-12);
        }
    }

    fn candidate(ratio: f64, correlation: f64, hausdorff: f64) -> MatchCandidate {
        MatchCandidate {
            landmark: LandmarkId(1),
            correlation,
            hausdorff,
            likeness: None,
            distance: ratio,
            tau: 1.0,
            ratio,
            probability: 1.0,
            refusal: None,
        }
    }

    #[test]
    fn measures_by_hand_and_within_bounds() {
        let two = [candidate(0.4, 0.2, 3.0), candidate(0.8, 0.9, f64::INFINITY)];
        let found = measures(&two, 0, 9).unwrap();
        let expected = [0.4, 0.08, 0.5, 0.125, 0.2, 0.3, 0.1 * 10f64.ln()];
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?}");
        assert!(measures(&two, 2, 9).is_none() && confidence(&two, 2, 9, DistanceKind::Both).abs() < 1e-12);
        let bad = f64::NAN;
        for ratio in [0.0, 1e300, f64::INFINITY, bad] {
            let found =
                measures(&[candidate(ratio, bad, bad), candidate(0.0, 0.0, 0.0)], 0, usize::MAX).unwrap();
            assert!(
                found.iter().all(|m| (0.0..=crate::recognise::decision::measures::FAR).contains(m)),
                "{found:?}"
            );
        }
    }

    #[test]
    fn confidence_never_rises_with_a_measure() {
        for kind in [DistanceKind::Both, DistanceKind::Correlation, DistanceKind::Hausdorff] {
            let of = |ratio: f64, next: f64, c: f64, h: f64, n: usize| {
                confidence(&[candidate(ratio, c, h), candidate(next, 1.0, 30.0)], 0, n, kind)
            };
            let best = of(0.1, 2.0, 0.1, 1.0, 10);
            assert!(best <= 1.0 && best > 0.9, "{kind:?}: {best}");
            for worse in [
                of(0.6, 2.0, 0.1, 1.0, 10),
                of(0.1, 0.15, 0.1, 1.0, 10),
                of(0.1, 2.0, 0.6, 1.0, 10),
                of(0.1, 2.0, 0.1, 9.0, 10),
                of(0.1, 2.0, 0.1, 1.0, 10_000),
            ] {
                assert!(worse <= best && worse >= 0.0, "{kind:?}: {worse} {best}");
            }
            assert!(of(0.95, 1.0, 0.9, f64::INFINITY, 300) < 0.9 * best, "{kind:?}");
        }
    }
}
