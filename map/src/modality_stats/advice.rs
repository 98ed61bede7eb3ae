//! Advice: what the statistics of a place say about each modality there.

use crate::{localise::FixSource, modality_stats::modality::Modality};
use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

/// Error of a modality in a place beyond its claimed covariance. Robot-aligned: along, across
/// (left), heading.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ErrorModel {
    /// Bias to subtract: metres, metres, radians; of odometry for each metre driven.
    pub bias: Vector3<f64>,
    /// Variance to add, as a share of the claimed one.
    pub excess: Vector3<f64>,
}

/// The part of the map that statistics come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StatsScope {
    /// The pose cell itself.
    Cell,
    /// The cell and its eight neighbours.
    Neighbourhood,
    /// The named area that contains the cell.
    Area,
    /// The whole map.
    Map,
}

/// Which modalities to use at a pose, and with which error models.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ModalityAdvice {
    /// The best modality; `None` where too little is known.
    pub best: Option<Modality>,
    /// Whether each modality is used, in the order of [`Modality::ALL`].
    pub used: [bool; 3],
    /// The error model of each modality, in the order of [`Modality::ALL`].
    pub faults: [ErrorModel; 3],
    /// The scope of the ranking.
    pub level: StatsScope,
}

impl Default for ModalityAdvice {
    /// Without statistics every modality is used as it claims.
    fn default() -> Self {
        Self { best: None, used: [true; 3], faults: [ErrorModel::default(); 3], level: StatsScope::Map }
    }
}

impl ModalityAdvice {
    /// Whether fixes of a source are used.
    pub fn uses(&self, modality: FixSource) -> bool {
        self.used[Modality::from(modality).index()]
    }

    /// The error model of a modality.
    pub fn fault(&self, module: Modality) -> &ErrorModel {
        &self.faults[module.index()]
    }
}

/// The rotation from robot-aligned errors (along, across, heading) to (x, y, theta) of the map.
pub(crate) fn map_from_aligned(theta_rad: f64) -> Matrix3<f64> {
    let (s, c) = theta_rad.sin_cos();
    Matrix3::new(c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0)
}
