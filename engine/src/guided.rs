//! What a known pose adds to a frame: which of the landmarks that look alike a quad is, by where each is expected; and
//! expected landmarks that were not detected, asked for one by one.
//!
//! In: the image, its facts, the map, the pose without the frame. Out: [`Guided`]: what is one landmark by picture and place
//! together, with its pose. A picture that fits no landmark is none wherever it hangs. Keeps nothing.

use super::{
    doubles::{Resembling, hang_where_known, resembling},
    frame_context::FrameContext,
    snapshot::MapSnapshot,
};
use map::{
    guided::{
        AssociateParams, CameraView, Candidate, ExpectParams, Expectations, Expected, GuidedReport,
        KnownLandmark, MAX_OBSERVATIONS, Observation, associate, expect,
    },
    localise::LandmarkObservation,
    pose2::Pose2Covariance,
    visibility::Obstacle,
};
use nalgebra::Matrix2;
use std::{collections::BTreeSet, sync::Arc};
use vision::{
    frame::GrayImage,
    geometry::{Corners, polygon},
    model::LandmarkId,
    pipeline::{ACCEPTED_NATS, ExpectedLandmark, QuadAnalysis, expected, matched_border},
    points::verify::PointEvidence,
    pose::{LandmarkPose, landmark_pose},
    recognise::{MatchRefusal, Verdict},
    seen_border::SeenBorder,
};

/// Two quads that overlap by more than this and may be the same landmark are two borders of one thing.
const SAME_THING_IOU: f64 = 0.5;

/// Most landmarks that are asked for where they are expected, in one frame: those whose shortest side is the longest.
pub const MAX_ASKED: usize = 8;

/// A landmark that is surely in view, with sides of at least this, is found if it is there.
const SURELY_FOUND_PX: f64 = 48.0;

/// A landmark that was named by the pose.
#[derive(Debug, Clone, PartialEq)]
pub struct GuidedSighting {
    /// Index of its quad in the facts of the frame; `None` if none was detected.
    pub quad: Option<usize>,
    /// Which landmark.
    pub landmark: LandmarkId,
    /// Its corners in the landmark's order; outside of the image where its border cuts it.
    pub corners_px: Corners,
    /// Their covariances, px^2.
    pub covariance_px2: [Matrix2<f64>; 4],
    /// Its pose.
    pub seen: LandmarkPose,
    /// What points say of it, where they decided.
    pub points: Option<PointEvidence>,
}

/// What a known pose adds to a frame.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Guided {
    /// Landmarks that were named by the pose; those that the picture alone names are not among them.
    pub sightings: Vec<GuidedSighting>,
    /// What speaks against the pose.
    pub report: GuidedReport,
}

impl Guided {
    /// As sightings of known place.
    pub fn placed<'a>(&'a self, map: &'a MapSnapshot) -> Vec<LandmarkObservation<'a>> {
        let place = |s: &'a GuidedSighting| {
            let place = map.landmarks.get(&s.landmark)?.place.as_ref()?;
            Some(LandmarkObservation { landmark: s.landmark, seen: &s.seen, place })
        };
        self.sightings.iter().filter_map(place).collect()
    }
}

/// A part of the image that may be landmarks.
struct MayBe {
    /// `None`: nothing was detected, the landmark was asked for.
    quad: Option<usize>,
    /// The picture alone names it.
    is_unique: bool,
    picture_nats: f64,
    resembling: Resembling,
    points: Option<PointEvidence>,
}

/// Names what the picture alone leaves open by `prior`, the pose without the frame. Where the camera or its mounting is not
/// known, nothing is added.
pub fn guided(image: &GrayImage, view: &FrameContext<'_>, prior: &Pose2Covariance) -> Guided {
    let (Some(mounting), Some(intrinsics)) = (view.mounting, view.camera) else { return Guided::default() };
    let map = view.map;
    // Until it is known what looks alike, a pose may not choose between landmarks.
    if map.pending.look_alikes {
        return Guided::default();
    }
    let known = map.landmarks.iter().filter_map(|(id, info)| {
        let place = info.place.as_ref().filter(|_| info.is_trusted())?;
        Some(KnownLandmark { landmark: *id, place, visible: map.visibility.get(id).map(Arc::as_ref) })
    });
    let known: Vec<_> = known.collect();
    let obstacles: Vec<Obstacle> = map.walls.iter().map(Obstacle::from).collect();
    let camera = CameraView { mounting, intrinsics, image_px: view.image_px };
    let named = expect(prior, &camera, &known, &obstacles, &ExpectParams::default()).and_then(|expected| {
        let may_be = observed(image, view, &expected);
        let observations: Vec<Observation> = may_be.iter().map(observation).collect();
        Ok((associate(&expected, &observations, &AssociateParams::default())?, may_be, expected))
    });
    let (assigned, may_be, expected) = match named {
        Ok(named) => named,
        Err(error) => {
            tracing::error!(%error, "checked inputs were refused by guided recognition");
            return Guided::default();
        }
    };
    let is_missed = |e: &Expected| {
        let is_seen = assigned.unique().any(|(_, id)| id == e.landmark);
        e.is_sure && e.side_px >= SURELY_FOUND_PX && is_told_apart(map, e.landmark) && !is_seen
    };
    let missed = expected.searchable().any(is_missed);
    let report = GuidedReport { contradictions: assigned.contradictions(), missed };
    let named = assigned.unique().filter(|(i, _)| !may_be[*i].is_unique);
    let sightings = named.filter_map(|(i, landmark)| sighting(&may_be[i], landmark, view)).collect();
    Guided { sightings, report }
}

/// Whether a landmark is in use by itself, and nothing looks like it.
fn is_told_apart(map: &MapSnapshot, id: LandmarkId) -> bool {
    map.models.get(id).is_some() && !map.look_alikes.alike.contains_key(&id)
}

/// What may be landmarks, each thing once: of several borders the one that fits best, of what was detected and what was
/// asked for the former.
fn observed(image: &GrayImage, view: &FrameContext<'_>, expected: &Expectations) -> Vec<MayBe> {
    let quads = view.facts.quads.iter().enumerate();
    let mut all: Vec<MayBe> = quads.filter_map(|(i, facts)| may_be(image, i, facts, view)).collect();
    all.sort_by(|a, b| {
        let by_fit = a.resembling.ratio.total_cmp(&b.resembling.ratio);
        b.is_unique.cmp(&a.is_unique).then(by_fit)
    });
    let mut kept: Vec<MayBe> = Vec::new();
    let keep = |kept: &mut Vec<MayBe>, one: MayBe| {
        let is_known = kept.iter().any(|k| {
            let (a, b) = (&k.resembling, &one.resembling);
            (k.is_unique || !a.members.is_disjoint(&b.members)) && overlap(&a.corners_px, &b.corners_px)
        });
        if !is_known && kept.len() < MAX_OBSERVATIONS {
            kept.push(one);
        }
    };
    for one in all {
        keep(&mut kept, one);
    }
    let mut open: Vec<&Expected> =
        expected.searchable().filter(|e| kept.iter().all(|k| !is_found(k, e))).collect();
    open.sort_by(|a, b| b.side_px.total_cmp(&a.side_px).then(a.landmark.cmp(&b.landmark)));
    for one in open.into_iter().take(MAX_ASKED).filter_map(|e| asked(image, e, view)) {
        keep(&mut kept, one);
    }
    kept
}

fn overlap(a: &Corners, b: &Corners) -> bool {
    polygon::iou(a.points(), b.points()) > SAME_THING_IOU
}

/// Whether a landmark need not be asked for: it was named, or something that was detected there may be it.
fn is_found(kept: &MayBe, e: &Expected) -> bool {
    let Resembling { members, corners_px, .. } = &kept.resembling;
    let is_there = Corners::new(e.corners_px).is_ok_and(|expected_px| overlap(corners_px, &expected_px));
    members.contains(&e.landmark) && (kept.is_unique || is_there)
}

/// The landmarks that one quad may be.
fn may_be(image: &GrayImage, quad: usize, facts: &QuadAnalysis, view: &FrameContext<'_>) -> Option<MayBe> {
    let verdict = facts.recognition.as_ref()?;
    let quad = Some(quad);
    if let Verdict::Unique(landmark) = verdict.verdict {
        let SeenBorder { corners_px, covariance_px2, .. } =
            matched_border(&facts.quad, verdict, &view.map.params)?;
        let ratio = verdict.candidates.first().map_or(0.0, |c| c.ratio);
        let members = [landmark].into();
        let resembling = Resembling { members, fitting: 1, ratio, corners_px, covariance_px2 };
        let (picture_nats, points) = (ACCEPTED_NATS, None);
        return Some(MayBe { quad, is_unique: true, picture_nats, resembling, points });
    }
    let resembling = match plain(facts, view) {
        Some(plain) => plain,
        None if view.map.look_alikes.models.is_empty() => return None,
        None => resembling(image, &facts.quad, view.map)?,
    };
    Some(MayBe { quad, is_unique: false, picture_nats: ACCEPTED_NATS, resembling, points: None })
}

/// A quad that the icon of one landmark alone speaks for, and nothing of the map looks like that landmark.
fn plain(facts: &QuadAnalysis, view: &FrameContext<'_>) -> Option<Resembling> {
    let verdict = facts.recognition.as_ref()?;
    let Verdict::Ambiguous(landmark) = verdict.verdict else { return None };
    let first = verdict.candidates.iter().find(|c| c.landmark == landmark)?;
    let members = [landmark].into();
    let is_alone =
        !view.map.look_alikes.alike.contains_key(&landmark) && hang_where_known(&members, view.map);
    if first.refusal != Some(MatchRefusal::Plain) || !is_alone {
        return None;
    }
    let SeenBorder { corners_px, covariance_px2, .. } =
        matched_border(&facts.quad, verdict, &view.map.params)?;
    Some(Resembling { members, fitting: 1, ratio: first.ratio, corners_px, covariance_px2 })
}

/// An expected landmark that was not detected, asked for; it may as well be another that looks the same.
fn asked(image: &GrayImage, e: &Expected, view: &FrameContext<'_>) -> Option<MayBe> {
    let (map, id) = (view.map, e.landmark);
    let models =
        [&map.models, &map.look_alikes.models].into_iter().find(|models| models.get(id).is_some())?;
    let found = expected(image, &Corners::new(e.corners_px).ok()?, id, models, &map.params)?;
    let members: BTreeSet<LandmarkId> =
        map.look_alikes.alike.get(&id).map_or_else(|| [id].into(), |alike| alike.iter().copied().collect());
    if !hang_where_known(&members, map) {
        return None;
    }
    let ExpectedLandmark { corners_px, covariance_px2, picture_nats, points } = found;
    let resembling = Resembling { members, fitting: 1, ratio: 1.0, corners_px, covariance_px2 };
    Some(MayBe { quad: None, is_unique: false, picture_nats, resembling, points })
}

fn observation(may_be: &MayBe) -> Observation {
    let Resembling { members, corners_px, covariance_px2, .. } = &may_be.resembling;
    let candidate =
        |id: &LandmarkId| Candidate { landmark: *id, picture_nats: may_be.picture_nats, prior_nats: 0.0 };
    Observation::new(*corners_px, covariance_px2, members.iter().map(candidate).collect())
}

fn sighting(may_be: &MayBe, landmark: LandmarkId, view: &FrameContext<'_>) -> Option<GuidedSighting> {
    let Resembling { corners_px, covariance_px2, .. } = &may_be.resembling;
    let size = view.map.sizes.get(&landmark)?;
    let seen = landmark_pose(corners_px, covariance_px2, *size, view.camera?).ok()?;
    let (quad, points) = (may_be.quad, may_be.points.clone());
    let (corners_px, covariance_px2) = (*corners_px, *covariance_px2);
    Some(GuidedSighting { quad, landmark, corners_px, covariance_px2, seen, points })
}

#[cfg(test)]
mod tests;
