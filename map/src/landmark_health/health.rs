//! The health of a landmark, and what changes it.

use crate::pose2::Pose2;
use serde::{Deserialize, Serialize};
use vision::model::LandmarkId;

/// Whether a landmark may be used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LandmarkHealth {
    /// No finding.
    #[default]
    Sound,
    /// There is a finding; the landmark is still used, and the operator is informed.
    Flagged,
    /// Excluded from fixes until a person decides.
    Quarantined,
}

/// Evidence against the place of a landmark.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Finding {
    /// It is observed elsewhere.
    Moved {
        /// Observed centre on the floor and direction of the normal, map frame.
        observed_place: Pose2,
        /// Distance from its place, metres.
        offset_m: f64,
        /// Number of observations.
        sightings: u32,
    },
    /// It should be visible and is not.
    Missing {
        /// Consecutive frames without it.
        missed_frames: u32,
    },
}

/// A change of a landmark's health.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HealthChange {
    /// Number of the landmark.
    pub landmark: LandmarkId,
    /// The new health.
    pub health: LandmarkHealth,
    /// The finding; `None` for a sound landmark.
    pub finding: Option<Finding>,
}
