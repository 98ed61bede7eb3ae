//! A quad and the landmarks of a map in, the verdict out (method 10). Nearest landmarks first; those within reach are
//! verified by laying the quad's picture on the learnt icon; then thresholds, margin, probabilities and confidence.
//! "Unknown" whenever in doubt.

use super::{
    Candidate, DistanceKind, MAX_CANDIDATES, Recognition, Refusal, Verdict,
    align::AlignParams,
    by_points::by_points,
    compare::{Near, Sighting, nearest, short_list, sightings},
    confidence::{confidence, entropy_m, entropy_norm, probability},
    content::Content,
    look::{Judged, look, verify},
    models::ModelSet,
    watch::{NoWatch, Step, Watch},
};
use crate::{detect::quads::Quad, frame::GrayImage, params::Params};
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
    /// Landmarks of the short list whose signature is less alike are not looked at, -1 to 1.
    pub min_signature: f32,
    /// Nor those that are further behind the first one.
    pub signature_gap: f32,
    /// Landmarks up to which tau of the likeness holds as it is.
    pub crowd: usize,
    /// From there on tau shrinks by this share with every factor of e: the more landmarks, the nearer the nearest of them
    /// is to any stranger. On 732 quads of other buildings among 267 landmarks, strangers within a ratio grow by e with
    /// 0.08 of ratio.
    pub crowd_share: f64,
    /// A landmark whose likeness uses more than this share of its tau...
    pub doubtful_share: f64,
    /// ... is refused where more than this share of the picture shows something else, 0 to 1.
    pub max_contradicting: f64,
    /// Beyond the frame the picture must be at least this much like the learnt one, -1 to 1...
    pub min_content_likeness: f64,
    /// ... in what amounts to at least so many buckets. A landmark that shows less is not used.
    pub min_content: f64,
    /// From this likeness beyond the frame on...
    pub sure_content_likeness: f64,
    /// ... in so many buckets, none of the paper's distances need agree: saturation moves them far.
    pub sure_content: f64,
    /// Landmarks that are verified at most.
    pub max_verified: usize,
    /// Whether points decide where icons would (`both`); what they say nothing of is left to the icons. See
    /// `docs/method/25-recognition-by-points.md`.
    pub points: bool,
    /// Landmarks with more points than this are never accepted by their icons: their points would have said so. One with
    /// fewer that its icon speaks for is ambiguous, with [`Refusal::Plain`]: the robot's pose may name it.
    pub max_icon_points: usize,
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
            min_signature: 0.3,
            signature_gap: 0.35,
            crowd: 300,
            crowd_share: 0.08,
            doubtful_share: 0.85,
            max_contradicting: 0.12,
            min_content_likeness: 0.45,
            min_content: 1.5,
            sure_content_likeness: 0.6,
            sure_content: 4.0,
            max_verified: 2,
            points: true,
            max_icon_points: 40,
            align: AlignParams::default(),
        }
    }
}

/// What is left of tau in the largest map.
const LEAST_TAU_SHARE: f64 = 0.5;

impl VerdictParams {
    /// The share of tau of the likeness that holds among `landmarks`: as many strangers are accepted by a large map as by
    /// one of `crowd` landmarks.
    pub fn tau_share(&self, landmarks: usize) -> f64 {
        let crowds = landmarks.max(1) as f64 / self.crowd.max(1) as f64;
        (1.0 - self.crowd_share * crowds.ln().max(0.0)).clamp(LEAST_TAU_SHARE, 1.0)
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
    recognise_watched(image, quad, models, kind, p, &mut NoWatch)
}

/// The same, and `watch` is told of every step.
pub fn recognise_watched(
    image: &GrayImage,
    quad: &Quad,
    models: &ModelSet,
    kind: DistanceKind,
    p: &Params,
    watch: &mut impl Watch,
) -> Verdict {
    if models.is_empty() || models.params_hash() != p.distance_hash() {
        return unknown(models.len());
    }
    if kind == DistanceKind::Both && p.recognise.verdict.points {
        let said = by_points(image, quad, models, p);
        watch.finished(Step::Points);
        if let Some(verdict) = said {
            return verdict;
        }
    }
    let sightings = sightings(image, quad, p);
    watch.finished(Step::Icons);
    let near = match kind {
        DistanceKind::Both => short_list(&sightings, models, p.recognise.verdict.short_list),
        DistanceKind::Correlation | DistanceKind::Hausdorff => {
            nearest(&sightings, models, kind, MAX_CANDIDATES, p)
        }
    };
    watch.finished(Step::ShortList);
    let mut found: Vec<Judged> = near
        .into_iter()
        .map(|near| Judged { near, moved: None, contradicting: 0.0, content: Content::NONE })
        .collect();
    match kind {
        DistanceKind::Both => look(image, &sightings, &mut found, models.lattices(), p, watch),
        DistanceKind::Correlation | DistanceKind::Hausdorff => {
            verify(image, &sightings, &mut found, kind, models.lattices(), p);
            watch.finished(Step::Alignment);
        }
    }
    let verdict = decide(&found, &sightings, kind, models.len(), &p.recognise.verdict);
    watch.finished(Step::Decision);
    verdict
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
        points: None,
    }
}

/// Thresholds, margin, probabilities: the paper's three cases.
fn decide(
    found: &[Judged],
    sightings: &[Sighting],
    kind: DistanceKind,
    landmarks: usize,
    p: &VerdictParams,
) -> Verdict {
    let share = if kind == DistanceKind::Both { p.tau_share(landmarks) } else { 1.0 };
    let refusals: Vec<Option<Refusal>> = found.iter().map(|j| j.refusal(kind, share, p)).collect();
    let accepted = refusals.iter().filter(|r| r.is_none()).count();
    let mut verdict = unknown(landmarks);
    verdict.entropy_m = entropy_m(accepted, landmarks);
    verdict.entropy_norm = entropy_norm(accepted, landmarks);
    verdict.candidates = found
        .iter()
        .zip(&refusals)
        .take(MAX_CANDIDATES)
        .map(|(j, refusal)| candidate(&j.near, *refusal, accepted, (kind, share)))
        .collect();
    let Some(best) = refusals.iter().position(Option::is_none) else { return verdict };
    let near = &found[best].near;
    (verdict.rotation, verdict.border) = (sightings[near.sighting].rotation, sightings[near.sighting].border);
    verdict.aligned_px = found[best].moved;
    let margin = margin(found, best, kind);
    // Departs from method 10, which asks for a margin only where two or more are accepted: a runner-up just above its
    // own threshold is as much reason for doubt as one just below.
    let refusal = if margin >= p.margin {
        Some(Refusal::Margin)
    } else {
        (kind == DistanceKind::Both && p.points).then_some(Refusal::Plain)
    };
    if refusal.is_none() {
        verdict.recognition = Recognition::Unique(near.model.id);
        verdict.confidence = confidence(&verdict.candidates, best, landmarks, kind);
        return verdict;
    }
    verdict.recognition = Recognition::Ambiguous(near.model.id);
    if let Some(c) = verdict.candidates.get_mut(best) {
        c.refusal = refusal;
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

fn candidate(
    near: &Near,
    refusal: Option<Refusal>,
    accepted: usize,
    (kind, share): (DistanceKind, f64),
) -> Candidate {
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
        tau: share * tau,
        ratio: near.ratio(kind) / share,
        probability: probability(refusal.is_none(), accepted),
        refusal,
    }
}

#[cfg(test)]
mod tests;
