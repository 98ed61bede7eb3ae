//! Limits of expectations.

use serde::{Deserialize, Serialize};

/// Limits of expectations.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ExpectParams {
    /// Landmarks further from the camera than this are left out, metres.
    pub max_range_m: f64,
    /// Shortest side in the image below which a landmark is too small, px.
    pub min_side_px: f64,
    /// Angle against the normal beyond which a landmark is too oblique, radians.
    pub max_incidence_rad: f64,
    /// Least share of a landmark's area in the image, 0 to 1; with less it is left out.
    pub min_image_share: f64,
    /// Least share of its face that obstacles leave free, 0 to 1.
    pub min_unoccluded_share: f64,
    /// Standard deviation of a measured corner that the search gates allow for, px.
    pub corner_sigma_px: f64,
    /// Size of the search gates: squared Mahalanobis distance, 2 degrees of freedom. 13.816 is 99.9
    /// %.
    pub gate_chi2: f64,
    /// Largest half extent of a search gate, px; beyond it the prior is too uncertain to guide.
    pub max_gate_px: f64,
    /// A landmark is surely in view when it is so within this many standard deviations of the
    /// prior.
    pub sure_sigmas: f64,
    /// How far before its wall a landmark is taken to hang when lines of sight are tested, metres.
    pub standoff_m: f64,
}

impl Default for ExpectParams {
    fn default() -> Self {
        Self {
            max_range_m: 30.0,
            min_side_px: 24.0,
            max_incidence_rad: 75.0_f64.to_radians(),
            min_image_share: 0.25,
            min_unoccluded_share: 0.5,
            corner_sigma_px: 1.0,
            gate_chi2: crate::gate::CHI2_2_999,
            max_gate_px: 120.0,
            sure_sigmas: 3.0,
            standoff_m: 0.05,
        }
    }
}
