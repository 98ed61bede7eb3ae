//! Limits of the schedule.

use crate::gate::{CHI2_3_99, CHI2_3_999};
use serde::{Deserialize, Serialize};

/// Limits of the schedule.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ScheduleParams {
    /// At least every so many frames are searched globally...
    pub interval_frames: u32,
    /// ...and while nothing supports the pose.
    pub unsupported_interval_frames: u32,
    /// After so many frames without support every frame is searched globally...
    pub max_guided_frames: u32,
    /// ...or after so many metres.
    pub max_guided_m: f64,
    /// With the position known worse than this in its worst direction every frame is searched globally, metres...
    pub max_sigma_m: f64,
    /// ...or with the heading known worse than this, radians.
    pub max_sigma_rad: f64,
    /// A global fix within this squared Mahalanobis distance of the pose supports it (3 degrees of freedom).
    pub support_chi2: f64,
    /// A global fix beyond this contradicts the pose (3 degrees of freedom).
    pub contradict_chi2: f64,
    /// Support older than this counts for nothing, metres.
    pub support_m: f64,
    /// A pose that so many landmarks support needs two witnesses to be replaced.
    pub established_landmarks: usize,
    /// Contradicting global fixes in a row, which agree, that replace a pose...
    pub reset_fixes: u32,
    /// ...and one that nothing supports.
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
