//! The result of the fusion, and what became of each input.

use crate::pose2::Pose2Covariance;

/// The fused pose and what it rests on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FusedPose {
    /// Capture time of the last odometry, ns.
    pub at_ns: i64,
    /// `map_from_robot` with covariance.
    pub pose: Pose2Covariance,
    /// Fixes by landmarks applied since the start.
    pub corrections: u64,
    /// Scans applied since the start.
    pub laser_corrections: u64,
    /// Consecutive fixes that contradict the pose; 0 when the last one agreed.
    pub contradictions: u32,
}

/// Outcome of an odometry reading.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OdometryOutcome {
    /// It moved the pose.
    Moved,
    /// Ignored: older than the window, or a second reading of the same time.
    TooOld,
    /// The robot cannot have moved so far: the odometry frame is another one. The pose is unknown
    /// until the next fix.
    Jumped,
}

/// What a fix may do to the pose, by how its landmarks were recognised.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum FixRole {
    /// Recognised without the pose: the fix may start the pose, correct it, contradict it, and
    /// replace it together with others that agree.
    #[default]
    Independent,
    /// Recognised where the pose expects them ([`crate::guided`]): the fix only corrects. It
    /// neither counts as a contradiction nor ends one, since it was searched for around the pose.
    Guided,
    /// The caller has decided that the pose is wrong ([`crate::guided::Schedule`]): the fix
    /// replaces it.
    Replacing,
}

/// Outcome of a fix.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum FixOutcome {
    /// It gave the first pose.
    Started,
    /// It corrected the pose.
    Applied {
        /// Squared Mahalanobis distance, 3 degrees of freedom.
        distance2: f64,
    },
    /// It agrees with the pose, but its modality is excluded there ([`crate::modality_stats`]).
    ExcludedByMode {
        /// Squared Mahalanobis distance, 3 degrees of freedom.
        distance2: f64,
    },
    /// It contradicts the pose and was not applied.
    GatedOut {
        /// Squared Mahalanobis distance, 3 degrees of freedom.
        distance2: f64,
        /// Number of consecutive contradictions.
        in_a_row: u32,
    },
    /// It replaced the pose: the last of consecutive contradictions that agree, or
    /// [`FixRole::Replacing`].
    Reset,
    /// Nothing new: the same landmarks, or the laser, from the same pose.
    Repeated,
    /// A scan or a guided fix without a pose to correct.
    NoPose,
    /// Older than the replay window.
    TooOld,
    /// Newer than the last odometry: it is applied when the next odometry arrives.
    Waiting,
}
