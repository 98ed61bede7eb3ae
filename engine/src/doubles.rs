//! Landmarks that look alike: for a robot that does not know where it is, and for naming them by a pose that is known
//! (`guided.rs`). Thresholds that tell landmarks from one another
//! refuse what fits several; here they are lifted to what they would be if nothing looked like them, so that a sighting may
//! be of any of those that look the same: which these are is known before anything is seen. Out: where the robot would
//! stand for each of them. Never a recognition. Points have no thresholds to lift; where they say nothing, icons are asked
//! of all, also of those that are named by their points only.

use super::snapshot::map_snapshot::MapSnapshot;
use map::{
    extrinsics::CameraExtrinsics,
    localise::{FixResult, LandmarkObservation, LocaliseParams, robot_pose},
    place::LandmarkPlace,
    pose2::Pose2,
    relocalise::{AssociationHypothesis, PossibleLandmark, RelativeObservation},
};
use nalgebra::{Matrix2, Matrix6};
use std::{
    collections::{BTreeMap, BTreeSet},
    sync::Arc,
};
use vision::{
    detect::Quad,
    frame::{GrayImage, Intrinsics},
    geometry::Corners,
    model::LandmarkId,
    params::Params,
    pipeline::{FrameAnalysis, QuadAnalysis, recognise_quad},
    pose::{LandmarkPose, landmark_pose},
    recognise::{MatchRefusal, Verdict},
    seen_border::SeenBorder,
};

/// Most landmarks that look the same: a sighting of more says too little for what it costs.
pub const MAX_ALIKE: usize = map::relocalise::MAX_MEMBERS / 2;

/// One thing that was seen: each landmark it may be, and how it was seen if it is that one.
pub type AmbiguousObservation = Vec<(LandmarkId, RelativeObservation)>;

/// What a frame shows of landmarks that have doubles. Only what may be several, all of known and trusted place: one that
/// hangs nobody knows where would be taken for the others again and again.
pub fn sighted(
    image: &GrayImage,
    facts: &FrameAnalysis,
    map: &MapSnapshot,
    mounting: &CameraExtrinsics,
    camera: &Intrinsics,
) -> Vec<AmbiguousObservation> {
    if map.look_alikes.models.is_empty() {
        return Vec::new();
    }
    let unsure =
        |q: &&QuadAnalysis| q.recognition.as_ref().is_some_and(|v| !matches!(v.verdict, Verdict::Unique(_)));
    facts.quads.iter().filter(unsure).filter_map(|q| one(image, q, map, mounting, camera)).collect()
}

fn one(
    image: &GrayImage,
    facts: &QuadAnalysis,
    map: &MapSnapshot,
    mounting: &CameraExtrinsics,
    camera: &Intrinsics,
) -> Option<AmbiguousObservation> {
    let alike = resembling(image, &facts.quad, map).filter(|alike| alike.fitting >= 2)?;
    let mut sighted = Vec::new();
    for id in alike.members {
        let place = map.landmarks.get(&id)?.place.as_ref()?;
        let seen = landmark_pose(&alike.corners_px, &alike.covariance_px2, place.size, camera).ok()?;
        sighted.extend(glimpses(id, place, &seen, mounting).into_iter().map(|glimpse| (id, glimpse)));
    }
    (!sighted.is_empty()).then_some(sighted)
}

/// A quad that looks like landmarks which look like one another.
#[derive(Debug, Clone, PartialEq)]
pub struct Resembling {
    /// All that it may be: all of known and trusted place.
    pub members: BTreeSet<LandmarkId>,
    /// How many of them it was compared with and fits.
    pub fitting: usize,
    /// How well it fits the best: its distance over the threshold, below 1.
    pub ratio: f64,
    /// Its corners in the landmark's order.
    pub corners_px: Corners,
    /// Their covariances.
    pub covariance_px2: [Matrix2<f64>; 4],
}

/// Whether all of these have a place that is trusted.
pub fn hang_where_known(landmarks: &BTreeSet<LandmarkId>, map: &MapSnapshot) -> bool {
    let is_known = |id| map.landmarks.get(id).is_some_and(|info| info.is_trusted() && info.place.is_some());
    landmarks.iter().all(is_known)
}

/// Which landmarks with doubles a quad may be; `None` where it is none of them, or may be one that hangs nobody knows where.
pub fn resembling(image: &GrayImage, quad: &Quad, map: &MapSnapshot) -> Option<Resembling> {
    let asked = |p: &Params| recognise_quad(image, quad, &map.look_alikes.models, p);
    let (mut verdict, mut border) = asked(&map.params);
    if map.params.recognise.verdict.points && verdict.verdict == Verdict::Unknown {
        (verdict, border) = asked(&map.look_alikes.by_icons);
    }
    let (Verdict::Ambiguous(_) | Verdict::Unique(_)) = verdict.verdict else { return None };
    let fits = |refusal: Option<MatchRefusal>| matches!(refusal, None | Some(MatchRefusal::Margin));
    let fitting: BTreeSet<LandmarkId> =
        verdict.candidates.iter().filter(|c| fits(c.refusal)).map(|c| c.landmark).collect();
    let members = members(&fitting, &map.look_alikes.alike)?;
    if !hang_where_known(&members, map) {
        return None;
    }
    let SeenBorder { corners_px, covariance_px2, .. } = border?;
    let ratio = verdict.candidates.first()?.ratio;
    Some(Resembling { members, fitting: fitting.len(), ratio, corners_px, covariance_px2 })
}

/// All that a thing may be which these fit: those, and whatever looks like one of them; `None` if that is nothing, or too
/// many to say anything.
fn members(
    fitting: &BTreeSet<LandmarkId>,
    alike: &BTreeMap<LandmarkId, Arc<Vec<LandmarkId>>>,
) -> Option<BTreeSet<LandmarkId>> {
    let like = fitting.iter().filter_map(|id| alike.get(id)).flat_map(|all| all.iter().copied());
    let all: BTreeSet<LandmarkId> = fitting.iter().copied().chain(like).collect();
    (!all.is_empty() && all.len() <= MAX_ALIKE).then_some(all)
}

/// Where the landmark is from the robot: one, or two where its picture allows both.
fn glimpses(
    id: LandmarkId,
    place: &LandmarkPlace,
    seen: &LandmarkPose,
    mounting: &CameraExtrinsics,
) -> Vec<RelativeObservation> {
    // As if it hung at the origin: what robot_pose gives then is the robot in the landmark's own frame.
    let at_origin =
        LandmarkPlace { x_m: 0.0, y_m: 0.0, theta_rad: 0.0, covariance: Matrix6::zeros(), ..*place };
    let sighting = LandmarkObservation { landmark: id, seen, place: &at_origin };
    let fixes = match robot_pose(&[sighting], mounting, None, &LocaliseParams::default()) {
        Ok(FixResult::Fixed(fix)) => vec![*fix],
        Ok(FixResult::Ambiguous(fixes)) => fixes,
        Ok(FixResult::Refused(_)) | Err(_) => Vec::new(),
    };
    let turned = |fix: map::localise::Fix| {
        let robot_from_landmark = fix.pose.inverse();
        RelativeObservation {
            robot_from_landmark: robot_from_landmark.pose,
            covariance: robot_from_landmark.covariance,
        }
    };
    fixes.into_iter().map(turned).collect()
}

/// The readings of a sighting, all as probable; `clutter` is left for what is on no map.
pub fn readings<'a>(
    sighted: &[(LandmarkId, RelativeObservation)],
    map: &'a MapSnapshot,
    clutter: f64,
) -> Vec<AssociationHypothesis<'a>> {
    let probability = (1.0 - clutter) / sighted.len().max(1) as f64;
    let reading = |(id, glimpse): &(LandmarkId, RelativeObservation)| {
        let place = map.landmarks.get(id)?.place.as_ref()?;
        let visible = map.visibility.get(id).map(Arc::as_ref);
        Some(AssociationHypothesis {
            glimpse: *glimpse,
            member: PossibleLandmark { place, visible, probability },
        })
    };
    sighted.iter().filter_map(reading).collect()
}

/// A landmark's place as a pose on the floor.
pub fn on_floor(place: &LandmarkPlace) -> Pose2 {
    Pose2::new(place.x_m, place.y_m, place.theta_rad)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ids(ids: &[u64]) -> BTreeSet<LandmarkId> {
        ids.iter().map(|id| LandmarkId(*id)).collect()
    }

    #[test]
    fn what_fits_some_of_a_class_may_be_any_of_it() {
        let class = |ids: std::ops::Range<u64>| Arc::new(ids.map(LandmarkId).collect::<Vec<_>>());
        let classes = [class(0..12), class(20..22)];
        let alike = classes.iter().flat_map(|c| c.iter().map(|id| (*id, c.clone()))).collect();
        assert_eq!(members(&ids(&[0, 2, 4, 6, 8]), &alike).unwrap().len(), 12);
        assert_eq!(members(&ids(&[0, 20]), &alike).unwrap().len(), 14);
        assert_eq!(members(&ids(&[3]), &alike).unwrap().len(), 12);
        assert_eq!(members(&ids(&[]), &alike), None);
    }

    #[test]
    fn too_many_that_look_the_same_say_nothing() {
        let all = |count: u64| {
            let ids: Arc<Vec<LandmarkId>> = Arc::new((0..count).map(LandmarkId).collect());
            ids.iter().map(|id| (*id, ids.clone())).collect::<BTreeMap<_, _>>()
        };
        let some = BTreeSet::from([LandmarkId(0), LandmarkId(1)]);
        assert_eq!(members(&some, &all(MAX_ALIKE as u64)).unwrap().len(), MAX_ALIKE);
        assert_eq!(members(&some, &all(MAX_ALIKE as u64 + 1)), None);
    }
}
