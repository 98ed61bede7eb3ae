//! Late fixes and readings, and the bounds of the replay window.

use crate::{
    fuse::{
        fuser::{Fuser, MAX_EVENTS},
        outcome::{FixOutcome, OdometryOutcome},
        params::FuseParams,
        tests::{SECOND, drive, eager, fix},
    },
    pose2::Pose2,
};

#[test]
fn a_late_fix_has_the_same_effect_as_one_in_time() {
    let run = |late: bool| {
        let mut fuser = Fuser::new(eager());
        drive(&mut fuser, 0.0);
        fuser.apply_fix(0, &fix(1, Pose2::default(), 0.05, 0.01)).unwrap();
        let between = fix(2, Pose2::new(0.56, 0.01, 0.11), 0.03, 0.01);
        for i in 1..=12_i64 {
            if i == 6 && !late {
                assert_eq!(fuser.apply_fix(55 * SECOND / 100, &between).unwrap(), FixOutcome::Waiting);
            }
            fuser.apply_odometry(i * SECOND / 10, Pose2::new(i as f64 * 0.1, 0.0, 0.02 * i as f64)).unwrap();
        }
        if late {
            let outcome = fuser.apply_fix(55 * SECOND / 100, &between).unwrap();
            assert!(matches!(outcome, FixOutcome::Applied { .. }), "{outcome:?}");
        }
        fuser.pose().unwrap()
    };
    let (a, b) = (run(false), run(true));
    assert_eq!((a.corrections, a.at_ns), (2, b.at_ns));
    assert_eq!(b.corrections, 2);
    assert!(a.pose.pose.minus(&b.pose.pose).norm() < 1e-12);
    assert!((a.pose.covariance - b.pose.covariance).norm() < 1e-12);
    // 55 ms after a reading lies half-way to the next: the fix of x = 0.56 at odometry 0.55 moved
    // the pose forward.
    assert!(a.pose.pose.x_m > 1.17, "{a:?}");
}

#[test]
fn odometry_out_of_order_is_put_in_order() {
    let mut straight = Fuser::new(eager());
    let mut shuffled = Fuser::new(eager());
    for i in [0, 1, 2, 3, 4, 5_i64] {
        straight.apply_odometry(i * SECOND / 10, Pose2::new(i as f64 * 0.1, 0.0, 0.1 * i as f64)).unwrap();
    }
    for i in [0, 2, 1, 5, 3, 4_i64] {
        shuffled.apply_odometry(i * SECOND / 10, Pose2::new(i as f64 * 0.1, 0.0, 0.1 * i as f64)).unwrap();
    }
    for fuser in [&mut straight, &mut shuffled] {
        fuser.apply_fix(SECOND / 10, &fix(1, Pose2::new(3.0, 0.0, 0.0), 0.05, 0.01)).unwrap();
    }
    assert_eq!(straight.pose(), shuffled.pose());
    assert_eq!(straight.apply_odometry(SECOND / 10, Pose2::default()).unwrap(), OdometryOutcome::TooOld);
}

#[test]
fn events_older_than_the_window_are_refused() {
    let mut fuser = Fuser::new(eager());
    drive(&mut fuser, 5.0);
    let f = fix(1, Pose2::new(3.0, 0.0, 0.0), 0.05, 0.01);
    assert_eq!(fuser.apply_fix(29 * SECOND / 10 - 1, &f).unwrap(), FixOutcome::TooOld);
    assert_eq!(fuser.apply_fix(3 * SECOND, &f).unwrap(), FixOutcome::Started);
    assert!((fuser.pose().unwrap().pose.pose.x_m - 5.0).abs() < 1e-9);
    // A fix before the first odometry is always refused.
    let mut empty = Fuser::new(eager());
    assert_eq!(empty.apply_fix(-5, &f).unwrap(), FixOutcome::Waiting);
    drive(&mut empty, 0.0);
    assert_eq!(empty.pose(), None);
    empty.apply_odometry(SECOND, Pose2::new(0.1, 0.0, 0.0)).unwrap();
    assert_eq!(empty.pose(), None);
    assert_eq!(empty.apply_fix(SECOND, &f).unwrap(), FixOutcome::Started);
}

#[test]
fn the_prior_of_a_frame_is_the_pose_at_its_time() {
    let mut fuser = Fuser::new(eager());
    drive(&mut fuser, 0.0);
    fuser.apply_fix(0, &fix(1, Pose2::new(4.0, 0.0, 0.0), 0.05, 0.01)).unwrap();
    drive(&mut fuser, 1.0);
    let at = fuser.pose_at(45 * SECOND / 100).unwrap();
    assert!(at.pose.minus(&Pose2::new(4.45, 0.0, 0.0)).norm() < 1e-9);
    assert_eq!(fuser.pose_at(SECOND), Some(fuser.pose().unwrap().pose));
    assert_eq!(fuser.pose_at(SECOND + 1), None, "odometry has not come that far");
    assert_eq!(fuser.pose_at(-1), None);
}

#[test]
fn memory_is_bounded() {
    let mut fuser = Fuser::new(FuseParams { window_s: 1e6, ..eager() });
    for i in 0..(MAX_EVENTS as i64 + 300) {
        fuser.apply_odometry(i * SECOND / 100, Pose2::default()).unwrap();
    }
    assert!(fuser.events.len() <= MAX_EVENTS);
    for i in 0..(MAX_EVENTS as i64 + 300) {
        fuser.apply_fix(3600 * SECOND + i, &fix(i as u64, Pose2::default(), 0.05, 0.01)).unwrap();
        assert!(fuser.events.len() <= MAX_EVENTS);
    }
    let mut many = Fuser::new(eager());
    drive(&mut many, 0.0);
    for i in 0..50 {
        many.apply_fix(0, &fix(i, Pose2::default(), 0.05, 0.01)).unwrap();
    }
    let pose = many.pose().unwrap();
    assert_eq!(pose.corrections, 50);
    assert!(pose.pose.covariance.cholesky().is_some());
}
