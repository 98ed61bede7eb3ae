//! A quad and the landmarks of a map in, the verdict out (method 10). Retrieval of the nearest
//! landmarks, verification by template alignment, then thresholds, margin, probabilities and
//! confidence. `Unknown` when in doubt.

use crate::{
    detect::quad::Quad,
    frame::GrayImage,
    model::model_set::ModelSet,
    paper::{deciding_distance::verified_nearest, entropy::Possibilities},
    params::Params,
    recognise::{
        decision::{
            by_points::by_points,
            confidence::confidence,
            result::{
                Evidence, IconEvidence, MAX_CANDIDATES, MatchCandidate, MatchRefusal, RecognitionResult,
                Verdict,
            },
        },
        distance_kind::DistanceKind,
        params::VerdictParams,
        retrieval::nearest::{NearLandmark, QuadReading, quad_readings, short_list},
        step_listener::{NoListener, RecogniseStep, StepListener},
        verification::short_list::{VerifiedLandmark, verify_short_list},
    },
};

/// Recognises the landmark in `quad`. Models learnt under other parameters than `p` never match.
pub fn recognise(
    image: &GrayImage,
    quad: &Quad,
    models: &ModelSet,
    kind: DistanceKind,
    p: &Params,
) -> RecognitionResult {
    recognise_watched(image, quad, models, kind, p, &mut NoListener)
}

/// The same, reporting every step to `watch`.
pub fn recognise_watched(
    image: &GrayImage,
    quad: &Quad,
    models: &ModelSet,
    kind: DistanceKind,
    p: &Params,
    watch: &mut impl StepListener,
) -> RecognitionResult {
    if models.is_empty() || models.params_hash() != p.distance_hash() {
        return unknown(models.len());
    }
    if kind == DistanceKind::Both && p.recognise.verdict.points {
        let said = by_points(image, quad, models, p);
        watch.finished(RecogniseStep::Points);
        if let Some(verdict) = said {
            return verdict;
        }
    }
    let readings = quad_readings(image, quad, p);
    watch.finished(RecogniseStep::Icons);
    let found = match kind {
        DistanceKind::Both => {
            let near = short_list(&readings, models, p.recognise.verdict.short_list);
            watch.finished(RecogniseStep::ShortList);
            let mut found: Vec<VerifiedLandmark> = near.into_iter().map(VerifiedLandmark::new).collect();
            verify_short_list(image, &readings, &mut found, models.lattices(), p, watch);
            found
        }
        DistanceKind::Correlation | DistanceKind::Hausdorff => {
            verified_nearest(image, &readings, models, kind, p, watch)
        }
    };
    let verdict = decide(&found, &readings, kind, models.len(), &p.recognise.verdict);
    watch.finished(RecogniseStep::Decision);
    verdict
}

/// No landmark, no candidate.
fn unknown(landmarks: usize) -> RecognitionResult {
    RecognitionResult {
        verdict: Verdict::Unknown,
        candidates: Vec::new(),
        possibilities: Possibilities::new(0, false),
        confidence: 0.0,
        rotation: 0,
        border: 0,
        aligned_px: None,
        landmarks,
        points: None,
    }
}

/// Thresholds, margin, probabilities: the paper's three cases.
fn decide(
    found: &[VerifiedLandmark],
    readings: &[QuadReading],
    kind: DistanceKind,
    landmarks: usize,
    p: &VerdictParams,
) -> RecognitionResult {
    let share = if kind == DistanceKind::Both { p.tau_share(landmarks) } else { 1.0 };
    let refusals: Vec<Option<MatchRefusal>> = found.iter().map(|j| j.refusal(kind, share, p)).collect();
    let accepted = refusals.iter().filter(|r| r.is_none()).count();
    let best = refusals.iter().position(Option::is_none);
    // Departs from method 10, which asks for a margin only where two or more are accepted: a
    // runner-up just above its own threshold is as much reason for doubt as one just below.
    let refusal = best.and_then(|best| match margin(found, best, kind) {
        margin if margin >= p.margin => Some(MatchRefusal::Margin),
        _ => (kind == DistanceKind::Both && p.points).then_some(MatchRefusal::Plain),
    });
    let possibilities = Possibilities::new(accepted, refusal.is_some());
    let of = |(j, refusal): (&VerifiedLandmark, &Option<MatchRefusal>)| {
        candidate(&j.near, *refusal, possibilities, (kind, share))
    };
    let mut verdict = RecognitionResult {
        possibilities,
        candidates: found.iter().zip(&refusals).take(MAX_CANDIDATES).map(of).collect(),
        ..unknown(landmarks)
    };
    let Some(best) = best else { return verdict };
    let near = &found[best].near;
    (verdict.rotation, verdict.border) = (readings[near.reading].rotation, readings[near.reading].border);
    verdict.aligned_px = found[best].moved;
    if refusal.is_none() {
        verdict.verdict = Verdict::Unique(near.model.id);
        verdict.confidence = confidence(&verdict.candidates, best, landmarks, kind);
        return verdict;
    }
    verdict.verdict = Verdict::Ambiguous(near.model.id);
    if let Some(c) = verdict.candidates.get_mut(best) {
        c.refusal = refusal;
    }
    verdict
}

/// The ratio of `best` over that of the nearest other landmark. 0 when there is no other landmark,
/// 1 when the others have no distance to compare with.
fn margin(found: &[VerifiedLandmark], best: usize, kind: DistanceKind) -> f64 {
    if found.len() < 2 {
        return 0.0;
    }
    let over = |ratio: &dyn Fn(&NearLandmark) -> f64| {
        let others = found.iter().enumerate().filter(|(i, _)| *i != best);
        let runner_up = others.map(|(_, j)| ratio(&j.near)).fold(f64::INFINITY, f64::min);
        if runner_up.is_finite() { ratio(&found[best].near) / runner_up } else { 1.0 }
    };
    match kind {
        DistanceKind::Correlation => over(&NearLandmark::correlation_ratio),
        DistanceKind::Hausdorff => over(&NearLandmark::hausdorff_ratio),
        DistanceKind::Both => over(&|near| near.ratio(kind)),
    }
}

fn candidate(
    near: &NearLandmark,
    refusal: Option<MatchRefusal>,
    possibilities: Possibilities,
    (kind, share): (DistanceKind, f64),
) -> MatchCandidate {
    let (distance, tau) = match kind {
        DistanceKind::Hausdorff => (near.hausdorff, near.model.hausdorff.tau),
        DistanceKind::Correlation => (near.correlation, near.model.correlation.tau),
        DistanceKind::Both => (1.0 - near.likeness.unwrap_or(-1.0), near.model.likeness.tau),
    };
    MatchCandidate {
        landmark: near.model.id,
        evidence: Evidence::Icon(IconEvidence {
            correlation: near.correlation,
            hausdorff: near.hausdorff,
            likeness: near.likeness,
            distance,
            tau: share * tau,
        }),
        ratio: near.ratio(kind) / share,
        probability: possibilities.probability(refusal.is_none()),
        refusal,
    }
}

#[cfg(test)]
mod tests;
