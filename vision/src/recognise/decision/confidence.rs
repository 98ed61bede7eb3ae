//! Candidates in, the calibrated confidence of an identity out.

use crate::recognise::{
    decision::{
        confidence_weights,
        measures::{MEASURES, measures},
        result::MatchCandidate,
    },
    distance_kind::DistanceKind,
};

/// Probability that the identity of candidate `best` is right: a logistic model over [`measures`],
/// fitted to labelled answers (`waymark-lab train confidence`), one per deciding distance. It never
/// rises with any measure. Calibration: docs/EVALUATION.md. 0 without such a candidate.
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
    use crate::{
        model::landmark_id::LandmarkId,
        recognise::decision::result::{Evidence, IconEvidence},
    };

    fn candidate(ratio: f64, correlation: f64, hausdorff: f64) -> MatchCandidate {
        MatchCandidate {
            landmark: LandmarkId(1),
            evidence: Evidence::Icon(IconEvidence {
                correlation,
                hausdorff,
                likeness: None,
                distance: ratio,
                tau: 1.0,
            }),
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
