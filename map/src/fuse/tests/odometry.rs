//! Systematic errors and jumps of odometry, and readings with wrong times.

use crate::{
    fuse::{
        fuser::Fuser,
        outcome::{FixOutcome, OdometryOutcome},
        params::FuseParams,
        tests::{SECOND, drive, fix},
    },
    pose2::{Pose2, Pose2Covariance},
};
use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};
use vision::random::Random;

#[test]
fn systematic_odometry_errors_are_estimated() {
    // 24 drives past a landmark every 6 m, by a robot with a systematic scale and drift of
    // odometry.
    let p = FuseParams::default();
    let mut random = Random::new(5);
    let (mut before, mut after, mut nees, drives) = (0.0, 0.0, 0.0, 24);
    for _ in 0..drives {
        let true_errors =
            Vector2::new(p.scale_sigma * random.normal(), p.turn_bias_sigma_rad_per_m * random.normal());
        let mut fuser = Fuser::new(p.clone());
        let (mut truth, mut odom) = (Pose2::default(), Pose2::default());
        let mut missed_m = Vec::new();
        for i in 0..=240_i64 {
            fuser.apply_odometry(i * SECOND / 10, odom).unwrap();
            if i % 60 == 0 {
                if let Some(fused) = fuser.pose() {
                    missed_m.push(fused.pose.pose.minus(&truth).fixed_rows::<2>(0).norm());
                }
                let off =
                    Vector3::new(0.01 * random.normal(), 0.01 * random.normal(), 0.002 * random.normal());
                let seen = fix(i as u64, truth.plus(&off), 0.01, 1e-4);
                fuser.apply_fix(i * SECOND / 10, &seen).unwrap();
            }
            let measured = Pose2::new(0.1, 0.0, 0.0);
            let turn_rad = 0.1 * true_errors.y;
            odom = odom.compose(&measured);
            truth = truth.compose(&Pose2::new(0.1 * (1.0 + true_errors.x), 0.0, turn_rad));
        }
        (before, after) = (before + missed_m[0], after + missed_m[3]);
        let known = fuser.odometry_errors().unwrap();
        let off = known.errors - true_errors;
        nees += off.dot(&(known.covariance.try_inverse().unwrap() * off));
        assert!(known.covariance[(0, 0)] < 0.15 * p.scale_sigma.powi(2), "{}", known.covariance);
    }
    assert!(after < 0.35 * before, "{after} m before the fourth landmark, {before} m before the second");
    // The drives lack the noise that the filter assumes: errors are smaller than stated, never
    // larger.
    assert!(nees / f64::from(drives) < 2.6, "{nees}");
}

#[test]
fn estimated_odometry_errors_survive_a_jump() {
    let mut fuser = Fuser::new(FuseParams::default());
    assert_eq!(fuser.odometry_errors(), None);
    drive(&mut fuser, 1.0);
    let start = Pose2Covariance::new(Pose2::default(), Matrix3::identity() * 1e-4).unwrap();
    fuser.start(&start).unwrap();
    for i in 11..=100 {
        fuser.apply_odometry(i * SECOND / 10, Pose2::new(i as f64 * 0.1, 0.0, 0.0)).unwrap();
    }
    // 9 m by odometry were 9.09 m.
    fuser.apply_fix(10 * SECOND, &fix(1, Pose2::new(9.09, 0.0, 0.0), 0.01, 1e-4)).unwrap();
    let learnt = fuser.odometry_errors().unwrap();
    assert!((0.007..0.01).contains(&learnt.errors.x), "{}", learnt.errors);
    let before: Matrix2<f64> = learnt.covariance;
    assert_eq!(
        fuser.apply_odometry(11 * SECOND, Pose2::new(900.0, 0.0, 0.0)).unwrap(),
        OdometryOutcome::Jumped
    );
    assert_eq!(fuser.pose(), None);
    assert_eq!(fuser.odometry_errors(), Some(learnt));
    fuser.apply_fix(11 * SECOND, &fix(1, Pose2::new(3.0, 0.0, 0.0), 0.01, 1e-4)).unwrap();
    assert_eq!(fuser.odometry_errors().unwrap().covariance, before);
}

#[test]
fn jumps_of_odometry_lose_the_pose_and_steps_of_the_clock_do_not() {
    let mut fuser = Fuser::new(FuseParams::default());
    drive(&mut fuser, 1.0);
    fuser.apply_fix(SECOND, &fix(1, Pose2::default(), 0.05, 0.01)).unwrap();
    let far = |x| Pose2::new(1.0 + x, 0.0, 0.0);
    // 10 m/s for 0.1 s, and 0.1 s of slack.
    let mut near = fuser.clone();
    assert_eq!(near.apply_odometry(11 * SECOND / 10, far(1.99)).unwrap(), OdometryOutcome::Moved);
    assert_eq!(fuser.apply_odometry(11 * SECOND / 10, far(2.01)).unwrap(), OdometryOutcome::Jumped);
    assert_eq!(fuser.pose(), None);
    assert_eq!(
        fuser.apply_fix(11 * SECOND / 10, &fix(1, Pose2::default(), 0.05, 0.01)).unwrap(),
        FixOutcome::Started
    );
    // A clock that is set by an hour, back and forth: the pose continues by odometry.
    let mut set = Fuser::new(FuseParams::default());
    drive(&mut set, 1.0);
    set.apply_fix(SECOND, &fix(1, Pose2::default(), 0.05, 0.01)).unwrap();
    let started = set.pose().unwrap();
    for (at_ns, x) in [(3600 * SECOND, 2.0), (2 * SECOND, 3.0)] {
        assert_eq!(set.set_clock(at_ns, Pose2::new(x, 0.0, 0.0), 1.0).unwrap(), OdometryOutcome::Moved);
        let pose = set.pose().unwrap();
        assert_eq!((pose.at_ns, pose.corrections), (at_ns, 1));
        assert!((pose.pose.pose.x_m - started.pose.pose.x_m - (x - 1.0)).abs() < 1e-9);
        assert!(pose.pose.covariance[(0, 0)] > started.pose.covariance[(0, 0)]);
    }
    assert_eq!(set.apply_odometry(3 * SECOND, Pose2::new(4.0, 0.0, 0.0)).unwrap(), OdometryOutcome::Moved);
    // Too far for the time between: it is another odometry frame.
    assert_eq!(set.set_clock(SECOND, Pose2::new(40.0, 0.0, 0.0), 1.0).unwrap(), OdometryOutcome::Jumped);
    assert_eq!(set.pose(), None);
}

/// One reading more than 10 s late must not lose the pose.
#[test]
fn one_reading_far_behind_loses_nothing() {
    let mut fuser = Fuser::new(FuseParams::default());
    drive(&mut fuser, 5.0);
    fuser.apply_fix(5 * SECOND, &fix(1, Pose2::default(), 0.05, 0.01)).unwrap();
    let before = fuser.pose().unwrap();
    assert_eq!(
        fuser.apply_odometry(-20 * SECOND, Pose2::new(5.0, 0.0, 0.0)).unwrap(),
        OdometryOutcome::TooOld
    );
    assert_eq!(fuser.pose().unwrap(), before);
}

#[test]
fn a_retracted_reading_has_no_effect() {
    let mut with = Fuser::new(FuseParams::default());
    drive(&mut with, 1.0);
    with.apply_fix(SECOND, &fix(1, Pose2::default(), 0.05, 0.01)).unwrap();
    let mut without = with.clone();
    with.apply_odometry(13 * SECOND / 10, Pose2::new(1.05, 0.0, 0.0)).unwrap();
    // It waits for odometry of its time, or is applied by the stray reading.
    let late = fix(2, Pose2::new(0.2, 0.0, 0.0), 0.05, 0.01);
    with.apply_fix(12 * SECOND / 10, &late).unwrap();
    without.apply_fix(12 * SECOND / 10, &late).unwrap();
    with.retract(13 * SECOND / 10);
    for fuser in [&mut with, &mut without] {
        for (tenths, x) in [(11, 1.1), (12, 1.2), (13, 1.3)] {
            fuser.apply_odometry(tenths * SECOND / 10, Pose2::new(x, 0.0, 0.0)).unwrap();
        }
    }
    assert_eq!(with.pose(), without.pose());
    assert_eq!(with.pose().unwrap().corrections, 2);
    with.retract(77);
    assert_eq!(with.pose(), without.pose());
}

#[test]
fn a_slow_stamp_is_no_jump_if_the_reading_came_later() {
    let mut fuser = Fuser::new(FuseParams::default());
    drive(&mut fuser, 1.0);
    fuser.apply_fix(SECOND, &fix(1, Pose2::default(), 0.05, 0.01)).unwrap();
    // 2 m in a second, stamped 50 ms after the reading before.
    let at_ns = SECOND + SECOND / 20;
    let mut by_stamp = fuser.clone();
    assert_eq!(by_stamp.apply_odometry(at_ns, Pose2::new(3.0, 0.0, 0.0)).unwrap(), OdometryOutcome::Jumped);
    let outcome = fuser.apply_odometry_after(at_ns, Pose2::new(3.0, 0.0, 0.0), 1.0).unwrap();
    assert_eq!(outcome, OdometryOutcome::Moved);
}

#[test]
fn a_newer_reading_with_an_earlier_time_moves_the_pose() {
    let mut fuser = Fuser::new(FuseParams::default());
    drive(&mut fuser, 1.0);
    fuser.apply_fix(SECOND, &fix(1, Pose2::default(), 0.05, 0.01)).unwrap();
    let held = fuser.pose().unwrap();
    let pose = fuser.pose_by(SECOND - 1, &Pose2::new(1.1, 0.0, 0.0)).unwrap();
    assert_eq!((pose.at_ns, pose.corrections), (SECOND - 1, 1));
    assert!((pose.pose.pose.x_m - held.pose.pose.x_m - 0.1).abs() < 1e-9);
    assert_eq!(fuser.pose().unwrap(), held);
}

#[test]
fn cutting_a_motion_changes_no_noise() {
    let p = FuseParams::default();
    let whole = p.motion_noise(&Pose2::new(0.4, 0.3, 0.0));
    let half = p.motion_noise(&Pose2::new(0.2, 0.15, 0.0));
    assert!((whole - half * 2.0).norm() < 1e-15);
    assert!((p.motion_noise(&Pose2::new(0.0, 0.0, 0.0))).norm() < 1e-15);
}
