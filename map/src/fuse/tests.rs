//! Batch least squares, simulated drives with drawn places and extrinsics, late arrivals,
//! contradictions, bounds.

mod corridor_drive;
mod gate;
mod laser_drive;
mod odometry;
mod replay;

use crate::{
    fuse::{
        fuser::Fuser,
        outcome::{FixOutcome, OdometryOutcome},
        params::FuseParams,
    },
    localise::{AmbiguityResolvedBy, Fix, FixSource, Nuisance, NuisanceKey},
    pose2::{Pose2, Pose2Covariance},
};
use nalgebra::{DMatrix, DVector, Matrix3, Matrix3x2, Matrix3x6, Matrix6, Vector3, Vector6};
use vision::{model::LandmarkId, random::Random};

pub(super) const SECOND: i64 = 1_000_000_000;

/// A fix as `localise` gives it: `noise_m` new in every frame, and the landmark's place within
/// `place_m`.
pub(super) fn fix(landmark: u64, pose: Pose2, noise_m: f64, place_m: f64) -> Fix {
    let noise = Matrix3::from_diagonal(&Vector3::new(noise_m, noise_m, 0.2 * noise_m).map(|v| v * v));
    let p = place_m * place_m;
    let covariance = Matrix6::from_diagonal(&Vector6::new(p, p, 1e-4 * p, p, 1e-6, 1e-6));
    let mut jacobian = Matrix3x6::zeros();
    // An error of the place moves the fix with it, and turns it about the landmark, 3 m ahead.
    jacobian.fixed_view_mut::<2, 2>(0, 0).fill_with_identity();
    jacobian[(1, 2)] = -3.0;
    jacobian[(2, 2)] = 1.0;
    let jacobian = -jacobian;
    let total = noise + jacobian * covariance * jacobian.transpose();
    Fix {
        modality: FixSource::Landmarks,
        pose: Pose2Covariance::new(pose, total).unwrap(),
        noise,
        nuisances: vec![Nuisance { key: NuisanceKey::Landmark(LandmarkId(landmark)), jacobian, covariance }],
        landmarks: vec![LandmarkId(landmark)],
        decided_by: AmbiguityResolvedBy::Single,
        chi2: 5.0,
        dof: 5,
    }
}

pub(super) fn eager() -> FuseParams {
    FuseParams { min_move_m: 0.0, min_turn_rad: 0.0, ..FuseParams::default() }
}

/// Odometry along x at 1 m/s, ten times a second, up to `until_s`.
pub(super) fn drive(fuser: &mut Fuser, until_s: f64) {
    for i in 0..=(until_s * 10.0) as i64 {
        let outcome = fuser.apply_odometry(i * SECOND / 10, Pose2::new(i as f64 * 0.1, 0.0, 0.0)).unwrap();
        assert_ne!(outcome, OdometryOutcome::Jumped);
    }
}

#[test]
fn there_is_no_pose_before_the_first_fix_or_a_given_start() {
    let mut fuser = Fuser::new(FuseParams::default());
    drive(&mut fuser, 1.0);
    assert_eq!(fuser.pose(), None);
    let outcome = fuser.apply_fix(SECOND, &fix(1, Pose2::new(5.0, 2.0, 0.1), 0.05, 0.01)).unwrap();
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
    // Oracle: all poses, both places and odometry's errors in one weighted least-squares problem.
    // Errors are a millionth of their sigma, so that every derivative is taken at the same point
    // and the two must agree to rounding.
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
        fuser.apply_odometry(i as i64 * SECOND, odom).unwrap();
        let e = Vector3::from_fn(|_, _| 1e-7 * random.normal());
        let made = fix(1 + (i as u64 / 3) % 2, truth.plus(&e), 0.05, 0.03);
        let mut j = DMatrix::zeros(3, unknowns);
        j.view_mut((0, 3 * i), (3, 3)).fill_with_identity();
        j.view_mut((0, 3 * (steps + 1) + 6 * ((i / 3) % 2)), (3, 6)).copy_from(&made.nuisances[0].jacobian);
        add(j, DVector::from_iterator(3, e.iter().copied()), dynamic(&made.noise.try_inverse().unwrap()));
        fuser.apply_fix(i as i64 * SECOND, &made).unwrap();
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
fn a_hundred_fixes_do_not_undercut_the_covariance_of_the_place() {
    let mut fuser = Fuser::new(eager());
    drive(&mut fuser, 0.0);
    for _ in 0..100 {
        fuser.apply_fix(0, &fix(1, Pose2::default(), 0.05, 0.03)).unwrap();
    }
    let sigma = fuser.pose().unwrap().pose.covariance[(0, 0)].sqrt();
    assert!((0.03..0.031).contains(&sigma), "{sigma}");
    // A second landmark does add something.
    fuser.apply_fix(0, &fix(2, Pose2::default(), 0.05, 0.03)).unwrap();
    assert!(fuser.pose().unwrap().pose.covariance[(0, 0)].sqrt() < 0.029);
}

/// A simulated drive: the truth, odometry drawn from its own model, fixes with drawn places. NEES
/// at the end.
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
        assert_eq!(fuser.apply_odometry(at, odom).unwrap(), OdometryOutcome::Moved);
        if i % 3 == 0 {
            let l = (i / 30) as usize % 4;
            let mut made = fix(l as u64, truth, 0.05, 0.02);
            let v = made.noise.map_diagonal(f64::sqrt);
            let v = v.component_mul(&Vector3::new(random.normal(), random.normal(), random.normal()));
            let j = made.nuisances[0].jacobian.fixed_columns::<3>(0).into_owned();
            made.pose.pose = truth.plus(&(v + j * places[l]));
            fuser.apply_fix(at, &made).unwrap();
        }
    }
    let fused = fuser.pose().unwrap().pose;
    let e = fused.pose.minus(&truth);
    e.dot(&fused.covariance.cholesky().unwrap().solve(&e))
}

#[test]
fn the_fused_covariance_is_consistent() {
    let mut random = Random::new(2);
    let n = 150;
    let mean = (0..n).map(|_| drive_at_random(&mut random)).sum::<f64>() / f64::from(n);
    // 99 % band of the mean of 150 draws with 3 degrees of freedom: 2.51 to 3.54.
    assert!((2.51..3.54).contains(&mean), "{mean}");
}

#[test]
fn an_outlier_is_gated_out_and_a_kidnapped_robot_recovers() {
    let mut fuser = Fuser::new(FuseParams::default());
    drive(&mut fuser, 0.0);
    fuser.apply_fix(0, &fix(1, Pose2::default(), 0.05, 0.01)).unwrap();
    let before = fuser.pose().unwrap();
    let away = |i: i64, l| fix(l, Pose2::new(9.0 + 0.1 * i as f64, 4.0, 0.0), 0.05, 0.01);
    let outcome = fuser.apply_fix(0, &away(0, 2)).unwrap();
    assert!(matches!(outcome, FixOutcome::GatedOut { in_a_row: 1, .. }), "{outcome:?}");
    let after = fuser.pose().unwrap();
    assert_eq!((after.pose, after.corrections, after.contradictions), (before.pose, 1, 1));
    // A single wrong landmark never replaces the pose...
    for i in 1..20 {
        fuser.apply_odometry(i * SECOND / 10, Pose2::new(i as f64 * 0.1, 0.0, 0.0)).unwrap();
        let outcome = fuser.apply_fix(i * SECOND / 10, &away(i, 2)).unwrap();
        assert!(matches!(outcome, FixOutcome::GatedOut { .. }), "{outcome:?}");
    }
    // ...a second one that agrees with it does.
    fuser.apply_odometry(2 * SECOND, Pose2::new(2.0, 0.0, 0.0)).unwrap();
    assert_eq!(fuser.apply_fix(2 * SECOND, &away(20, 3)).unwrap(), FixOutcome::Reset);
    let found = fuser.pose().unwrap();
    assert!(found.pose.pose.minus(&Pose2::new(11.0, 4.0, 0.0)).norm() < 1e-9);
    assert_eq!(found.contradictions, 0);
}

#[test]
fn contradictions_that_disagree_do_not_add_up() {
    let mut fuser = Fuser::new(FuseParams::default());
    drive(&mut fuser, 0.0);
    fuser.apply_fix(0, &fix(1, Pose2::default(), 0.05, 0.01)).unwrap();
    for i in 1..30_i64 {
        fuser.apply_odometry(i * SECOND / 10, Pose2::new(i as f64 * 0.1, 0.0, 0.0)).unwrap();
        let wild = fix(i as u64, Pose2::new(5.0 + 3.0 * (i % 7) as f64, -4.0, 1.0), 0.05, 0.01);
        let outcome = fuser.apply_fix(i * SECOND / 10, &wild).unwrap();
        assert!(matches!(outcome, FixOutcome::GatedOut { in_a_row: 1, .. }), "{outcome:?}");
    }
    // One agreeing fix clears the count.
    let good = fix(1, Pose2::new(2.9, 0.0, 0.0), 0.05, 0.01);
    assert!(matches!(fuser.apply_fix(29 * SECOND / 10, &good).unwrap(), FixOutcome::Applied { .. }));
    assert_eq!(fuser.pose().unwrap().contradictions, 0);
}

#[test]
fn repeated_fixes_of_a_standing_robot_add_nothing() {
    let mut fuser = Fuser::new(FuseParams::default());
    drive(&mut fuser, 0.0);
    let view = fix(1, Pose2::default(), 0.05, 0.0);
    fuser.apply_fix(0, &view).unwrap();
    let once = fuser.pose().unwrap();
    for _ in 0..10 {
        assert_eq!(fuser.apply_fix(0, &view).unwrap(), FixOutcome::Repeated);
    }
    assert_eq!(fuser.pose().unwrap(), once);
    assert!(matches!(
        fuser.apply_fix(0, &fix(2, Pose2::default(), 0.05, 0.0)).unwrap(),
        FixOutcome::Applied { .. }
    ));
}

#[test]
fn invalid_numbers_are_refused() {
    let mut fuser = Fuser::new(FuseParams::default());
    assert_eq!(fuser.apply_odometry(0, Pose2::new(f64::NAN, 0.0, 0.0)).unwrap_err().field, "x_m");
    drive(&mut fuser, 0.0);
    let good = fix(1, Pose2::default(), 0.05, 0.01);
    let mut bad = good.clone();
    bad.noise = -bad.noise;
    assert_eq!(fuser.apply_fix(0, &bad).unwrap_err().field, "noise");
    let mut bad = good.clone();
    bad.nuisances[0].jacobian[(0, 0)] = f64::INFINITY;
    assert_eq!(fuser.apply_fix(0, &bad).unwrap_err().field, "nuisance.jacobian");
    let mut bad = good;
    bad.pose.pose.x_m = f64::NAN;
    assert_eq!(fuser.apply_fix(0, &bad).unwrap_err().field, "x_m");
    assert_eq!(fuser.pose(), None);
    // Any time is accepted.
    let mut odd = Fuser::new(FuseParams::default());
    for t in [i64::MIN, i64::MAX, 0, -1, i64::MAX - 1] {
        odd.apply_odometry(t, Pose2::default()).unwrap();
        odd.pose_at(t);
    }
}

#[test]
fn undetermined_directions_stay_undetermined_under_error_models() {
    use super::error_correction;
    use crate::modality_stats::{ErrorModel, Modality, ModalityAdvice};
    let mut seen = fix(1, Pose2::new(1.0, 2.0, 0.3), 0.05, 0.02);
    seen.noise[(0, 0)] += 1e4;
    seen.pose.covariance[(0, 0)] += 1e4;
    let mut advice = ModalityAdvice::default();
    advice.faults[Modality::Landmarks as usize] =
        ErrorModel { bias: Vector3::new(0.0, 0.1, 0.0), excess: Vector3::new(2.0, 2.0, 2.0) };
    let at = Pose2::default();
    let corrected = error_correction::fix(&seen, &at, &advice);
    assert!((corrected.pose.pose.y_m - 1.9).abs() < 1e-12);
    let [lasting] = &corrected.nuisances[..] else { panic!("{corrected:?}") };
    let spread = lasting.jacobian * lasting.covariance * lasting.jacobian.transpose();
    // An undetermined direction is in no nuisance parameter: estimating that would determine it.
    assert!(spread[(0, 0)] < 1.0 && spread[(1, 1)] > 2.0 * 0.0025, "{spread}");
    assert!(corrected.pose.covariance[(1, 1)] > 4.9 * seen.pose.covariance[(1, 1)], "{corrected:?}");
    let total = corrected.noise + spread;
    assert!((total - corrected.pose.covariance).norm() < 1e-6, "{total} {}", corrected.pose.covariance);
    let unchanged = error_correction::fix(&seen, &at, &ModalityAdvice::default());
    assert_eq!(*unchanged, seen);
}
