//! Parameters of the joint map.

use nalgebra::Vector6;
use serde::{Deserialize, Serialize};

/// Parameters of the joint map.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct JointParams {
    /// Standard deviation of odometry's scale in a drive.
    pub scale_sigma: f64,
    /// Standard deviation of odometry's drift in a drive, rad/m.
    pub drift_sigma_rad_per_m: f64,
    /// How far objects hang from their wall or ceiling: standard deviation, metres.
    pub hanging_sigma_m: f64,
    /// How far objects turn away from their wall, or lean: standard deviation, radians.
    pub hanging_sigma_rad: f64,
    /// Standard deviations of the differences of two tracks of one object: x, y, theta, z, log
    /// width, log height; metres and radians.
    pub same_sigmas: [f64; 6],
    /// Standard deviation of the logarithm of a size that a person gave.
    pub size_sigma: f64,
    /// Standard deviation of the direction of a floor plan's lines, radians.
    pub plan_sigma_rad: f64,
    /// Standard deviation of the offset of a floor plan's lines, metres.
    pub plan_sigma_m: f64,
    /// Error of a printed border, added to the covariance of every corner, px.
    pub border_sigma_px: f64,
    /// For lines that the program gave to walls: beyond this chi2 a line's weight falls off.
    pub line_doubt_chi2: Option<f64>,
    /// Least views of a track that becomes a landmark.
    pub min_views: usize,
}

impl Default for JointParams {
    fn default() -> Self {
        let half_degree = 0.5_f64.to_radians();
        Self {
            scale_sigma: 0.02,
            drift_sigma_rad_per_m: 0.006,
            hanging_sigma_m: 0.01,
            hanging_sigma_rad: half_degree,
            same_sigmas: [0.003, 0.003, 0.2_f64.to_radians(), 0.003, 0.005, 0.005],
            size_sigma: 0.002,
            plan_sigma_rad: 0.3_f64.to_radians(),
            plan_sigma_m: 0.03,
            border_sigma_px: 0.3,
            line_doubt_chi2: None,
            min_views: 3,
        }
    }
}

impl JointParams {
    pub(super) fn same_sigmas(&self) -> Vector6<f64> {
        Vector6::from(self.same_sigmas)
    }
}
