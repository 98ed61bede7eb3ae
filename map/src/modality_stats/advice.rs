//! What the statistics of a place say about each modality there.

use crate::{localise::FixSource, modality_stats::modality::Modality};
use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

/// How a module errs in a place, beyond what it says itself. Robot-aligned: along, across (left), heading.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ErrorModel {
    /// To be subtracted: metres, metres, radians; of odometry for each metre.
    pub bias: Vector3<f64>,
    /// To be added to each variance, as a share of what is claimed.
    pub excess: Vector3<f64>,
}

/// Where advice comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StatsScope {
    /// The cell itself was driven through often enough.
    Cell,
    /// It and the eight around it.
    Around,
    /// The named area it lies in.
    Area,
    /// All of the map.
    Map,
}

/// What is known of the modules where a robot is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ModalityAdvice {
    /// The best module; none where too little is known.
    pub best: Option<Modality>,
    /// Which are used, in the order of [`Modality::ALL`].
    pub used: [bool; 3],
    /// How each errs.
    pub faults: [ErrorModel; 3],
    /// Where the ranking comes from.
    pub level: StatsScope,
}

impl Default for ModalityAdvice {
    /// Nothing is known: everything is used as it says.
    fn default() -> Self {
        Self { best: None, used: [true; 3], faults: [ErrorModel::default(); 3], level: StatsScope::Map }
    }
}

impl ModalityAdvice {
    /// Whether fixes of a modality are used.
    pub fn uses(&self, modality: FixSource) -> bool {
        self.used[Modality::from(modality).index()]
    }

    /// How a module errs.
    pub fn fault(&self, module: Modality) -> &ErrorModel {
        &self.faults[module.index()]
    }
}

/// The turn that takes robot-aligned (along, across, heading) to (x, y, theta) of the map.
pub(crate) fn map_from_aligned(theta_rad: f64) -> Matrix3<f64> {
    let (s, c) = theta_rad.sin_cos();
    Matrix3::new(c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0)
}
