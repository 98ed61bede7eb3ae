//! Compares the answers to the same frames of two plays: of two builds, or against two versions of
//! a map. In: answers and the frames they are for. Out: what became of each frame, and the counts.

use map::pose2::Pose2Covariance;
use protos::{
    Name,
    convert::geometry::pose2_covariance,
    named::named_landmarks,
    v1::{Answer, Status},
};
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};

/// Most frames that are compared.
pub const MAX_FRAMES: usize = 1_000_000;
/// Poses further apart than this, in standard deviations of the earlier one, differ.
pub const POSE_SIGMAS: f64 = 1.0;
/// Added to the covariance of a pose, so that one that claims to be exact can be compared: 0.1 mm,
/// 0.1 mrad.
const ROUNDING: f64 = 1e-8;

/// The frame that an answer is for.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
pub struct FrameId {
    /// Its robot.
    pub robot: Name,
    /// Its camera.
    pub camera: Name,
    /// Its epoch.
    pub epoch: u64,
    /// Its number.
    pub seq: u64,
}

/// What an answer says of a frame, as far as it is compared.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Outcome {
    /// The landmarks that it names.
    pub names: BTreeSet<String>,
    /// The robot's pose by them, `map_from_robot`.
    pub pose: Option<Pose2Covariance>,
    /// The map's version.
    pub map_version: u64,
}

impl Outcome {
    /// `None` for a frame that was not looked at: refused, expired, or by a server that is not
    /// ready.
    pub fn of(answer: &Answer) -> Option<Self> {
        if !matches!(answer.status(), Status::Matched | Status::Ambiguous | Status::NoMatch) {
            return None;
        }
        Some(Self {
            names: named_landmarks(answer).map(|n| n.name.to_owned()).collect(),
            pose: answer.map_from_robot.as_ref().and_then(|pose| pose2_covariance(pose).ok()),
            map_version: answer.map_version,
        })
    }
}

/// What became of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Change {
    /// The same names, and poses that agree.
    Same,
    /// Other names.
    DifferentName,
    /// The same names; the pose is further than [`POSE_SIGMAS`] from the earlier one.
    PoseDiffers,
    /// A name or the pose is gone, and no name has come.
    Lost,
    /// A name or the pose has come, and no name is gone.
    New,
    /// It was answered before, and is not now.
    NotAnswered,
    /// It was not answered before, and is now.
    NotAnsweredBefore,
}

impl Change {
    /// Every change.
    pub const ALL: [Self; 7] = [
        Self::Same,
        Self::DifferentName,
        Self::PoseDiffers,
        Self::Lost,
        Self::New,
        Self::NotAnswered,
        Self::NotAnsweredBefore,
    ];

    /// In words, for a table.
    pub fn words(self) -> &'static str {
        match self {
            Self::Same => "same",
            Self::DifferentName => "different name",
            Self::PoseDiffers => "pose differs",
            Self::Lost => "lost",
            Self::New => "new",
            Self::NotAnswered => "not answered now",
            Self::NotAnsweredBefore => "not answered before",
        }
    }

    /// Whether the plays differ by it. A frame that was not answered before has nothing to differ
    /// from.
    pub fn is_difference(self) -> bool {
        !matches!(self, Self::Same | Self::NotAnsweredBefore)
    }
}

/// A frame that is not the same.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FrameChange {
    /// The frame.
    #[serde(flatten)]
    pub frame: FrameId,
    /// What became of it.
    pub change: Change,
    /// The names before.
    pub before: BTreeSet<String>,
    /// The names now.
    pub after: BTreeSet<String>,
    /// Distance of the poses in standard deviations of the earlier one; absent unless there are
    /// two.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pose_sigmas: Option<f64>,
    /// Distance of the positions, metres; absent unless there are two.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub distance_m: Option<f64>,
}

/// All frames of two plays.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    /// Frames of either.
    pub frames: usize,
    /// Frames by what became of them; every change is listed.
    pub counts: BTreeMap<Change, usize>,
    /// Versions of the map in the answers before, and now.
    pub map_versions: [BTreeSet<u64>; 2],
    /// The frames that are not the same, in order.
    pub changes: Vec<FrameChange>,
}

impl Comparison {
    /// Whether the plays differ.
    pub fn is_different(&self) -> bool {
        self.changes.iter().any(|c| c.change.is_difference())
    }
}

/// The answers of a play, by frame.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Play {
    outcomes: BTreeMap<FrameId, Outcome>,
}

impl Play {
    /// Adds an answer; false if it is not compared: it says nothing, or there are [`MAX_FRAMES`]
    /// already.
    pub fn add(&mut self, robot: &Name, camera: &Name, answer: &Answer) -> bool {
        let id =
            FrameId { robot: robot.clone(), camera: camera.clone(), epoch: answer.epoch, seq: answer.seq };
        match Outcome::of(answer) {
            Some(outcome) if self.outcomes.len() < MAX_FRAMES => {
                self.outcomes.insert(id, outcome);
                true
            }
            _ => false,
        }
    }

    /// Answers.
    pub fn len(&self) -> usize {
        self.outcomes.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.outcomes.is_empty()
    }

    /// Compares a later play of the same frames with this one.
    pub fn compare(&self, later: &Self) -> Comparison {
        let frames: BTreeSet<&FrameId> = self.outcomes.keys().chain(later.outcomes.keys()).collect();
        let mut counts: BTreeMap<Change, usize> = Change::ALL.map(|change| (change, 0)).into();
        let mut changes = Vec::new();
        for frame in &frames {
            let found = frame_change(frame, self.outcomes.get(frame), later.outcomes.get(frame));
            *counts.entry(found.change).or_default() += 1;
            if found.change != Change::Same {
                changes.push(found);
            }
        }
        let map_versions = [self, later].map(|play| play.outcomes.values().map(|o| o.map_version).collect());
        Comparison { frames: frames.len(), counts, map_versions, changes }
    }
}

fn frame_change(frame: &FrameId, before: Option<&Outcome>, after: Option<&Outcome>) -> FrameChange {
    let names = |outcome: Option<&Outcome>| outcome.map(|o| o.names.clone()).unwrap_or_default();
    let poses = before.and_then(|b| b.pose).zip(after.and_then(|a| a.pose));
    let pose_sigmas = poses.and_then(|(before, after)| sigmas(&before, &after));
    let distance_m = poses.map(|(b, a)| (b.pose.x_m - a.pose.x_m).hypot(b.pose.y_m - a.pose.y_m));
    let change = match (before, after) {
        (Some(before), Some(after)) => change(before, after, pose_sigmas),
        (Some(_), None) => Change::NotAnswered,
        (None, _) => Change::NotAnsweredBefore,
    };
    FrameChange {
        frame: frame.clone(),
        change,
        before: names(before),
        after: names(after),
        pose_sigmas,
        distance_m,
    }
}

fn change(before: &Outcome, after: &Outcome, pose_sigmas: Option<f64>) -> Change {
    let is_less = before.names.is_superset(&after.names);
    let is_more = after.names.is_superset(&before.names);
    match (is_less, is_more, before.pose.is_some(), after.pose.is_some()) {
        (false, false, ..) => Change::DifferentName,
        (true, false, ..) | (true, true, true, false) => Change::Lost,
        (false, true, ..) | (true, true, false, true) => Change::New,
        (true, true, true, true) if pose_sigmas.is_none_or(|s| s > POSE_SIGMAS) => Change::PoseDiffers,
        (true, true, ..) => Change::Same,
    }
}

/// Mahalanobis distance of the later pose under the covariance of the earlier one.
fn sigmas(before: &Pose2Covariance, after: &Pose2Covariance) -> Option<f64> {
    let d = after.pose.minus(&before.pose);
    let covariance = before.covariance + nalgebra::Matrix3::identity() * ROUNDING;
    Some(d.dot(&covariance.cholesky()?.solve(&d)).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use protos::v1::{Pose2, QuadAnswer, Sighting, Verdict};

    fn answer(seq: u64, names: &[&str], x_m: Option<f64>) -> Answer {
        let quad = |name: &&str| QuadAnswer {
            verdict: Verdict::Unique.into(),
            sighting: Sighting::Global.into(),
            landmark: (*name).to_owned(),
            ..QuadAnswer::default()
        };
        let covariance = vec![0.01, 0.0, 0.0, 0.0, 0.01, 0.0, 0.0, 0.0, 0.0001];
        let pose = |x_m| protos::v1::Pose2Covariance {
            pose: Some(Pose2 { x_m, ..Pose2::default() }),
            covariance: covariance.clone(),
        };
        Answer {
            epoch: 1,
            seq,
            map_version: seq,
            status: Status::Matched.into(),
            quads: names.iter().map(quad).collect(),
            map_from_robot: x_m.map(pose),
            ..Answer::default()
        }
    }

    fn change_of(before: &Answer, after: &Answer) -> Change {
        let (robot, camera) = (Name::new("r1").unwrap(), Name::new("front").unwrap());
        let (mut a, mut b) = (Play::default(), Play::default());
        a.add(&robot, &camera, before);
        b.add(&robot, &camera, after);
        let found = a.compare(&b);
        assert_eq!((found.frames, found.counts.values().sum::<usize>()), (1, 1));
        let (change, _) = found.counts.iter().find(|(_, n)| **n == 1).unwrap();
        assert_eq!(found.is_different(), change.is_difference());
        *change
    }

    #[test]
    fn every_change_has_its_name() {
        let with = |names: &[&str], x_m| answer(1, names, x_m);
        let poster = with(&["poster"], Some(1.0));
        let refused = Answer { status: Status::Rejected.into(), ..poster.clone() };
        for (after, change) in [
            (with(&["poster"], Some(1.05)), Change::Same),
            (with(&["poster"], Some(1.11)), Change::PoseDiffers),
            (with(&["door"], Some(1.0)), Change::DifferentName),
            (with(&["poster", "door"], Some(9.0)), Change::New),
            (with(&[], None), Change::Lost),
            (with(&["poster"], None), Change::Lost),
            (refused.clone(), Change::NotAnswered),
        ] {
            assert_eq!(change_of(&poster, &after), change, "{after:?}");
        }
        assert_eq!(change_of(&with(&["poster"], None), &poster), Change::New);
        assert_eq!(change_of(&with(&[], None), &with(&[], None)), Change::Same);
        assert_eq!(change_of(&refused, &poster), Change::NotAnsweredBefore);
    }
}
