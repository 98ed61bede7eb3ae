//! Parameters of the fusion, and the noise model of odometry.

use crate::{gate::CHI2_3_99, pose2::Pose2};
use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

/// Parameters of the fusion.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FuseParams {
    /// Odometry: standard deviation along the motion after 1 m, metres; grows with the square root
    /// of the distance.
    pub along_m: f64,
    /// Odometry: standard deviation across the motion after 1 m, metres.
    pub across_m: f64,
    /// Odometry: standard deviation of the heading after 1 m, radians.
    pub turn_rad: f64,
    /// Odometry: standard deviation of the heading after turning 1 rad, radians.
    pub turn_per_turn_rad: f64,
    /// Standard deviation of the scale error of an unknown robot, share.
    ///
    /// Not in method 15: worn wheels and loads make a share of odometry's error the same every
    /// metre. As noise it would return after every landmark.
    pub scale_sigma: f64,
    /// Standard deviation of the heading drift of an unknown robot, rad/m.
    pub turn_bias_sigma_rad_per_m: f64,
    /// Random walk of the scale within 1 m, share; grows with the square root of the distance.
    pub scale_drift: f64,
    /// Random walk of the heading drift within 1 m, rad/m.
    pub turn_bias_drift_rad_per_m: f64,
    /// Gate on a fix: 99 % of chi2 with 3 degrees of freedom.
    pub gate_chi2: f64,
    /// Fixes older than the newest event by more than this are refused, seconds.
    pub window_s: f64,
    /// Consecutive contradicting fixes that agree with one another and replace the pose,
    pub reset_count: u32,
    /// if they rest on this many landmarks: a single wrong identity can be as steady as the truth.
    ///
    /// Departs from method 15, where five fixes gated out mark their source as failed: odometry
    /// drifts, landmarks do not, so agreeing landmarks win.
    pub reset_landmarks: usize,
    /// A further fix by the same landmarks, or a further scan, counts only after this motion,
    /// metres: from the same pose its errors are the same.
    ///
    /// Departs from method 15, which applies every fix.
    pub min_move_m: f64,
    /// Or after this turn, radians.
    pub min_turn_rad: f64,
    /// A motion faster than this between two readings is a jump of odometry.
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
    /// Covariance of a motion, in the frame where it starts. Linear in the distance, so that
    /// cutting a motion into pieces changes nothing.
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

    /// Variances (along, across, heading) of one metre straight on for an unknown robot: noise and
    /// systematic errors.
    pub(crate) fn metre_variances(&self) -> Vector3<f64> {
        let turn = self.turn_rad.powi(2) + self.turn_bias_sigma_rad_per_m.powi(2);
        // Random heading along the metre adds a third of its variance across.
        let across = self.across_m.powi(2) + turn / 3.0;
        Vector3::new(self.along_m.powi(2) + self.scale_sigma.powi(2), across, turn)
    }
}
