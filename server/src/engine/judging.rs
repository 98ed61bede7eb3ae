//! What a frame says of the robot's pose and of the landmarks themselves: landmarks are judged by the pose without the
//! frame, what hangs elsewhere is left out, and the rest gives the fix. In: the facts of a frame and what is known
//! without it. Out: the fix or why there is none, and what is to be remembered of the landmarks. Keeps nothing.

use super::{motion::Grounds, snapshot::MapSnapshot, verdicts};
use map::{
    changes::{ChangeParams, Expectation, Eye, Judged, expected, judge, sift},
    localise::{Fix, Sighting},
    mounting::Mounting,
    pose2::Pose2Covariance,
};
use vision::{
    frame::Intrinsics,
    pipeline::FrameFacts,
    recognise::{LandmarkId, Recognition, Verdict},
};

/// A frame that was looked at.
#[derive(Debug, Clone, Copy)]
pub struct View<'a> {
    /// What is in it.
    pub facts: &'a FrameFacts,
    /// The map it was compared with.
    pub map: &'a MapSnapshot,
    /// Where the camera sat.
    pub mounting: Option<&'a Mounting>,
    /// The camera.
    pub camera: Option<&'a Intrinsics>,
    /// Width and height.
    pub image_px: [f64; 2],
    /// What the robot itself believes.
    pub prior: Option<&'a Pose2Covariance>,
}

/// What a frame says about the landmarks themselves, by the pose without it.
#[derive(Debug)]
pub struct Seen {
    /// That pose.
    pub grounds: Grounds,
    /// Landmarks that are in the frame.
    pub judged: Vec<Judged>,
    /// Landmarks that should be and are not.
    pub missed: Vec<LandmarkId>,
}

/// The fix by a frame, or the word that says why there is none; and what it says of the landmarks, where the robot's
/// pose was known without it.
pub fn judged_fix(view: &View<'_>, grounds: Option<Grounds>) -> (Result<Fix, &'static str>, Option<Seen>) {
    let sightings = verdicts::sightings(view.facts, view.map);
    let seen = grounds.and_then(|grounds| seen(view, sightings.as_deref().ok(), grounds));
    let judged = seen.as_ref().map_or(&[][..], |s| &s.judged);
    let fix = sightings.and_then(|all| {
        let prior = seen.as_ref().map(|s| &s.grounds.pose);
        fix(view, &sift(&all, judged), prior)
    });
    (fix, seen)
}

/// The robot's pose by landmarks. The robot's own prior gates; ours only chooses between two solutions, so that a fused
/// pose gone wrong cannot keep out the fixes that would correct it.
fn fix(
    view: &View<'_>,
    sightings: &[Sighting<'_>],
    prior: Option<&Pose2Covariance>,
) -> Result<Fix, &'static str> {
    let fix = verdicts::robot_fix(sightings, view.mounting, view.prior);
    if fix.as_ref().err() != Some(&verdicts::AMBIGUOUS) || view.prior.is_some() || prior.is_none() {
        return fix;
    }
    verdicts::robot_fix(sightings, view.mounting, prior)
}

/// A candidate whose distance is below this many times its threshold may well be there, though nobody would swear to it.
const NEARLY: f64 = 1.5;

/// Whether a quad shows a landmark, or something that is taken for it, or nearly.
fn may_be(verdict: &Verdict, id: LandmarkId) -> bool {
    let (Recognition::Unique(seen) | Recognition::Ambiguous(seen)) = verdict.recognition else {
        return verdict.candidates.first().is_some_and(|c| c.landmark == id && c.ratio < NEARLY);
    };
    seen == id
}

/// Which landmarks hang where they should, and which should be in the frame and are not.
fn seen(view: &View<'_>, sightings: Option<&[Sighting<'_>]>, grounds: Grounds) -> Option<Seen> {
    let View { facts, map, image_px, .. } = *view;
    let (mounting, camera) = (view.mounting?, view.camera?);
    let p = ChangeParams::default();
    let judge = |s: &Sighting<'_>| judge(s, mounting, &grounds.pose, &grounds.supporters, &p).ok();
    let judged = sightings.unwrap_or_default().iter().filter_map(judge).collect();
    let there = |id: LandmarkId| facts.quads.iter().filter_map(|q| q.verdict.as_ref()).any(|v| may_be(v, id));
    let learnt = map.models.iter().filter_map(|model| {
        let (info, visible) = (map.landmarks.get(&model.id)?, map.visibility.get(&model.id)?);
        let place = info.place.as_ref().filter(|_| info.is_trusted() && !there(model.id))?;
        Some(Expectation { landmark: model.id, place, visible })
    });
    let eye = Eye { mounting, camera, image_px };
    // Missing is told only by a pose that others hold up.
    let missed = if grounds.supporters.len() >= p.supporters {
        expected(&grounds.pose, &eye, &learnt.collect::<Vec<_>>(), &p)
    } else {
        Vec::new()
    };
    Some(Seen { grounds, judged, missed })
}
