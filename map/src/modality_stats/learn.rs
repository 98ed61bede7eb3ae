//! From a reference run to statistics: the errors of every modality's own position, and of single
//! measurements against their claimed covariance, by pose cell.
//!
//! In: odometry and fixes of a robot, the reference trajectory. Out: statistics by cell. Each
//! modality covers the whole trajectory by itself, from the start of the reference ("loose
//! coupling", method 15), so that its drift is not hidden by the other one.

use crate::{
    fuse::{FuseParams, Fuser},
    localise::{Fix, FixSource},
    modality_stats::{
        advice::map_from_aligned, evidence::StatsByModality, modality::Modality,
        reference::ReferenceTrajectory,
    },
    pose_cell::PoseCell,
    pose2::{Pose2, Pose2Covariance, wrap_rad},
};
use nalgebra::{Matrix3, Vector3};
use std::collections::BTreeMap;

/// Most cells of one run.
pub const MAX_CELLS: usize = 4096;
/// Positions are compared after this distance along the reference, metres,
const STEP_M: f64 = 0.05;
/// or after this turn, radians.
const STEP_RAD: f64 = 0.05;
/// A modality is available within this distance of its last fix, metres.
const NEWS_M: f64 = 0.5;
/// Length of the stretches over which odometry is compared, metres.
const STRETCH_M: f64 = 1.0;
/// Stretches that turn by more than this are left out: along and across would not be defined,
/// radians.
const STRETCH_RAD: f64 = 0.5;
/// Smallest standard deviations assumed, metres and radians; they keep the weights finite.
const LEAST: [f64; 2] = [1e-3, 1e-4];

/// A recording compared with a reference trajectory.
#[derive(Debug, Clone, Copy)]
pub struct ReferenceRun<'a> {
    /// `odom_from_robot` by time, in order, ns of the robot's clock.
    pub odometry: &'a [(i64, Pose2)],
    /// Fixes by time of capture, in order; repeated ones left out.
    pub fixes: &'a [(i64, Fix)],
    /// True pose by time, same clock.
    pub reference: &'a ReferenceTrajectory,
}

/// Statistics of one reference run.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RunStats {
    /// Statistics by pose cell.
    pub cells: BTreeMap<PoseCell, StatsByModality>,
    /// Distance along the reference trajectory, metres.
    pub way_m: f64,
    /// Fixes at times without a reference pose.
    pub unknown_fixes: u64,
    /// Steps in cells beyond [`MAX_CELLS`], left out.
    pub beyond: u64,
}

impl RunStats {
    fn cell(&mut self, pose: &Pose2) -> Option<&mut StatsByModality> {
        let cell = PoseCell::of(pose);
        if self.cells.len() >= MAX_CELLS && !self.cells.contains_key(&cell) {
            self.beyond += 1;
            return None;
        }
        Some(self.cells.entry(cell).or_default())
    }
}

/// One step along the reference trajectory.
struct Step {
    /// Number of the contiguous piece of the reference.
    piece: u32,
    way_m: f64,
    truth: Pose2,
    odometry: Pose2,
}

/// Compares a run with its reference trajectory. The result is empty where they have no time in
/// common.
pub fn learn_modality_stats(run: &ReferenceRun<'_>, p: &FuseParams) -> RunStats {
    let mut learnt = RunStats::default();
    let steps = positions(run, p, &mut learnt);
    measured_fixes(run, &mut learnt);
    measured_odometry(&steps, run.reference, p, &mut learnt);
    learnt
}

/// A modality with its own fusion.
struct Walker {
    modality: FixSource,
    fuser: Fuser,
    /// Distance along the reference at its last fix.
    news_m: Option<f64>,
}

impl Walker {
    fn new(modality: FixSource, p: &FuseParams) -> Self {
        Self { modality, fuser: Fuser::new(p.clone()), news_m: None }
    }

    /// Its position, if its last fix is recent.
    fn position(&self, way_m: f64) -> Option<Pose2> {
        self.news_m.filter(|at_m| way_m - at_m <= NEWS_M)?;
        Some(self.fuser.pose()?.pose.pose)
    }
}

/// Fuses every modality by itself and records its error step by step.
fn positions(run: &ReferenceRun<'_>, p: &FuseParams, learnt: &mut RunStats) -> Vec<Step> {
    let mut walkers = [FixSource::Laser, FixSource::Landmarks].map(|modality| Walker::new(modality, p));
    let mut map_from_odom: Option<Pose2> = None;
    let (mut steps, mut piece, mut way_m): (Vec<Step>, u32, f64) = (Vec::new(), 0, 0.0);
    let (mut before, mut since_ns): (Option<Pose2>, i64) = (None, 0);
    let mut fixes = run.fixes.iter().peekable();
    for (at_ns, odometry) in run.odometry {
        let mut apply_fixes = |walkers: &mut [Walker; 2], until_ns: i64, way_m: f64| {
            while let Some((t, fix)) = fixes.next_if(|(t, _)| *t < until_ns) {
                for walker in walkers.iter_mut().filter(|w| w.modality == fix.modality) {
                    // Fixes out of range were refused before; a refusal here only leaves the fix
                    // out.
                    if walker.fuser.pose().is_some() && walker.fuser.apply_fix(*t, fix).is_ok() {
                        walker.news_m = Some(way_m);
                    }
                }
            }
        };
        apply_fixes(&mut walkers, *at_ns, way_m);
        for walker in &mut walkers {
            walker.fuser.apply_odometry(*at_ns, *odometry).ok();
        }
        let Some(truth) = run.reference.at(*at_ns) else {
            (piece, before) = (piece + u32::from(before.is_some()), None);
            continue;
        };
        if map_from_odom.is_none() {
            map_from_odom = Some(truth.compose(&odometry.inverse()));
            let variances =
                Vector3::new(run.reference.sigma_m, run.reference.sigma_m, run.reference.sigma_rad);
            let covariance = Matrix3::from_diagonal(&variances.map(|s| s * s));
            for walker in &mut walkers {
                walker.fuser.start(&Pose2Covariance { pose: truth, covariance }).ok();
            }
        }
        let motion = before.map_or_else(Pose2::default, |before| before.between(&truth));
        let moved_m = motion.position().norm();
        if before.is_some() && moved_m < 0.999 * STEP_M && motion.theta_rad.abs() < STEP_RAD {
            continue;
        }
        let seconds = before.map_or(0.0, |_| at_ns.saturating_sub(since_ns) as f64 * 1e-9);
        (way_m, before, since_ns) = (way_m + moved_m, Some(truth), *at_ns);
        steps.push(Step { piece, way_m, truth, odometry: *odometry });
        let odometry = map_from_odom.map(|m| m.compose(odometry));
        let [laser, landmarks] = &walkers;
        let found = [odometry, laser.position(way_m), landmarks.position(way_m)];
        let Some(cell) = learnt.cell(&truth) else { continue };
        for (evidence, pose) in cell.iter_mut().zip(found) {
            evidence.step(seconds, pose.map(|pose| aligned(&pose, &truth)).as_ref());
        }
    }
    learnt.way_m = way_m;
    steps
}

/// Error of a pose, robot-aligned.
fn aligned(pose: &Pose2, truth: &Pose2) -> Vector3<f64> {
    map_from_aligned(truth.theta_rad).transpose() * pose.minus(truth)
}

/// Adds the error of every fix; a passage ends where another cell begins.
fn measured_fixes(run: &ReferenceRun<'_>, learnt: &mut RunStats) {
    let r = run.reference;
    for module in [Modality::Laser, Modality::Landmarks] {
        let of_module = run.fixes.iter().filter(|(_, fix)| Modality::from(fix.modality) == module);
        let mut found: Vec<(Pose2, Vector3<f64>, Vector3<f64>)> = Vec::new();
        for (at_ns, fix) in of_module {
            let Some(truth) = r.at(*at_ns) else {
                learnt.unknown_fixes += 1;
                continue;
            };
            let turn = map_from_aligned(truth.theta_rad);
            let claimed = (turn.transpose() * fix.pose.covariance * turn).diagonal();
            let variances = Vector3::new(
                claimed.x + r.sigma_m * r.sigma_m + LEAST[0] * LEAST[0],
                claimed.y + r.sigma_m * r.sigma_m + LEAST[0] * LEAST[0],
                claimed.z + r.sigma_rad * r.sigma_rad + LEAST[1] * LEAST[1],
            );
            found.push((truth, aligned(&fix.pose.pose, &truth), variances));
        }
        visits(module, &found, learnt);
    }
}

/// Adds the error of odometry over stretches of a metre.
fn measured_odometry(steps: &[Step], r: &ReferenceTrajectory, p: &FuseParams, learnt: &mut RunStats) {
    let mut found = Vec::new();
    let mut from = 0;
    for to in steps {
        while from < steps.len()
            && (steps[from].piece < to.piece || to.way_m - steps[from].way_m > STRETCH_M + STEP_M)
        {
            from += 1;
        }
        let start = &steps[from];
        let length_m = to.way_m - start.way_m;
        let (truly, measured) = (start.truth.between(&to.truth), start.odometry.between(&to.odometry));
        // Driving backwards changes the sign of a bias: only forward motion is used.
        if length_m < 0.999 * STRETCH_M || truly.theta_rad.abs() > STRETCH_RAD || measured.x_m <= 0.0 {
            continue;
        }
        let d = measured.minus(&truly);
        let error = Vector3::new(d.x, d.y, wrap_rad(d.z)) / length_m;
        // Both ends have the uncertainty of the reference; the heading error at the start rotates
        // the stretch.
        let (place, heading) = (2.0 * r.sigma_m.powi(2), r.sigma_rad.powi(2));
        let turned = p.turn_per_turn_rad.powi(2) * measured.theta_rad.abs();
        let variances = p.metre_variances() + Vector3::new(place, place + heading, 2.0 * heading + turned);
        let middle = steps[from..].iter().find(|s| s.way_m >= 0.5 * (start.way_m + to.way_m)).unwrap_or(to);
        found.push((middle.truth, error, variances));
    }
    visits(Modality::Odometry, &found, learnt);
}

/// Adds measurements, passage by passage.
fn visits(module: Modality, found: &[(Pose2, Vector3<f64>, Vector3<f64>)], learnt: &mut RunStats) {
    for visit in found.chunk_by(|a, b| PoseCell::of(&a.0) == PoseCell::of(&b.0)) {
        let mut evidence = super::ModalityStats::default();
        for (_, error, variances) in visit {
            evidence.measure(error, variances);
        }
        evidence.end_visit();
        if let Some(cell) = learnt.cell(&visit[0].0) {
            cell[module.index()].add(&evidence);
        }
    }
}
