//! The quads of a frame as observations for the tracker. In: an offered frame. Out: for each whole
//! quad its icon, its place on the walls and its identity. A doubtful identity gives no view.

use super::OfferedFrame;
use crate::store::landmark_placement::StoredCapture;
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

/// A pose with a larger standard deviation on the floor places no quads, nor one...
pub(crate) const POSE_SIGMA_M: f64 = 0.15;
/// ...with a larger standard deviation of the heading.
pub(crate) const POSE_SIGMA_RAD: f64 = 0.035;
/// Least confidence of a recognised landmark to learn from.
pub(crate) const MIN_CONFIDENCE: f64 = 0.9;
/// A quad may show a landmark whose match candidate has a ratio below this.
const POSSIBLE_RATIO: f64 = 1.5;

/// The observations of a frame.
pub(super) struct FrameObservations {
    pub(super) quads: Vec<QuadObservation>,
    /// For each quad, the covariances of its corners, px^2.
    pub(super) corners_px2: Vec<[Matrix2<f64>; 4]>,
    /// How the picture was taken, if the pose is known well enough.
    pub(super) capture: Option<StoredCapture>,
    pub(super) unusable: u64,
    pub(super) not_on_wall: u64,
}

/// Camera and pose of a frame.
struct PosedCamera<'a> {
    camera: &'a Intrinsics,
    extrinsics: &'a CameraExtrinsics,
    map_from_robot: &'a Pose2Covariance,
}

fn posed_camera(offered: &OfferedFrame) -> Option<PosedCamera<'_>> {
    let pose = offered.gathered.map_from_robot.as_ref()?;
    let c = &pose.covariance;
    let is_precise = (c[(0, 0)] + c[(1, 1)]).sqrt() <= POSE_SIGMA_M && c[(2, 2)].sqrt() <= POSE_SIGMA_RAD;
    Some(PosedCamera {
        camera: offered.frame.intrinsics.as_ref()?,
        extrinsics: offered.frame.mounting.as_ref()?,
        map_from_robot: is_precise.then_some(pose)?,
    })
}

/// Observes the quads of a frame.
pub(super) fn frame_observations(offered: &OfferedFrame, params: &Params) -> FrameObservations {
    let posed = posed_camera(offered);
    let capture = posed
        .as_ref()
        .map(|s| StoredCapture::of_robot(s.camera, s.map_from_robot, &s.extrinsics.robot_from_camera));
    let mut observed =
        FrameObservations { quads: vec![], corners_px2: vec![], capture, unusable: 0, not_on_wall: 0 };
    for analysis in &offered.gathered.quads {
        if analysis.quad.kind != QuadKind::Full || analysis.quad.side_clipped.contains(&true) {
            observed.unusable += 1;
            continue;
        }
        let recognised = recognised(analysis, params);
        let (corners_px, covariance_px2) = recognised
            .map_or((analysis.quad.corners_px, analysis.quad.believed_covariance_px2()), |(_, s)| {
                (s.corners_px, s.covariance_px2)
            });
        let Ok(place) = place(&corners_px, &covariance_px2, posed.as_ref(), &offered.gathered.map) else {
            observed.not_on_wall += 1;
            continue;
        };
        let Ok(icon) = icon(&offered.gathered.image, &corners_px, &params.icon) else {
            observed.unusable += 1;
            continue;
        };
        let identity =
            identity(analysis, recognised.map(|(id, _)| id), place.as_ref(), &offered.gathered.map);
        let icon = features(icon, &params.recognise);
        observed.corners_px2.push(stated_covariance_px2(analysis, recognised.map(|(_, border)| border)));
        observed.quads.push(QuadObservation { corners_px, icon, place, identity });
    }
    observed
}

/// The landmark with verdict unique and enough confidence, with its corners. Those by points alone
/// are not good enough to learn from.
fn recognised(analysis: &QuadAnalysis, params: &Params) -> Option<(LandmarkId, SeenBorder)> {
    let result = analysis.recognition.as_ref()?;
    let Verdict::Unique(id) = result.verdict else { return None };
    if result.confidence < MIN_CONFIDENCE {
        return None;
    }
    matched_border(&analysis.quad, result, params)
        .filter(|border| border.found_by != FoundBy::Points)
        .map(|border| (id, border))
}

/// The covariances of corners, px^2: by the detector, in the order of a recognised landmark's
/// corners; by alignment where the landmark was taught by another border than the detected one.
fn stated_covariance_px2(analysis: &QuadAnalysis, recognised: Option<SeenBorder>) -> [Matrix2<f64>; 4] {
    if let Some(aligned) = recognised.filter(|border| border.found_by == FoundBy::Alignment) {
        return aligned.covariance_px2;
    }
    let turn = analysis.recognition.as_ref().filter(|_| recognised.is_some()).map_or(0, |v| v.rotation);
    let mut covariance_px2 = analysis.quad.corner_covariance_px2;
    covariance_px2.rotate_left(turn % 4);
    covariance_px2
}

/// The place of a quad; `None` where the pose or the walls are not known. Errors: it is not flat on
/// a wall.
fn place(
    corners: &Corners,
    covariance_px2: &[Matrix2<f64>; 4],
    posed: Option<&PosedCamera<'_>>,
    map: &MapSnapshot,
) -> Result<Option<LandmarkPlace>, ()> {
    let Some(PosedCamera { camera, extrinsics, map_from_robot }) = posed.filter(|_| !map.walls.is_empty())
    else {
        return Ok(None);
    };
    let view = PosedView { corners, covariance_px2, camera, map_from_robot, mounting: extrinsics };
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
    analysis: &QuadAnalysis,
    recognised: Option<LandmarkId>,
    place: Option<&LandmarkPlace>,
    map: &MapSnapshot,
) -> Identity {
    let place_of = |id: &LandmarkId| map.landmarks.get(id).and_then(|l| l.place.as_ref());
    let is_there = |id: &LandmarkId| place.zip(place_of(id)).map(|(seen, known)| overlap(seen, known));
    if let Some(id) = recognised {
        let is_sound =
            map.landmarks.get(&id).is_some_and(|l| l.health == map::landmark_health::LandmarkHealth::Sound);
        // A quad at another place than the landmark's is a moved landmark, or another object.
        return if is_sound && is_there(&id) != Some(false) {
            Identity::Landmark(id)
        } else {
            Identity::Doubtful
        };
    }
    let Some(result) = &analysis.recognition else { return Identity::Doubtful };
    if let Verdict::Ambiguous(id) = result.verdict {
        // A match by the icon alone counts at the landmark's place.
        let is_plain =
            result.candidates.iter().any(|c| c.landmark == id && c.refusal == Some(MatchRefusal::Plain));
        let is_it = is_plain && is_there(&id) == Some(true);
        return if is_it { Identity::Landmark(id) } else { Identity::Doubtful };
    }
    let near =
        result.candidates.iter().any(|c| c.ratio < POSSIBLE_RATIO && is_there(&c.landmark) != Some(false));
    let on_one = map.landmarks.keys().any(|id| is_there(id) == Some(true));
    if near || on_one { Identity::Doubtful } else { Identity::Stranger }
}
