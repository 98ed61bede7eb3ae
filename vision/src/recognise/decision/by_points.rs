//! The decision by points: landmarks with point evidence in, the verdict out, or `None` where no
//! landmark has enough evidence and the icons decide. Corners are those of the homography, refined
//! by alignment with the learnt icon.
//!
//! The number of false alarms is computed for unrelated pictures. Against look-alikes three more
//! conditions hold: every other landmark with point evidence must be contradicted; where a landmark
//! of the map lowered the likeness threshold, the likeness must pass that threshold; and a picture
//! that is unlike the icon needs more evidence.

use crate::{
    detect::quad::Quad,
    frame::GrayImage,
    geometry::corners::Corners,
    model::{landmark_model::LandmarkModel, model_set::ModelSet},
    paper::entropy::Possibilities,
    params::Params,
    points::{
        search::{LandmarkPoints, search},
        verify::PointEvidence,
    },
    recognise::{
        decision::result::{
            Evidence, MAX_CANDIDATES, MatchCandidate, MatchRefusal, RecognitionResult, Verdict,
        },
        verification::icon_alignment::{IconAlignment, align_to_icon},
    },
    seen_border::is_same_border,
};

/// log10 of the largest expected number of false alarms in the comparison of a quad with a map.
pub const LOG10_EPSILON: f64 = -5.0;
/// log10 of the comparisons of a quad with one landmark: four turns.
const LOG10_TURNS: f64 = 0.6;
/// A picture whose gradient similarity with the learnt icon is below this is unlike the landmark...
const UNLIKE: f64 = 0.3;
/// ... and is named only with fewer false alarms than this.
const LOG10_EPSILON_UNLIKE: f64 = -20.0;
/// A landmark with this many connected mismatched parts of 25 is doubtful.
pub const DOUBTFUL_PARTS: usize = 5;

/// log10 of the expected false alarms of `evidence` in a map of `landmarks`.
pub fn log10_false_alarms(evidence: &PointEvidence, landmarks: usize) -> f64 {
    evidence.log10_nfa + LOG10_TURNS + (landmarks.max(1) as f64).log10()
}

/// The verdict on `quad` by points. `None` without point evidence for any landmark.
pub(crate) fn by_points(
    image: &GrayImage,
    quad: &Quad,
    models: &ModelSet,
    p: &Params,
) -> Option<RecognitionResult> {
    let of = |index: usize| models.at_point_index(index).map_or(&[][..], |m| m.points.as_slice());
    let n = models.len();
    let (found, rivals): (Vec<LandmarkPoints>, Vec<LandmarkPoints>) =
        search(image, quad, models.points(), of).into_iter().partition(|f| f.model < n);
    let alarms: Vec<f64> = found.iter().map(|f| log10_false_alarms(&f.evidence, n)).collect();
    let accepted = alarms.iter().filter(|a| **a <= LOG10_EPSILON).count();
    if accepted == 0 {
        return None;
    }
    let (best, model) = (found.first()?, models.at(found.first()?.model)?);
    let mut evidence = best.evidence.clone();
    let (border, corners_px) = nearest_border(quad, &evidence);
    let is_detected = is_same_border(&corners_px, &evidence.corners_px, p);
    let alignment = align_to_icon(image, &mut evidence, Some(&corners_px), (model, models), p);
    // The homography's corners are used unless the detector found the same border.
    let is_located = is_detected || is_well_known(&evidence);
    let others = found.iter().skip(1).chain(&rivals);
    let refusal =
        refusal(best, others, (model, &alignment), n, p).or((!is_located).then_some(MatchRefusal::Corners));
    let sure = refusal.is_none();
    let possibilities = Possibilities::new(accepted, !sure);
    let of = |(i, f): (usize, &LandmarkPoints)| {
        let ratio = if alarms[i] < 0.0 { LOG10_EPSILON / alarms[i] } else { f64::INFINITY };
        let refused =
            if i == 0 { refusal } else { (alarms[i] > LOG10_EPSILON).then_some(MatchRefusal::Points) };
        Some(MatchCandidate {
            landmark: models.at(f.model)?.id,
            evidence: Evidence::Points { likeness: if i == 0 { alignment.likeness } else { None } },
            ratio,
            probability: possibilities.probability(alarms[i] <= LOG10_EPSILON),
            refusal: refused,
        })
    };
    Some(RecognitionResult {
        verdict: if sure { Verdict::Unique(model.id) } else { Verdict::Ambiguous(model.id) },
        candidates: found.iter().enumerate().filter_map(of).take(MAX_CANDIDATES).collect(),
        possibilities,
        confidence: if sure { confidence(alarms[0]) } else { 0.0 },
        rotation: evidence.turned,
        border,
        aligned_px: Some(evidence.corners_px),
        landmarks: n,
        points: Some(Box::new(evidence)),
    })
}

/// Largest standard deviation of a corner as a share of the landmark's size: beyond it the visible
/// part does not determine the corners, and the landmark is not identified.
const MAX_CORNER_SIGMA_SHARE: f64 = 0.1;

/// Whether the points determine the landmark's corners.
pub(crate) fn is_well_known(evidence: &PointEvidence) -> bool {
    let limit_px2 = MAX_CORNER_SIGMA_SHARE.powi(2) * evidence.corners_px.area_px2();
    evidence.corner_covariance_px2.iter().all(|c| c.symmetric_eigenvalues().max() <= limit_px2)
}

/// The refusal of `best` (landmark `model`, aligned with its icon) among `landmarks`, given the
/// point evidence for `others`.
fn refusal<'a>(
    best: &LandmarkPoints,
    mut others: impl Iterator<Item = &'a LandmarkPoints>,
    (model, alignment): (&LandmarkModel, &IconAlignment),
    landmarks: usize,
    p: &Params,
) -> Option<MatchRefusal> {
    if is_doubtful(&best.evidence, alignment) {
        return Some(MatchRefusal::Disagreement);
    }
    // The ratio of the exponents depends on the number of taught points, not on presence: a
    // look-alike taught with fewer points agrees wherever it has any.
    let alarms = |evidence: &PointEvidence| log10_false_alarms(evidence, landmarks);
    let is_rival = |evidence: &PointEvidence| {
        let accepted = alarms(evidence) <= LOG10_EPSILON;
        alarms(evidence) / alarms(&best.evidence) >= p.recognise.verdict.margin
            || (accepted && !is_contradicted(evidence))
    };
    if others.any(|f| is_rival(&f.evidence)) {
        return Some(MatchRefusal::Margin);
    }
    // A landmark that looks the same upside down: its name is certain, its pose is not.
    if best.turned.as_ref().is_some_and(is_rival) {
        return Some(MatchRefusal::Margin);
    }
    // Two doors have panels in common: a few points agree, and the icon does not.
    let is_unlike = alignment.likeness.is_some_and(|l| l < UNLIKE);
    if is_unlike && alarms(&best.evidence) > LOG10_EPSILON_UNLIKE {
        return Some(MatchRefusal::Similarity);
    }
    // No likeness where part of the landmark is outside the image.
    let is_within_threshold = alignment.likeness.is_none_or(|l| 1.0 - l < model.likeness.tau);
    (has_look_alike(model, p) && !is_within_threshold).then_some(MatchRefusal::Similarity)
}

/// Whether a look-alike in the map lowered tau of the likeness below its cap: points alone may not
/// separate the two.
fn has_look_alike(model: &LandmarkModel, p: &Params) -> bool {
    model.likeness.tau < p.learn.threshold.nearest_share * p.learn.likeness_cap
}

/// Whether a connected part of the landmark mismatches: by its icon where aligned, as the icon
/// covers every part; otherwise by its points.
pub(crate) fn is_doubtful(evidence: &PointEvidence, alignment: &IconAlignment) -> bool {
    alignment.has_mismatch.unwrap_or_else(|| evidence.agreement.largest_disagreement() >= DOUBTFUL_PARTS)
}

/// Whether a connected part of it mismatches by its points.
fn is_contradicted(evidence: &PointEvidence) -> bool {
    is_doubtful(evidence, &IconAlignment::NONE)
}

/// The border of `quad` nearest to the landmark's: 0 for its corners, i for alternate i - 1; and
/// its corners, the landmark's top-left first.
fn nearest_border(quad: &Quad, evidence: &PointEvidence) -> (usize, Corners) {
    let turned =
        std::iter::once(&quad.corners_px).chain(&quad.alternates).map(|c| c.rotated(evidence.turned));
    let off_px = |c: &Corners| c.furthest_px(&evidence.corners_px);
    let nearest = turned.enumerate().min_by(|a, b| off_px(&a.1).total_cmp(&off_px(&b.1)));
    nearest.unwrap_or((0, quad.corners_px.rotated(evidence.turned)))
}

/// Probability that the identity is right. The exponent is discounted, because the computed
/// false-alarm rate holds only under the chance model.
fn confidence(log10_false_alarms: f64) -> f64 {
    const DISCOUNT: f64 = 0.35;
    1.0 - 10.0_f64.powf(DISCOUNT * log10_false_alarms.min(0.0))
}

#[cfg(test)]
mod tests;
