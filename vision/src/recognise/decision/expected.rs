//! One landmark, asked for where its corners are expected, whatever was detected there.
//!
//! In: an image, the landmark's model, its expected corners. Out: [`ExpectedLandmark`]: its corners with covariance
//! and how much the picture speaks for it, or nothing. Points find it also where the image border cuts it or
//! something hides a part of it; where they say nothing it is laid on its icon, and must be in view as a whole.

use crate::{
    detect::quad::{Quad, QuadKind},
    frame::GrayImage,
    geometry::corners::Corners,
    model::{landmark_id::LandmarkId, model_set::ModelSet},
    params::Params,
    points::verify::{PointEvidence, verify_at},
    recognise::{
        decision::{
            by_points::{is_doubtful, is_well_known},
            result::Verdict,
            verdict::recognise,
        },
        distance_kind::DistanceKind,
        verification::icon_alignment::{IconAlignment, align_to_icon},
    },
    seen_border::aligned_covariance_px2,
};
use nalgebra::{Matrix2, Point2};

/// log10 of the false alarms that asking for one landmark at one place may have, expected.
pub const LOG10_EPSILON_EXPECTED: f64 = -4.0;
/// Evidence of a landmark that passes every gate of its icon, nats: of the quads of strangers less than one in a
/// thousand does (`docs/EVALUATION.md`).
pub const ACCEPTED_NATS: f64 = 6.9;

/// A landmark found where it was expected.
#[derive(Debug, Clone, PartialEq)]
pub struct ExpectedLandmark {
    /// Its corners, TL first; outside of the image where its border cuts it.
    pub corners_px: Corners,
    /// Their covariances, px^2.
    pub covariance_px2: [Matrix2<f64>; 4],
    /// ln of how much likelier the picture is with the landmark there than without.
    pub picture_nats: f64,
    /// What points say of it, where they decided.
    pub points: Option<PointEvidence>,
}

/// What points say of an expected landmark.
enum Said {
    /// It is there.
    Found(Box<ExpectedLandmark>),
    /// Its points are there while a part of it shows something else.
    Doubtful,
    /// Nothing.
    Silent,
}

/// Looks for landmark `id` of `models` at `expected_px`. `None`: the picture does not show it there, or it is in doubt.
pub fn expected(
    image: &GrayImage,
    expected_px: &Corners,
    id: LandmarkId,
    models: &ModelSet,
    p: &Params,
) -> Option<ExpectedLandmark> {
    let is_whole = expected_px.points().iter().all(|c| is_inside(image, c));
    match by_points(image, expected_px, (id, is_whole), models, p) {
        Said::Found(found) => Some(*found),
        Said::Doubtful => None,
        Said::Silent => is_whole.then(|| by_icon(image, expected_px, id, models, p)).flatten(),
    }
}

fn by_points(
    image: &GrayImage,
    expected_px: &Corners,
    (id, is_whole): (LandmarkId, bool),
    models: &ModelSet,
    p: &Params,
) -> Said {
    let Some(model) = models.get(id).filter(|model| !model.points.is_empty()) else { return Said::Silent };
    let Some(mut evidence) = verify_at(image, &model.points, expected_px) else { return Said::Silent };
    let are_there = evidence.log10_nfa <= LOG10_EPSILON_EXPECTED;
    let alignment = if is_whole && are_there {
        align_to_icon(image, &mut evidence, None, (model, models), p)
    } else {
        IconAlignment::NONE
    };
    if is_doubtful(&evidence, &alignment) {
        return Said::Doubtful;
    }
    if !are_there {
        return Said::Silent;
    }
    if !is_well_known(&evidence) {
        return Said::Silent;
    }
    Said::Found(Box::new(ExpectedLandmark {
        corners_px: evidence.corners_px,
        covariance_px2: evidence.corner_covariance_px2,
        picture_nats: -evidence.log10_nfa * std::f64::consts::LN_10,
        points: Some(evidence),
    }))
}

fn by_icon(
    image: &GrayImage,
    expected_px: &Corners,
    id: LandmarkId,
    models: &ModelSet,
    p: &Params,
) -> Option<ExpectedLandmark> {
    // Points had their say.
    let mut by_icons = p.clone();
    by_icons.recognise.verdict.points = false;
    let verdict = recognise(image, &as_quad(expected_px), &models.only(id)?, DistanceKind::Both, &by_icons);
    let (Verdict::Unique(_), Some(corners_px)) = (verdict.verdict, verdict.aligned_px) else {
        return None;
    };
    let covariance_px2 = aligned_covariance_px2(&corners_px, p.icon.size);
    Some(ExpectedLandmark { corners_px, covariance_px2, picture_nats: ACCEPTED_NATS, points: None })
}

fn is_inside(image: &GrayImage, c: &Point2<f64>) -> bool {
    c.x >= 0.0 && c.y >= 0.0 && c.x <= image.width() as f64 - 1.0 && c.y <= image.height() as f64 - 1.0
}

/// Expected corners as if they had been detected.
fn as_quad(corners_px: &Corners) -> Quad {
    Quad {
        corners_px: *corners_px,
        corner_covariance_px2: [Matrix2::identity(); 4],
        side_support: [0.0; 4],
        side_clipped: [false; 4],
        score: 0.0,
        kind: QuadKind::Full,
        upright_ambiguous: false,
        alternates: Vec::new(),
    }
}
