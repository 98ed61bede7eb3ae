//! A landmark that points speak for is laid on its learnt icon. In: the image, the evidence with the corners of the
//! homography, the landmark. Out: sharper corners in the evidence, how like the picture is there, and whether a part of it
//! shows something else.

use super::{
    align::{Aligner, Laid, Surroundings, Template},
    differing::Differing,
    likeness::{Smoothed, between},
    models::ModelSet,
    signature::{Signature, likeness},
};
use crate::{
    detect::quads::Corners, frame::GrayImage, icon::rectify, learn::model::LandmarkModel, params::Params,
    points::verify::PointEvidence, seen_border::FoundBy,
};

/// Alignment is believed from this likeness on if it moved no corner of the homography further than...
const MIN_LIKENESS: f64 = 0.4;
/// ... so many icon pixels, or...
const MAX_MOVED_ICON_PX: f64 = 4.0;
/// ... so many squared standard deviations: 99.99 % of a corner in the plane.
const MAX_SQUARE: f64 = 18.4;
/// From this likeness on the picture itself says that it lies there, however sure the points are of another place.
const SURE_LIKENESS: f64 = 0.65;

/// What came of laying a picture on a learnt icon.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Laying {
    /// How like the icon the picture is there, -1 to 1. `None` where the image does not show all of it.
    pub(super) likeness: Option<f64>,
    /// Whether a connected part shows something else. `None` unless the alignment is believed.
    pub(super) differs: Option<bool>,
}

impl Laying {
    /// Not laid on anything.
    pub(super) const NONE: Self = Self { likeness: None, differs: None };
}

/// Lays the picture on the learnt icon, from the corners of `evidence` and, if that leads nowhere, from `detected_px`; takes
/// over the corners if they are where the points can have put them, or the picture leaves no doubt.
pub(super) fn sharpened(
    image: &GrayImage,
    evidence: &mut PointEvidence,
    detected_px: Option<&Corners>,
    (model, models): (&LandmarkModel, &ModelSet),
    p: &Params,
) -> Laying {
    let mut first = None;
    for start_px in std::iter::once(&evidence.corners_px.clone()).chain(detected_px) {
        let Some((laid, learnt)) = laid(image, start_px, (model, models), p) else { continue };
        let seen = Smoothed::new(&laid.icon);
        let alike = between(&seen, &learnt, &p.recognise.correlation).likeness;
        first = first.or(Some(alike));
        let is_possible = alike >= MIN_LIKENESS && may_be_at(evidence, &laid.corners_px, p);
        if !is_possible && alike < SURE_LIKENESS {
            continue;
        }
        evidence.corners_px = laid.corners_px;
        evidence.corner_covariance_px2 = laid.covariance_px2;
        evidence.found_by = FoundBy::Alignment;
        let differing = Differing::new(&seen, &learnt);
        if let Some(differing) = differing.as_ref().filter(|d| d.has_part()) {
            evidence.agreement = differing.marked(evidence.agreement);
        }
        return Laying { likeness: Some(alike), differs: differing.map(|d| d.has_part()) };
    }
    Laying { likeness: first, differs: None }
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

/// The picture laid on the nearest of the learnt icons from `start_px`, and that icon.
fn laid(
    image: &GrayImage,
    start_px: &Corners,
    (model, models): (&LandmarkModel, &ModelSet),
    p: &Params,
) -> Option<(Laid, Smoothed)> {
    let align = &p.recognise.verdict.align;
    let icon = rectify(image, start_px, &p.icon).ok()?;
    let signature = Signature::new(&icon);
    let alike = |i: usize| likeness(model.exemplars[i].signature.values(), signature.values());
    let nearest = (0..model.exemplars.len()).max_by(|a, b| alike(*a).total_cmp(&alike(*b)))?;
    let (learnt, coarse) = model.exemplars[nearest].template(align);
    let around = Surroundings::new(image, start_px, &icon, align)?;
    let laid = Aligner::new(models.lattices(), align).align(&around, &Template::new(&learnt, &coarse))?;
    Some((laid, Smoothed::new(&learnt)))
}
