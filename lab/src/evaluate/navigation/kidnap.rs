//! A kidnapped robot: it is carried forwards while its odometry stands still, so that its fused
//! pose is wrong. True odometry in; odometry without the displacement out, and counts until the
//! pose is right again or given up.

use map::pose2::{Pose2, Pose2Covariance};
use serde::Serialize;

/// Robots are kidnapped this long after their first pose.
const AFTER_S: f64 = 8.0;
/// Error below which the pose is right again.
const RIGHT_M: f64 = 0.3;

/// Outcome for a kidnapped robot.
#[derive(Debug, Clone, Default, Serialize)]
pub(super) struct KidnapOutcome {
    /// Frames that showed an active landmark in full view, up to the one that ended the wrong pose.
    pub(super) frames: usize,
    /// The pose was given up or is right again.
    pub(super) is_found_out: bool,
    /// Wrong names by guided recognition with the wrong pose.
    pub(super) misled: usize,
}

/// Kidnaps a robot once.
#[derive(Debug)]
pub(super) struct Kidnap {
    by_m: f64,
    first_fix_s: Option<f64>,
    /// Displacement that odometry missed: reported pose from the pose it would report.
    missed: Option<Pose2>,
    pub(super) outcome: Option<KidnapOutcome>,
}

impl Kidnap {
    /// Carried `by_m` forwards; 0: never.
    pub(super) fn new(by_m: f64) -> Self {
        Self { by_m, first_fix_s: None, missed: None, outcome: None }
    }

    /// Reported odometry at `time_s` for true odometry `odom_from_robot`.
    pub(super) fn odometry(&mut self, time_s: f64, odom_from_robot: Pose2) -> Pose2 {
        let is_due = self.first_fix_s.is_some_and(|first| time_s >= first + AFTER_S);
        if self.by_m != 0.0 && self.missed.is_none() && is_due {
            let back = Pose2::new(-self.by_m, 0.0, 0.0);
            self.missed = Some(odom_from_robot.compose(&back).compose(&odom_from_robot.inverse()));
            self.outcome = Some(KidnapOutcome::default());
        }
        self.missed.map_or(odom_from_robot, |missed| missed.compose(&odom_from_robot))
    }

    /// Counts a frame at `time_s`: whether it shows an active landmark, wrong names by the pose,
    /// and fused and true pose after it.
    pub(super) fn count_frame(
        &mut self,
        time_s: f64,
        (shows, misled): (bool, usize),
        (fused, truth): (Option<&Pose2Covariance>, &Pose2),
    ) {
        self.first_fix_s = self.first_fix_s.or(fused.map(|_| time_s));
        let Some(outcome) = self.outcome.as_mut().filter(|c| !c.is_found_out) else { return };
        outcome.frames += usize::from(shows);
        outcome.misled += misled;
        let off_m = |f: &Pose2Covariance| (f.pose.position() - truth.position()).norm();
        outcome.is_found_out = fused.is_none_or(|f| off_m(f) < RIGHT_M);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix3;

    fn at(x_m: f64) -> Pose2Covariance {
        Pose2Covariance { pose: Pose2::new(x_m, 0.0, 0.0), covariance: Matrix3::identity() }
    }

    #[test]
    fn odometry_misses_the_displacement_and_frames_count_until_the_pose_is_right() {
        let mut kidnap = Kidnap::new(2.0);
        let heading = std::f64::consts::FRAC_PI_2;
        assert_eq!(kidnap.odometry(0.0, Pose2::new(1.0, 1.0, heading)), Pose2::new(1.0, 1.0, heading));
        kidnap.count_frame(0.0, (true, 0), (Some(&at(0.0)), &Pose2::new(0.0, 0.0, 0.0)));
        assert!(kidnap.outcome.is_none());
        let moved = kidnap.odometry(9.0, Pose2::new(1.0, 5.0, heading));
        assert!((moved.x_m - 1.0).abs() < 1e-12 && (moved.y_m - 3.0).abs() < 1e-12, "{moved:?}");
        let truth = Pose2::new(2.0, 0.0, 0.0);
        kidnap.count_frame(9.0, (false, 0), (Some(&at(0.0)), &truth));
        kidnap.count_frame(9.5, (true, 1), (Some(&at(0.0)), &truth));
        kidnap.count_frame(10.0, (true, 0), (Some(&at(1.9)), &truth));
        kidnap.count_frame(10.5, (true, 1), (Some(&at(0.0)), &truth));
        let outcome = kidnap.outcome.as_ref().unwrap();
        assert_eq!((outcome.frames, outcome.misled, outcome.is_found_out), (2, 1, true));
        let later = kidnap.odometry(11.0, Pose2::new(1.0, 6.0, heading));
        assert!((later.y_m - 4.0).abs() < 1e-12, "{later:?}");
    }

    #[test]
    fn a_robot_that_is_not_kidnapped_keeps_its_odometry() {
        let mut kidnap = Kidnap::new(0.0);
        kidnap.count_frame(0.0, (true, 0), (Some(&at(0.0)), &Pose2::new(0.0, 0.0, 0.0)));
        assert_eq!(kidnap.odometry(99.0, Pose2::new(3.0, 0.0, 0.0)), Pose2::new(3.0, 0.0, 0.0));
        assert!(kidnap.outcome.is_none());
    }
}
