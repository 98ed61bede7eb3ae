//! Global localisation without a history: one frame, one scan or both, and the map. In: what a
//! robot senses at one place. Out: its pose with covariance, the poses that it may be at, or none.
//! Nothing of it changes a robot's fused pose.

use crate::{
    frame::{
        ambiguous_observations::ambiguous_observations,
        analysis::{StageTimes, analyse_frame, frame_camera},
        answer::{cautions, quads_answer},
        fixes::{NoFix, landmark_observations, robot_fixes},
        relocalise::{RelocalisationInput, Relocalisers},
    },
    snapshot::MapSnapshot,
};
use map::{
    extrinsics::CameraExtrinsics,
    laser::Scan,
    laser_fix::{
        GlobalRefusal, LaserFix, LaserFixParams, LaserRefusal, MAX_POSES, global_laser_fixes, laser_fix,
    },
    localise::FixResult,
    pose2::{Pose2, Pose2Covariance},
};
use nalgebra::Point2;
use protos::{Name, v1};
use vision::{
    frame::{Intrinsics, PictureRef},
    model::LandmarkId,
};

/// Most poses of a result.
pub const MAX_HYPOTHESES: usize = MAX_POSES;
/// A pose with a larger standard deviation of its position is no pose: along a bare corridor the
/// walls tell nothing.
const MAX_SIGMA_M: f64 = 1.0;
/// Least worth of a point without a wall, as squared standard deviations of one with a wall.
const MISSED2: f64 = 9.0;
/// Most points of a scan that count as independent: errors of a map's walls are common to many.
const INDEPENDENT: f64 = 30.0;

/// A frame with what its camera is and where it sits.
#[derive(Debug, Clone, Copy)]
pub struct LocaliseFrame<'a> {
    /// The picture.
    pub picture: PictureRef<'a>,
    /// Its camera.
    pub camera: &'a Intrinsics,
    /// `robot_from_camera`.
    pub extrinsics: &'a CameraExtrinsics,
}

/// What a robot senses at one place: at least one of the two.
#[derive(Debug, Clone, Copy)]
pub struct LocaliseInput<'a> {
    /// The map.
    pub map: &'a MapSnapshot,
    /// A frame.
    pub frame: Option<LocaliseFrame<'a>>,
    /// A scan from the same place.
    pub scan: Option<&'a Scan>,
}

/// A pose that the robot may be at.
#[derive(Debug, Clone, PartialEq)]
pub struct LocaliseHypothesis {
    /// `map_from_robot`.
    pub pose: Pose2Covariance,
    /// All hypotheses sum to 1.
    pub probability: f64,
    /// The landmarks that it rests on.
    pub landmarks: Vec<LandmarkId>,
    /// Share of the scan's points with a wall, 0 to 1; absent where the scan was not used.
    pub matched: Option<f64>,
    /// Quads that may be several landmarks give it: in one frame alone, that is never enough for a
    /// pose.
    by_look_alikes: bool,
}

/// Why there is not exactly one pose.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LocaliseReason {
    /// The frame gives no pose.
    Frame(NoFix),
    /// Several poses are left.
    Ambiguous,
    /// The walls leave the pose undetermined in a direction.
    Undetermined,
    /// Too few returns from flat surfaces, or no walls.
    FewPoints,
    /// The scan matches nowhere, or not where the landmarks are.
    PoorMatch,
    /// The map is too large to be searched by a scan.
    MapTooLarge,
    /// The time was over, or the request was given up.
    Stopped,
}

impl LocaliseReason {
    /// The word in the API.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Frame(NoFix::NothingRecognised) => "nothing_recognised",
            Self::Frame(reason) => reason.as_str(),
            Self::Ambiguous => "ambiguous",
            Self::Undetermined => "undetermined",
            Self::FewPoints => "few_points",
            Self::PoorMatch => "poor_match",
            Self::MapTooLarge => "map_too_large",
            Self::Stopped => "stopped",
        }
    }
}

/// What came of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Localisation {
    /// Where the robot may be, most probable first; exactly one if there is no `reason`.
    pub hypotheses: Vec<LocaliseHypothesis>,
    /// Why it is not known.
    pub reason: Option<LocaliseReason>,
    /// The answer to the frame.
    pub answer: Option<v1::Answer>,
}

/// Localises. `stop` is asked now and then; a stopped search has the reason
/// [`LocaliseReason::Stopped`].
pub fn localise(input: &LocaliseInput<'_>, stop: &dyn Fn() -> bool) -> Localisation {
    let (found, mut answer) = match &input.frame {
        Some(frame) => {
            let (found, answer) = by_frame(input.map, frame);
            (found, Some(answer))
        }
        None => (Err(LocaliseReason::Frame(NoFix::NothingRecognised)), None),
    };
    let found = match (found, input.scan) {
        (found, None) => found,
        (Ok(found), Some(scan)) => with_scan(input.map, found, scan),
        (Err(reason), Some(scan)) => by_scan(input.map, scan, stop).map_err(|by_scan| match by_scan {
            // Without walls, the frame says more.
            LocaliseReason::FewPoints if input.frame.is_some() => reason,
            other => other,
        }),
    };
    let (mut hypotheses, mut reason) = match found {
        Ok(hypotheses) => (hypotheses, None),
        Err(reason) => (Vec::new(), Some(reason)),
    };
    hypotheses.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    hypotheses.truncate(MAX_HYPOTHESES);
    normalise(&mut hypotheses);
    if let [only] = hypotheses.as_slice() {
        let c = &only.pose.covariance;
        let is_known = c[(0, 0)].max(c[(1, 1)]).sqrt() <= MAX_SIGMA_M;
        reason = if only.by_look_alikes && only.matched.is_none() {
            Some(LocaliseReason::Ambiguous)
        } else {
            (!is_known).then_some(LocaliseReason::Undetermined)
        };
        if let Some(answer) = answer.as_mut().filter(|_| reason.is_none()) {
            let (pose, position_m2) = (&only.pose.pose, c[(0, 0)] + c[(1, 1)]);
            let at_m = Point2::new(pose.x_m, pose.y_m);
            answer.pose_cautions = cautions(&at_m, position_m2.sqrt(), &only.landmarks, input.map);
        }
    } else if !hypotheses.is_empty() {
        reason = Some(LocaliseReason::Ambiguous);
    }
    Localisation { hypotheses, reason, answer }
}

fn normalise(hypotheses: &mut [LocaliseHypothesis]) {
    let sum: f64 = hypotheses.iter().map(|h| h.probability).sum();
    for hypothesis in hypotheses {
        hypothesis.probability = if sum > 0.0 { hypothesis.probability / sum } else { 0.0 };
    }
}

type Found = Result<Vec<LocaliseHypothesis>, LocaliseReason>;

/// By landmarks: those that the picture names, else those that a quad may be.
fn by_frame(map: &MapSnapshot, frame: &LocaliseFrame<'_>) -> (Found, v1::Answer) {
    let mut times = StageTimes::start();
    let camera = frame_camera(Some(frame.camera), Some(frame.extrinsics), map);
    let analysis = analyse_frame(frame.picture, camera, map, &mut times);
    let mut answer = quads_answer(&analysis, map);
    let fixes = landmark_observations(&analysis, map).and_then(|observations| {
        robot_fixes(&observations, Some(frame.extrinsics), None, &map.poses.localise)
    });
    let one = |fix: &map::localise::Fix, probability| LocaliseHypothesis {
        pose: fix.pose,
        probability,
        landmarks: fix.landmarks.clone(),
        matched: None,
        by_look_alikes: false,
    };
    let found = match fixes {
        Ok(FixResult::Fixed(fix)) => Ok(vec![one(&fix, 1.0)]),
        Ok(FixResult::Ambiguous(fixes)) => Ok(fixes.iter().map(|fix| one(fix, 1.0)).collect()),
        Ok(FixResult::Refused(refusal)) => Err(NoFix::from(&refusal)),
        Err(reason) => Err(reason),
    };
    let found = found.or_else(|reason| {
        let by_look_alikes = look_alike_poses(map, frame, &analysis);
        if by_look_alikes.is_empty() { Err(LocaliseReason::Frame(reason)) } else { Ok(by_look_alikes) }
    });
    times.ended("localise");
    answer.timings = times.finish();
    (found, answer)
}

/// The poses that explain quads which may be several landmarks.
fn look_alike_poses(
    map: &MapSnapshot,
    frame: &LocaliseFrame<'_>,
    analysis: &vision::pipeline::FrameAnalysis,
) -> Vec<LocaliseHypothesis> {
    let observations =
        ambiguous_observations(frame.picture.grey(), analysis, map, frame.extrinsics, frame.camera);
    let Ok(nobody) = Name::new("localise") else { return Vec::new() };
    // Of this frame alone: it has no odometry.
    let input =
        RelocalisationInput { epoch: 0, map, odometry: Pose2::default(), observations: &observations };
    let update = Relocalisers::default().update(&nobody, &input).unwrap_or_default();
    let one = |h: &map::relocalise::PoseHypothesis| LocaliseHypothesis {
        pose: h.pose,
        probability: h.mass,
        landmarks: Vec::new(),
        matched: None,
        by_look_alikes: true,
    };
    update.hypotheses.iter().map(one).collect()
}

/// Poses by landmarks, each corrected by the scan; those that the scan contradicts go.
fn with_scan(map: &MapSnapshot, found: Vec<LocaliseHypothesis>, scan: &Scan) -> Found {
    let p = &map.poses.laser_fix;
    let mut kept = Vec::new();
    for hypothesis in found {
        match laser_fix(&map.wall_index, scan, &hypothesis.pose, p) {
            Ok(Ok(fix)) => {
                let weight = hypothesis.probability * likelihood(&fix, p);
                let pose = fused(&hypothesis.pose, &fix.pose).unwrap_or(hypothesis.pose);
                kept.push(LocaliseHypothesis {
                    pose,
                    probability: weight,
                    matched: Some(fix.matched),
                    ..hypothesis
                });
            }
            // The walls say nothing here.
            Ok(Err(LaserRefusal::FewPoints { .. } | LaserRefusal::Ambiguous)) => kept.push(hypothesis),
            Ok(Err(LaserRefusal::PoorMatch { .. } | LaserRefusal::GatePrior { .. })) | Err(_) => {}
        }
    }
    if kept.is_empty() { Err(LocaliseReason::PoorMatch) } else { Ok(kept) }
}

/// Poses by the scan alone.
fn by_scan(map: &MapSnapshot, scan: &Scan, stop: &dyn Fn() -> bool) -> Found {
    let p = &map.poses.laser_fix;
    let found = global_laser_fixes(&map.wall_index, scan, p, stop);
    let fixes = match found {
        Ok(Ok(fixes)) => fixes,
        Ok(Err(GlobalRefusal::TooLarge)) => return Err(LocaliseReason::MapTooLarge),
        Ok(Err(GlobalRefusal::Stopped)) => return Err(LocaliseReason::Stopped),
        Ok(Err(GlobalRefusal::PoorMatch { .. })) => return Err(LocaliseReason::PoorMatch),
        Ok(Err(GlobalRefusal::FewPoints { .. })) | Err(_) => return Err(LocaliseReason::FewPoints),
    };
    let one = |fix: &LaserFix| LocaliseHypothesis {
        pose: fix.pose,
        probability: likelihood(fix, p),
        landmarks: Vec::new(),
        matched: Some(fix.matched),
        by_look_alikes: false,
    };
    Ok(fixes.iter().map(one).collect())
}

/// Likelihood of a scan at a pose, up to a factor: points with a wall by their distances, each of
/// the others as one that is three standard deviations off.
fn likelihood(fix: &LaserFix, p: &LaserFixParams) -> f64 {
    let all = fix.points as f64 / fix.matched.max(1e-3);
    let of_one = (fix.rms_m / p.outlier_m).powi(2).min(MISSED2);
    let mean = fix.matched * of_one + (1.0 - fix.matched) * MISSED2;
    (-0.5 * mean * (all / p.correlated).min(INDEPENDENT)).exp()
}

/// Two independent estimates of one pose; `None` if a covariance is singular.
fn fused(a: &Pose2Covariance, b: &Pose2Covariance) -> Option<Pose2Covariance> {
    let gain = a.covariance * (a.covariance + b.covariance).cholesky()?.inverse();
    let pose = a.pose.plus(&(gain * b.pose.minus(&a.pose)));
    let covariance = a.covariance - gain * a.covariance;
    Pose2Covariance::new(pose, 0.5 * (covariance + covariance.transpose())).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Scene;
    use vision::frame::GrayImage;

    /// In front of a poster that was taught; without walls.
    #[test]
    fn a_frame_of_a_known_poster_tells_where_the_robot_is_and_one_of_nothing_does_not() {
        let mut scene = Scene::new();
        let map = scene.taught();
        let (_, readings) = scene.stops(2, 1).remove(0);
        let camera = scene.intrinsics();
        let extrinsics = CameraExtrinsics::new(readings.step.robot_from_camera).unwrap();
        let at = |image: &GrayImage| {
            let picture = image.into();
            let frame = LocaliseFrame { picture, camera: &camera, extrinsics: &extrinsics };
            localise(&LocaliseInput { map: &map, frame: Some(frame), scan: None }, &|| false)
        };
        let found = at(&readings.frame.image);
        assert_eq!(found.reason, None, "{:?}", found.hypotheses);
        let error = found.hypotheses[0].pose.pose.minus(&readings.step.map_from_robot);
        assert!(error.xy().norm() < 0.3 && error.z.abs() < 0.2, "{error:?}");
        assert_eq!(found.hypotheses[0].landmarks.len(), 1);
        let nothing = at(&GrayImage::from_fn(640, 480, |_, _| 90));
        assert_eq!(nothing.reason.map(LocaliseReason::as_str), Some("nothing_recognised"));
        assert!(nothing.hypotheses.is_empty() && nothing.answer.is_some());
    }

    #[test]
    fn two_estimates_of_one_pose_are_better_than_each() {
        let at = |x_m, sigma_m: f64| Pose2Covariance {
            pose: Pose2::new(x_m, 0.0, 0.0),
            covariance: nalgebra::Matrix3::identity() * sigma_m.powi(2),
        };
        let both = fused(&at(0.0, 0.2), &at(0.3, 0.1)).unwrap();
        assert!((both.pose.x_m - 0.24).abs() < 1e-9, "{both:?}");
        assert!((both.covariance[(0, 0)] - 0.008).abs() < 1e-9, "{both:?}");
    }
}
