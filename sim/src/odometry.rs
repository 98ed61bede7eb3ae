//! Wheel odometry with systematic errors (scale, heading drift) and noise.

use map::pose2::Pose2;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};

use crate::seed;

/// Errors of odometry. By default it drifts by more than a metre in 25 m: without landmarks the
/// robot would hit the left wall (method 18, E10).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct OdometryParams {
    /// Measured length / true length - 1.
    pub scale_error: f64,
    /// Measured turn without a true one, rad per metre; negative: a robot that corrects it turns
    /// left.
    pub heading_bias_rad_per_m: f64,
    /// Standard deviation of the length after one metre.
    pub length_sigma_m: f64,
    /// Standard deviation of the heading after one metre.
    pub heading_sigma_rad: f64,
    /// Standard deviation of the heading after turning by one radian.
    pub turn_sigma_rad: f64,
}

impl Default for OdometryParams {
    fn default() -> Self {
        Self {
            scale_error: 0.015,
            heading_bias_rad_per_m: -0.005,
            length_sigma_m: 0.01,
            heading_sigma_rad: 0.004,
            turn_sigma_rad: 0.01,
        }
    }
}

/// The odometry of one robot.
#[derive(Debug, Clone)]
pub struct Odometry {
    params: OdometryParams,
    rng: ChaCha8Rng,
    odom_from_robot: Pose2,
}

impl Odometry {
    /// Starts at a pose, usually the true one, so that `odom` and `map` agree at first.
    pub fn new(params: OdometryParams, start: Pose2, seed: u64) -> Self {
        Self { params, rng: seed::stream(seed, 50), odom_from_robot: start }
    }

    /// The pose by odometry.
    pub fn pose(&self) -> Pose2 {
        self.odom_from_robot
    }

    /// Measures a true motion (the robot's new pose in its old frame) and adds it up.
    pub fn advance(&mut self, motion: &Pose2) -> Pose2 {
        let p = &self.params;
        let (length, turn) = (motion.position().norm(), motion.theta_rad);
        let mut noise = || -> f64 { StandardNormal.sample(&mut self.rng) };
        let root = length.sqrt();
        let scale = if length > 0.0 { 1.0 + p.scale_error + p.length_sigma_m * noise() / root } else { 1.0 };
        let error = p.heading_bias_rad_per_m * length
            + p.heading_sigma_rad * root * noise()
            + p.turn_sigma_rad * turn.abs().sqrt() * noise();
        let measured = Pose2::new(motion.x_m * scale, motion.y_m * scale, turn + error);
        self.odom_from_robot = self.odom_from_robot.compose(&measured);
        self.odom_from_robot
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERFECT: OdometryParams = OdometryParams {
        scale_error: 0.0,
        heading_bias_rad_per_m: 0.0,
        length_sigma_m: 0.0,
        heading_sigma_rad: 0.0,
        turn_sigma_rad: 0.0,
    };

    fn drive(params: &OdometryParams, seed: u64) -> Pose2 {
        let mut odometry = Odometry::new(params.clone(), Pose2::default(), seed);
        (0..250).map(|_| odometry.advance(&Pose2::new(0.1, 0.0, 0.0))).last().unwrap()
    }

    #[test]
    fn bias_and_scale_are_exact_without_noise() {
        let p = OdometryParams { scale_error: 0.02, heading_bias_rad_per_m: 0.004, ..PERFECT };
        let end = drive(&p, 1);
        assert!((end.theta_rad - 0.1).abs() < 1e-9);
        // A circle of radius 1.02 / 0.004 m: chord and sagitta.
        let radius = 1.02 / 0.004;
        assert!((end.x_m - radius * 0.1_f64.sin()).abs() < 0.02, "{end:?}");
        assert!((end.y_m - radius * (1.0 - 0.1_f64.cos())).abs() < 0.02, "{end:?}");
        assert!(drive(&PERFECT, 1).minus(&Pose2::new(25.0, 0.0, 0.0)).norm() < 1e-9);
    }

    #[test]
    fn noise_has_its_sigma_whatever_the_step() {
        let p = OdometryParams { length_sigma_m: 0.02, heading_sigma_rad: 0.01, ..PERFECT };
        let ends: Vec<Pose2> = (0..600).map(|seed| drive(&p, seed)).collect();
        let sigma = |f: fn(&Pose2) -> f64| {
            let mean = ends.iter().map(f).sum::<f64>() / 600.0;
            (ends.iter().map(|e| (f(e) - mean).powi(2)).sum::<f64>() / 600.0).sqrt()
        };
        // Random walks over 25 m.
        assert!((sigma(|e| e.theta_rad) / 0.05 - 1.0).abs() < 0.1);
        assert!((sigma(|e| e.x_m) / 0.1 - 1.0).abs() < 0.15, "{}", sigma(|e| e.x_m));
    }

    #[test]
    fn odometry_alone_would_leave_the_corridor() {
        let errors: Vec<f64> = (0..50).map(|seed| drive(&OdometryParams::default(), seed).y_m).collect();
        assert!(errors.iter().filter(|y| **y < -1.0).count() > 40, "{errors:?}");
    }

    #[test]
    fn a_standing_robot_does_not_drift() {
        let mut odometry = Odometry::new(OdometryParams::default(), Pose2::new(1.0, 2.0, 0.3), 4);
        for _ in 0..100 {
            odometry.advance(&Pose2::default());
        }
        assert_eq!(odometry.pose(), Pose2::new(1.0, 2.0, 0.3));
    }
}
