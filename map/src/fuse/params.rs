//! Knobs of the fusion, and what they say of odometry's noise.

use crate::{gate::CHI2_3_99, pose2::Pose2};
use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

/// Knobs of the fusion.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FuseParams {
    /// Odometry: standard deviation along the motion after 1 m (grows with the square root).
    pub along_m: f64,
    /// The same across the motion.
    pub across_m: f64,
    /// Of the heading after 1 m.
    pub turn_rad: f64,
    /// Of the heading after turning 1 rad.
    pub turn_per_turn_rad: f64,
    /// How far odometry's scale may be off before anything is known of this robot: standard deviation of the share.
    ///
    /// Not in method 15: wheels wear and loads press them, so that a share of odometry's error is the same every metre.
    /// Left in the noise it would come back after every landmark.
    pub scale_sigma: f64,
    /// The same of a turn that is made but not measured, per metre.
    pub turn_bias_sigma_rad_per_m: f64,
    /// How far they wander within 1 m (grows with the square root).
    pub scale_drift: f64,
    /// The same of the turn.
    pub turn_bias_drift_rad_per_m: f64,
    /// Gate on a fix: 99 % of chi2 with 3 degrees of freedom.
    pub gate_chi2: f64,
    /// Fixes older than this behind the newest event are refused.
    pub window_s: f64,
    /// Contradicting fixes in a row that agree with one another and thereby replace the pose...
    pub reset_count: u32,
    /// ...if they rest on this many landmarks: one wrong identity in view can be as steady as the truth.
    ///
    /// Departs from method 15, where five fixes gated out mark their source as failed: odometry drifts, landmarks do
    /// not, so agreeing landmarks win.
    pub reset_landmarks: usize,
    /// A fix on the same landmarks, or another scan, is new only after this motion: from the same place its errors are
    /// the same.
    ///
    /// Departs from method 15, which applies every fix.
    pub min_move_m: f64,
    /// Or after this turn.
    pub min_turn_rad: f64,
    /// Faster than this between two readings is a jump of odometry.
    pub max_speed_mps: f64,
}

impl Default for FuseParams {
    fn default() -> Self {
        Self {
            along_m: 0.02,
            across_m: 0.01,
            turn_rad: 0.007,
            turn_per_turn_rad: 0.02,
            scale_sigma: 0.02,
            turn_bias_sigma_rad_per_m: 0.006,
            scale_drift: 0.001,
            turn_bias_drift_rad_per_m: 0.0003,
            gate_chi2: CHI2_3_99,
            window_s: 2.0,
            reset_count: 5,
            reset_landmarks: 2,
            min_move_m: 0.05,
            min_turn_rad: 0.02,
            max_speed_mps: 10.0,
        }
    }
}

impl FuseParams {
    /// Covariance of a motion, in the frame where it starts. Linear in its length, so that cutting a motion in pieces
    /// changes nothing.
    pub fn motion_noise(&self, motion: &Pose2) -> Matrix3<f64> {
        let (metres, radians) = (motion.position().norm(), motion.theta_rad.abs());
        let turn = self.turn_rad.powi(2) * metres + self.turn_per_turn_rad.powi(2) * radians;
        let (along, across) = (self.along_m.powi(2) * metres, self.across_m.powi(2) * metres);
        let (s, c) = motion.y_m.atan2(motion.x_m).sin_cos();
        let mut noise = Matrix3::from_diagonal(&Vector3::new(0.0, 0.0, turn));
        noise[(0, 0)] = along * c * c + across * s * s;
        noise[(1, 1)] = along * s * s + across * c * c;
        noise[(0, 1)] = (along - across) * s * c;
        noise[(1, 0)] = noise[(0, 1)];
        noise
    }

    /// Variances (along, across, heading) of a metre straight on by odometry of which nothing is known yet: noise, and what
    /// it always gets wrong.
    pub(crate) fn metre_variances(&self) -> Vector3<f64> {
        let turn = self.turn_rad.powi(2) + self.turn_bias_sigma_rad_per_m.powi(2);
        // A heading that wanders on the way moves the end aside by a third of its square.
        let across = self.across_m.powi(2) + turn / 3.0;
        Vector3::new(self.along_m.powi(2) + self.scale_sigma.powi(2), across, turn)
    }
}
