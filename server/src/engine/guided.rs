//! What a known pose adds to a frame: which of the landmarks that look alike a quad is, by where each is expected.
//!
//! In: the image, its facts, the map, the pose without the frame. Out: [`Guided`]: quads that are one landmark by picture
//! and place together, with their poses. A picture that fits no landmark is none wherever it hangs. Keeps nothing.

use super::{
    doubles::{Resembling, resembling},
    judging::View,
};
use map::{
    guided::{
        AssociateParams, CameraView, Candidate, ExpectParams, GuidedReport, KnownLandmark, MAX_OBSERVATIONS,
        Observation, associate, expect,
    },
    localise::Sighting,
    pose2::Pose2Covariance,
    visibility::Obstacle,
};
use std::sync::Arc;
use vision::{
    detect::quads::Corners,
    frame::GrayImage,
    geometry::polygon,
    localise::pose::{LandmarkPose, landmark_pose},
    pipeline::{QuadFacts, matched},
    recognise::{LandmarkId, Recognition},
};

/// Picture evidence of a quad that passes every gate of recognition, nats: of the quads of strangers less than one in a
/// thousand does (`docs/EVALUATION.md`), of those of a landmark most do.
const ACCEPTED_NATS: f64 = 6.9;
/// Two quads that overlap by more than this and may be the same landmark are two borders of one thing.
const SAME_THING_IOU: f64 = 0.5;

/// A landmark that was named by the pose.
#[derive(Debug, Clone, PartialEq)]
pub struct GuidedSighting {
    /// Index of its quad in the facts of the frame.
    pub quad: usize,
    /// Which landmark.
    pub landmark: LandmarkId,
    /// Its corners in the landmark's order.
    pub corners_px: Corners,
    /// Its pose.
    pub seen: LandmarkPose,
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
    /// The landmark that a quad is by the pose.
    pub fn of(&self, quad: usize) -> Option<&GuidedSighting> {
        self.sightings.iter().find(|s| s.quad == quad)
    }

    /// As sightings of known place.
    pub fn placed<'a>(&'a self, map: &'a super::snapshot::MapSnapshot) -> Vec<Sighting<'a>> {
        let place = |s: &'a GuidedSighting| {
            let place = map.landmarks.get(&s.landmark)?.place.as_ref()?;
            Some(Sighting { landmark: s.landmark, seen: &s.seen, place })
        };
        self.sightings.iter().filter_map(place).collect()
    }
}

/// A quad that may be landmarks.
struct MayBe {
    quad: usize,
    /// The picture alone names it.
    is_unique: bool,
    resembling: Resembling,
}

/// Names the quads that look like several landmarks by `prior`, the pose without the frame. Where the camera or its mounting
/// is not known, or nothing in the frame has look-alikes, nothing is added.
pub fn guided(image: &GrayImage, view: &View<'_>, prior: &Pose2Covariance) -> Guided {
    let (Some(mounting), Some(intrinsics)) = (view.mounting, view.camera) else { return Guided::default() };
    let may_be = observed(image, view);
    if may_be.iter().all(|m| m.is_unique) {
        return Guided::default();
    }
    let map = view.map;
    let known = map.landmarks.iter().filter_map(|(id, info)| {
        let place = info.place.as_ref().filter(|_| info.is_trusted())?;
        Some(KnownLandmark { landmark: *id, place, visible: map.visibility.get(id).map(Arc::as_ref) })
    });
    let obstacles: Vec<Obstacle> = map.walls.iter().map(Obstacle::from).collect();
    let camera = CameraView { mounting, intrinsics, image_px: view.image_px };
    let observations: Vec<Observation> = may_be.iter().map(observation).collect();
    let known: Vec<_> = known.collect();
    let assigned = expect(prior, &camera, &known, &obstacles, &ExpectParams::default())
        .and_then(|expected| associate(&expected, &observations, &AssociateParams::default()));
    let assigned = match assigned {
        Ok(assigned) => assigned,
        Err(error) => {
            tracing::error!(%error, "checked inputs were refused by guided recognition");
            return Guided::default();
        }
    };
    let report = GuidedReport { contradictions: assigned.contradictions(), missed: false };
    let named = assigned.unique().filter(|(i, _)| !may_be[*i].is_unique);
    let sightings = named.filter_map(|(i, landmark)| sighting(&may_be[i], landmark, view)).collect();
    Guided { sightings, report }
}

/// The quads that may be landmarks, each thing once: of several borders the one that fits best.
fn observed(image: &GrayImage, view: &View<'_>) -> Vec<MayBe> {
    let quads = view.facts.quads.iter().enumerate();
    let mut all: Vec<MayBe> = quads.filter_map(|(i, facts)| may_be(image, i, facts, view)).collect();
    all.sort_by(|a, b| {
        let key = |m: &MayBe| (!m.is_unique, m.resembling.ratio);
        let ((a_is, a_ratio), (b_is, b_ratio)) = (key(a), key(b));
        a_is.cmp(&b_is).then(a_ratio.total_cmp(&b_ratio))
    });
    let mut kept: Vec<MayBe> = Vec::new();
    for one in all {
        let is_known = kept.iter().any(|k| {
            let (a, b) = (&k.resembling, &one.resembling);
            !a.members.is_disjoint(&b.members)
                && polygon::iou(a.corners_px.points(), b.corners_px.points()) > SAME_THING_IOU
        });
        if !is_known && kept.len() < MAX_OBSERVATIONS {
            kept.push(one);
        }
    }
    kept
}

/// The landmarks that one quad may be.
fn may_be(image: &GrayImage, quad: usize, facts: &QuadFacts, view: &View<'_>) -> Option<MayBe> {
    let verdict = facts.verdict.as_ref()?;
    if let Recognition::Unique(landmark) = verdict.recognition {
        let (corners_px, covariance_px2) = matched(&facts.quad, verdict, &view.map.params)?;
        let ratio = verdict.candidates.first().map_or(0.0, |c| c.ratio);
        let members = [landmark].into();
        let resembling = Resembling { members, fitting: 1, ratio, corners_px, covariance_px2 };
        return Some(MayBe { quad, is_unique: true, resembling });
    }
    if view.map.doubles.models.is_empty() {
        return None;
    }
    let resembling = resembling(image, &facts.quad, view.map)?;
    Some(MayBe { quad, is_unique: false, resembling })
}

fn observation(may_be: &MayBe) -> Observation {
    let Resembling { members, corners_px, covariance_px2, .. } = &may_be.resembling;
    let candidate =
        |id: &LandmarkId| Candidate { landmark: *id, picture_nats: ACCEPTED_NATS, prior_nats: 0.0 };
    Observation::new(*corners_px, covariance_px2, members.iter().map(candidate).collect())
}

fn sighting(may_be: &MayBe, landmark: LandmarkId, view: &View<'_>) -> Option<GuidedSighting> {
    let Resembling { corners_px, covariance_px2, .. } = &may_be.resembling;
    let size = view.map.sizes.get(&landmark)?;
    let seen = landmark_pose(corners_px, covariance_px2, *size, view.camera?).ok()?;
    Some(GuidedSighting { quad: may_be.quad, landmark, corners_px: *corners_px, seen })
}
