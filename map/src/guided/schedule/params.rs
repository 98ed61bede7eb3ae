//! Parameters of the schedule.

use crate::gate::{CHI2_3_99, CHI2_3_999};
use serde::{Deserialize, Serialize};

/// Parameters of the schedule.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ScheduleParams {
    /// Largest distance of two global searches, frames.
    pub interval_frames: u32,
    /// The same while nothing supports the pose, frames.
    pub unsupported_interval_frames: u32,
    /// Without support for this many frames every frame is searched globally,
    pub max_guided_frames: u32,
    /// or without support for this distance, metres.
    pub max_guided_m: f64,
    /// With a larger position uncertainty in its worst direction every frame is searched globally,
    /// metres,
    pub max_sigma_m: f64,
    /// or with a larger heading uncertainty, radians.
    pub max_sigma_rad: f64,
    /// A global fix within this squared Mahalanobis distance of the pose supports it (3 degrees of
    /// freedom).
    pub support_chi2: f64,
    /// A global fix beyond this contradicts the pose (3 degrees of freedom).
    pub contradict_chi2: f64,
    /// Older support does not count, metres driven.
    pub support_m: f64,
    /// A pose with support by this many landmarks needs two witnesses to be replaced.
    pub established_landmarks: usize,
    /// Consecutive contradicting global fixes that agree and replace a supported pose.
    pub reset_fixes: u32,
    /// The same for an unsupported pose.
    pub unsupported_reset_fixes: u32,
}

impl Default for ScheduleParams {
    fn default() -> Self {
        Self {
            interval_frames: 3,
            unsupported_interval_frames: 2,
            max_guided_frames: 30,
            max_guided_m: 10.0,
            max_sigma_m: 0.5,
            max_sigma_rad: 0.15,
            support_chi2: CHI2_3_99,
            contradict_chi2: CHI2_3_999,
            support_m: 20.0,
            established_landmarks: 2,
            reset_fixes: 3,
            unsupported_reset_fixes: 2,
        }
    }
}
