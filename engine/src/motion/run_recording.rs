//! A recording: the odometry and the fixes of one robot during a drive, in memory, until somebody
//! gives its reference trajectory, cancels it, or the server stops. In: what the robot's fusion
//! gets. Out: the same, in order of capture.

use map::{
    localise::{Fix, FixSource},
    modality_stats::{ReferenceRun, ReferenceTrajectory},
    pose2::Pose2,
};
use std::sync::atomic::{AtomicU64, Ordering};

/// Recordings at a time.
pub const MAX_RECORDINGS: usize = 8;
/// Fixes of one recording; each takes about 3 kB.
pub const MAX_RUN_FIXES: usize = 20_000;
/// Odometry readings of one recording.
pub const MAX_RUN_ODOMETRY: usize = 200_000;
/// A reading is added after this motion...
const STEP_M: f64 = 0.01;
/// ...or this turn.
const STEP_RAD: f64 = 0.01;

static NEXT: AtomicU64 = AtomicU64::new(0);

/// Status of a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordingStatus {
    /// Name of the map that the robot was on.
    pub map: String,
    /// Name of the robot.
    pub robot: String,
    /// False once it is full, a new epoch began, the robot went to another map, its odometry
    /// jumped, or its clock was set. What was recorded until then can be learnt from.
    pub active: bool,
    /// Why it is not active any more.
    pub reason: Option<String>,
    /// Distance driven by odometry, m.
    pub distance_m: f64,
    /// Time of the first and the last reading of odometry, ns of the robot's clock; absent before
    /// the first.
    pub span_ns: Option<[i64; 2]>,
    /// Odometry readings in it.
    pub odometry: usize,
    /// Fixes by landmarks.
    pub landmarks: usize,
    /// Fixes by the laser.
    pub laser: usize,
}

/// Why a recording cannot start or be learnt from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum RecordingError {
    /// The robot has a recording.
    #[error("a run of this robot is being recorded already")]
    AlreadyRecording,
    /// Too many at a time.
    #[error("{MAX_RECORDINGS} runs are being recorded already")]
    TooMany,
    /// It is being learnt from.
    #[error("the run of this robot is being learnt from already")]
    Lent,
    /// There is none.
    #[error("no run of this robot is being recorded")]
    None,
}

/// A recording.
#[derive(Debug, Clone)]
pub struct RunRecording {
    /// Unique since the start of the server.
    pub(super) number: u64,
    /// It is being learnt from.
    pub(super) lent: bool,
    /// Name of the map that the robot was on.
    pub map: String,
    /// Capture time (ns) and reading (odom frame); times rise.
    pub(super) odometry: Vec<(i64, Pose2)>,
    fixes: Vec<(i64, Fix)>,
    ended: Option<&'static str>,
    distance_m: f64,
}

impl RunRecording {
    pub(super) fn new(map: &str) -> Self {
        let number = NEXT.fetch_add(1, Ordering::Relaxed);
        Self {
            number,
            lent: false,
            map: map.to_owned(),
            odometry: Vec::new(),
            fixes: Vec::new(),
            ended: None,
            distance_m: 0.0,
        }
    }

    /// Ends it; the first reason stays.
    pub(super) fn end(&mut self, reason: &'static str) {
        self.ended.get_or_insert(reason);
    }

    /// Adds an odometry reading if it is newer and the robot has moved.
    pub(super) fn add_odometry(&mut self, at_ns: i64, odom_from_robot: Pose2) {
        let Some((last_ns, last)) = self.odometry.last() else {
            if self.ended.is_none() {
                self.odometry.push((at_ns, odom_from_robot));
            }
            return;
        };
        let motion = last.between(&odom_from_robot);
        let is_still = motion.position().norm() < STEP_M && motion.theta_rad.abs() < STEP_RAD;
        if self.ended.is_some() || at_ns <= *last_ns || is_still {
            return;
        }
        if self.odometry.len() == MAX_RUN_ODOMETRY {
            self.end("full");
            return;
        }
        self.distance_m += motion.position().norm();
        self.odometry.push((at_ns, odom_from_robot));
    }

    /// Adds a fix, whatever became of it.
    pub(super) fn add_fix(&mut self, at_ns: i64, fix: &Fix) {
        if self.ended.is_some() {
            return;
        }
        if self.fixes.len() == MAX_RUN_FIXES {
            self.end("full");
            return;
        }
        self.fixes.push((at_ns, fix.clone()));
    }

    /// Odometry and fixes, each in order of capture, with the reference trajectory.
    pub fn with_reference<'a>(&'a mut self, reference: &'a ReferenceTrajectory) -> ReferenceRun<'a> {
        self.fixes.sort_by_key(|(at_ns, _)| *at_ns);
        ReferenceRun { odometry: &self.odometry, fixes: &self.fixes, reference }
    }

    pub(super) fn status(&self, robot: &str) -> RecordingStatus {
        let fixes_by = |modality| self.fixes.iter().filter(|(_, fix)| fix.modality == modality).count();
        let span_ns = self.odometry.first().zip(self.odometry.last()).map(|(a, b)| [a.0, b.0]);
        RecordingStatus {
            map: self.map.clone(),
            robot: robot.to_owned(),
            active: self.ended.is_none(),
            reason: self.ended.map(str::to_owned),
            distance_m: self.distance_m,
            span_ns,
            odometry: self.odometry.len(),
            landmarks: fixes_by(FixSource::Landmarks),
            laser: fixes_by(FixSource::Laser),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use map::{localise::AmbiguityResolvedBy, pose2::Pose2Covariance};
    use nalgebra::Matrix3;

    fn fix(modality: FixSource) -> Fix {
        let covariance = Matrix3::identity() * 1e-4;
        Fix {
            modality,
            pose: Pose2Covariance { pose: Pose2::default(), covariance },
            noise: covariance,
            nuisances: Vec::new(),
            landmarks: Vec::new(),
            decided_by: AmbiguityResolvedBy::Single,
            chi2: 1.0,
            dof: 5,
        }
    }

    #[test]
    fn a_recording_drops_what_is_not_new_and_is_in_order_of_capture() {
        let mut run = RunRecording::new("hall");
        for (at_ns, x_m) in [(10, 0.0), (20, 0.005), (30, 0.02), (25, 0.5), (40, 0.04)] {
            run.add_odometry(at_ns, Pose2::new(x_m, 0.0, 0.0));
        }
        assert_eq!(run.odometry.iter().map(|(t, _)| *t).collect::<Vec<_>>(), [10, 30, 40]);
        run.add_fix(35, &fix(FixSource::Laser));
        run.add_fix(12, &fix(FixSource::Landmarks));
        let reference =
            ReferenceTrajectory::new(vec![(0, Pose2::default()), (1, Pose2::default())], 0.0, 0.0).unwrap();
        assert_eq!(
            run.with_reference(&reference).fixes.iter().map(|(t, _)| *t).collect::<Vec<_>>(),
            [12, 35]
        );
        let status = run.status("r1");
        assert!((status.distance_m - 0.04).abs() < 1e-12);
        assert_eq!(
            (status.span_ns, status.odometry, status.landmarks, status.laser),
            (Some([10, 40]), 3, 1, 1)
        );
        run.end("odometry jumped");
        run.end("full");
        run.add_odometry(50, Pose2::new(9.0, 0.0, 0.0));
        run.add_fix(50, &fix(FixSource::Laser));
        let after = run.status("r1");
        assert_eq!((after.active, after.reason.as_deref()), (false, Some("odometry jumped")));
        assert_eq!((after.odometry, after.laser), (3, 1));
    }

    #[test]
    fn a_recording_is_bounded() {
        let mut run = RunRecording::new("hall");
        for i in 0..=MAX_RUN_FIXES as i64 {
            run.add_fix(i, &fix(FixSource::Laser));
        }
        assert_eq!((run.fixes.len(), run.ended), (MAX_RUN_FIXES, Some("full")));
        let mut run = RunRecording::new("hall");
        for i in 0..=MAX_RUN_ODOMETRY as i64 {
            run.add_odometry(i, Pose2::new(0.02 * i as f64, 0.0, 0.0));
        }
        assert_eq!((run.odometry.len(), run.ended), (MAX_RUN_ODOMETRY, Some("full")));
    }
}
