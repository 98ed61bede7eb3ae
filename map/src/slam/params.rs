//! Limits of mapping.

use crate::{
    lines::LineParams,
    pose2::{Pose2, Pose2Covariance},
    slam::{cloud::CloudParams, correlative::CorrelativeParams, icp::IcpParams, loop_closure::LoopParams},
    walls::WallParams,
};
use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

/// Knobs of mapping.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SlamParams {
    /// Points of a scan.
    pub cloud: CloudParams,
    /// Search for a pose near the predicted one.
    pub search: CorrelativeParams,
    /// The last step of every match.
    pub align: IcpParams,
    /// Loops.
    pub loops: LoopParams,
    /// The final fit.
    pub refine: RefineParams,
    /// Segments of a scan.
    pub lines: LineParams,
    /// Walls from segments.
    pub walls: WallParams,
    /// How surely neighbouring key scans lie on each other: position, for joining their segments to walls...
    pub near_m: f64,
    /// ...and heading.
    pub near_rad: f64,
    /// Odometry: standard deviation of the position per metre driven.
    pub odometry_m_per_m: f64,
    /// Of the heading per metre driven.
    pub odometry_rad_per_m: f64,
    /// Of the heading per radian turned.
    pub odometry_rad_per_rad: f64,
    /// Of the position, whatever the motion.
    pub odometry_m: f64,
    /// Of the heading, whatever the motion.
    pub odometry_rad: f64,
    /// A new key pose after this way...
    pub key_m: f64,
    /// ...or this turn...
    pub key_rad: f64,
    /// ...or when less than this share of a scan is seen again.
    pub key_matched: f64,
    /// Key scans that make up the recent map.
    pub recent_keys: usize,
    /// And no older than this way.
    pub recent_m: f64,
    /// A match with a smaller share of the scan is none: odometry alone counts.
    pub min_matched: f64,
}

impl Default for SlamParams {
    fn default() -> Self {
        Self {
            cloud: CloudParams::default(),
            search: CorrelativeParams::default(),
            align: IcpParams::default(),
            loops: LoopParams::default(),
            refine: RefineParams::default(),
            lines: LineParams {
                range_sigma_m: 0.02,
                split_m: 0.06,
                min_points: 6,
                min_length_m: 0.3,
                ..LineParams::default()
            },
            walls: WallParams::default(),
            near_m: 0.02,
            near_rad: 0.004,
            odometry_m_per_m: 0.08,
            odometry_rad_per_m: 0.06,
            odometry_rad_per_rad: 0.15,
            odometry_m: 0.02,
            odometry_rad: 0.01,
            key_m: 0.4,
            key_rad: 0.35,
            key_matched: 0.6,
            recent_keys: 30,
            recent_m: 15.0,
            min_matched: 0.15,
        }
    }
}

impl SlamParams {
    /// Covariance of a motion measured by odometry, in the frame where it starts.
    pub(super) fn motion(&self, motion: &Pose2) -> Pose2Covariance {
        let (metres, radians) = (motion.position().norm(), motion.theta_rad.abs());
        let position = self.odometry_m.powi(2) + (self.odometry_m_per_m * metres).powi(2);
        let heading = self.odometry_rad.powi(2)
            + (self.odometry_rad_per_m * metres).powi(2)
            + (self.odometry_rad_per_rad * radians).powi(2);
        let covariance = Matrix3::from_diagonal(&Vector3::new(position, position, heading));
        Pose2Covariance { pose: *motion, covariance }
    }
}

/// Knobs of the final fit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RefineParams {
    /// How often.
    pub rounds: usize,
    /// Partners of each key scan among those before it, the nearest.
    pub partners: usize,
    /// Partners are not farther off than this.
    pub near_m: f64,
    /// Least share of the points that find their surface.
    pub min_matched: f64,
    /// An alignment that moves a pose more than this is a mistake.
    pub max_move_m: f64,
    /// Key scans of one part of the path that are counted as one: their errors are the same.
    pub doubt_chi2: f64,
}

impl Default for RefineParams {
    fn default() -> Self {
        Self { rounds: 2, partners: 6, near_m: 5.0, min_matched: 0.45, max_move_m: 0.5, doubt_chi2: 4.0 }
    }
}
