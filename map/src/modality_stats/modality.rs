//! The modalities that estimate a pose, and which of them are fused.

use crate::localise::FixSource;
use serde::{Deserialize, Serialize};

/// What computes a position by itself ("localisation module" in the paper).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Modality {
    /// Odometry alone.
    Odometry,
    /// Scans and odometry.
    Laser,
    /// Recognised landmarks and odometry.
    Landmarks,
}

impl Modality {
    /// All of them, in the order of every array here.
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

/// What is fused where runs have told which module is best. Odometry carries the pose in any case.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FusionMode {
    /// Everything, each as sure as it proved to be.
    // Departs from method 15, which has the other two: see docs/EVALUATION.md, "Modalities by area".
    #[default]
    All,
    /// The modules whose score is at most twice the best one's.
    Fuse,
    /// The best module alone.
    Single,
}
