//! Keyframe: a pose whose scan stays in the pose graph.

use crate::{pose2::Pose2, segments::LaserSegment, slam::cloud::Cloud};

/// A pose from which the map is made.
#[derive(Debug, Clone)]
pub(crate) struct Keyframe {
    pub pose: Pose2,
    pub odom: Pose2,
    pub cloud: Cloud,
    pub lines: Vec<LaserSegment>,
    /// Distance driven up to here, metres.
    pub path_m: f64,
}
