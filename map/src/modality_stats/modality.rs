//! The modalities that estimate a pose, and the fusion mode.

use crate::localise::FixSource;
use serde::{Deserialize, Serialize};

/// A modality: what estimates a position by itself ("localisation module" in the paper).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Modality {
    /// Odometry alone.
    Odometry,
    /// Scan matching, with odometry between scans.
    Laser,
    /// Recognised landmarks, with odometry between them.
    Landmarks,
}

impl Modality {
    /// All modalities, in the order of every array of this module.
    pub const ALL: [Self; 3] = [Self::Odometry, Self::Laser, Self::Landmarks];

    pub(super) fn index(self) -> usize {
        self as usize
    }
}

impl From<FixSource> for Modality {
    fn from(modality: FixSource) -> Self {
        match modality {
            FixSource::Laser => Self::Laser,
            FixSource::Landmarks => Self::Landmarks,
        }
    }
}

/// Which modalities are fused where reference runs rank them. Odometry carries the pose in any
/// case.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FusionMode {
    // Departs from method 15, which has the other two: see docs/EVALUATION.md, "Modalities by
    // area".
    /// All modalities, each with its learnt error model.
    #[default]
    All,
    /// The modalities whose score is at most twice the best one's.
    NearBest,
    /// The best modality alone.
    Best,
}
