//! What a frame says of the robot's pose and of the landmarks themselves: landmarks are judged by the pose without the
//! frame, what hangs elsewhere is left out, and the rest gives the fixes: one by the landmarks that the picture alone names,
//! one by those that the pose names. In: the facts of a frame and what is known without it. Out: [`JudgedFrame`]. Keeps
//! nothing.

use super::{
    fixes::{self, NoFix},
    frame_context::FrameContext,
    guided::Guided,
    motion::{FrameFixes, PriorPose},
};
use map::{
    landmark_health::{
        ExpectedLandmark, HealthParams, MountedCamera, PlaceCheck, PlaceVerdict as InPlace, check_place,
        drop_unreliable, expected,
    },
    localise::{Fix, FixResult, LandmarkObservation},
    pose2::Pose2Covariance,
};
use vision::{
    model::LandmarkId,
    recognise::{RecognitionResult, Verdict},
};

/// What a frame says about the landmarks themselves, by the pose without it.
#[derive(Debug)]
pub struct LandmarkChecks {
    /// That pose.
    pub grounds: PriorPose,
    /// Landmarks that are in the frame.
    pub judged: Vec<PlaceCheck>,
    /// Landmarks that should be and are not.
    pub missed: Vec<LandmarkId>,
}

/// What a frame says of the robot's pose and of the landmarks.
#[derive(Debug)]
pub struct JudgedFrame {
    /// The robot's pose without the frame.
    pub prior: Option<Pose2Covariance>,
    /// The fix by the landmarks that the picture alone names, or why there is none.
    pub fix: Result<Fix, NoFix>,
    /// The same without a pose of ours to choose among several solutions.
    pub independent: Option<FixResult>,
    /// The fix by the landmarks that the pose names, and by the others where they alone gave none.
    pub guided: Option<Fix>,
    /// What it says of the landmarks, where the robot's pose was known without it.
    pub seen: Option<LandmarkChecks>,
    /// The frame was not searched for all landmarks of the map.
    pub only_expected: bool,
}

impl JudgedFrame {
    /// What goes to the robot's fusion.
    pub fn fixes(&self) -> FrameFixes<'_> {
        FrameFixes {
            prior: self.prior.as_ref(),
            independent: self.independent.as_ref(),
            chosen: self.fix.as_ref().ok(),
            guided: self.guided.as_ref(),
            missed: self.seen.as_ref().map_or(&[], |s| &s.missed),
            only_expected: self.only_expected,
        }
    }
}

/// Judges a frame by what is known without it, and `guided`, the landmarks that this names.
pub fn judged_frame(view: &FrameContext<'_>, grounds: Option<PriorPose>, guided: &Guided) -> JudgedFrame {
    let global = fixes::sightings(view.facts, view.map);
    let known = grounds.as_ref().map(|grounds| grounds.pose);
    let seen = grounds.and_then(|grounds| seen(view, global.as_deref().ok(), grounds));
    let judged = seen.as_ref().map_or(&[][..], |s| &s.judged);
    let prior = known.as_ref().or(view.prior);
    let global = global.map(|all| drop_unreliable(&all, judged));
    let (fix, independent) = match &global {
        Ok(sightings) => frame_fixes(view, sightings, prior),
        Err(word) => (Err(*word), None),
    };
    let with = if fix == Err(NoFix::Ambiguous) { global.as_deref().unwrap_or_default() } else { &[] };
    let guided = prior.and_then(|prior| guided_fix(view, guided, with, (prior, seen.as_ref())));
    JudgedFrame { prior: known, fix, independent, guided, seen, only_expected: false }
}

/// Judges a frame of which only the landmarks were looked for that the pose without it expects: they may correct that pose.
/// What hangs elsewhere, or not at all, is said by frames that are searched.
pub fn judged_expected(view: &FrameContext<'_>, grounds: PriorPose, guided: &Guided) -> JudgedFrame {
    let prior = grounds.pose;
    let seen = LandmarkChecks { grounds, judged: Vec::new(), missed: Vec::new() };
    let guided = guided_fix(view, guided, &[], (&prior, Some(&seen)));
    let (prior, seen) = (Some(prior), Some(seen));
    JudgedFrame {
        prior,
        fix: Err(NoFix::NothingRecognised),
        independent: None,
        guided,
        seen,
        only_expected: true,
    }
}

/// The robot's pose by landmarks. The robot's own prior gates; ours only chooses between two solutions, so that a fused
/// pose gone wrong cannot keep out the fixes that would correct it.
fn frame_fixes(
    view: &FrameContext<'_>,
    sightings: &[LandmarkObservation<'_>],
    prior: Option<&Pose2Covariance>,
) -> (Result<Fix, NoFix>, Option<FixResult>) {
    let independent = fixes::robot_fixes(sightings, view.mounting, view.prior);
    let fix = match &independent {
        Ok(FixResult::Ambiguous(_)) if view.prior.is_none() && prior.is_some() => {
            fixes::robot_fix(sightings, view.mounting, prior)
        }
        Ok(fix) => fixes::only(fix),
        Err(word) => Err(*word),
    };
    (fix, independent.ok())
}

/// The robot's pose by landmarks that the pose names, and those given. What may have been moved is left out: by a pose that
/// is known well, nothing is gained by what hardly tells.
fn guided_fix(
    view: &FrameContext<'_>,
    guided: &Guided,
    with: &[LandmarkObservation<'_>],
    (prior, seen): (&Pose2Covariance, Option<&LandmarkChecks>),
) -> Option<Fix> {
    let named = guided.placed(view.map);
    let mounting = view.mounting.filter(|_| !named.is_empty())?;
    let supporters = seen.map_or(&[][..], |s| &s.grounds.supporters);
    let p = HealthParams::default();
    let judged = named.iter().filter_map(|s| check_place(s, mounting, prior, supporters, &p).ok());
    let judged: Vec<_> = judged.collect();
    let in_place = |s: &&LandmarkObservation<'_>| {
        judged.iter().any(|j| {
            j.landmark == s.landmark && matches!(j.verdict, InPlace::InPlace { .. } | InPlace::Undecided)
        })
    };
    let all: Vec<LandmarkObservation<'_>> = named.iter().filter(in_place).chain(with).copied().collect();
    fixes::robot_fix(&all, Some(mounting), Some(prior)).ok()
}

/// A candidate whose distance is below this many times its threshold may well be there, though nobody would swear to it.
const NEARLY: f64 = 1.5;

/// Whether a quad shows a landmark, or something that is taken for it, or nearly.
fn may_be(verdict: &RecognitionResult, id: LandmarkId) -> bool {
    let (Verdict::Unique(seen) | Verdict::Ambiguous(seen)) = verdict.verdict else {
        return verdict.candidates.first().is_some_and(|c| c.landmark == id && c.ratio < NEARLY);
    };
    seen == id
}

/// Which landmarks hang where they should, and which should be in the frame and are not.
fn seen(
    view: &FrameContext<'_>,
    sightings: Option<&[LandmarkObservation<'_>]>,
    grounds: PriorPose,
) -> Option<LandmarkChecks> {
    let FrameContext { facts, map, image_px, .. } = *view;
    let (mounting, camera) = (view.mounting?, view.camera?);
    let p = HealthParams::default();
    let judge =
        |s: &LandmarkObservation<'_>| check_place(s, mounting, &grounds.pose, &grounds.supporters, &p).ok();
    let judged = sightings.unwrap_or_default().iter().filter_map(judge).collect();
    let there =
        |id: LandmarkId| facts.quads.iter().filter_map(|q| q.recognition.as_ref()).any(|v| may_be(v, id));
    let learnt = map.models.iter().filter_map(|model| {
        let (info, visible) = (map.landmarks.get(&model.id)?, map.visibility.get(&model.id)?);
        let place = info.place.as_ref().filter(|_| info.is_trusted() && !there(model.id))?;
        Some(ExpectedLandmark { landmark: model.id, place, visible })
    });
    let eye = MountedCamera { mounting, camera, image_px };
    // Missing is told only by a pose that others hold up.
    let missed = if grounds.supporters.len() >= p.supporters {
        expected(&grounds.pose, &eye, &learnt.collect::<Vec<_>>(), &p)
    } else {
        Vec::new()
    };
    Some(LandmarkChecks { grounds, judged, missed })
}
