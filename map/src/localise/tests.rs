//! Exact poses, derivatives against differences, consistent covariance by Monte Carlo, the planar
//! ambiguity, refusals.

mod derivatives;
mod covariance;
mod camera_pose;
mod refusal_causes;
mod wrong_intrinsics;

use crate::{
    extrinsics::{CameraExtrinsics, pan_tilt},
    localise::{
        fix::{AmbiguityResolvedBy, Fix, FixRefusal, FixResult, LandmarkObservation},
        params::LocaliseParams,
        robot_pose::{MAX_OBSERVATIONS, robot_pose},
    },
    place::{LandmarkPlace, PlaceSigmas},
    pose2::{Pose2, Pose2Covariance},
};
use nalgebra::{Isometry3, Matrix2, Matrix3, Matrix6, Point2, Vector2, Vector3, Vector6};
use vision::{
    frame::{Distortion, Intrinsics, IntrinsicsSigmas},
    geometry::Corners,
    model::LandmarkId,
    pose::{
        LandmarkPose, LandmarkSize, landmark_pose,
        reprojection::{corner_points, pixel},
    },
    random::Random,
};

pub(super) const SIZE: LandmarkSize = LandmarkSize { width_m: 0.6, height_m: 0.84 };

pub(super) fn camera() -> Intrinsics {
    Intrinsics::new(700.0, 700.0, 320.0, 240.0, Distortion::None).unwrap()
}

pub(super) fn mounting() -> CameraExtrinsics {
    CameraExtrinsics::new(pan_tilt(0.0, 0.05, Vector3::new(0.1, 0.02, 1.2))).unwrap()
}

pub(super) fn place() -> LandmarkPlace {
    LandmarkPlace::by_hand(Vector3::new(5.0, 3.0, 1.5), -2.2, SIZE, PlaceSigmas::default()).unwrap()
}

/// A robot at `d_m` and azimuth `psi_deg` from the landmark's normal, looking at it.
pub(super) fn robot(place: &LandmarkPlace, d_m: f64, psi_deg: f64) -> Pose2 {
    let a = place.theta_rad + psi_deg.to_radians();
    Pose2::new(place.x_m + d_m * a.cos(), place.y_m + d_m * a.sin(), a + std::f64::consts::PI)
}

/// The pose of a landmark measured by the camera; `None` if a corner is behind it.
pub(super) fn observe(
    robot: &Pose2,
    place: &LandmarkPlace,
    robot_from_camera: &Isometry3<f64>,
    sigma_px: f64,
    random: &mut Random,
) -> Option<LandmarkPose> {
    let camera_from_landmark =
        robot_from_camera.inverse() * robot.to_isometry3().inverse() * place.map_from_landmark();
    observe_by(&camera(), &camera(), &camera_from_landmark, place.size, sigma_px, random)
}

/// The pose measured by the `real` camera with the `stated` intrinsics.
pub(super) fn observe_by(
    real: &Intrinsics,
    stated: &Intrinsics,
    camera_from_landmark: &Isometry3<f64>,
    size: LandmarkSize,
    sigma_px: f64,
    random: &mut Random,
) -> Option<LandmarkPose> {
    let mut points = [Point2::origin(); 4];
    for (px, point) in points.iter_mut().zip(corner_points(&size)) {
        let noise = Vector2::new(random.normal(), random.normal()) * sigma_px;
        *px = pixel(camera_from_landmark, &point, real)? + noise;
    }
    let claimed = [Matrix2::identity() * sigma_px.max(0.01).powi(2); 4];
    landmark_pose(&Corners::new(points).ok()?, &claimed, SIZE, stated).ok()
}

/// 1 % and 4 px.
pub(super) fn stated() -> Intrinsics {
    camera().with_sigmas(IntrinsicsSigmas { focal_px: 7.0, center_px: 4.0 }).unwrap()
}

/// The camera with errors (share of the focal length, cx, cy).
pub(super) fn off(e: &Vector3<f64>) -> Intrinsics {
    let (k, share) = (camera(), 1.0 + e.x);
    let (fx_px, fy_px) = (k.fx_px * share, k.fy_px * share);
    Intrinsics { fx_px, fy_px, cx_px: k.cx_px + e.y, cy_px: k.cy_px + e.z, ..k }
}

pub(super) fn observation<'a>(
    id: u64,
    seen: &'a LandmarkPose,
    place: &'a LandmarkPlace,
) -> LandmarkObservation<'a> {
    LandmarkObservation { landmark: LandmarkId(id), seen, place }
}

pub(super) fn draw(covariance: &Matrix6<f64>, random: &mut Random) -> Vector6<f64> {
    covariance.cholesky().unwrap().l() * Vector6::from_fn(|_, _| random.normal())
}

pub(super) fn moved(place: &LandmarkPlace, e: &Vector6<f64>) -> LandmarkPlace {
    let size = LandmarkSize { width_m: place.size.width_m + e[4], height_m: place.size.height_m + e[5] };
    LandmarkPlace {
        x_m: place.x_m + e[0],
        y_m: place.y_m + e[1],
        theta_rad: place.theta_rad + e[2],
        z_m: place.z_m + e[3],
        size,
        ..*place
    }
}

pub(super) fn fixed(answer: FixResult) -> Fix {
    match answer {
        FixResult::Fixed(fix) => *fix,
        other => panic!("{other:?}"),
    }
}

pub(super) fn fix_of(
    seen: &LandmarkPose,
    place: &LandmarkPlace,
    prior: Option<&Pose2Covariance>,
) -> FixResult {
    robot_pose(&[observation(1, seen, place)], &mounting(), prior, &LocaliseParams::default()).unwrap()
}

pub(super) fn nees(fix: &Fix, truth: &Pose2) -> f64 {
    let e = fix.pose.pose.minus(truth);
    e.dot(&fix.pose.covariance.cholesky().unwrap().solve(&e))
}

#[test]
fn exact_corners_give_the_exact_pose() {
    let mut random = Random::new(1);
    for (d, psi) in [(1.5, 30.0), (3.0, -50.0), (5.0, 70.0), (2.0, 0.0), (4.0, -20.0)] {
        let truth = robot(&place(), d, psi);
        let seen = observe(&truth, &place(), &mounting().robot_from_camera, 0.0, &mut random).unwrap();
        let fix = fixed(fix_of(&seen, &place(), None));
        // The mean of the posterior differs from its peak by the curvature of the problem.
        let sigma = fix.pose.covariance.diagonal().map(f64::sqrt);
        let e = fix.pose.pose.minus(&truth);
        assert!((0..3).all(|k| e[k].abs() < 0.1 * sigma[k]), "{d} {psi}: {e} {sigma}");
        assert!(fix.chi2 < 1e-6);
        assert_eq!((fix.dof, &fix.landmarks), (5, &vec![LandmarkId(1)]));
    }
}

/// A distant oblique view whose two solutions fit equally: only a prior decides.
fn undecided(random: &mut Random) -> (Pose2, LandmarkPose) {
    let truth = robot(&place(), 6.0, 20.0);
    loop {
        let seen = observe(&truth, &place(), &mounting().robot_from_camera, 1.5, random).unwrap();
        if matches!(fix_of(&seen, &place(), None), FixResult::Ambiguous(_)) {
            return (truth, seen);
        }
    }
}

#[test]
fn an_ambiguity_is_resolved_by_the_prior_only() {
    let mut random = Random::new(6);
    for _ in 0..20 {
        let (truth, seen) = undecided(&mut random);
        let around = |pose: Pose2, xy: f64, theta: f64| {
            let v = Vector3::new(xy * xy, xy * xy, theta * theta);
            Pose2Covariance::new(pose, Matrix3::from_diagonal(&v)).unwrap()
        };
        match fix_of(&seen, &place(), Some(&around(truth, 0.3, 0.05))) {
            FixResult::Fixed(fix) => {
                assert_eq!(fix.decided_by, AmbiguityResolvedBy::Prior);
                assert!(nees(&fix, &truth) < 25.0);
            }
            other => panic!("{other:?}"),
        }
        // A wide prior decides nothing.
        let vague = fix_of(&seen, &place(), Some(&around(truth, 50.0, 3.0)));
        assert!(matches!(vague, FixResult::Ambiguous(_)), "{vague:?}");
        // A prior elsewhere refuses both.
        let elsewhere = around(truth.plus(&Vector3::new(30.0, 0.0, 0.0)), 0.3, 0.05);
        let refused = fix_of(&seen, &place(), Some(&elsewhere));
        let FixResult::Refused(FixRefusal::Prior { nearest, distance2, limit }) = refused else {
            panic!("{refused:?}")
        };
        assert!(distance2 > limit && nearest.distance2(&elsewhere) == Some(distance2), "{nearest:?}");
    }
}

#[test]
fn a_second_landmark_reduces_the_covariance_and_resolves_the_ambiguity() {
    let mut random = Random::new(8);
    let first = place();
    let second = LandmarkPlace { x_m: first.x_m + 0.8, y_m: first.y_m - 1.1, z_m: 1.8, ..first };
    let truth = robot(&first, 6.0, 20.0);
    let sight = |place: &LandmarkPlace, random: &mut Random| {
        observe(&truth, place, &mounting().robot_from_camera, 1.0, random).unwrap()
    };
    let (mut sum, mut sharper) = (0.0, 0);
    for _ in 0..50 {
        let (a, b) = (sight(&first, &mut random), sight(&second, &mut random));
        let both = [observation(1, &a, &first), observation(2, &b, &second)];
        let fix = fixed(robot_pose(&both, &mounting(), None, &LocaliseParams::default()).unwrap());
        assert_eq!(fix.dof, 13);
        sum += nees(&fix, &truth);
        let alone = fix_of(&a, &first, None);
        let wide = |f: &Fix| f.pose.covariance[(0, 0)] + f.pose.covariance[(1, 1)];
        sharper += usize::from(match alone {
            FixResult::Fixed(one) => wide(&one) > wide(&fix),
            _ => true,
        });
        // Order does not matter.
        let swapped = [both[1], both[0]];
        let again = fixed(robot_pose(&swapped, &mounting(), None, &LocaliseParams::default()).unwrap());
        assert!(again.pose.pose.minus(&fix.pose.pose).norm() < 1e-4);
    }
    assert!(sharper >= 45, "{sharper}");
    assert!(sum / 50.0 < 3.9, "{}", sum / 50.0);
}

#[test]
fn contradictory_landmarks_and_places_are_refused() {
    let mut random = Random::new(9);
    let truth = robot(&place(), 2.5, 30.0);
    let seen = observe(&truth, &place(), &mounting().robot_from_camera, 0.5, &mut random).unwrap();
    // Its place is half a metre too high: no floor pose fits.
    let raised = LandmarkPlace { z_m: 2.0, ..place() };
    let answer = fix_of(&seen, &raised, None);
    assert!(matches!(answer, FixResult::Refused(FixRefusal::ReprojectionError { .. })), "{answer:?}");
    // Of two landmarks one was moved by a metre.
    let other = LandmarkPlace { x_m: place().x_m + 0.9, y_m: place().y_m - 0.6, ..place() };
    let b = observe(&truth, &other, &mounting().robot_from_camera, 0.5, &mut random).unwrap();
    let claimed = LandmarkPlace { x_m: other.x_m + 0.8, y_m: other.y_m - 0.6, ..other };
    let home = place();
    let both = [observation(1, &seen, &home), observation(2, &b, &claimed)];
    let answer = robot_pose(&both, &mounting(), None, &LocaliseParams::default()).unwrap();
    assert!(matches!(answer, FixResult::Refused(FixRefusal::Disagree { .. })), "{answer:?}");
}

#[test]
fn invalid_numbers_are_refused_with_their_field() {
    let mut random = Random::new(10);
    let truth = robot(&place(), 2.5, 30.0);
    let seen = observe(&truth, &place(), &mounting().robot_from_camera, 0.5, &mut random).unwrap();
    let p = LocaliseParams::default();
    assert_eq!(robot_pose(&[], &mounting(), None, &p).unwrap_err().field, "observations");
    let home = place();
    let nowhere = LandmarkPlace { y_m: f64::NAN, ..place() };
    let with = |place: &LandmarkPlace, mounting: &CameraExtrinsics, prior: Option<&Pose2Covariance>| {
        robot_pose(&[observation(1, &seen, place)], mounting, prior, &p).unwrap_err().field
    };
    assert_eq!(with(&nowhere, &mounting(), None), "y_m");
    let mut loose = mounting();
    loose.robot_from_camera.translation.vector.x = f64::INFINITY;
    assert_eq!(with(&home, &loose, None), "robot_from_camera.translation");
    let prior = Pose2Covariance { pose: truth, covariance: -Matrix3::identity() };
    assert_eq!(with(&home, &mounting(), Some(&prior)), "covariance");
    // More observations than are used.
    let many = vec![observation(1, &seen, &home); MAX_OBSERVATIONS + 3];
    match robot_pose(&many, &mounting(), None, &p).unwrap() {
        FixResult::Fixed(fix) => assert_eq!(fix.landmarks.len(), MAX_OBSERVATIONS),
        other => panic!("{other:?}"),
    }
}

#[test]
fn the_fix_moves_with_the_map_frame() {
    // Symmetry: the same world in another map frame.
    let mut random = Random::new(11);
    let truth = robot(&place(), 3.0, 35.0);
    let seen = observe(&truth, &place(), &mounting().robot_from_camera, 0.5, &mut random).unwrap();
    let fix = fixed(fix_of(&seen, &place(), None));
    let shift = Pose2::new(-7.0, 11.0, 2.5);
    let at = shift.compose(&Pose2::new(place().x_m, place().y_m, place().theta_rad));
    let elsewhere = LandmarkPlace { x_m: at.x_m, y_m: at.y_m, theta_rad: at.theta_rad, ..place() };
    let other = fixed(fix_of(&seen, &elsewhere, None));
    assert!(shift.compose(&fix.pose.pose).minus(&other.pose.pose).norm() < 1e-6);
    assert!((fix.pose.covariance.determinant() / other.pose.covariance.determinant() - 1.0).abs() < 1e-3);
}
