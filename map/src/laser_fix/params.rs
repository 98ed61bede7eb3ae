//! Parameters of localisation in walls.

use crate::{
    check::{self, OutOfRange},
    slam::cloud::CloudParams,
    walls::WallParams,
};
use serde::{Deserialize, Serialize};

/// Parameters of localisation in walls.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LaserFixParams {
    /// Extraction of surface points.
    pub cloud: CloudParams,
    /// Search radius for a point's wall at first, metres,
    pub start_radius_m: f64,
    /// and at last, metres.
    pub end_radius_m: f64,
    /// Largest angle between surface and wall, radians.
    pub max_turn_rad: f64,
    /// Largest number of iterations from one start.
    pub iterations: usize,
    /// Smallest standard deviation of a point across its wall, metres.
    pub sigma_m: f64,
    /// Distance beyond which a point's weight falls off, metres.
    pub outlier_m: f64,
    /// Number of points with a common error; the information is divided by it.
    pub correlated: f64,
    /// Unevenness of walls where a scan sees them: standard deviation of their offset, metres,
    pub rough_m: f64,
    /// and of their direction, radians, whatever the number of points.
    pub rough_rad: f64,
    /// Least number of points with a wall.
    pub min_points: usize,
    /// Least share of points with a wall, 0 to 1.
    pub min_matched: f64,
    /// Gate on the squared Mahalanobis distance to the prior: 99.9 % of chi2 with 3 degrees of
    /// freedom.
    pub prior_gate: f64,
    /// A prior with a larger standard deviation is tried from several starts, metres,
    pub wide_m: f64,
    /// or with a larger one of the heading, radians.
    pub wide_rad: f64,
    /// Another solution with this share of the best one's points makes the result ambiguous.
    pub rival_share: f64,
    /// Results that differ by more than this chi2 are different solutions.
    pub apart_chi2: f64,
}

impl Default for LaserFixParams {
    fn default() -> Self {
        Self {
            cloud: CloudParams::default(),
            start_radius_m: 0.6,
            end_radius_m: 0.15,
            max_turn_rad: 0.5,
            iterations: 16,
            sigma_m: 0.02,
            outlier_m: 0.06,
            correlated: 3.0,
            rough_m: WallParams::default().rough_m,
            rough_rad: WallParams::default().rough_rad,
            min_points: 20,
            min_matched: 0.5,
            prior_gate: 16.27,
            wide_m: 0.2,
            wide_rad: 0.06,
            rival_share: 0.9,
            apart_chi2: 25.0,
        }
    }
}

impl LaserFixParams {
    pub(super) fn check(&self) -> Result<(), OutOfRange> {
        check::within("params.end_radius_m", self.end_radius_m, 1e-3, 1.0)?;
        check::within("params.start_radius_m", self.start_radius_m, self.end_radius_m, 1.0)
    }
}
