//! A quad and the landmarks of a map in, the verdict out (method 10). Nearest landmarks first; those within reach are
//! verified by laying the quad's picture on the learnt icon; then thresholds, margin, probabilities and confidence.
//! "Unknown" whenever in doubt.

use super::{
    Candidate, DistanceKind, IconFeatures, MAX_CANDIDATES, Recognition, Refusal, Verdict,
    align::{AlignParams, Surroundings, Template},
    compare::{Near, Sighting, least_hausdorff, nearest, short_list, sightings},
    confidence::{confidence, entropy_m, entropy_norm, probability},
    correlation::correlation,
    features,
    likeness::likeness,
    models::ModelSet,
};
use crate::{
    detect::quads::{Corners, Quad},
    frame::GrayImage,
    icon::rectify,
    params::Params,
};
use serde::{Deserialize, Serialize};

/// Parameters of the decision.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct VerdictParams {
    /// The nearest landmark is the answer only while its ratio is below this share of the runner-up's (method 10:
    /// 0.7).
    pub margin: f64,
    /// Candidates below this ratio are verified by alignment; 0 turns verification off.
    pub verify_reach: f64,
    /// After alignment a distance is accepted below this share of tau: the corners were moved to please the landmark.
    pub verified_share: f64,
    /// Landmarks on the short list, of which the picture is laid on each.
    pub short_list: usize,
    /// Landmarks that are verified at most.
    pub max_verified: usize,
    /// How corners are moved.
    pub align: AlignParams,
}

impl Default for VerdictParams {
    fn default() -> Self {
        Self {
            margin: 0.7,
            verify_reach: 1.5,
            verified_share: 0.8,
            short_list: 8,
            max_verified: 2,
            align: AlignParams::default(),
        }
    }
}

/// Recognises what `quad` encloses. Models learnt under other parameters than `p` never match.
pub fn recognise(
    image: &GrayImage,
    quad: &Quad,
    models: &ModelSet,
    kind: DistanceKind,
    p: &Params,
) -> Verdict {
    if models.is_empty() || models.params_hash() != p.distance_hash() {
        return unknown(models.len());
    }
    let sightings = sightings(image, quad, p);
    let near = match kind {
        DistanceKind::Both => short_list(&sightings, models, p.recognise.verdict.short_list, p),
        DistanceKind::Correlation | DistanceKind::Hausdorff => {
            nearest(&sightings, models, kind, MAX_CANDIDATES, p)
        }
    };
    let mut found: Vec<Judged> = near.into_iter().map(|near| Judged { near, moved: None }).collect();
    match kind {
        DistanceKind::Both => look(image, &sightings, &mut found, p),
        DistanceKind::Correlation | DistanceKind::Hausdorff => verify(image, &sightings, &mut found, kind, p),
    }
    decide(&found, &sightings, kind, models.len(), &p.recognise.verdict)
}

/// No landmark, no candidate.
fn unknown(landmarks: usize) -> Verdict {
    Verdict {
        recognition: Recognition::Unknown,
        candidates: Vec::new(),
        entropy_m: 1.0,
        entropy_norm: 1.0,
        confidence: 0.0,
        rotation: 0,
        border: 0,
        aligned_px: None,
        landmarks,
    }
}

/// A near landmark, with or without alignment.
struct Judged {
    near: Near,
    /// Where alignment moved the corners, if the distances are those after it.
    moved: Option<Corners>,
}

impl Judged {
    /// The first gate that refuses it.
    fn refusal(&self, kind: DistanceKind, p: &VerdictParams) -> Option<Refusal> {
        // The corners were moved to please the landmark, but for Both, whose tau was learnt after such moves.
        let limit = if self.moved.is_some() { p.verified_share } else { 1.0 };
        // Written so that a NaN refuses.
        let below = |ratio: f64, limit: f64| ratio < limit;
        let correlation = below(self.near.correlation_ratio(), limit);
        let hausdorff = below(self.near.hausdorff_ratio(), limit);
        match kind {
            DistanceKind::Correlation => (!correlation).then_some(Refusal::Correlation),
            DistanceKind::Hausdorff => (!hausdorff).then_some(Refusal::Hausdorff),
            DistanceKind::Both if !below(self.near.ratio(kind), 1.0) => Some(Refusal::Likeness),
            DistanceKind::Both => (!correlation && !hausdorff).then_some(Refusal::Correlation),
        }
    }
}

/// Lays the quad's picture on the exemplar of each landmark of the short list, and compares it there; the distances are
/// those of the picture where it came to lie.
fn look(image: &GrayImage, sightings: &[Sighting], found: &mut [Judged], p: &Params) {
    let (c, v) = (&p.recognise.correlation, &p.recognise.verdict);
    let mut surroundings: Vec<Option<Option<Surroundings>>> = vec![None; sightings.len()];
    for Judged { near, moved } in found.iter_mut() {
        let sighting = &sightings[near.sighting];
        let Some(exemplar) = near.model.exemplars.get(near.exemplar) else { continue };
        let around = surroundings[near.sighting]
            .get_or_insert_with(|| Surroundings::new(image, &sighting.corners_px, &p.icon, &v.align));
        let template = Template::new(&exemplar.icon, c);
        let laid = around.as_ref().and_then(|s| s.align(&template, &v.align));
        let Some(laid) = laid else {
            near.likeness = Some(likeness(&sighting.icon, &exemplar.icon, c));
            continue;
        };
        near.likeness = Some(likeness(&laid.icon, &exemplar.icon, c));
        *moved = Some(laid.corners_px);
        if near.ratio(DistanceKind::Both) < 1.0 {
            let icon = features(laid.icon, &p.recognise);
            let each = near.model.exemplars.iter().map(|e| correlation(&icon, e, c));
            (near.correlation, near.hausdorff) =
                (each.fold(2.0, f64::min), least_hausdorff(&icon.points, &near.model, p).0);
        }
    }
    found.sort_by(|a, b| a.near.ratio(DistanceKind::Both).total_cmp(&b.near.ratio(DistanceKind::Both)));
}

/// Lays the quad's picture on each candidate within reach, nearest first, and keeps what the better fit says.
fn verify(image: &GrayImage, sightings: &[Sighting], found: &mut [Judged], kind: DistanceKind, p: &Params) {
    let v = &p.recognise.verdict;
    let mut surroundings: Vec<Option<Option<Surroundings>>> = vec![None; sightings.len()];
    for judged in found.iter_mut().filter(|j| j.near.ratio(kind) < v.verify_reach).take(v.max_verified) {
        let i = judged.near.sighting;
        let around = surroundings[i]
            .get_or_insert_with(|| Surroundings::new(image, &sightings[i].corners_px, &p.icon, &v.align));
        let Some((icon, corners_px)) = around.as_ref().and_then(|s| laid_on(image, s, &judged.near, p))
        else {
            continue;
        };
        let model = &judged.near.model;
        let each = model.exemplars.iter().map(|e| correlation(&icon, e, &p.recognise.correlation));
        let (correlation, hausdorff) = (each.fold(2.0, f64::min), least_hausdorff(&icon.points, model, p).0);
        let near = Near { correlation, hausdorff, ..judged.near.clone() };
        let moved = Judged { near, moved: Some(corners_px) };
        // What was accepted where it stood is not lost by a move that fits worse.
        let lost = judged.refusal(kind, v).is_none() && moved.refusal(kind, v).is_some();
        if moved.near.ratio(kind) < judged.near.ratio(kind) && !lost {
            *judged = moved;
        }
    }
    found.sort_by(|a, b| a.near.ratio(kind).total_cmp(&b.near.ratio(kind)));
}

/// The quad's picture after its corners were moved to fit the nearest exemplar, and those corners.
fn laid_on(
    image: &GrayImage,
    around: &Surroundings,
    near: &Near,
    p: &Params,
) -> Option<(IconFeatures, Corners)> {
    let r = &p.recognise;
    let exemplar = near.model.exemplars.get(near.exemplar)?;
    let corners = around.align(&Template::new(&exemplar.icon, &r.correlation), &r.verdict.align)?.corners_px;
    let icon = rectify(image, &corners, &p.icon).ok()?;
    Some((features(icon, r), corners))
}

/// Thresholds, margin, probabilities: the paper's three cases.
fn decide(
    found: &[Judged],
    sightings: &[Sighting],
    kind: DistanceKind,
    landmarks: usize,
    p: &VerdictParams,
) -> Verdict {
    let refusals: Vec<Option<Refusal>> = found.iter().map(|j| j.refusal(kind, p)).collect();
    let accepted = refusals.iter().filter(|r| r.is_none()).count();
    let mut verdict = unknown(landmarks);
    verdict.entropy_m = entropy_m(accepted, landmarks);
    verdict.entropy_norm = entropy_norm(accepted, landmarks);
    verdict.candidates = found
        .iter()
        .zip(&refusals)
        .take(MAX_CANDIDATES)
        .map(|(j, refusal)| candidate(&j.near, *refusal, accepted, kind))
        .collect();
    let Some(best) = refusals.iter().position(Option::is_none) else { return verdict };
    let near = &found[best].near;
    (verdict.rotation, verdict.border) = (sightings[near.sighting].rotation, sightings[near.sighting].border);
    verdict.aligned_px = found[best].moved;
    let margin = margin(found, best, kind);
    // Departs from method 10, which asks for a margin only where two or more are accepted: a runner-up just above its
    // own threshold is as much reason for doubt as one just below.
    if margin < p.margin {
        verdict.recognition = Recognition::Unique(near.model.id);
        verdict.confidence = confidence(near.ratio(kind), margin);
    } else {
        verdict.recognition = Recognition::Ambiguous(near.model.id);
        if let Some(c) = verdict.candidates.get_mut(best) {
            c.refusal = Some(Refusal::Margin);
        }
    }
    verdict
}

/// The ratio of `best` over that of the nearest other landmark. 0 when there is no other landmark, 1 when the others have no distance to compare with.
fn margin(found: &[Judged], best: usize, kind: DistanceKind) -> f64 {
    if found.len() < 2 {
        return 0.0;
    }
    let over = |ratio: &dyn Fn(&Near) -> f64| {
        let others = found.iter().enumerate().filter(|(i, _)| *i != best);
        let runner_up = others.map(|(_, j)| ratio(&j.near)).fold(f64::INFINITY, f64::min);
        if runner_up.is_finite() { ratio(&found[best].near) / runner_up } else { 1.0 }
    };
    match kind {
        DistanceKind::Correlation => over(&Near::correlation_ratio),
        DistanceKind::Hausdorff => over(&Near::hausdorff_ratio),
        DistanceKind::Both => over(&|near| near.ratio(kind)),
    }
}

fn candidate(near: &Near, refusal: Option<Refusal>, accepted: usize, kind: DistanceKind) -> Candidate {
    let (distance, tau) = match kind {
        DistanceKind::Hausdorff => (near.hausdorff, near.model.hausdorff.tau),
        DistanceKind::Correlation => (near.correlation, near.model.correlation.tau),
        DistanceKind::Both => (1.0 - near.likeness.unwrap_or(-1.0), near.model.likeness.tau),
    };
    Candidate {
        landmark: near.model.id,
        correlation: near.correlation,
        hausdorff: near.hausdorff,
        likeness: near.likeness,
        distance,
        tau,
        ratio: near.ratio(kind),
        probability: probability(refusal.is_none(), accepted),
        refusal,
    }
}

#[cfg(test)]
mod tests;
