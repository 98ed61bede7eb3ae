//! Inputs and outputs of the schedule, frame by frame.

use crate::{
    localise::{Fix, FixResult},
    pose2::{Pose2, Pose2Covariance},
};
use serde::{Deserialize, Serialize};
use vision::model::LandmarkId;

/// How far a pose is trusted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Trust {
    /// There is no pose.
    NoPose,
    /// No global observation has agreed with it.
    Unsupported,
    /// Global observations have agreed with it lately.
    Supported,
    /// The last global observation that agreed is too long ago.
    Stale,
    /// The last global observation contradicts it.
    Contradicted,
}

/// Why a frame is searched globally.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum GlobalReason {
    /// There is no pose to guide.
    NoPose,
    /// A global observation contradicts the pose.
    Contradicted,
    /// The pose is too uncertain.
    Uncertain,
    /// Nothing has supported the pose for too many frames or metres.
    Stale,
    /// The last global search is [`super::ScheduleParams::interval_frames`] frames ago.
    Interval,
    /// A landmark that is surely in view was not found.
    Missed,
    /// A guided observation contradicts the pose.
    GuidedContradiction,
}

/// What to do with a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FramePlan {
    /// Whether to look for expected landmarks. Not while the pose is contradicted.
    pub guided: bool,
    /// Whether to search the whole map as well, and why.
    pub global: Option<GlobalReason>,
}

/// Result of guided recognition of a frame.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct GuidedReport {
    /// Observations that contradict the pose ([`crate::guided::Assignment::contradictions`]).
    pub contradictions: usize,
    /// Whether a landmark that is surely in view was not found (as in [`FrameReport::missed`]).
    pub missed: bool,
}

impl GuidedReport {
    /// Whether the frame must be searched globally after all, and why.
    pub fn global_reason(&self) -> Option<GlobalReason> {
        if self.contradictions > 0 {
            Some(GlobalReason::GuidedContradiction)
        } else if self.missed {
            Some(GlobalReason::Missed)
        } else {
            None
        }
    }
}

/// Result of a frame.
#[derive(Debug, Clone, Copy)]
pub struct FrameReport<'a> {
    /// The camera, as in [`super::Schedule::plan`].
    pub camera: u32,
    /// Motion by odometry since the frame before, in the robot frame then; the identity for the
    /// first.
    pub motion: Pose2,
    /// The pose at the frame's time without the frame, if there is one.
    pub prior: Option<&'a Pose2Covariance>,
    /// Whether the whole map was searched.
    pub searched: bool,
    /// The pose by the uniquely recognised landmarks of that search alone, made without any prior.
    pub global: Option<&'a FixResult>,
    /// Landmarks surely in view ([`crate::guided::Expected::is_sure`]) that neither way found. Only
    /// those that are recognised reliably when they are there: not members of look-alike classes,
    /// not quarantined ones.
    pub missed: &'a [LandmarkId],
}

/// How the global fix of a frame goes to the fuser.
#[derive(Debug, Clone, PartialEq)]
pub enum Decision {
    /// No global fix, or one without information on the pose.
    Keep,
    /// The global fix agrees with the pose, or starts one: it goes to the fuser as
    /// `FixRole::Independent`.
    Use,
    /// The global fix contradicts the pose: it goes to the fuser as `FixRole::Independent`, which
    /// leaves it out and counts it.
    Doubt {
        /// How many global fixes in a row contradict the pose and agree with one another.
        in_a_row: u32,
    },
    /// The global fix replaces the pose (`FixRole::Replacing`).
    Replace(Box<Fix>),
}
