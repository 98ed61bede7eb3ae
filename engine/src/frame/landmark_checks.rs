//! Checks landmarks by their places, and computes the fixes of a frame. In: an analysed frame, the
//! prior pose without it, the guided observations. Out: [`FrameEvaluation`]. Stateless.
//!
//! Each observed landmark is compared with its place by the prior pose. An observation of a
//! landmark that hangs elsewhere is dropped. The others give two fixes: a global one by the
//! landmarks that the picture alone names, and a guided one by the landmarks that the prior pose
//! names.

use super::{
    context::FrameContext,
    fixes::{self, NoFix, PoseRefusal, pose_refusal},
    guided::GuidedResult,
};
use crate::motion::{FrameFixes, PriorPose};
use map::{
    landmark_health::{
        ExpectedLandmark, MountedCamera, PlaceCheck, PlaceVerdict, check_place, drop_unreliable, expected,
    },
    localise::{Fix, FixResult, LandmarkObservation},
    pose2::Pose2Covariance,
};
use vision::{
    model::LandmarkId,
    recognise::{RecognitionResult, Verdict},
};

/// Landmarks compared with their places by the prior pose.
#[derive(Debug)]
pub struct LandmarkChecks {
    /// That pose.
    pub prior: PriorPose,
    /// Landmarks that were observed in the frame.
    pub observed: Vec<PlaceCheck>,
    /// Landmarks that were expected in the frame and not observed.
    pub missed: Vec<LandmarkId>,
}

/// The fixes and landmark checks of one frame.
#[derive(Debug)]
pub struct FrameEvaluation {
    /// The robot's pose without the frame (map frame).
    pub prior: Option<Pose2Covariance>,
    /// The fix by the landmarks that the picture alone names, or why there is none.
    pub fix: Result<Fix, NoFix>,
    /// Which number does not fit, where the re-projection error refused that fix.
    pub refusal: Option<PoseRefusal>,
    /// The fix without the server's prior pose, which chooses among several solutions.
    pub independent: Option<FixResult>,
    /// The fix by the landmarks that the pose names, and by the others where they alone gave none.
    pub guided: Option<Fix>,
    /// The landmark checks, where the robot's pose was known without the frame.
    pub checks: Option<LandmarkChecks>,
    /// The frame was not searched for all landmarks of the map.
    pub only_expected: bool,
}

impl FrameEvaluation {
    /// What the robot's fusion gets.
    pub fn fixes(&self) -> FrameFixes<'_> {
        FrameFixes {
            prior: self.prior.as_ref(),
            independent: self.independent.as_ref(),
            chosen: self.fix.as_ref().ok(),
            guided: self.guided.as_ref(),
            missed: self.checks.as_ref().map_or(&[], |c| &c.missed),
            only_expected: self.only_expected,
        }
    }
}

/// Fixes and landmark checks of a searched frame. `guided` holds the landmarks that the prior pose
/// names: `known`, the server's, or without it the robot's own.
pub fn evaluate_frame(
    frame: &FrameContext<'_>,
    known: Option<PriorPose>,
    guided: &GuidedResult,
) -> FrameEvaluation {
    let named = fixes::landmark_observations(frame.analysis, frame.map);
    let known_pose = known.as_ref().map(|known| known.pose);
    let checks = known.and_then(|known| landmark_checks(frame, named.as_deref().ok(), known));
    let observed = checks.as_ref().map_or(&[][..], |c| &c.observed);
    let prior = known_pose.as_ref().or(frame.prior);
    let reliable = named.map(|all| drop_unreliable(&all, observed));
    let (fix, independent) = match &reliable {
        Ok(observations) => frame_fixes(frame, observations, prior),
        Err(reason) => (Err(*reason), None),
    };
    let observations = reliable.as_deref().unwrap_or_default();
    let p = &frame.map.poses.localise;
    let refusal = pose_refusal(observations, frame.extrinsics, prior, independent.as_ref(), p);
    let with = if fix == Err(NoFix::Ambiguous) { observations } else { &[] };
    let guided_fix = prior.and_then(|prior| guided_fix(frame, guided, with, (prior, checks.as_ref())));
    FrameEvaluation {
        prior: known_pose,
        fix,
        refusal,
        independent,
        guided: guided_fix,
        checks,
        only_expected: false,
    }
}

/// The guided fix of a frame in which only the expected landmarks were looked for: it may correct
/// the prior pose. Searched frames find landmarks that were moved or are missing.
pub fn evaluate_expected_only(
    frame: &FrameContext<'_>,
    prior: PriorPose,
    guided: &GuidedResult,
) -> FrameEvaluation {
    let pose = prior.pose;
    let checks = LandmarkChecks { prior, observed: Vec::new(), missed: Vec::new() };
    FrameEvaluation {
        prior: Some(pose),
        fix: Err(NoFix::NothingRecognised),
        refusal: None,
        independent: None,
        guided: guided_fix(frame, guided, &[], (&pose, Some(&checks))),
        checks: Some(checks),
        only_expected: true,
    }
}

/// The robot's pose by landmarks. The robot's own prior gates. The server's prior only chooses
/// between two solutions, so that a wrong fused pose cannot keep out the fixes that would correct
/// it.
fn frame_fixes(
    frame: &FrameContext<'_>,
    observations: &[LandmarkObservation<'_>],
    prior: Option<&Pose2Covariance>,
) -> (Result<Fix, NoFix>, Option<FixResult>) {
    let p = &frame.map.poses.localise;
    let independent = fixes::robot_fixes(observations, frame.extrinsics, frame.prior, p);
    let fix = match &independent {
        Ok(FixResult::Ambiguous(_)) if frame.prior.is_none() && prior.is_some() => {
            fixes::robot_fix(observations, frame.extrinsics, prior, p)
        }
        Ok(fix) => fixes::single_fix(fix),
        Err(reason) => Err(*reason),
    };
    (fix, independent.ok())
}

/// The robot's pose by the landmarks that the prior pose names, and those in `with`. A landmark
/// that may have been moved is left out.
fn guided_fix(
    frame: &FrameContext<'_>,
    guided: &GuidedResult,
    with: &[LandmarkObservation<'_>],
    (prior, checks): (&Pose2Covariance, Option<&LandmarkChecks>),
) -> Option<Fix> {
    let named = guided.landmark_observations(frame.map);
    let extrinsics = frame.extrinsics.filter(|_| !named.is_empty())?;
    let supporting = checks.map_or(&[][..], |c| &c.prior.supporting_landmarks);
    let p = &frame.map.poses;
    let checked = named.iter().filter_map(|o| check_place(o, extrinsics, prior, supporting, &p.health).ok());
    let checked: Vec<_> = checked.collect();
    let is_in_place = |o: &&LandmarkObservation<'_>| {
        checked.iter().any(|c| {
            c.landmark == o.landmark
                && matches!(c.verdict, PlaceVerdict::InPlace { .. } | PlaceVerdict::Undecided)
        })
    };
    let all: Vec<LandmarkObservation<'_>> = named.iter().filter(is_in_place).chain(with).copied().collect();
    fixes::robot_fix(&all, Some(extrinsics), Some(prior), &p.localise).ok()
}

/// A landmark whose best match candidate has a ratio below this does not count as missing.
const POSSIBLE_RATIO: f64 = 1.5;

/// Whether a quad may show a landmark: by its verdict, or nearly.
fn is_plausible(result: &RecognitionResult, id: LandmarkId) -> bool {
    let (Verdict::Unique(named) | Verdict::Ambiguous(named)) = result.verdict else {
        return result.candidates.first().is_some_and(|c| c.landmark == id && c.ratio < POSSIBLE_RATIO);
    };
    named == id
}

/// Checks observed landmarks against their places; lists expected but missing ones.
fn landmark_checks(
    frame: &FrameContext<'_>,
    observations: Option<&[LandmarkObservation<'_>]>,
    prior: PriorPose,
) -> Option<LandmarkChecks> {
    let FrameContext { analysis, map, image_px, .. } = *frame;
    let (extrinsics, camera) = (frame.extrinsics?, frame.camera?);
    let p = &map.poses.health;
    let check = |o: &LandmarkObservation<'_>| {
        check_place(o, extrinsics, &prior.pose, &prior.supporting_landmarks, p).ok()
    };
    let observed = observations.unwrap_or_default().iter().filter_map(check).collect();
    let results = || analysis.quads.iter().filter_map(|q| q.recognition.as_ref());
    let may_be_there = |id: LandmarkId| results().any(|result| is_plausible(result, id));
    let candidates = map.models.iter().filter_map(|model| {
        let (info, visible) = (map.landmarks.get(&model.id)?, map.visibility.get(&model.id)?);
        let place = info.place.as_ref().filter(|_| info.is_trusted() && !may_be_there(model.id))?;
        Some(ExpectedLandmark { landmark: model.id, place, visible })
    });
    let camera = MountedCamera { mounting: extrinsics, camera, image_px };
    // Only a pose that rests on several other landmarks shows that one is missing, and only in a
    // whole image.
    let missed = if frame.is_whole && prior.supporting_landmarks.len() >= p.supporters {
        expected(&prior.pose, &camera, &candidates.collect::<Vec<_>>(), p)
    } else {
        Vec::new()
    };
    Some(LandmarkChecks { prior, observed, missed })
}
