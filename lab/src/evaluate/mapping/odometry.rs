//! Odometry made from corrected poses: relative poses with stated noise, from a seed.

use formats::scan_log::LogEntry;
use map::pose2::Pose2;
use vision::random::Random;

/// Noise of odometry.
#[derive(Debug, Clone, Copy)]
pub(super) struct Noise {
    /// Standard deviation along the motion, share of the way.
    along: f64,
    across: f64,
    /// Of the heading after one metre.
    rad_per_root_m: f64,
    /// Of the heading, share of the turn.
    turn: f64,
    /// Systematic turn to one side, rad per metre.
    bias_rad_per_m: f64,
}

impl Noise {
    /// The default noise, `k` times.
    pub(super) fn times(k: f64) -> Self {
        Self {
            along: 0.05 * k,
            across: 0.02 * k,
            rad_per_root_m: 0.02 * k,
            turn: 0.05 * k,
            bias_rad_per_m: 0.004 * k,
        }
    }
}

/// Replaces the odometry of all records by noisy motions between their true poses.
pub(super) fn make(records: &mut [LogEntry], noise: Noise, seed: u64) {
    let mut random = Random::new(seed);
    let mut odom = Pose2::default();
    let mut before: Option<Pose2> = None;
    for record in records {
        let Some(truth) = record.truth else { continue };
        if let Some(before) = before {
            let m = before.between(&truth);
            let d = m.position().norm();
            let turn = m.theta_rad.abs() * noise.turn * random.normal();
            odom = odom.compose(&Pose2::new(
                m.x_m + noise.along * d * random.normal(),
                m.y_m + noise.across * d * random.normal(),
                m.theta_rad
                    + noise.rad_per_root_m * d.sqrt() * random.normal()
                    + turn
                    + noise.bias_rad_per_m * d,
            ));
        }
        record.odom = odom;
        before = Some(truth);
    }
}
