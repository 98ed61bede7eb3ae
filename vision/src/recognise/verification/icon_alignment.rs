//! Template alignment of a landmark with point evidence. In: the image, the evidence with the
//! corners of the homography, the landmark. Out: the aligned corners in the evidence, the likeness
//! there, and whether a part mismatches.

use crate::{
    frame::GrayImage,
    geometry::corners::Corners,
    icon::rectify,
    model::{landmark_model::LandmarkModel, model_set::ModelSet},
    params::Params,
    points::verify::PointEvidence,
    recognise::{
        alignment::{
            aligner::{Aligner, Alignment, Template},
            surroundings::Surroundings,
        },
        features::signature::{Signature, likeness},
        verification::{
            gradient_similarity::{Smoothed, between},
            mismatch::MismatchMap,
        },
    },
    seen_border::FoundBy,
};

/// Alignment is accepted from this likeness on if it moved no corner of the homography further
/// than...
const MIN_LIKENESS: f64 = 0.4;
/// ... so many icon pixels, or...
const MAX_MOVED_ICON_PX: f64 = 4.0;
/// ... so many squared standard deviations: 99.99 % of a corner in the plane.
const MAX_SQUARE: f64 = 18.4;
/// From this likeness on alignment is accepted at any displacement: the covariance of points that
/// lie at one end of a landmark is too small at its other end.
const SURE_LIKENESS: f64 = 0.65;

/// Comparison of the picture with a learnt icon after alignment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct IconAlignment {
    /// Likeness after alignment, -1 to 1. `None` where part of the landmark is outside the image.
    pub(crate) likeness: Option<f64>,
    /// Whether a connected part mismatches. `None` unless the alignment is accepted.
    pub(crate) has_mismatch: Option<bool>,
}

impl IconAlignment {
    /// No alignment was tried.
    pub(crate) const NONE: Self = Self { likeness: None, has_mismatch: None };
}

/// Aligns the picture with the learnt icon, starting at the corners of `evidence` and, if that
/// fails, at `detected_px`. The aligned corners replace those of `evidence` if its covariance
/// allows them, or from [`SURE_LIKENESS`] on.
pub(crate) fn align_to_icon(
    image: &GrayImage,
    evidence: &mut PointEvidence,
    detected_px: Option<&Corners>,
    (model, models): (&LandmarkModel, &ModelSet),
    p: &Params,
) -> IconAlignment {
    let mut first = None;
    for start_px in std::iter::once(&evidence.corners_px.clone()).chain(detected_px) {
        let Some((alignment, learnt)) = aligned(image, start_px, (model, models), p) else { continue };
        let picture = Smoothed::new(&alignment.icon);
        let similarity = between(&picture, &learnt, &p.recognise.correlation).likeness;
        first = first.or(Some(similarity));
        let is_possible = similarity >= MIN_LIKENESS && may_be_at(evidence, &alignment.corners_px, p);
        if !is_possible && similarity < SURE_LIKENESS {
            continue;
        }
        evidence.corners_px = alignment.corners_px;
        evidence.corner_covariance_px2 = alignment.covariance_px2;
        evidence.found_by = FoundBy::Alignment;
        let mismatches = MismatchMap::new(&picture, &learnt);
        let has_mismatch = mismatches.as_ref().map(MismatchMap::has_mismatched_part);
        if let Some(mismatches) = mismatches.filter(|_| has_mismatch == Some(true)) {
            evidence.agreement = mismatches.marked(evidence.agreement);
        }
        return IconAlignment { likeness: Some(similarity), has_mismatch };
    }
    IconAlignment { likeness: first, has_mismatch: None }
}

/// Whether `corners_px` are consistent with the covariance of the points.
fn may_be_at(evidence: &PointEvidence, corners_px: &Corners, p: &Params) -> bool {
    let icon_px = evidence.corners_px.area_px2().sqrt() / p.icon.size as f64;
    let pairs = evidence.corners_px.points().iter().zip(corners_px.points());
    pairs.zip(&evidence.corner_covariance_px2).all(|((a, b), covariance)| {
        let off = a - b;
        off.norm() <= MAX_MOVED_ICON_PX * icon_px
            || covariance.cholesky().is_some_and(|c| off.dot(&c.solve(&off)) <= MAX_SQUARE)
    })
}

/// The picture aligned with the most similar of the learnt icons, starting at `start_px`, and that
/// icon.
fn aligned(
    image: &GrayImage,
    start_px: &Corners,
    (model, models): (&LandmarkModel, &ModelSet),
    p: &Params,
) -> Option<(Alignment, Smoothed)> {
    let align = &p.recognise.verdict.align;
    let icon = rectify(image, start_px, &p.icon).ok()?;
    let signature = Signature::new(&icon);
    let similarity = |i: usize| likeness(model.exemplars[i].signature.values(), signature.values());
    let nearest = (0..model.exemplars.len()).max_by(|a, b| similarity(*a).total_cmp(&similarity(*b)))?;
    let (learnt, coarse) = model.exemplars[nearest].template(align);
    let around = Surroundings::new(image, start_px, &icon, align)?;
    let alignment =
        Aligner::new(models.lattices(), align).align(&around, &Template::new(&learnt, &coarse))?;
    Some((alignment, Smoothed::new(&learnt)))
}
