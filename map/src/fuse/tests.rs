//! Batch least squares, simulated drives with drawn places and mounting, late arrivals, contradictions, bounds.

use super::*;
use crate::localise::{DecidedBy, Modality, Nuisance, NuisanceKey};
use nalgebra::{DMatrix, DVector, Matrix2, Matrix3, Matrix3x2, Matrix3x6, Matrix6, Vector2, Vector6};
use vision::{model::LandmarkId, random::Random};

const SECOND: i64 = 1_000_000_000;

/// A fix as `localise` gives it: `noise_m` new in every frame, and the landmark's place within `place_m`.
pub(super) fn fix(landmark: u64, pose: Pose2, noise_m: f64, place_m: f64) -> Fix {
    let noise = Matrix3::from_diagonal(&Vector3::new(noise_m, noise_m, 0.2 * noise_m).map(|v| v * v));
    let p = place_m * place_m;
    let covariance = Matrix6::from_diagonal(&Vector6::new(p, p, 1e-4 * p, p, 1e-6, 1e-6));
    let mut jacobian = Matrix3x6::zeros();
    // The place moves the fix with it; turned about the landmark, 3 m ahead.
    jacobian.fixed_view_mut::<2, 2>(0, 0).fill_with_identity();
    jacobian[(1, 2)] = -3.0;
    jacobian[(2, 2)] = 1.0;
    let jacobian = -jacobian;
    let total = noise + jacobian * covariance * jacobian.transpose();
    Fix {
        modality: Modality::Landmarks,
        pose: Pose2Covariance::new(pose, total).unwrap(),
        noise,
        nuisances: vec![Nuisance { key: NuisanceKey::Landmark(LandmarkId(landmark)), jacobian, covariance }],
        landmarks: vec![LandmarkId(landmark)],
        decided_by: DecidedBy::Single,
        chi2: 5.0,
        dof: 5,
    }
}

fn eager() -> FuseParams {
    FuseParams { min_move_m: 0.0, min_turn_rad: 0.0, ..FuseParams::default() }
}

/// Odometry along x at 1 m/s, ten times a second, up to `until_s`.
fn drive(fuser: &mut Fuser, until_s: f64) {
    for i in 0..=(until_s * 10.0) as i64 {
        let outcome = fuser.odometry(i * SECOND / 10, Pose2::new(i as f64 * 0.1, 0.0, 0.0)).unwrap();
        assert_ne!(outcome, OdometryOutcome::Jumped);
    }
}

#[test]
fn there_is_no_pose_before_the_first_fix_or_a_given_start() {
    let mut fuser = Fuser::new(FuseParams::default());
    drive(&mut fuser, 1.0);
    assert_eq!(fuser.pose(), None);
    let outcome = fuser.fix(SECOND, &fix(1, Pose2::new(5.0, 2.0, 0.1), 0.05, 0.01)).unwrap();
    assert_eq!(outcome, FixOutcome::Started);
    let fused = fuser.pose().unwrap();
    assert_eq!((fused.at_ns, fused.corrections), (SECOND, 1));
    assert!(fused.pose.pose.minus(&Pose2::new(5.0, 2.0, 0.1)).norm() < 1e-12);
    let mut given = Fuser::new(FuseParams::default());
    drive(&mut given, 1.0);
    given.start(&fused.pose).unwrap();
    let pose = given.pose().unwrap();
    assert_eq!((pose.pose, pose.corrections), (fused.pose, 0));
}

#[test]
fn equals_batch_least_squares() {
    // Oracle: all poses, both places and odometry's errors in one weighted least-squares problem. Errors are a millionth of their sigma,
    // so that every derivative is taken at the same point and the two must agree to rounding.
    let mut random = Random::new(1);
    let p = FuseParams { scale_drift: 0.0, turn_bias_drift_rad_per_m: 0.0, ..eager() };
    let steps = 6;
    let motion = Pose2::new(0.5, 0.0, 0.3);
    let mut truth = Pose2::new(1.0, 2.0, 0.4);
    let mut odom = Pose2::default();
    let mut fuser = Fuser::new(p.clone());
    let unknowns = 3 * (steps + 1) + 12 + 2;
    let lasting = unknowns - 2;
    let (mut h, mut g) = (DMatrix::zeros(unknowns, unknowns), DVector::zeros(unknowns));
    let mut add = |j: DMatrix<f64>, r: DVector<f64>, w: DMatrix<f64>| {
        h += j.transpose() * &w * &j;
        g += j.transpose() * w * r;
    };
    let dynamic = |m: &Matrix3<f64>| DMatrix::from_iterator(3, 3, m.iter().copied());
    for l in 0..2 {
        let mut j = DMatrix::zeros(6, unknowns);
        j.view_mut((0, 3 * (steps + 1) + 6 * l), (6, 6)).fill_with_identity();
        let w = fix(1, truth, 0.05, 0.03).nuisances[0].covariance.try_inverse().unwrap();
        add(j, DVector::zeros(6), DMatrix::from_iterator(6, 6, w.iter().copied()));
    }
    for (k, sigma) in [p.scale_sigma, p.turn_bias_sigma_rad_per_m].into_iter().enumerate() {
        let mut j = DMatrix::zeros(1, unknowns);
        j[(0, lasting + k)] = 1.0;
        add(j, DVector::zeros(1), DMatrix::from_element(1, 1, sigma.powi(-2)));
    }
    for i in 0..=steps {
        if i > 0 {
            let noise = p.motion_noise(&motion);
            let (by_pose, by_motion) = truth.compose_jacobians(&motion);
            let w = (by_motion * noise * by_motion.transpose()).try_inverse().unwrap();
            let mut j = DMatrix::zeros(3, unknowns);
            j.view_mut((0, 3 * i), (3, 3)).fill_with_identity();
            j.view_mut((0, 3 * (i - 1)), (3, 3)).copy_from(&-by_pose);
            let length_m = motion.position().norm();
            let by_errors = by_motion * Matrix3x2::new(motion.x_m, 0.0, motion.y_m, 0.0, 0.0, length_m);
            j.view_mut((0, lasting), (3, 2)).copy_from(&-by_errors);
            add(j, DVector::zeros(3), dynamic(&w));
            (truth, odom) = (truth.compose(&motion), odom.compose(&motion));
        }
        fuser.odometry(i as i64 * SECOND, odom).unwrap();
        let e = Vector3::from_fn(|_, _| 1e-7 * random.normal());
        let made = fix(1 + (i as u64 / 3) % 2, truth.plus(&e), 0.05, 0.03);
        let mut j = DMatrix::zeros(3, unknowns);
        j.view_mut((0, 3 * i), (3, 3)).fill_with_identity();
        j.view_mut((0, 3 * (steps + 1) + 6 * ((i / 3) % 2)), (3, 6)).copy_from(&made.nuisances[0].jacobian);
        add(j, DVector::from_iterator(3, e.iter().copied()), dynamic(&made.noise.try_inverse().unwrap()));
        fuser.fix(i as i64 * SECOND, &made).unwrap();
    }
    let covariance = h.clone().cholesky().unwrap().inverse();
    let solution = &covariance * g;
    let fused = fuser.pose().unwrap();
    let e = fused.pose.pose.minus(&truth);
    let at = 3 * steps;
    for k in 0..3 {
        assert!((e[k] - solution[at + k]).abs() < 1e-11, "{e} {}", solution.rows(at, 3));
        for l in 0..3 {
            let (got, want) = (fused.pose.covariance[(k, l)], covariance[(at + k, at + l)]);
            assert!((got - want).abs() < 1e-6 * covariance[(at, at)], "{k} {l}: {got} {want}");
        }
    }
}

#[test]
fn odometry_learns_its_own_errors() {
    // 24 drives past a landmark every 6 m, by a robot whose odometry is off by a scale and a turn of its own.
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
            fuser.odometry(i * SECOND / 10, odom).unwrap();
            if i % 60 == 0 {
                if let Some(fused) = fuser.pose() {
                    missed_m.push(fused.pose.pose.minus(&truth).fixed_rows::<2>(0).norm());
                }
                let off =
                    Vector3::new(0.01 * random.normal(), 0.01 * random.normal(), 0.002 * random.normal());
                let seen = fix(i as u64, truth.plus(&off), 0.01, 1e-4);
                fuser.fix(i * SECOND / 10, &seen).unwrap();
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
    // The drives have none of the noise that the filter allows for: surer than it claims, but no less.
    assert!(nees / f64::from(drives) < 2.6, "{nees}");
}

#[test]
fn what_odometry_learnt_outlives_a_jump() {
    let mut fuser = Fuser::new(FuseParams::default());
    assert_eq!(fuser.odometry_errors(), None);
    drive(&mut fuser, 1.0);
    let start = Pose2Covariance::new(Pose2::default(), Matrix3::identity() * 1e-4).unwrap();
    fuser.start(&start).unwrap();
    for i in 11..=100 {
        fuser.odometry(i * SECOND / 10, Pose2::new(i as f64 * 0.1, 0.0, 0.0)).unwrap();
    }
    // 9 m by odometry were 9.09 m.
    fuser.fix(10 * SECOND, &fix(1, Pose2::new(9.09, 0.0, 0.0), 0.01, 1e-4)).unwrap();
    let learnt = fuser.odometry_errors().unwrap();
    assert!((0.007..0.01).contains(&learnt.errors.x), "{}", learnt.errors);
    let before: Matrix2<f64> = learnt.covariance;
    assert_eq!(fuser.odometry(11 * SECOND, Pose2::new(900.0, 0.0, 0.0)).unwrap(), OdometryOutcome::Jumped);
    assert_eq!(fuser.pose(), None);
    assert_eq!(fuser.odometry_errors(), Some(learnt));
    fuser.fix(11 * SECOND, &fix(1, Pose2::new(3.0, 0.0, 0.0), 0.01, 1e-4)).unwrap();
    assert_eq!(fuser.odometry_errors().unwrap().covariance, before);
}

#[test]
fn a_hundred_fixes_know_no_more_than_the_map() {
    let mut fuser = Fuser::new(eager());
    drive(&mut fuser, 0.0);
    for _ in 0..100 {
        fuser.fix(0, &fix(1, Pose2::default(), 0.05, 0.03)).unwrap();
    }
    let sigma = fuser.pose().unwrap().pose.covariance[(0, 0)].sqrt();
    assert!((0.03..0.031).contains(&sigma), "{sigma}");
    // A second landmark does add something.
    fuser.fix(0, &fix(2, Pose2::default(), 0.05, 0.03)).unwrap();
    assert!(fuser.pose().unwrap().pose.covariance[(0, 0)].sqrt() < 0.029);
}

/// A simulated drive: the truth, odometry drawn from its own model, fixes with drawn places. NEES at the end.
fn drive_at_random(random: &mut Random) -> f64 {
    let p = FuseParams::default();
    let places: Vec<Vector3<f64>> =
        (0..4).map(|_| Vector3::new(random.normal(), random.normal(), 0.0) * 0.02).collect();
    let (mut truth, mut odom) = (Pose2::new(2.0, 1.0, 0.5), Pose2::default());
    let mut fuser = Fuser::new(p.clone());
    for i in 0..150_i64 {
        let motion = Pose2::new(0.1, 0.0, 0.05 * (i as f64 * 0.1).sin());
        let noise = p.motion_noise(&motion);
        let e = Vector3::new(random.normal(), random.normal(), random.normal());
        let drawn = motion.plus(&noise.map_diagonal(f64::sqrt).component_mul(&e));
        (truth, odom) = (truth.compose(&drawn), odom.compose(&motion));
        let at = i * SECOND / 5;
        assert_eq!(fuser.odometry(at, odom).unwrap(), OdometryOutcome::Moved);
        if i % 3 == 0 {
            let l = (i / 30) as usize % 4;
            let mut made = fix(l as u64, truth, 0.05, 0.02);
            let v = made.noise.map_diagonal(f64::sqrt);
            let v = v.component_mul(&Vector3::new(random.normal(), random.normal(), random.normal()));
            let j = made.nuisances[0].jacobian.fixed_columns::<3>(0).into_owned();
            made.pose.pose = truth.plus(&(v + j * places[l]));
            fuser.fix(at, &made).unwrap();
        }
    }
    let fused = fuser.pose().unwrap().pose;
    let e = fused.pose.minus(&truth);
    e.dot(&fused.covariance.cholesky().unwrap().solve(&e))
}

#[test]
fn the_fused_covariance_is_honest() {
    let mut random = Random::new(2);
    let n = 150;
    let mean = (0..n).map(|_| drive_at_random(&mut random)).sum::<f64>() / f64::from(n);
    // 99 % band of the mean of 150 draws with 3 degrees of freedom: 2.51 to 3.54.
    assert!((2.51..3.54).contains(&mean), "{mean}");
}

#[test]
fn a_late_fix_changes_the_past_as_if_it_had_been_in_time() {
    let run = |late: bool| {
        let mut fuser = Fuser::new(eager());
        drive(&mut fuser, 0.0);
        fuser.fix(0, &fix(1, Pose2::default(), 0.05, 0.01)).unwrap();
        let between = fix(2, Pose2::new(0.56, 0.01, 0.11), 0.03, 0.01);
        for i in 1..=12_i64 {
            if i == 6 && !late {
                assert_eq!(fuser.fix(55 * SECOND / 100, &between).unwrap(), FixOutcome::Waiting);
            }
            fuser.odometry(i * SECOND / 10, Pose2::new(i as f64 * 0.1, 0.0, 0.02 * i as f64)).unwrap();
        }
        if late {
            let outcome = fuser.fix(55 * SECOND / 100, &between).unwrap();
            assert!(matches!(outcome, FixOutcome::Applied { .. }), "{outcome:?}");
        }
        fuser.pose().unwrap()
    };
    let (a, b) = (run(false), run(true));
    assert_eq!((a.corrections, a.at_ns), (2, b.at_ns));
    assert_eq!(b.corrections, 2);
    assert!(a.pose.pose.minus(&b.pose.pose).norm() < 1e-12);
    assert!((a.pose.covariance - b.pose.covariance).norm() < 1e-12);
    // 55 ms after a reading lies half-way to the next: the fix of x = 0.56 at odometry 0.55 moved the pose forward.
    assert!(a.pose.pose.x_m > 1.17, "{a:?}");
}

#[test]
fn odometry_out_of_order_is_put_in_order() {
    let mut straight = Fuser::new(eager());
    let mut shuffled = Fuser::new(eager());
    for i in [0, 1, 2, 3, 4, 5_i64] {
        straight.odometry(i * SECOND / 10, Pose2::new(i as f64 * 0.1, 0.0, 0.1 * i as f64)).unwrap();
    }
    for i in [0, 2, 1, 5, 3, 4_i64] {
        shuffled.odometry(i * SECOND / 10, Pose2::new(i as f64 * 0.1, 0.0, 0.1 * i as f64)).unwrap();
    }
    for fuser in [&mut straight, &mut shuffled] {
        fuser.fix(SECOND / 10, &fix(1, Pose2::new(3.0, 0.0, 0.0), 0.05, 0.01)).unwrap();
    }
    assert_eq!(straight.pose(), shuffled.pose());
    assert_eq!(straight.odometry(SECOND / 10, Pose2::default()).unwrap(), OdometryOutcome::TooOld);
}

#[test]
fn what_is_too_old_is_refused_at_the_bound() {
    let mut fuser = Fuser::new(eager());
    drive(&mut fuser, 5.0);
    let f = fix(1, Pose2::new(3.0, 0.0, 0.0), 0.05, 0.01);
    assert_eq!(fuser.fix(29 * SECOND / 10 - 1, &f).unwrap(), FixOutcome::TooOld);
    assert_eq!(fuser.fix(3 * SECOND, &f).unwrap(), FixOutcome::Started);
    assert!((fuser.pose().unwrap().pose.pose.x_m - 5.0).abs() < 1e-9);
    // A fix before the first odometry can never be placed.
    let mut empty = Fuser::new(eager());
    assert_eq!(empty.fix(-5, &f).unwrap(), FixOutcome::Waiting);
    drive(&mut empty, 0.0);
    assert_eq!(empty.pose(), None);
    empty.odometry(SECOND, Pose2::new(0.1, 0.0, 0.0)).unwrap();
    assert_eq!(empty.pose(), None);
    assert_eq!(empty.fix(SECOND, &f).unwrap(), FixOutcome::Started);
}

#[test]
fn an_outlier_is_left_out_and_a_kidnapped_robot_is_found() {
    let mut fuser = Fuser::new(FuseParams::default());
    drive(&mut fuser, 0.0);
    fuser.fix(0, &fix(1, Pose2::default(), 0.05, 0.01)).unwrap();
    let before = fuser.pose().unwrap();
    let away = |i: i64, l| fix(l, Pose2::new(9.0 + 0.1 * i as f64, 4.0, 0.0), 0.05, 0.01);
    let outcome = fuser.fix(0, &away(0, 2)).unwrap();
    assert!(matches!(outcome, FixOutcome::GatedOut { in_a_row: 1, .. }), "{outcome:?}");
    let after = fuser.pose().unwrap();
    assert_eq!((after.pose, after.corrections, after.contradictions), (before.pose, 1, 1));
    // The same wrong landmark for ever does not win...
    for i in 1..20 {
        fuser.odometry(i * SECOND / 10, Pose2::new(i as f64 * 0.1, 0.0, 0.0)).unwrap();
        let outcome = fuser.fix(i * SECOND / 10, &away(i, 2)).unwrap();
        assert!(matches!(outcome, FixOutcome::GatedOut { .. }), "{outcome:?}");
    }
    // ...a second that agrees does.
    fuser.odometry(2 * SECOND, Pose2::new(2.0, 0.0, 0.0)).unwrap();
    assert_eq!(fuser.fix(2 * SECOND, &away(20, 3)).unwrap(), FixOutcome::Reset);
    let found = fuser.pose().unwrap();
    assert!(found.pose.pose.minus(&Pose2::new(11.0, 4.0, 0.0)).norm() < 1e-9);
    assert_eq!(found.contradictions, 0);
}

#[test]
fn contradictions_that_disagree_do_not_add_up() {
    let mut fuser = Fuser::new(FuseParams::default());
    drive(&mut fuser, 0.0);
    fuser.fix(0, &fix(1, Pose2::default(), 0.05, 0.01)).unwrap();
    for i in 1..30_i64 {
        fuser.odometry(i * SECOND / 10, Pose2::new(i as f64 * 0.1, 0.0, 0.0)).unwrap();
        let wild = fix(i as u64, Pose2::new(5.0 + 3.0 * (i % 7) as f64, -4.0, 1.0), 0.05, 0.01);
        let outcome = fuser.fix(i * SECOND / 10, &wild).unwrap();
        assert!(matches!(outcome, FixOutcome::GatedOut { in_a_row: 1, .. }), "{outcome:?}");
    }
    // One good fix clears the doubt.
    let good = fix(1, Pose2::new(2.9, 0.0, 0.0), 0.05, 0.01);
    assert!(matches!(fuser.fix(29 * SECOND / 10, &good).unwrap(), FixOutcome::Applied { .. }));
    assert_eq!(fuser.pose().unwrap().contradictions, 0);
}

#[test]
fn a_robot_that_stands_learns_nothing_from_the_same_view() {
    let mut fuser = Fuser::new(FuseParams::default());
    drive(&mut fuser, 0.0);
    let view = fix(1, Pose2::default(), 0.05, 0.0);
    fuser.fix(0, &view).unwrap();
    let once = fuser.pose().unwrap();
    for _ in 0..10 {
        assert_eq!(fuser.fix(0, &view).unwrap(), FixOutcome::Repeated);
    }
    assert_eq!(fuser.pose().unwrap(), once);
    assert!(matches!(
        fuser.fix(0, &fix(2, Pose2::default(), 0.05, 0.0)).unwrap(),
        FixOutcome::Applied { .. }
    ));
}

#[test]
fn jumps_of_odometry_lose_the_pose_and_steps_of_the_clock_do_not() {
    let mut fuser = Fuser::new(FuseParams::default());
    drive(&mut fuser, 1.0);
    fuser.fix(SECOND, &fix(1, Pose2::default(), 0.05, 0.01)).unwrap();
    let far = |x| Pose2::new(1.0 + x, 0.0, 0.0);
    // 10 m/s for 0.1 s, and 0.1 s of slack.
    let mut near = fuser.clone();
    assert_eq!(near.odometry(11 * SECOND / 10, far(1.99)).unwrap(), OdometryOutcome::Moved);
    assert_eq!(fuser.odometry(11 * SECOND / 10, far(2.01)).unwrap(), OdometryOutcome::Jumped);
    assert_eq!(fuser.pose(), None);
    assert_eq!(
        fuser.fix(11 * SECOND / 10, &fix(1, Pose2::default(), 0.05, 0.01)).unwrap(),
        FixOutcome::Started
    );
    // A clock that was wrong by an hour is set, back and forth: the pose goes on by odometry.
    let mut set = Fuser::new(FuseParams::default());
    drive(&mut set, 1.0);
    set.fix(SECOND, &fix(1, Pose2::default(), 0.05, 0.01)).unwrap();
    let started = set.pose().unwrap();
    for (at_ns, x) in [(3600 * SECOND, 2.0), (2 * SECOND, 3.0)] {
        assert_eq!(set.set_clock(at_ns, Pose2::new(x, 0.0, 0.0), 1.0).unwrap(), OdometryOutcome::Moved);
        let pose = set.pose().unwrap();
        assert_eq!((pose.at_ns, pose.corrections), (at_ns, 1));
        assert!((pose.pose.pose.x_m - started.pose.pose.x_m - (x - 1.0)).abs() < 1e-9);
        assert!(pose.pose.covariance[(0, 0)] > started.pose.covariance[(0, 0)]);
    }
    assert_eq!(set.odometry(3 * SECOND, Pose2::new(4.0, 0.0, 0.0)).unwrap(), OdometryOutcome::Moved);
    // So far a robot cannot have come meanwhile: it is another odometry frame.
    assert_eq!(set.set_clock(SECOND, Pose2::new(40.0, 0.0, 0.0), 1.0).unwrap(), OdometryOutcome::Jumped);
    assert_eq!(set.pose(), None);
}

/// Fault F2: one reading more than 10 s behind used to lose the pose.
#[test]
fn one_reading_far_behind_loses_nothing() {
    let mut fuser = Fuser::new(FuseParams::default());
    drive(&mut fuser, 5.0);
    fuser.fix(5 * SECOND, &fix(1, Pose2::default(), 0.05, 0.01)).unwrap();
    let before = fuser.pose().unwrap();
    assert_eq!(fuser.odometry(-20 * SECOND, Pose2::new(5.0, 0.0, 0.0)).unwrap(), OdometryOutcome::TooOld);
    assert_eq!(fuser.pose().unwrap(), before);
}

#[test]
fn a_reading_that_is_retracted_was_never_there() {
    let mut with = Fuser::new(FuseParams::default());
    drive(&mut with, 1.0);
    with.fix(SECOND, &fix(1, Pose2::default(), 0.05, 0.01)).unwrap();
    let mut without = with.clone();
    with.odometry(13 * SECOND / 10, Pose2::new(1.05, 0.0, 0.0)).unwrap();
    // It waits for odometry of its time, or is judged by the stray reading.
    let late = fix(2, Pose2::new(0.2, 0.0, 0.0), 0.05, 0.01);
    with.fix(12 * SECOND / 10, &late).unwrap();
    without.fix(12 * SECOND / 10, &late).unwrap();
    with.retract(13 * SECOND / 10);
    for fuser in [&mut with, &mut without] {
        for (tenths, x) in [(11, 1.1), (12, 1.2), (13, 1.3)] {
            fuser.odometry(tenths * SECOND / 10, Pose2::new(x, 0.0, 0.0)).unwrap();
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
    fuser.fix(SECOND, &fix(1, Pose2::default(), 0.05, 0.01)).unwrap();
    // 2 m in a second, stamped 50 ms after the reading before.
    let at_ns = SECOND + SECOND / 20;
    let mut by_stamp = fuser.clone();
    assert_eq!(by_stamp.odometry(at_ns, Pose2::new(3.0, 0.0, 0.0)).unwrap(), OdometryOutcome::Jumped);
    let outcome = fuser.odometry_after(at_ns, Pose2::new(3.0, 0.0, 0.0), 1.0).unwrap();
    assert_eq!(outcome, OdometryOutcome::Moved);
}

#[test]
fn a_newer_reading_with_an_earlier_time_moves_the_pose() {
    let mut fuser = Fuser::new(FuseParams::default());
    drive(&mut fuser, 1.0);
    fuser.fix(SECOND, &fix(1, Pose2::default(), 0.05, 0.01)).unwrap();
    let held = fuser.pose().unwrap();
    let pose = fuser.pose_by(SECOND - 1, &Pose2::new(1.1, 0.0, 0.0)).unwrap();
    assert_eq!((pose.at_ns, pose.corrections), (SECOND - 1, 1));
    assert!((pose.pose.pose.x_m - held.pose.pose.x_m - 0.1).abs() < 1e-9);
    assert_eq!(fuser.pose().unwrap(), held);
}

#[test]
fn the_prior_of_a_frame_is_the_pose_at_its_time() {
    let mut fuser = Fuser::new(eager());
    drive(&mut fuser, 0.0);
    fuser.fix(0, &fix(1, Pose2::new(4.0, 0.0, 0.0), 0.05, 0.01)).unwrap();
    drive(&mut fuser, 1.0);
    let at = fuser.pose_at(45 * SECOND / 100).unwrap();
    assert!(at.pose.minus(&Pose2::new(4.45, 0.0, 0.0)).norm() < 1e-9);
    assert_eq!(fuser.pose_at(SECOND), Some(fuser.pose().unwrap().pose));
    assert_eq!(fuser.pose_at(SECOND + 1), None, "odometry has not come that far");
    assert_eq!(fuser.pose_at(-1), None);
}

#[test]
fn cutting_a_motion_changes_no_noise() {
    let p = FuseParams::default();
    let whole = p.motion_noise(&Pose2::new(0.4, 0.3, 0.0));
    let half = p.motion_noise(&Pose2::new(0.2, 0.15, 0.0));
    assert!((whole - half * 2.0).norm() < 1e-15);
    assert!((p.motion_noise(&Pose2::new(0.0, 0.0, 0.0))).norm() < 1e-15);
}

#[test]
fn memory_is_bounded() {
    let mut fuser = Fuser::new(FuseParams { window_s: 1e6, ..eager() });
    for i in 0..(MAX_EVENTS as i64 + 300) {
        fuser.odometry(i * SECOND / 100, Pose2::default()).unwrap();
    }
    assert!(fuser.events.len() <= MAX_EVENTS);
    for i in 0..(MAX_EVENTS as i64 + 300) {
        fuser.fix(3600 * SECOND + i, &fix(i as u64, Pose2::default(), 0.05, 0.01)).unwrap();
        assert!(fuser.events.len() <= MAX_EVENTS);
    }
    let mut many = Fuser::new(eager());
    drive(&mut many, 0.0);
    for i in 0..50 {
        many.fix(0, &fix(i, Pose2::default(), 0.05, 0.01)).unwrap();
    }
    let pose = many.pose().unwrap();
    assert_eq!(pose.corrections, 50);
    assert!(pose.pose.covariance.cholesky().is_some());
}

#[test]
fn numbers_that_are_none_are_refused() {
    let mut fuser = Fuser::new(FuseParams::default());
    assert_eq!(fuser.odometry(0, Pose2::new(f64::NAN, 0.0, 0.0)).unwrap_err().field, "x_m");
    drive(&mut fuser, 0.0);
    let good = fix(1, Pose2::default(), 0.05, 0.01);
    let mut bad = good.clone();
    bad.noise = -bad.noise;
    assert_eq!(fuser.fix(0, &bad).unwrap_err().field, "noise");
    let mut bad = good.clone();
    bad.nuisances[0].jacobian[(0, 0)] = f64::INFINITY;
    assert_eq!(fuser.fix(0, &bad).unwrap_err().field, "nuisance.jacobian");
    let mut bad = good;
    bad.pose.pose.x_m = f64::NAN;
    assert_eq!(fuser.fix(0, &bad).unwrap_err().field, "x_m");
    assert_eq!(fuser.pose(), None);
    // Any time is a time.
    let mut odd = Fuser::new(FuseParams::default());
    for t in [i64::MIN, i64::MAX, 0, -1, i64::MAX - 1] {
        odd.odometry(t, Pose2::default()).unwrap();
        odd.pose_at(t);
    }
}

#[test]
fn what_is_not_known_stays_so_whatever_runs_have_shown() {
    use super::trust;
    use crate::areas::{Advice, Fault, Module};
    let mut seen = fix(1, Pose2::new(1.0, 2.0, 0.3), 0.05, 0.02);
    seen.noise[(0, 0)] += 1e4;
    seen.pose.covariance[(0, 0)] += 1e4;
    let mut advice = Advice::default();
    advice.faults[Module::Landmarks as usize] =
        Fault { bias: Vector3::new(0.0, 0.1, 0.0), excess: Vector3::new(2.0, 2.0, 2.0) };
    let at = Pose2::default();
    let trusted = trust::fix(&seen, &at, &advice);
    assert!((trusted.pose.pose.y_m - 1.9).abs() < 1e-12);
    let [lasting] = &trusted.nuisances[..] else { panic!("{trusted:?}") };
    let spread = lasting.jacobian * lasting.covariance * lasting.jacobian.transpose();
    // What it did not know is in no error that lasts: learning one would make it known.
    assert!(spread[(0, 0)] < 1.0 && spread[(1, 1)] > 2.0 * 0.0025, "{spread}");
    assert!(trusted.pose.covariance[(1, 1)] > 4.9 * seen.pose.covariance[(1, 1)], "{trusted:?}");
    let total = trusted.noise + spread;
    assert!((total - trusted.pose.covariance).norm() < 1e-6, "{total} {}", trusted.pose.covariance);
    let untouched = trust::fix(&seen, &at, &Advice::default());
    assert_eq!(*untouched, seen);
}
