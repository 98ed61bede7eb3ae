//! Verification of one landmark at its expected corners, without a detected quad.
//!
//! In: an image, the landmark's model, its expected corners. Out: [`ExpectedLandmark`]: its corners
//! with covariance and its evidence, or `None`. Points verify it also where the image border cuts
//! it or a part is hidden; without point evidence the picture is aligned with its icon, and the
//! landmark must be entirely visible.

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

/// log10 of the largest expected number of false alarms for one landmark at one place.
pub const LOG10_EPSILON_EXPECTED: f64 = -4.0;
/// Evidence of a landmark that passes every gate of its icon, nats: fewer than one in a thousand
/// quads of distractors pass (`docs/EVALUATION.md`).
pub const ACCEPTED_NATS: f64 = 6.9;

/// A landmark found where it was expected.
#[derive(Debug, Clone, PartialEq)]
pub struct ExpectedLandmark {
    /// Its corners, TL first; outside of the image where its border cuts it.
    pub corners_px: Corners,
    /// Their covariances, px^2.
    pub covariance_px2: [Matrix2<f64>; 4],
    /// Log likelihood ratio of presence against absence, nats.
    pub picture_nats: f64,
    /// Its point evidence, where points decided.
    pub points: Option<PointEvidence>,
}

/// Outcome of the points for an expected landmark.
enum PointOutcome {
    Found(Box<ExpectedLandmark>),
    /// Points agree, but a part mismatches.
    Doubtful,
    Silent,
}

/// Verifies landmark `id` of `models` at `expected_px`. `None`: not verified, or doubtful.
pub fn expected(
    image: &GrayImage,
    expected_px: &Corners,
    id: LandmarkId,
    models: &ModelSet,
    p: &Params,
) -> Option<ExpectedLandmark> {
    let is_whole = expected_px.points().iter().all(|c| is_inside(image, c));
    match by_points(image, expected_px, (id, is_whole), models, p) {
        PointOutcome::Found(found) => Some(*found),
        PointOutcome::Doubtful => None,
        PointOutcome::Silent => is_whole.then(|| by_icon(image, expected_px, id, models, p)).flatten(),
    }
}

fn by_points(
    image: &GrayImage,
    expected_px: &Corners,
    (id, is_whole): (LandmarkId, bool),
    models: &ModelSet,
    p: &Params,
) -> PointOutcome {
    let Some(model) = models.get(id).filter(|model| !model.points.is_empty()) else {
        return PointOutcome::Silent;
    };
    let Some(mut evidence) = verify_at(image, &model.points, expected_px) else {
        return PointOutcome::Silent;
    };
    let are_there = evidence.log10_nfa <= LOG10_EPSILON_EXPECTED;
    let alignment = if is_whole && are_there {
        align_to_icon(image, &mut evidence, None, (model, models), p)
    } else {
        IconAlignment::NONE
    };
    if is_doubtful(&evidence, &alignment) {
        return PointOutcome::Doubtful;
    }
    if !are_there {
        return PointOutcome::Silent;
    }
    if !is_well_known(&evidence) {
        return PointOutcome::Silent;
    }
    PointOutcome::Found(Box::new(ExpectedLandmark {
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
    // Landmarks with enough points are decided by points alone.
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

/// A quad with the expected corners.
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
