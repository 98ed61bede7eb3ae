//! Parameters of mapping.

use crate::{
    lines::LineParams,
    pose2::{Pose2, Pose2Covariance},
    slam::{cloud::CloudParams, correlative::CorrelativeParams, icp::IcpParams, loop_closure::LoopParams},
    walls::WallParams,
};
use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

/// Parameters of mapping.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SlamParams {
    /// Extraction of surface points.
    pub cloud: CloudParams,
    /// Correlative search near the predicted pose.
    pub search: CorrelativeParams,
    /// Point-to-line ICP, the last step of every match.
    pub align: IcpParams,
    /// Loop closure.
    pub loops: LoopParams,
    /// Final fit.
    pub refine: RefineParams,
    /// Line extraction of the keyframes.
    pub lines: LineParams,
    /// Merging of lines into walls.
    pub walls: WallParams,
    /// Standard deviation between neighbouring keyframes when their lines are merged into walls:
    /// position, metres,
    pub near_m: f64,
    /// and heading, radians.
    pub near_rad: f64,
    /// Odometry: standard deviation of the position per metre driven, metres.
    pub odometry_m_per_m: f64,
    /// Odometry: standard deviation of the heading per metre driven, radians.
    pub odometry_rad_per_m: f64,
    /// Odometry: standard deviation of the heading per radian turned, radians.
    pub odometry_rad_per_rad: f64,
    /// Odometry: standard deviation of the position for any motion, metres.
    pub odometry_m: f64,
    /// Odometry: standard deviation of the heading for any motion, radians.
    pub odometry_rad: f64,
    /// A new keyframe after this distance, metres,
    pub key_m: f64,
    /// or after this turn, radians,
    pub key_rad: f64,
    /// or when a smaller share of the scan matches.
    pub key_matched: f64,
    /// Keyframes of the recent map, at most this many
    pub recent_keys: usize,
    /// and no older than this distance, metres.
    pub recent_m: f64,
    /// With a smaller share of the scan matched, odometry alone counts.
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

/// Parameters of the final fit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RefineParams {
    /// Number of rounds.
    pub rounds: usize,
    /// Keyframes that each one is matched with: the nearest.
    pub partners: usize,
    /// Partners are at most this far apart, metres.
    pub near_m: f64,
    /// Least share of matched points.
    pub min_matched: f64,
    /// Matches that move a pose by more than this are refused, metres.
    pub max_move_m: f64,
    /// A constraint's weight falls off beyond this chi2.
    pub doubt_chi2: f64,
}

impl Default for RefineParams {
    fn default() -> Self {
        Self { rounds: 2, partners: 6, near_m: 5.0, min_matched: 0.45, max_move_m: 0.5, doubt_chi2: 4.0 }
    }
}
