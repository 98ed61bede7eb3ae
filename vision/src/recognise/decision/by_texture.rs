//! A frame in whose quads landmarks may be missing in, landmarks that its texture shows without a
//! border out.
//!
//! The points of the frame vote for places of landmarks. The corners of a place are a quad like a
//! detected one: the rules of points decide on it unchanged, with a price for the places that were
//! searched.

use crate::{
    detect::quad::{Quad, QuadKind},
    frame::{GrayImage, Intrinsics},
    geometry::{corners::Corners, polygon::iou},
    model::{landmark_id::LandmarkId, model_set::ModelSet},
    params::Params,
    points::{
        frame_places::{Place, frame_places},
        frame_points::{FramePoints, frame_points},
    },
    recognise::decision::{
        by_points::{LOG10_EPSILON, by_points, log10_false_alarms},
        result::{RecognitionResult, Verdict},
    },
    up::Up,
};
use nalgebra::{Matrix2, Point2};
use std::f64::consts::FRAC_PI_2;

/// Most places of a frame that are compared with the map, the best supported first.
pub(crate) const MAX_PLACES: usize = 3;
/// log10 of the different places, sizes and shapes of a landmark in a frame: a detected quad is at
/// one of them.
const LOG10_PLACES: f64 = 4.0;
/// Overlap above which two landmarks cannot both be there.
const SAME_PLACE_IOU: f64 = 0.3;

/// Quads of landmarks that the texture of `image` shows beside those `named` already, with their
/// verdicts, all unique. At most [`MAX_PLACES`].
pub(crate) fn by_texture(
    image: &GrayImage,
    named: &[(LandmarkId, Corners)],
    (up, camera): (Option<&Up>, Option<&Intrinsics>),
    models: &ModelSet,
    p: &Params,
) -> Vec<(Quad, RecognitionResult)> {
    let mut found: Vec<(Quad, RecognitionResult)> = Vec::new();
    if models.is_empty() || models.points().is_empty() || models.params_hash() != p.distance_hash() {
        return found;
    }
    let (roll_rad, turns) = roll(image, up, camera);
    let explained: Vec<Corners> = named.iter().map(|(_, corners)| *corners).collect();
    let Some(frame) = frame_points(image, roll_rad, &explained) else { return found };
    let is_open =
        |place: &Place| models.at(place.model).is_some_and(|m| named.iter().all(|(id, _)| *id != m.id));
    let mut places: Vec<(Place, usize)> = Vec::new();
    for turn in turns {
        let turned = frame_places(&frame.turned(turn), models.points(), models.len());
        places.extend(turned.into_iter().filter(is_open).map(|place| (place, turn)));
    }
    places.sort_by_key(|(place, _)| std::cmp::Reverse((place.support, place.weight)));
    for (place, turn) in places.into_iter().take(MAX_PLACES) {
        let Some(quad) = quad(&frame, &place, turn) else { continue };
        let Some((quad, verdict)) = identified(image, quad.named_by(up, camera), &place, models, p) else {
            continue;
        };
        let is_new = |at: &Corners, id: Verdict| {
            id != verdict.verdict && iou(at.points(), quad.corners_px.points()) <= SAME_PLACE_IOU
        };
        let earlier = found.iter().map(|(quad, other)| (quad.corners_px, other.verdict));
        let detected = named.iter().map(|(id, corners)| (*corners, Verdict::Unique(*id)));
        if earlier.chain(detected).all(|(at, id)| is_new(&at, id)) {
            found.push((quad, verdict));
        }
    }
    found
}

/// By how much the picture is rolled beyond whole quarters, radians, clockwise on screen, and which
/// quarters to try.
fn roll(image: &GrayImage, up: Option<&Up>, camera: Option<&Intrinsics>) -> (f64, std::ops::Range<usize>) {
    let centre = Point2::new(0.5 * image.width() as f64 - 0.5, 0.5 * image.height() as f64 - 0.5);
    let Some(down) = up.and_then(|up| up.down_at(&centre, camera)) else { return (0.0, 0..4) };
    let roll_rad = (-down.x).atan2(down.y);
    let quarters = (roll_rad / FRAC_PI_2).round();
    let turn = (quarters as i32).rem_euclid(4) as usize;
    (roll_rad - quarters * FRAC_PI_2, turn..turn + 1)
}

/// A place as a quad, the landmark's top-left corner first. `None` where its corners are no quad.
fn quad(frame: &FramePoints, place: &Place, turn: usize) -> Option<Quad> {
    let corners_px = Corners::new(place.corners_px.map(|at| frame.to_image(at, turn))).ok()?;
    Some(Quad {
        corners_px,
        corner_covariance_px2: [Matrix2::zeros(); 4],
        side_support: [0.0; 4],
        side_clipped: [false; 4],
        score: 0.0,
        kind: QuadKind::Texture,
        upright_ambiguous: false,
        alternates: Vec::new(),
    })
}

/// Times that the rules are asked for a place: at its corners, and at those that the points gave
/// then. Only there is a slanted landmark described as it was taught.
const ROUNDS: usize = 2;

/// The quad with the corners and covariances of its landmark, where the map's rules name exactly
/// the one that the place was found by, in every round.
fn identified(
    image: &GrayImage,
    mut quad: Quad,
    place: &Place,
    models: &ModelSet,
    p: &Params,
) -> Option<(Quad, RecognitionResult)> {
    let mut said = None;
    for _ in 0..ROUNDS {
        let verdict = by_points(image, &quad, models, p)?;
        let evidence = verdict.points.as_ref()?;
        let is_it = models.at(place.model).is_some_and(|m| verdict.verdict == Verdict::Unique(m.id));
        if !is_it || log10_false_alarms(evidence, models.len()) + LOG10_PLACES > LOG10_EPSILON {
            return None;
        }
        let back = (4 - verdict.rotation % 4) % 4;
        let covariance_px2 = evidence.corner_covariance_px2;
        quad.corners_px = evidence.corners_px.rotated(back);
        quad.corner_covariance_px2 = std::array::from_fn(|i| covariance_px2[(i + back) % 4]);
        quad.score = verdict.confidence;
        said = Some(verdict);
    }
    let is_outside = |c: &Point2<f64>| {
        c.x < 0.0 || c.y < 0.0 || c.x > image.width() as f64 - 1.0 || c.y > image.height() as f64 - 1.0
    };
    let corners = quad.corners_px.points();
    quad.side_clipped = std::array::from_fn(|i| is_outside(&corners[i]) || is_outside(&corners[(i + 1) % 4]));
    Some((quad, said?))
}

#[cfg(test)]
mod tests;
