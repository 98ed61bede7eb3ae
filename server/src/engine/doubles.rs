//! Landmarks that look alike, for a robot that does not know where it is. Thresholds that tell landmarks from one another
//! refuse what fits several; here they are lifted to what they would be if nothing looked like them, so that a sighting may
//! be of any of a few. Out: where the robot would stand for each of them. Never a recognition.

use super::snapshot::{Learnt, MapSnapshot};
use map::{
    hypotheses::{Glimpse, Member, Reading},
    localise::{LocaliseParams, RobotFix, Sighting, robot_pose},
    mounting::Mounting,
    place::LandmarkPlace,
    pose2::Pose2,
};
use nalgebra::Matrix6;
use std::{collections::BTreeMap, sync::Arc};
use vision::{
    frame::{GrayImage, Intrinsics},
    learn::{
        model::{Gate, LandmarkModel, ModelStatus, refit_thresholds},
        threshold::LimitedBy,
    },
    localise::pose::{LandmarkPose, landmark_pose},
    params::Params,
    pipeline::{FrameFacts, QuadFacts, matched},
    recognise::{
        DistanceKind, LandmarkId, MAX_CANDIDATES, Recognition, Refusal, models::ModelSet, verdict::recognise,
    },
};

/// Most landmarks with look-alikes that are kept for this.
pub const MAX_DOUBLES: usize = 512;

/// Whether something looks like it: its threshold was held down by others, or none could be found for that.
fn has_doubles(model: &LandmarkModel) -> bool {
    let overlaps = |failures: &[vision::learn::model::GateFailure]| {
        let threshold = |gate: &Gate| {
            matches!(
                gate,
                Gate::LikenessThreshold(_) | Gate::CorrelationThreshold(_) | Gate::HausdorffThreshold(_)
            )
        };
        !failures.is_empty() && failures.iter().all(|f| threshold(&f.gate))
    };
    match &model.status {
        ModelStatus::Active => model.likeness.limited_by == LimitedBy::NearestNegative,
        ModelStatus::Candidate(failures) => overlaps(failures),
    }
}

/// The landmarks that have look-alikes, with lifted thresholds; none where a map's distances decide alone.
pub fn doubles(learnt: &BTreeMap<LandmarkId, Learnt>, kind: DistanceKind, p: &Params) -> ModelSet {
    if kind != DistanceKind::Both {
        return ModelSet::default();
    }
    let held = learnt.values().map(|l| &l.model).filter(|m| has_doubles(m)).take(MAX_DOUBLES);
    let lifted = held.map(|model| Arc::new(refit_thresholds(model, &[], p))).filter(|m| m.is_active());
    ModelSet::new(lifted.collect(), p).unwrap_or_default()
}

/// One thing that was seen: each landmark it may be, and how it was seen if it is that one.
pub type Sighted = Vec<(LandmarkId, Glimpse)>;

/// What a frame shows of landmarks that have doubles. Only what may be several, all of known and trusted place: one that
/// hangs nobody knows where would be taken for the others again and again.
pub fn sighted(
    image: &GrayImage,
    facts: &FrameFacts,
    map: &MapSnapshot,
    mounting: &Mounting,
    camera: &Intrinsics,
) -> Vec<Sighted> {
    if map.doubles.is_empty() {
        return Vec::new();
    }
    let unsure =
        |q: &&QuadFacts| q.verdict.as_ref().is_some_and(|v| !matches!(v.recognition, Recognition::Unique(_)));
    facts.quads.iter().filter(unsure).filter_map(|q| one(image, q, map, mounting, camera)).collect()
}

fn one(
    image: &GrayImage,
    facts: &QuadFacts,
    map: &MapSnapshot,
    mounting: &Mounting,
    camera: &Intrinsics,
) -> Option<Sighted> {
    let verdict = recognise(image, &facts.quad, &map.doubles, DistanceKind::Both, &map.params);
    let Recognition::Ambiguous(_) = verdict.recognition else { return None };
    let fits = |refusal: Option<Refusal>| matches!(refusal, None | Some(Refusal::Margin));
    let members: Vec<LandmarkId> =
        verdict.candidates.iter().filter(|c| fits(c.refusal)).map(|c| c.landmark).collect();
    // As many as are told: there may be more of them.
    if members.len() < 2 || members.len() >= MAX_CANDIDATES {
        return None;
    }
    let (corners_px, covariance_px2) = matched(&facts.quad, &verdict, &map.params)?;
    let mut sighted = Vec::new();
    for id in members {
        let info = map.landmarks.get(&id).filter(|info| info.is_trusted())?;
        let place = info.place.as_ref()?;
        let seen = landmark_pose(&corners_px, &covariance_px2, place.size, camera).ok()?;
        sighted.extend(glimpses(id, place, &seen, mounting).into_iter().map(|glimpse| (id, glimpse)));
    }
    (!sighted.is_empty()).then_some(sighted)
}

/// Where the landmark is from the robot: one, or two where its picture allows both.
fn glimpses(id: LandmarkId, place: &LandmarkPlace, seen: &LandmarkPose, mounting: &Mounting) -> Vec<Glimpse> {
    // As if it hung at the origin: what robot_pose gives then is the robot in the landmark's own frame.
    let at_origin =
        LandmarkPlace { x_m: 0.0, y_m: 0.0, theta_rad: 0.0, covariance: Matrix6::zeros(), ..*place };
    let sighting = Sighting { landmark: id, seen, place: &at_origin };
    let fixes = match robot_pose(&[sighting], mounting, None, &LocaliseParams::default()) {
        Ok(RobotFix::Fixed(fix)) => vec![*fix],
        Ok(RobotFix::Ambiguous(fixes)) => fixes,
        Ok(RobotFix::Refused(_)) | Err(_) => Vec::new(),
    };
    let turned = |fix: map::localise::Fix| {
        let robot_from_landmark = fix.pose.inverse();
        Glimpse { robot_from_landmark: robot_from_landmark.pose, covariance: robot_from_landmark.covariance }
    };
    fixes.into_iter().map(turned).collect()
}

/// The readings of a sighting, all as probable; `clutter` is left for what is on no map.
pub fn readings<'a>(
    sighted: &[(LandmarkId, Glimpse)],
    map: &'a MapSnapshot,
    clutter: f64,
) -> Vec<Reading<'a>> {
    let probability = (1.0 - clutter) / sighted.len().max(1) as f64;
    let reading = |(id, glimpse): &(LandmarkId, Glimpse)| {
        let place = map.landmarks.get(id)?.place.as_ref()?;
        let visible = map.visibility.get(id).map(Arc::as_ref);
        Some(Reading { glimpse: *glimpse, member: Member { place, visible, probability } })
    };
    sighted.iter().filter_map(reading).collect()
}

/// A landmark's place as a pose on the floor.
pub fn on_floor(place: &LandmarkPlace) -> Pose2 {
    Pose2::new(place.x_m, place.y_m, place.theta_rad)
}
