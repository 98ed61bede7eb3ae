//! Guided recognition: what a known pose adds to a frame. It says which of several look-alikes a
//! quad is, by where each is expected, and it finds expected landmarks that were not detected, one
//! by one.
//!
//! In: the image, its analysis, the map, the prior pose without the frame. Out: [`GuidedResult`]:
//! landmarks that picture and place name together, each with its pose. A quad that fits no landmark
//! is never named. Stateless.

use super::{
    ambiguous_observations::{LookAlikeMatch, are_placed_and_trusted, match_look_alikes},
    context::FrameContext,
};
use crate::snapshot::MapSnapshot;
use map::{
    guided::{
        CameraView, Candidate, Expectations, Expected, GuidedReport, KnownLandmark, MAX_OBSERVATIONS,
        Observation, associate, expect,
    },
    localise::LandmarkObservation,
    pose2::Pose2Covariance,
    visibility::Obstacle,
};
use nalgebra::Matrix2;
use std::{collections::BTreeSet, sync::Arc};
use vision::{
    border::{BorderEstimate, estimate_border},
    frame::GrayImage,
    geometry::{Corners, polygon},
    model::LandmarkId,
    pipeline::{ACCEPTED_NATS, ExpectedLandmark, QuadAnalysis, expected, matched_border},
    points::verify::PointEvidence,
    pose::LandmarkPose,
    recognise::{MatchRefusal, Verdict},
    seen_border::{FoundBy, SeenBorder},
};

/// Two quads that overlap by more than this and may be the same landmark are two borders of one
/// object.
const SAME_OBJECT_IOU: f64 = 0.5;

/// Expected landmarks that are searched for one by one in a frame, at most: those with the longest
/// shortest side.
pub const MAX_EXPECTED_SEARCHES: usize = 8;

/// A landmark that is surely in view with sides of at least this is found if it is there.
const SURELY_FOUND_PX: f64 = 48.0;

/// A landmark that the prior pose names.
#[derive(Debug, Clone, PartialEq)]
pub struct GuidedObservation {
    /// Index of its quad in the analysis of the frame; `None` if none was detected.
    pub quad: Option<usize>,
    /// Which landmark.
    pub landmark: LandmarkId,
    /// Corners in the landmark's order, px; outside of the image where its border cuts the
    /// landmark.
    pub corners_px: Corners,
    /// Covariances of the corners, px^2.
    pub covariance_px2: [Matrix2<f64>; 4],
    /// Its pose (camera frame).
    pub pose: LandmarkPose,
    /// The points' evidence, where points decided.
    pub points: Option<PointEvidence>,
}

/// What a known pose adds to a frame.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct GuidedResult {
    /// Landmarks that the prior pose names; those that the picture alone names are not among them.
    pub observations: Vec<GuidedObservation>,
    /// Contradictions of the pose, and whether a landmark is missing.
    pub report: GuidedReport,
}

impl GuidedResult {
    /// The observations of landmarks with a place.
    pub fn landmark_observations<'a>(&'a self, map: &'a MapSnapshot) -> Vec<LandmarkObservation<'a>> {
        let placed = |o: &'a GuidedObservation| {
            let place = map.landmarks.get(&o.landmark)?.place.as_ref()?;
            Some(LandmarkObservation { landmark: o.landmark, seen: &o.pose, place })
        };
        self.observations.iter().filter_map(placed).collect()
    }
}

/// A quad, or a part of the image without one, that may be one of several landmarks.
struct QuadMatch {
    /// `None`: nothing was detected, an expected landmark was searched for.
    quad: Option<usize>,
    /// The picture alone names it.
    is_unique: bool,
    picture_nats: f64,
    matched: LookAlikeMatch,
    points: Option<PointEvidence>,
}

/// Names by `prior`, the pose without the frame, what the picture alone leaves open. Without
/// intrinsics or extrinsics, and while look-alike classes are pending, the result is empty.
pub fn recognise_guided(
    image: &GrayImage,
    frame: &FrameContext<'_>,
    prior: &Pose2Covariance,
) -> GuidedResult {
    let (Some(mounting), Some(intrinsics)) = (frame.extrinsics, frame.camera) else {
        return GuidedResult::default();
    };
    let map = frame.map;
    // Without the classes, a landmark could be named that another one looks like.
    if map.pending.look_alikes {
        return GuidedResult::default();
    }
    let known = map.landmarks.iter().filter_map(|(id, info)| {
        let place = info.place.as_ref().filter(|_| info.is_trusted())?;
        Some(KnownLandmark { landmark: *id, place, visible: map.visibility.get(id).map(Arc::as_ref) })
    });
    let known: Vec<_> = known.collect();
    let obstacles: Vec<Obstacle> = map.walls.iter().map(Obstacle::from).collect();
    let camera = CameraView { mounting, intrinsics, image_px: frame.image_px };
    let named = expect(prior, &camera, &known, &obstacles, &map.poses.expect).and_then(|expected| {
        let matches = quad_matches(image, frame, &expected);
        let observations: Vec<Observation> = matches.iter().map(observation).collect();
        Ok((associate(&expected, &observations, &map.poses.associate)?, matches, expected))
    });
    let (assigned, matches, expected) = match named {
        Ok(named) => named,
        Err(error) => {
            tracing::error!(%error, "guided_recognition_refused_checked_input");
            return GuidedResult::default();
        }
    };
    let is_missed = |e: &Expected| {
        let is_observed = assigned.unique().any(|(_, id)| id == e.landmark);
        frame.is_whole
            && e.is_sure
            && e.side_px >= SURELY_FOUND_PX
            && is_distinct(map, e.landmark)
            && !is_observed
    };
    let missed = expected.searchable().any(is_missed);
    let report = GuidedReport { contradictions: assigned.contradictions(), missed };
    let by_pose = assigned.unique().filter(|(i, _)| !matches[*i].is_unique);
    let observations =
        by_pose.filter_map(|(i, id)| guided_observation(image, &matches[i], id, frame)).collect();
    GuidedResult { observations, report }
}

/// Whether a landmark is active and has no look-alikes.
fn is_distinct(map: &MapSnapshot, id: LandmarkId) -> bool {
    map.models.get(id).is_some() && !map.look_alikes.classes.contains_key(&id)
}

/// What may be landmarks, each object once: of several borders the best match, and detected quads
/// before expected landmarks that were searched for.
fn quad_matches(image: &GrayImage, frame: &FrameContext<'_>, expected: &Expectations) -> Vec<QuadMatch> {
    let quads = frame.analysis.quads.iter().enumerate();
    let mut all: Vec<QuadMatch> =
        quads.filter_map(|(i, analysis)| match_quad(image, i, analysis, frame)).collect();
    all.sort_by(|a, b| {
        let by_fit = a.matched.ratio.total_cmp(&b.matched.ratio);
        b.is_unique.cmp(&a.is_unique).then(by_fit)
    });
    let mut chosen: Vec<QuadMatch> = Vec::new();
    let add = |chosen: &mut Vec<QuadMatch>, new: QuadMatch| {
        let is_known = chosen.iter().any(|other| {
            let (a, b) = (&other.matched, &new.matched);
            (other.is_unique || !a.members.is_disjoint(&b.members)) && overlap(&a.corners_px, &b.corners_px)
        });
        if !is_known && chosen.len() < MAX_OBSERVATIONS {
            chosen.push(new);
        }
    };
    for new in all {
        add(&mut chosen, new);
    }
    let is_open = |e: &&Expected| frame.is_whole && chosen.iter().all(|m| !is_found(m, e));
    let mut open: Vec<&Expected> = expected.searchable().filter(is_open).collect();
    open.sort_by(|a, b| b.side_px.total_cmp(&a.side_px).then(a.landmark.cmp(&b.landmark)));
    for new in open.into_iter().take(MAX_EXPECTED_SEARCHES).filter_map(|e| search(image, e, frame)) {
        add(&mut chosen, new);
    }
    chosen
}

fn overlap(a: &Corners, b: &Corners) -> bool {
    polygon::iou(a.points(), b.points()) > SAME_OBJECT_IOU
}

/// Whether an expected landmark need not be searched for: the picture names it, or a quad detected
/// there may be it.
fn is_found(chosen: &QuadMatch, e: &Expected) -> bool {
    let LookAlikeMatch { members, corners_px, .. } = &chosen.matched;
    let is_there = Corners::new(e.corners_px).is_ok_and(|expected_px| overlap(corners_px, &expected_px));
    members.contains(&e.landmark) && (chosen.is_unique || is_there)
}

/// The landmarks that one detected quad may be.
fn match_quad(
    image: &GrayImage,
    quad: usize,
    analysis: &QuadAnalysis,
    frame: &FrameContext<'_>,
) -> Option<QuadMatch> {
    let result = analysis.recognition.as_ref()?;
    let quad = Some(quad);
    if let Verdict::Unique(landmark) = result.verdict {
        let SeenBorder { corners_px, covariance_px2, .. } =
            matched_border(&analysis.quad, result, &frame.map.params)?;
        let ratio = result.candidates.first().map_or(0.0, |c| c.ratio);
        let members = [landmark].into();
        let matched = LookAlikeMatch { members, fitting: 1, ratio, corners_px, covariance_px2 };
        let (picture_nats, points) = (ACCEPTED_NATS, None);
        return Some(QuadMatch { quad, is_unique: true, picture_nats, matched, points });
    }
    let matched = match match_by_icon(analysis, frame) {
        Some(by_icon) => by_icon,
        None if frame.map.look_alikes.models.is_empty() => return None,
        None => match_look_alikes(image, &analysis.quad, frame.map)?,
    };
    Some(QuadMatch { quad, is_unique: false, picture_nats: ACCEPTED_NATS, matched, points: None })
}

/// A quad that matches one landmark by its icon, without points, where that landmark has no
/// look-alikes.
fn match_by_icon(analysis: &QuadAnalysis, frame: &FrameContext<'_>) -> Option<LookAlikeMatch> {
    let result = analysis.recognition.as_ref()?;
    let Verdict::Ambiguous(landmark) = result.verdict else { return None };
    let first = result.candidates.iter().find(|c| c.landmark == landmark)?;
    let members = [landmark].into();
    let is_alone =
        !frame.map.look_alikes.classes.contains_key(&landmark) && are_placed_and_trusted(&members, frame.map);
    if first.refusal != Some(MatchRefusal::Plain) || !is_alone {
        return None;
    }
    let SeenBorder { corners_px, covariance_px2, .. } =
        matched_border(&analysis.quad, result, &frame.map.params)?;
    Some(LookAlikeMatch { members, fitting: 1, ratio: first.ratio, corners_px, covariance_px2 })
}

/// Searches for an expected landmark that was not detected. What is found may be any member of its
/// look-alike class.
fn search(image: &GrayImage, e: &Expected, frame: &FrameContext<'_>) -> Option<QuadMatch> {
    let (map, id) = (frame.map, e.landmark);
    let models =
        [&map.models, &map.look_alikes.models].into_iter().find(|models| models.get(id).is_some())?;
    let found = expected(image, &Corners::new(e.corners_px).ok()?, id, models, &map.params)?;
    let members: BTreeSet<LandmarkId> =
        map.look_alikes.classes.get(&id).map_or_else(|| [id].into(), |class| class.iter().copied().collect());
    if !are_placed_and_trusted(&members, map) {
        return None;
    }
    let ExpectedLandmark { corners_px, covariance_px2, picture_nats, points } = found;
    let matched = LookAlikeMatch { members, fitting: 1, ratio: 1.0, corners_px, covariance_px2 };
    Some(QuadMatch { quad: None, is_unique: false, picture_nats, matched, points })
}

fn observation(quad: &QuadMatch) -> Observation {
    let LookAlikeMatch { members, corners_px, covariance_px2, .. } = &quad.matched;
    let candidate =
        |id: &LandmarkId| Candidate { landmark: *id, picture_nats: quad.picture_nats, prior_nats: 0.0 };
    Observation::new(*corners_px, covariance_px2, members.iter().map(candidate).collect())
}

/// The landmark at a quad that the prior pose names; `None` where no border is clear enough for a
/// pose.
fn guided_observation(
    image: &GrayImage,
    quad_match: &QuadMatch,
    landmark: LandmarkId,
    frame: &FrameContext<'_>,
) -> Option<GuidedObservation> {
    let LookAlikeMatch { corners_px, covariance_px2, .. } = &quad_match.matched;
    let size = frame.map.sizes.get(&landmark)?;
    let camera = frame.camera?;
    let border = if frame.is_whole {
        let found_by = FoundBy::Alignment;
        let texture = SeenBorder { corners_px: *corners_px, covariance_px2: *covariance_px2, found_by };
        estimate_border(image.into(), &texture, *size, camera).ok()?
    } else {
        let covariance_px2 = covariance_px2.into();
        BorderEstimate { corners_px: *corners_px, covariance_px2, is_mirrored: false }
    };
    let pose = border.pose(*size, camera).ok()?;
    let (quad, points) = (quad_match.quad, quad_match.points.clone());
    let BorderEstimate { corners_px, covariance_px2, .. } = border;
    let covariance_px2 = covariance_px2.blocks();
    Some(GuidedObservation { quad, landmark, corners_px, covariance_px2, pose, points })
}

#[cfg(test)]
mod tests;
