//! A quad and its verdict in, the border of the landmark that was matched out.

use crate::{
    detect::quad::{Quad, QuadKind},
    params::Params,
    recognise::decision::result::RecognitionResult,
    seen_border::{ALIGNED_SIGMA_ICON_PX, FoundBy, SeenBorder, aligned_covariance_px2, is_same_border},
};
use nalgebra::Matrix2;

/// Where the landmark's texture puts its border: by points, by alignment, or, where neither was
/// needed, as detected.
pub fn texture_border(quad: &Quad, verdict: &RecognitionResult, p: &Params) -> Option<SeenBorder> {
    if let Some(evidence) = &verdict.points {
        return Some(evidence.border());
    }
    let Some(corners_px) = verdict.aligned_px else { return matched_border(quad, verdict, p) };
    let covariance_px2 = aligned_covariance_px2(&corners_px, p.icon.size);
    Some(SeenBorder { corners_px, covariance_px2, found_by: FoundBy::Alignment })
}

/// The landmark's border: as detected, or, where another border of the same object was taught than
/// the one detected, as aligned. An alternate border has no covariances of its own: those of the
/// quad are used, both follow from similar edges.
pub fn matched_border(quad: &Quad, verdict: &RecognitionResult, p: &Params) -> Option<SeenBorder> {
    if quad.kind == QuadKind::Texture {
        return verdict.points.as_ref().map(|evidence| evidence.border());
    }
    let detected_px = match verdict.border {
        0 => &quad.corners_px,
        border => quad.alternates.get(border - 1)?,
    };
    let detected_px = detected_px.rotated(verdict.rotation);
    let believed_px2 = quad.believed_covariance_px2();
    let covariance_px2 = std::array::from_fn(|i| believed_px2[(i + verdict.rotation) % 4]);
    let detected = SeenBorder { corners_px: detected_px, covariance_px2, found_by: FoundBy::Edges };
    if let Some(own) = verdict.points.as_ref().map(|evidence| evidence.border()) {
        let is_same = match own.found_by {
            FoundBy::Alignment => detected.agrees_with(&own),
            FoundBy::Points | FoundBy::Edges => is_same_border(&detected_px, &own.corners_px, p),
        };
        return Some(if is_same { detected } else { own });
    }
    let Some(aligned_px) = verdict.aligned_px else { return Some(detected) };
    if is_same_border(&detected_px, &aligned_px, p) {
        return Some(detected);
    }
    let icon_px = detected_px.area_px2().sqrt() / p.icon.size as f64;
    let sigma_px = ALIGNED_SIGMA_ICON_PX * icon_px;
    let covariance_px2 = covariance_px2.map(|c| c + Matrix2::identity() * sigma_px * sigma_px);
    Some(SeenBorder { corners_px: aligned_px, covariance_px2, found_by: FoundBy::Alignment })
}
