//! What guided fixes may do to a pose, and how far a pose is trusted.

use super::*;
use v1::PoseTrust;

const DOOR: LandmarkId = LandmarkId(1);
const POSTER: LandmarkId = LandmarkId(2);

fn of(landmark: LandmarkId, x_m: f64) -> Fix {
    let mut fix = fix(x_m);
    fix.landmarks = vec![landmark];
    fix
}

/// A robot whose x is 7 m more than its odometry says.
pub(super) struct Robot {
    pub(super) motion: MotionTracker,
    pub(super) r1: Name,
    pub(super) seconds: u64,
}

impl Robot {
    pub(super) fn new() -> Self {
        let (motion, r1) = motion();
        Self { motion, r1, seconds: 0 }
    }

    /// One second and half a metre later, a frame with these fixes.
    pub(super) fn frame(&mut self, independent: Option<&Fix>, guided: Option<&Fix>) -> Option<v1::RobotPose> {
        self.seconds += 1;
        let x_m = 0.5 * self.seconds as f64;
        self.motion.odometry_of(&self.r1, odometry(self.seconds, x_m));
        let at = at(self.seconds as i64 * 1_000_000_000, x_m);
        let prior = self.motion.prior_pose(&self.r1, &front(), at).map(|prior| prior.pose);
        let fixed = independent.map(|fix| FixResult::Fixed(Box::new(fix.clone())));
        let fixes = FrameFixes {
            prior: prior.as_ref(),
            independent: fixed.as_ref(),
            chosen: independent,
            guided,
            missed: &[],
            only_expected: false,
        };
        self.motion.apply_frame(&self.r1, &front(), at, &fixes)
    }

    fn plan(&self) -> bool {
        let at = at(self.seconds as i64 * 1_000_000_000, 0.5 * self.seconds as f64);
        self.motion.prior_pose(&self.r1, &front(), at).unwrap().plan.guided
    }

    pub(super) fn total(&self, modality: &str, outcome: &str) -> u64 {
        let log = self.motion.corrections(&self.r1);
        log.totals.get(modality).and_then(|ends| ends.get(outcome)).copied().unwrap_or(0)
    }
}

#[test]
fn a_guided_fix_starts_nothing() {
    let mut robot = Robot::new();
    for _ in 0..5 {
        assert_eq!(robot.frame(None, Some(&of(DOOR, 8.0))), None);
    }
    assert!(robot.motion.pose(&robot.r1, "hall", time(5.0)).is_none());
}

#[test]
fn a_guided_fix_corrects_a_supported_pose_and_is_no_support() {
    let mut robot = Robot::new();
    let pose = robot.frame(Some(&of(POSTER, 7.5)), None).unwrap();
    assert_eq!(
        (pose.trust(), pose.modalities.as_slice()),
        (PoseTrust::Supported, &["odometry".into(), "landmarks".into()][..])
    );
    // Odometry alone gives 8.0.
    let pose = robot.frame(None, Some(&of(DOOR, 8.02))).unwrap();
    let x_m = pose.map_from_robot.unwrap().pose.unwrap().x_m;
    assert!(x_m > 8.003 && x_m < 8.02, "{x_m}");
    assert_eq!(pose.modalities, ["odometry", "landmarks", "guided"]);
    assert_eq!((robot.total("guided", "applied"), robot.total("landmarks", "started")), (1, 1));
    // After 30 frames, or 10 m, only guided fixes have agreed with it.
    let mut last = None;
    for _ in 0..40 {
        let x_m = 7.0 + 0.5 * (robot.seconds + 1) as f64;
        last = robot.frame(None, Some(&of(DOOR, x_m)));
    }
    let pose = last.unwrap();
    assert_eq!(pose.trust(), PoseTrust::Stale);
    assert_eq!(pose.modalities, ["odometry", "guided"]);
}

#[test]
fn while_a_landmark_contradicts_the_pose_nothing_guided_is_searched_for_or_used() {
    let mut robot = Robot::new();
    robot.frame(Some(&of(POSTER, 7.5)), None).unwrap();
    assert!(robot.plan());
    // Three metres off.
    let pose = robot.frame(Some(&of(LandmarkId(9), 11.0)), Some(&of(DOOR, 8.0))).unwrap();
    assert_eq!((pose.trust(), robot.total("guided", "applied")), (PoseTrust::Contradicted, 0));
    assert!(!robot.plan());
    // Another landmark agrees with the first: the pose was wrong.
    for x_m in [11.5, 12.0, 12.5] {
        robot.frame(Some(&of(LandmarkId(10), x_m)), None);
    }
    let pose = robot.motion.pose(&robot.r1, "hall", time(5.0)).unwrap();
    assert!((pose.pose.x_m - 12.5).abs() < 0.1, "{pose:?}");
    assert!(robot.plan());
}

#[test]
fn a_solution_that_the_pose_chose_corrects_it_and_is_no_support() {
    let mut robot = Robot::new();
    robot.frame(Some(&of(POSTER, 7.5)), None).unwrap();
    let mut last = None;
    for _ in 0..40 {
        let x_m = 7.0 + 0.5 * (robot.seconds + 1) as f64;
        let chosen = Fix { decided_by: AmbiguityResolvedBy::Prior, ..of(LandmarkId(robot.seconds), x_m) };
        last = robot.frame(Some(&chosen), None);
    }
    assert_eq!(last.unwrap().trust(), PoseTrust::Stale);
    assert!(robot.total("guided", "applied") > 30);
}
