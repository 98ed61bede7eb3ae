//! The quads of a frame as the tracker takes them: with icon, place on the walls and what is known of their identity.
//! When unsure it says doubtful, and then nothing is kept.

use super::Offer;
use crate::store::placing::Capture;
use engine::snapshot::MapSnapshot;
use map::{
    extrinsics::CameraExtrinsics,
    place::LandmarkPlace,
    placement::{PlacementParams, PosedView, placement, view_on_wall},
    pose2::Pose2Covariance,
    tracks::{Identity, QuadObservation},
};
use nalgebra::Matrix2;
use vision::{
    detect::QuadKind,
    frame::Intrinsics,
    geometry::Corners,
    icon::icon,
    model::LandmarkId,
    params::Params,
    pipeline::{QuadAnalysis, matched_border},
    recognise::{MatchRefusal, Verdict, features},
    seen_border::{FoundBy, SeenBorder},
};

/// A robot that knows its place less surely than this does not place what it sees: standard deviation on the floor...
pub(crate) const POSE_SIGMA_M: f64 = 0.15;
/// ... and of its heading.
pub(crate) const POSE_SIGMA_RAD: f64 = 0.035;
/// A recognised landmark whose confidence is below this is not sure enough to learn from.
pub(crate) const MIN_CONFIDENCE: f64 = 0.9;
/// A landmark whose ratio is below this may be the one that is seen.
const NEARLY: f64 = 1.5;

/// What a frame gives.
pub(super) struct FrameObservations {
    pub(super) glimpses: Vec<QuadObservation>,
    /// Of each, the covariance of its corners by the detector.
    pub(super) corners_px2: Vec<[Matrix2<f64>; 4]>,
    /// How the picture was taken, if that is known well enough.
    pub(super) capture: Option<Capture>,
    pub(super) unusable: u64,
    pub(super) not_on_wall: u64,
}

/// From where a frame was taken.
struct Stand<'a> {
    camera: &'a Intrinsics,
    mounting: &'a CameraExtrinsics,
    map_from_robot: &'a Pose2Covariance,
}

fn stand(offer: &Offer) -> Option<Stand<'_>> {
    let pose = offer.looked.believed.as_ref()?;
    let c = &pose.covariance;
    let sure = (c[(0, 0)] + c[(1, 1)]).sqrt() <= POSE_SIGMA_M && c[(2, 2)].sqrt() <= POSE_SIGMA_RAD;
    Some(Stand {
        camera: offer.frame.intrinsics.as_ref()?,
        mounting: offer.frame.mounting.as_ref()?,
        map_from_robot: sure.then_some(pose)?,
    })
}

/// The glimpses of a frame.
pub(super) fn glimpses(offer: &Offer, params: &Params) -> FrameObservations {
    let stand = stand(offer);
    let capture =
        stand.as_ref().map(|s| Capture::of_robot(s.camera, s.map_from_robot, &s.mounting.robot_from_camera));
    let mut found =
        FrameObservations { glimpses: vec![], corners_px2: vec![], capture, unusable: 0, not_on_wall: 0 };
    for facts in &offer.looked.quads {
        if facts.quad.kind != QuadKind::Full || facts.quad.side_clipped.contains(&true) {
            found.unusable += 1;
            continue;
        }
        let recognised = recognised(facts, params);
        let (corners_px, covariance_px2) = recognised
            .map_or((facts.quad.corners_px, facts.quad.believed_covariance_px2()), |(_, s)| {
                (s.corners_px, s.covariance_px2)
            });
        let Ok(place) = place(&corners_px, &covariance_px2, stand.as_ref(), &offer.looked.map) else {
            found.not_on_wall += 1;
            continue;
        };
        let Ok(icon) = icon(&offer.looked.image, &corners_px, &params.icon) else {
            found.unusable += 1;
            continue;
        };
        let identity = identity(facts, recognised.map(|(id, _)| id), place.as_ref(), &offer.looked.map);
        let icon = features(icon, &params.recognise);
        // Of a landmark that is seen the corners are those detected, turned.
        let turn = facts.recognition.as_ref().filter(|_| recognised.is_some()).map_or(0, |v| v.rotation);
        let mut covariance = facts.quad.corner_covariance_px2;
        covariance.rotate_left(turn % 4);
        found.corners_px2.push(covariance);
        found.glimpses.push(QuadObservation { corners_px, icon, place, identity });
    }
    found
}

/// The landmark that is seen beyond doubt, with its corners. Where its border was found only by laying the learnt picture
/// on it, the corners are not good enough to learn from.
fn recognised(facts: &QuadAnalysis, params: &Params) -> Option<(LandmarkId, SeenBorder)> {
    let verdict = facts.recognition.as_ref()?;
    let Verdict::Unique(id) = verdict.verdict else { return None };
    if verdict.confidence < MIN_CONFIDENCE || verdict.border != 0 {
        return None;
    }
    matched_border(&facts.quad, verdict, params)
        .filter(|s| s.found_by == FoundBy::Edges)
        .map(|seen| (id, seen))
}

/// Where it hangs; `None` where that cannot be known, an error where it is known not to hang flat on a wall.
fn place(
    corners: &Corners,
    covariance_px2: &[Matrix2<f64>; 4],
    stand: Option<&Stand<'_>>,
    map: &MapSnapshot,
) -> Result<Option<LandmarkPlace>, ()> {
    let Some(Stand { camera, mounting, map_from_robot }) = stand.filter(|_| !map.walls.is_empty()) else {
        return Ok(None);
    };
    let view = PosedView { corners, covariance_px2, camera, map_from_robot, mounting };
    let p = PlacementParams::default();
    let on_wall = view_on_wall(&view, &map.walls, &p).map_err(drop)?;
    placement(&[on_wall], &map.walls, &p).map(|made| Some(made.place)).map_err(drop)
}

/// Within reach of each other on the walls.
fn overlap(a: &LandmarkPlace, b: &LandmarkPlace) -> bool {
    let reach = |p: &LandmarkPlace| 0.5 * p.size.width_m.max(p.size.height_m);
    (a.x_m - b.x_m).hypot(a.y_m - b.y_m).hypot(a.z_m - b.z_m) < reach(a).max(reach(b))
}

fn identity(
    facts: &QuadAnalysis,
    recognised: Option<LandmarkId>,
    place: Option<&LandmarkPlace>,
    map: &MapSnapshot,
) -> Identity {
    let place_of = |id: &LandmarkId| map.landmarks.get(id).and_then(|l| l.place.as_ref());
    let there = |id: &LandmarkId| place.zip(place_of(id)).map(|(seen, known)| overlap(seen, known));
    if let Some(id) = recognised {
        let trusted =
            map.landmarks.get(&id).is_some_and(|l| l.standing == map::landmark_health::LandmarkHealth::Sound);
        // Elsewhere than it hangs: moved, or not it.
        return if trusted && there(&id) != Some(false) {
            Identity::Landmark(id)
        } else {
            Identity::Doubtful
        };
    }
    let Some(verdict) = &facts.recognition else { return Identity::Doubtful };
    if let Verdict::Ambiguous(id) = verdict.verdict {
        // What its icon alone speaks for is the landmark where that hangs.
        let is_plain =
            verdict.candidates.iter().any(|c| c.landmark == id && c.refusal == Some(MatchRefusal::Plain));
        let is_it = is_plain && there(&id) == Some(true);
        return if is_it { Identity::Landmark(id) } else { Identity::Doubtful };
    }
    let near = verdict.candidates.iter().any(|c| c.ratio < NEARLY && there(&c.landmark) != Some(false));
    let on_one = map.landmarks.keys().any(|id| there(id) == Some(true));
    if near || on_one { Identity::Doubtful } else { Identity::Stranger }
}
