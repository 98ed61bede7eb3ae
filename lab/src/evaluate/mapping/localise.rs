//! Localisation of single scans in the finished map: processor time, share of scans with an answer,
//! error.

use crate::evaluate::statistics;
use cli::clock::Clock;
use formats::scan_log::LogEntry;
use map::{
    laser_fix::{LaserFixParams, WallIndex, laser_fix},
    pose2::Pose2Covariance,
    slam::SlamMap,
};
use nalgebra::{Matrix3, Vector3};

/// Most scans tried, evenly taken.
const MAX_TRIED: usize = 300;
/// Offset of the prior from the map's own pose: x, y (m), theta (rad).
const OFF: [f64; 3] = [0.08, -0.06, 0.03];
/// Standard deviations of the prior: x, y (m), theta (rad).
const SIGMA: [f64; 3] = [0.1, 0.1, 0.03];

/// Figures of all tried scans.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Localised {
    /// Median processor time of one, microseconds.
    pub(super) us: f64,
    /// Share of the scans with an answer.
    pub(super) fixed: f64,
    /// Median distance of the answers from the map's own pose, metres, prior and fix fused.
    pub(super) off_m: f64,
}

/// Localises scans with a prior that has an offset.
pub(super) fn localise(map: &SlamMap, records: &[LogEntry]) -> anyhow::Result<Localised> {
    let walls = WallIndex::new(&map.walls);
    let covariance = Matrix3::from_diagonal(&Vector3::from(SIGMA).map(|s| s * s));
    let (mut times, mut off, mut tried) = (Vec::new(), Vec::new(), 0_usize);
    let stride = records.len().div_ceil(MAX_TRIED).max(1);
    for (record, pose) in records.iter().zip(&map.path).step_by(stride) {
        let prior = Pose2Covariance { pose: pose.plus(&Vector3::from(OFF)), covariance };
        let clock = Clock::start();
        let found = laser_fix(&walls, &record.scan, &prior, &LaserFixParams::default())?;
        times.push(clock.ms() * 1e3);
        tried += 1;
        let Ok(fix) = found else { continue };
        // Fused as in a filter: along a bare corridor the prior decides.
        let sum = (prior.covariance + fix.pose.covariance).try_inverse().unwrap_or_else(Matrix3::zeros);
        let fused = prior.pose.plus(&(prior.covariance * sum * fix.pose.pose.minus(&prior.pose)));
        off.push((fused.position() - pose.position()).norm());
    }
    let fixed = off.len() as f64 / tried.max(1) as f64;
    let us = statistics::median(&mut times).unwrap_or_default();
    Ok(Localised { us, fixed, off_m: statistics::median(&mut off).unwrap_or_default() })
}
