//! Limits of localisation in walls.

use crate::slam::cloud::CloudParams;
use serde::{Deserialize, Serialize};

/// Knobs of localisation in walls.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LaserFixParams {
    /// Points of the scan.
    pub cloud: CloudParams,
    /// How far from a point its wall is looked for at first...
    pub start_radius_m: f64,
    /// ...and at last.
    pub end_radius_m: f64,
    /// Surface and wall turn less than this against each other.
    pub max_turn_rad: f64,
    /// Most iterations from one start.
    pub iterations: usize,
    /// Smallest standard deviation of a point across its wall.
    pub sigma_m: f64,
    /// Beyond it a point's weight falls off.
    pub outlier_m: f64,
    /// Points that err together: their number is divided by this.
    pub correlated: f64,
    /// Standard deviation that no number of points removes: position, metres, and heading, radians.
    pub floor: [f64; 2],
    /// Fewest points with a wall.
    pub min_points: usize,
    /// Least share of the points that have a wall.
    pub min_matched: f64,
    /// Gate on the squared Mahalanobis distance to the prior: 99.9 % of chi2 with 3 degrees of freedom.
    pub prior_gate: f64,
    /// Priors wider than this are tried from several starts...
    pub wide_m: f64,
    /// ...or wider in the heading.
    pub wide_rad: f64,
    /// Another solution that matches so nearly as many points makes it ambiguous.
    pub rival_share: f64,
    /// Two results are two solutions if they differ by more than this chi2.
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
            floor: [0.003, 0.001],
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
