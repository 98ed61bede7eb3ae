//! What the fusion gives, and what became of each input.

use crate::pose2::Pose2Covariance;

/// The fused pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FusedPose {
    /// Capture time of the last odometry, ns.
    pub at_ns: i64,
    /// `map_from_robot`.
    pub pose: Pose2Covariance,
    /// Fixes by landmarks applied since the start.
    pub corrections: u64,
    /// Scans applied since the start.
    pub laser_corrections: u64,
    /// Fixes in a row that contradict it: above 0 it deserves doubt.
    pub contradictions: u32,
}

/// What became of an odometry reading.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OdometryOutcome {
    /// It moved the pose.
    Moved,
    /// It was too old, or a second one of the same time: ignored.
    TooOld,
    /// The robot cannot have moved so far: the odometry frame is another one. The pose is unknown until the next fix.
    Jumped,
}

/// What a fix may do to the pose, by how its landmarks were recognised.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum FixRole {
    /// Its landmarks were recognised without the pose: it may start the pose, correct it, contradict it, and with others
    /// that agree replace it.
    #[default]
    Independent,
    /// Its landmarks were recognised where the pose expects them ([`crate::guided`]): it corrects the pose and does nothing
    /// else. It neither counts as a contradiction nor ends one: the pose fits what was looked for by it.
    Guided,
    /// Whoever gives it has decided that the pose is wrong ([`crate::guided::Schedule`]): it replaces the pose.
    Replacing,
}

/// What became of a fix.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum FixOutcome {
    /// It gave the first pose.
    Started,
    /// It corrected the pose.
    Applied {
        /// Squared Mahalanobis distance, 3 degrees of freedom.
        distance2: f64,
    },
    /// It agrees with the pose, but its modality is not used where the robot is (see [`crate::modality_stats`]).
    NotUsed {
        /// Squared Mahalanobis distance.
        distance2: f64,
    },
    /// It contradicts the pose and was left out.
    GatedOut {
        /// Squared Mahalanobis distance.
        distance2: f64,
        /// How many in a row.
        in_a_row: u32,
    },
    /// It was the last of a row of contradictions that agree, or [`FixRole::Replacing`], and replaced the pose.
    Reset,
    /// Nothing new: the same landmarks, or the laser, from the same place.
    Repeated,
    /// A scan or a guided fix while there was no pose to correct.
    NoPose,
    /// Older than the replay window.
    TooOld,
    /// Newer than the last odometry: it will be applied when that arrives.
    Waiting,
}
