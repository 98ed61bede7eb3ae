//! The health of a landmark, and what changes it.

use crate::pose2::Pose2;
use serde::{Deserialize, Serialize};
use vision::recognise::LandmarkId;

/// How far a landmark is trusted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LandmarkHealth {
    /// Nothing speaks against it.
    #[default]
    Sound,
    /// Something does; it is still used, and whoever looks after the map is told.
    Flagged,
    /// It corrects no pose until a person has decided.
    Quarantined,
}

/// What speaks against a landmark.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Finding {
    /// It is seen elsewhere.
    Moved {
        /// Where it appears: centre on the floor and direction of its normal.
        apparent: Pose2,
        /// How far that is from its place.
        by_m: f64,
        /// How many sightings say so.
        sightings: u32,
    },
    /// It should be seen and is not.
    Missing {
        /// How many looks in a row.
        looks: u32,
    },
}

/// A landmark's standing should change.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HealthChange {
    /// Which landmark.
    pub landmark: LandmarkId,
    /// To what.
    pub standing: LandmarkHealth,
    /// Why; nothing speaks against a sound one.
    pub finding: Option<Finding>,
}
