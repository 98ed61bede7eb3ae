//! Observations of landmarks that look alike. In: a frame, its analysis, the map with its
//! look-alike classes. Out: for each quad that several placed landmarks fit, each landmark that it
//! may be, with its pose relative to the robot.
//!
//! The thresholds of the classes are fitted without negatives (`snapshot/look_alike_classes.rs`),
//! so that a quad may match every landmark of its class. Such a match is never a recognition. It
//! serves relocalisation (`relocalise.rs`) and guided recognition (`guided.rs`). Where points say
//! nothing, icons are compared with all landmarks, those included that only their points name.

use crate::snapshot::map_snapshot::MapSnapshot;
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

/// Most members of a look-alike class: an observation that may be of more says too little for what
/// it costs.
pub const MAX_CLASS_MEMBERS: usize = map::relocalise::MAX_MEMBERS / 2;

/// One object: each landmark it may be, and where that landmark is from the robot if it is that
/// one.
pub type AmbiguousObservation = Vec<(LandmarkId, RelativeObservation)>;

/// The ambiguous observations of a frame: quads that may be several landmarks, all of known and
/// trusted place. Where the place of one member is not known, that member would be taken for the
/// others again and again.
pub fn ambiguous_observations(
    image: &GrayImage,
    analysis: &FrameAnalysis,
    map: &MapSnapshot,
    extrinsics: &CameraExtrinsics,
    camera: &Intrinsics,
) -> Vec<AmbiguousObservation> {
    if map.look_alikes.models.is_empty() {
        return Vec::new();
    }
    let is_open =
        |q: &&QuadAnalysis| q.recognition.as_ref().is_some_and(|v| !matches!(v.verdict, Verdict::Unique(_)));
    let open = analysis.quads.iter().filter(is_open);
    open.filter_map(|q| ambiguous_observation(image, q, map, extrinsics, camera)).collect()
}

fn ambiguous_observation(
    image: &GrayImage,
    analysis: &QuadAnalysis,
    map: &MapSnapshot,
    extrinsics: &CameraExtrinsics,
    camera: &Intrinsics,
) -> Option<AmbiguousObservation> {
    let matched = match_look_alikes(image, &analysis.quad, map).filter(|matched| matched.fitting >= 2)?;
    let mut observation = Vec::new();
    for id in matched.members {
        let place = map.landmarks.get(&id)?.place.as_ref()?;
        let pose = landmark_pose(&matched.corners_px, &matched.covariance_px2, place.size, camera).ok()?;
        let relative = relative_observations(id, place, (&pose, extrinsics), &map.poses.localise);
        observation.extend(relative.into_iter().map(|relative| (id, relative)));
    }
    (!observation.is_empty()).then_some(observation)
}

/// A quad that matches landmarks which match one another.
#[derive(Debug, Clone, PartialEq)]
pub struct LookAlikeMatch {
    /// Every landmark that it may be, each with a known and trusted place.
    pub members: BTreeSet<LandmarkId>,
    /// How many of them accept it.
    pub fitting: usize,
    /// Distance of the best of them over its threshold, below 1.
    pub ratio: f64,
    /// Corners in the landmark's order, px.
    pub corners_px: Corners,
    /// Covariances of the corners, px^2.
    pub covariance_px2: [Matrix2<f64>; 4],
}

/// Whether each of these landmarks has a place, and none is quarantined.
pub fn are_placed_and_trusted(landmarks: &BTreeSet<LandmarkId>, map: &MapSnapshot) -> bool {
    let is_placed = |id| map.landmarks.get(id).is_some_and(|info| info.is_trusted() && info.place.is_some());
    landmarks.iter().all(is_placed)
}

/// The look-alike class that a quad matches. `None` where it matches no member, or where a member
/// has no trusted place.
pub fn match_look_alikes(image: &GrayImage, quad: &Quad, map: &MapSnapshot) -> Option<LookAlikeMatch> {
    let compare = |p: &Params| recognise_quad(image, quad, &map.look_alikes.models, p);
    let (mut result, mut border) = compare(&map.params);
    if map.params.recognise.verdict.points && result.verdict == Verdict::Unknown {
        (result, border) = compare(&map.look_alikes.by_icons);
    }
    let (Verdict::Ambiguous(_) | Verdict::Unique(_)) = result.verdict else { return None };
    let fits = |refusal: Option<MatchRefusal>| matches!(refusal, None | Some(MatchRefusal::Margin));
    let fitting: BTreeSet<LandmarkId> =
        result.candidates.iter().filter(|c| fits(c.refusal)).map(|c| c.landmark).collect();
    let members = class_members(&fitting, &map.look_alikes.classes)?;
    if !are_placed_and_trusted(&members, map) {
        return None;
    }
    let SeenBorder { corners_px, covariance_px2, .. } = border?;
    let ratio = result.candidates.first()?.ratio;
    Some(LookAlikeMatch { members, fitting: fitting.len(), ratio, corners_px, covariance_px2 })
}

/// The landmarks that fit, and the members of their classes. `None` if that is none, or more than
/// [`MAX_CLASS_MEMBERS`].
fn class_members(
    fitting: &BTreeSet<LandmarkId>,
    classes: &BTreeMap<LandmarkId, Arc<Vec<LandmarkId>>>,
) -> Option<BTreeSet<LandmarkId>> {
    let others = fitting.iter().filter_map(|id| classes.get(id)).flat_map(|class| class.iter().copied());
    let all: BTreeSet<LandmarkId> = fitting.iter().copied().chain(others).collect();
    (!all.is_empty() && all.len() <= MAX_CLASS_MEMBERS).then_some(all)
}

/// `robot_from_landmark`: one pose, or two where the corners allow both.
fn relative_observations(
    id: LandmarkId,
    place: &LandmarkPlace,
    (seen, extrinsics): (&LandmarkPose, &CameraExtrinsics),
    p: &LocaliseParams,
) -> Vec<RelativeObservation> {
    // With the landmark at the origin, robot_pose gives the robot in the landmark's own frame.
    let at_origin =
        LandmarkPlace { x_m: 0.0, y_m: 0.0, theta_rad: 0.0, covariance: Matrix6::zeros(), ..*place };
    let observation = LandmarkObservation { landmark: id, seen, place: &at_origin };
    let fixes = match robot_pose(&[observation], extrinsics, None, p) {
        Ok(FixResult::Fixed(fix)) => vec![*fix],
        Ok(FixResult::Ambiguous(fixes)) => fixes,
        Ok(FixResult::Refused(_)) | Err(_) => Vec::new(),
    };
    let relative = |fix: map::localise::Fix| {
        let robot_from_landmark = fix.pose.inverse();
        RelativeObservation {
            robot_from_landmark: robot_from_landmark.pose,
            covariance: robot_from_landmark.covariance,
        }
    };
    fixes.into_iter().map(relative).collect()
}

/// The association hypotheses of an observation, equally probable; `clutter` is the probability of
/// an object that is on no map, 0 to 1.
pub fn association_hypotheses<'a>(
    observation: &[(LandmarkId, RelativeObservation)],
    map: &'a MapSnapshot,
    clutter: f64,
) -> Vec<AssociationHypothesis<'a>> {
    let probability = (1.0 - clutter) / observation.len().max(1) as f64;
    let hypothesis = |(id, relative): &(LandmarkId, RelativeObservation)| {
        let place = map.landmarks.get(id)?.place.as_ref()?;
        let visible = map.visibility.get(id).map(Arc::as_ref);
        Some(AssociationHypothesis {
            glimpse: *relative,
            member: PossibleLandmark { place, visible, probability },
        })
    };
    observation.iter().filter_map(hypothesis).collect()
}

/// A landmark's place as a pose on the floor (map frame, m and rad).
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
        let by_landmark = classes.iter().flat_map(|c| c.iter().map(|id| (*id, c.clone()))).collect();
        assert_eq!(class_members(&ids(&[0, 2, 4, 6, 8]), &by_landmark).unwrap().len(), 12);
        assert_eq!(class_members(&ids(&[0, 20]), &by_landmark).unwrap().len(), 14);
        assert_eq!(class_members(&ids(&[3]), &by_landmark).unwrap().len(), 12);
        assert_eq!(class_members(&ids(&[]), &by_landmark), None);
    }

    #[test]
    fn too_many_that_look_the_same_say_nothing() {
        let all = |count: u64| {
            let ids: Arc<Vec<LandmarkId>> = Arc::new((0..count).map(LandmarkId).collect());
            ids.iter().map(|id| (*id, ids.clone())).collect::<BTreeMap<_, _>>()
        };
        let some = BTreeSet::from([LandmarkId(0), LandmarkId(1)]);
        assert_eq!(class_members(&some, &all(MAX_CLASS_MEMBERS as u64)).unwrap().len(), MAX_CLASS_MEMBERS);
        assert_eq!(class_members(&some, &all(MAX_CLASS_MEMBERS as u64 + 1)), None);
    }
}
