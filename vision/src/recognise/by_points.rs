//! The decision by points: landmarks that points speak for in, the verdict out, or `None` where points say nothing and the
//! icons are asked. Corners are those of the homography, sharpened by laying the picture on the learnt icon.
//!
//! False alarms are counted against things that have nothing in common with the landmark. Against its look-alikes two
//! more conditions stand: no other landmark whose points are there may go uncontradicted, and where something of the map
//! is so like the landmark that its icon would be taken for it, the likeness must be within the threshold that this left.

use super::{
    Candidate, MAX_CANDIDATES, Recognition, Refusal, Verdict,
    align::{Aligner, Laid, Surroundings, Template},
    confidence::{entropy_m, entropy_norm, probability},
    is_same_border,
    likeness::{Smoothed, between},
    models::ModelSet,
    signature::{Signature, likeness},
};
use crate::{
    detect::quads::{Corners, Quad},
    frame::GrayImage,
    icon::rectify,
    learn::model::LandmarkModel,
    params::Params,
    points::{
        search::{Found, search},
        verify::PointEvidence,
    },
    seen_border::FoundBy,
};

/// log10 of the false alarms that a comparison of a quad with a whole map may have, expected.
pub const LOG10_EPSILON: f64 = -5.0;
/// log10 of the comparisons of a quad with one landmark: four turns.
const LOG10_TURNS: f64 = 0.6;
/// A landmark with so many connected parts of 25 that show something else is in doubt.
pub const DOUBTFUL_PARTS: usize = 5;
/// Dense alignment moves no corner of the homography further than this, in icon pixels...
const MAX_MOVED_ICON_PX: f64 = 4.0;
/// Smallest likeness of an alignment that is believed.
const MIN_LIKENESS: f64 = 0.4;
/// Nor further than so many squared standard deviations: 99.99 % of a corner in the plane.
const MAX_SQUARE: f64 = 18.4;

/// log10 of the expected false alarms of `evidence` in a map of `landmarks`.
pub fn log10_false_alarms(evidence: &PointEvidence, landmarks: usize) -> f64 {
    evidence.log10_nfa + LOG10_TURNS + (landmarks.max(1) as f64).log10()
}

/// What points say of `quad`. `None` if they speak for no landmark.
pub(crate) fn by_points(image: &GrayImage, quad: &Quad, models: &ModelSet, p: &Params) -> Option<Verdict> {
    let of = |index: usize| models.at(index).map_or(&[][..], |m| m.points.as_slice());
    let found = search(image, quad, models.points(), of);
    let n = models.len();
    let alarms: Vec<f64> = found.iter().map(|f| log10_false_alarms(&f.evidence, n)).collect();
    let accepted = alarms.iter().filter(|a| **a <= LOG10_EPSILON).count();
    if accepted == 0 {
        return None;
    }
    let (best, model) = (found.first()?, models.at(found.first()?.model)?);
    let mut evidence = best.evidence.clone();
    let (border, corners_px) = nearest_border(quad, &evidence);
    let is_detected = is_same_border(&corners_px, &evidence.corners_px, p);
    let likeness = sharpened(image, &mut evidence, Some(&corners_px), (model, models), p);
    // The homography's corners stand unless the detector found the same.
    let is_located = is_detected || is_well_known(&evidence);
    let refusal =
        refusal(&found, &alarms, (model, likeness), p).or((!is_located).then_some(Refusal::Corners));
    let of = |(i, f): (usize, &Found)| {
        let ratio = if alarms[i] < 0.0 { LOG10_EPSILON / alarms[i] } else { f64::INFINITY };
        let refused = if i == 0 { refusal } else { (alarms[i] > LOG10_EPSILON).then_some(Refusal::Points) };
        Some(Candidate {
            landmark: models.at(f.model)?.id,
            correlation: 2.0,
            hausdorff: f64::INFINITY,
            likeness: if i == 0 { likeness } else { None },
            distance: ratio,
            tau: 1.0,
            ratio,
            probability: probability(alarms[i] <= LOG10_EPSILON, accepted),
            refusal: refused,
        })
    };
    let sure = refusal.is_none();
    Some(Verdict {
        recognition: if sure { Recognition::Unique(model.id) } else { Recognition::Ambiguous(model.id) },
        candidates: found.iter().enumerate().filter_map(of).take(MAX_CANDIDATES).collect(),
        entropy_m: entropy_m(accepted, n),
        entropy_norm: entropy_norm(accepted, n),
        confidence: if sure { confidence(alarms[0]) } else { 0.0 },
        rotation: evidence.turned,
        border,
        aligned_px: Some(evidence.corners_px),
        landmarks: n,
        points: Some(Box::new(evidence)),
    })
}

/// A landmark of which a corner is known worse than this share of its size is not told, standard deviations: what is seen of
/// it does not say where the rest is.
const MAX_CORNER_SIGMA_SHARE: f64 = 0.1;

/// Whether the points tell where the landmark's corners are.
pub(super) fn is_well_known(evidence: &PointEvidence) -> bool {
    let limit_px2 = MAX_CORNER_SIGMA_SHARE.powi(2) * evidence.corners_px.area_px2();
    evidence.corner_covariance_px2.iter().all(|c| c.symmetric_eigenvalues().max() <= limit_px2)
}

/// Why the first of `found`, which is `model` and has the `likeness`, is not named although its points are there.
fn refusal(
    found: &[Found],
    log10_alarms: &[f64],
    (model, likeness): (&LandmarkModel, Option<f64>),
    p: &Params,
) -> Option<Refusal> {
    if is_contradicted(found.first()?) {
        return Some(Refusal::Disagreement);
    }
    // Its share of the best one's exponent says how much was taught of a rival, not whether it hangs there: a look-alike
    // that was taught with fewer points agrees wherever it has any.
    let rivals = |(f, alarms): (&Found, &f64)| {
        let accepted = *alarms <= LOG10_EPSILON;
        alarms / log10_alarms[0] >= p.recognise.verdict.margin || (accepted && !is_contradicted(f))
    };
    if found.iter().zip(log10_alarms).skip(1).any(rivals) {
        return Some(Refusal::Margin);
    }
    // Where the image does not show all of it there is no likeness.
    let is_like = likeness.is_none_or(|l| 1.0 - l < model.likeness.tau);
    (has_double(model, p) && !is_like).then_some(Refusal::Likeness)
}

/// Something of the map is nearer to it than what is accepted where nothing is like it: to be told from that by points
/// alone is not certain.
fn has_double(model: &LandmarkModel, p: &Params) -> bool {
    model.likeness.tau < p.learn.threshold.nearest_share * p.learn.likeness_cap
}

/// A connected part of it shows something else.
fn is_contradicted(found: &Found) -> bool {
    found.evidence.agreement.largest_disagreement() >= DOUBTFUL_PARTS
}

/// Which border of `quad` lies nearest to where the landmark's is: 0 for its corners, i for alternate i - 1; and its
/// corners, the landmark's top-left first.
fn nearest_border(quad: &Quad, evidence: &PointEvidence) -> (usize, Corners) {
    let turned =
        std::iter::once(&quad.corners_px).chain(&quad.alternates).map(|c| c.rotated(evidence.turned));
    let off_px = |c: &Corners| c.furthest_px(&evidence.corners_px);
    let nearest = turned.enumerate().min_by(|a, b| off_px(&a.1).total_cmp(&off_px(&b.1)));
    nearest.unwrap_or((0, quad.corners_px.rotated(evidence.turned)))
}

/// Chance that the identity is right: false alarms are as rare as they are computed to be only if the model of chance
/// holds, so that the exponent is discounted.
fn confidence(log10_false_alarms: f64) -> f64 {
    const DISCOUNT: f64 = 0.35;
    1.0 - 10.0_f64.powf(DISCOUNT * log10_false_alarms.min(0.0))
}

/// Lays the picture on the learnt icon, from the corners of `evidence` and, if that leads nowhere, from `detected_px`; takes
/// over the corners if they are where the points can have put them. The likeness there.
pub(super) fn sharpened(
    image: &GrayImage,
    evidence: &mut PointEvidence,
    detected_px: Option<&Corners>,
    (model, models): (&LandmarkModel, &ModelSet),
    p: &Params,
) -> Option<f64> {
    let mut first = None;
    for start_px in std::iter::once(&evidence.corners_px.clone()).chain(detected_px) {
        let Some((laid, alike)) = laid(image, start_px, (model, models), p) else { continue };
        first = first.or(Some(alike));
        if alike >= MIN_LIKENESS && may_be_at(evidence, &laid.corners_px, p) {
            evidence.corners_px = laid.corners_px;
            evidence.corner_covariance_px2 = laid.covariance_px2;
            evidence.found_by = FoundBy::Alignment;
            return Some(alike);
        }
    }
    first
}

/// Whether the points leave it open that the landmark's corners are `corners_px`.
fn may_be_at(evidence: &PointEvidence, corners_px: &Corners, p: &Params) -> bool {
    let icon_px = evidence.corners_px.area_px2().sqrt() / p.icon.size as f64;
    let pairs = evidence.corners_px.points().iter().zip(corners_px.points());
    pairs.zip(&evidence.corner_covariance_px2).all(|((a, b), covariance)| {
        let off = a - b;
        off.norm() <= MAX_MOVED_ICON_PX * icon_px
            || covariance.cholesky().is_some_and(|c| off.dot(&c.solve(&off)) <= MAX_SQUARE)
    })
}

/// The picture laid on the nearest of the learnt icons from `start_px`, and how like it is there.
fn laid(
    image: &GrayImage,
    start_px: &Corners,
    (model, models): (&LandmarkModel, &ModelSet),
    p: &Params,
) -> Option<(Laid, f64)> {
    let (c, align) = (&p.recognise.correlation, &p.recognise.verdict.align);
    let icon = rectify(image, start_px, &p.icon).ok()?;
    let signature = Signature::new(&icon);
    let alike = |i: usize| likeness(model.exemplars[i].signature.values(), signature.values());
    let nearest = (0..model.exemplars.len()).max_by(|a, b| alike(*a).total_cmp(&alike(*b)))?;
    let (learnt, coarse) = model.exemplars[nearest].template(align);
    let around = Surroundings::new(image, start_px, &icon, align)?;
    let laid = Aligner::new(models.lattices(), align).align(&around, &Template::new(&learnt, &coarse))?;
    let alike = between(&Smoothed::new(&laid.icon), &Smoothed::new(&learnt), c).likeness;
    Some((laid, alike))
}

#[cfg(test)]
mod tests;
