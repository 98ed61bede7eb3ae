//! A kept frame against two versions of a map: what a robot would be told otherwise. In: the frame
//! and both versions. Out: the landmarks that are named by one of them alone, and how its pose
//! differs.
//!
//! Each version sees the frame as that of a robot whose pose is not known to the server: what
//! motion and earlier frames added to an answer belongs to its time.

use crate::{
    frame::{
        analysis::{Effect, OpenedFrame, StageTimes},
        answer::frame_answer,
        decode::{ImageLimits, decode_frame},
    },
    observers::{answer_records::named_landmarks, kept_frames::KeptFrame},
    snapshot::MapSnapshot,
};
use protos::{Rejection, v1};
use std::{collections::BTreeSet, f64::consts::TAU, sync::Arc};

/// A pose that differs by less in both is the same.
const SAME_M: f64 = 0.001;
const SAME_RAD: f64 = 0.001;

/// How the pose of the robot differs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PoseChange {
    /// Both say the same, or both say none.
    Same,
    /// Only the later version gives one.
    Gained,
    /// Only the earlier version gives one.
    Lost,
    /// Both give one.
    Moved {
        /// Between the two, m.
        distance_m: f64,
        /// Between the two headings, rad, 0 to pi.
        angle_rad: f64,
    },
}

/// How two answers to one frame differ.
#[derive(Debug, Clone, PartialEq)]
pub struct AnswerChange {
    /// Landmarks that the earlier version names alone.
    pub lost: Vec<String>,
    /// Landmarks that the later version names alone.
    pub gained: Vec<String>,
    /// The robot's pose.
    pub pose: PoseChange,
}

impl AnswerChange {
    /// Whether the robot would be told the same.
    pub fn is_none(&self) -> bool {
        self.lost.is_empty() && self.gained.is_empty() && self.pose == PoseChange::Same
    }
}

/// Answers a kept frame by two versions of its map. Errors: its image cannot be decoded.
pub fn replay(
    kept: &KeptFrame,
    [before, after]: [&Arc<MapSnapshot>; 2],
    limits: ImageLimits,
) -> Result<AnswerChange, Rejection> {
    let (frame, picture) = (&kept.frame, Arc::new(decode_frame(&kept.frame, limits)?));
    let answered = |map: &Arc<MapSnapshot>| {
        let (picture, map, effect) = (picture.clone(), map.clone(), Effect::AnswerOnly);
        let opened = OpenedFrame { frame, picture, map, effect, prior: None };
        frame_answer(&opened.searched(&mut StageTimes::start()))
    };
    Ok(change(&answered(before), &answered(after)))
}

/// The pose that a robot would use: of its landmarks, else by its own estimate.
fn pose(answer: &v1::Answer) -> Option<&v1::Pose2> {
    let pose = answer.map_from_robot.as_ref().or(answer.guided_map_from_robot.as_ref())?;
    pose.pose.as_ref()
}

fn change(before: &v1::Answer, after: &v1::Answer) -> AnswerChange {
    let names = |answer| named_landmarks(answer).into_iter().map(str::to_owned).collect::<BTreeSet<_>>();
    let (was, is) = (names(before), names(after));
    let pose = match (pose(before), pose(after)) {
        (None, None) => PoseChange::Same,
        (None, Some(_)) => PoseChange::Gained,
        (Some(_), None) => PoseChange::Lost,
        (Some(was), Some(is)) => {
            let distance_m = (is.x_m - was.x_m).hypot(is.y_m - was.y_m);
            let turn = (is.theta_rad - was.theta_rad).rem_euclid(TAU);
            let angle_rad = turn.min(TAU - turn);
            let is_same = distance_m < SAME_M && angle_rad < SAME_RAD;
            if is_same { PoseChange::Same } else { PoseChange::Moved { distance_m, angle_rad } }
        }
    };
    AnswerChange {
        lost: was.difference(&is).cloned().collect(),
        gained: is.difference(&was).cloned().collect(),
        pose,
    }
}

#[cfg(test)]
mod tests;
