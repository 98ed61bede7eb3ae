//! The paper's corridor in small (method 18, E10): camera, fix and fusion together; all that is
//! uncertain is drawn anew.

use crate::{
    extrinsics::{CameraExtrinsics, pan_tilt},
    fuse::{fuser::Fuser, params::FuseParams},
    localise::{FixResult, LandmarkObservation, LocaliseParams, robot_pose},
    place::{LandmarkPlace, PlaceSigmas, SharedErrors, SurveyId},
    pose2::Pose2,
};
use nalgebra::{Matrix2, Matrix6, Point2, Vector2, Vector3, Vector6};
use std::f64::consts::FRAC_PI_2;
use vision::{
    frame::{Distortion, Intrinsics},
    geometry::Corners,
    model::LandmarkId,
    pose::{
        LandmarkSize, landmark_pose,
        reprojection::{corner_points, perturbed, pixel},
    },
    random::Random,
};

const SIZE: LandmarkSize = LandmarkSize { width_m: 0.6, height_m: 0.84 };
const SIGMA_PX: f64 = 0.5;

/// Posters on the walls at y = 1.2 and -1.2.
fn hung() -> Vec<LandmarkPlace> {
    let place = |i: usize| {
        let (y, theta) = if i.is_multiple_of(2) { (1.2, -FRAC_PI_2) } else { (-1.2, FRAC_PI_2) };
        let centre = Vector3::new(4.0 + 6.0 * i as f64, y, 1.5);
        LandmarkPlace::by_hand(centre, theta, SIZE, PlaceSigmas::default()).unwrap()
    };
    (0..4).map(place).collect()
}

/// Places with errors as stated, and the errors `shared`, which all have in common.
fn drawn(places: &[LandmarkPlace], shared: &Matrix6<f64>, random: &mut Random) -> Vec<LandmarkPlace> {
    let in_common = shared * Vector6::from_fn(|_, _| random.normal());
    let mut draw = |p: &LandmarkPlace| {
        let e = p.covariance.map_diagonal(f64::sqrt).map(|s| s * random.normal()) + in_common;
        let size = LandmarkSize { width_m: p.size.width_m + e[4], height_m: p.size.height_m + e[5] };
        let (x_m, y_m, z_m) = (p.x_m + e[0], p.y_m + e[1], p.z_m + e[3]);
        LandmarkPlace { x_m, y_m, z_m, theta_rad: p.theta_rad + e[2], size, ..*p }
    };
    places.iter().map(&mut draw).collect()
}

/// 25 m along x; each poster is observed from 1 to 4 m ahead by a camera turned to its wall. All
/// places have the errors `shared` in common, which the map may know of. Mean squared error along
/// the corridor after the first fix, NEES at the end, corrections.
fn corridor(shared: &Matrix6<f64>, is_known: bool, random: &mut Random) -> (f64, f64, u64) {
    let camera = Intrinsics::new(500.0, 500.0, 320.0, 240.0, Distortion::None).unwrap();
    let places = hung();
    let true_places = drawn(&places, shared, random);
    let stated = SharedErrors { survey: SurveyId(7), by: *shared };
    let whole = |p: LandmarkPlace| LandmarkPlace {
        covariance: p.covariance + shared * shared.transpose(),
        shared: is_known.then_some(stated),
        ..p
    };
    let places: Vec<LandmarkPlace> = places.into_iter().map(whole).collect();
    let base = CameraExtrinsics::new(pan_tilt(0.0, 0.0, Vector3::new(0.1, 0.0, 1.3))).unwrap();
    let wrong = base.covariance.map_diagonal(f64::sqrt).map(|s| s * random.normal());
    let params = FuseParams::default();
    let mut fuser = Fuser::new(params.clone());
    let (mut truth, mut odom) = (Pose2::new(1.0, 0.1, 0.0), Pose2::default());
    let (mut squares, mut n) = (0.0, 0.0);
    for i in 0..230_i64 {
        let motion = Pose2::new(0.1, 0.0, 0.0);
        let noise = params.motion_noise(&motion).map_diagonal(f64::sqrt);
        let drawn = noise.map(|s| s * random.normal());
        (truth, odom) = (truth.compose(&motion.plus(&drawn)), odom.compose(&motion));
        // The robot keeps to the middle: the commanded turn is measured, with noise.
        let steer = Pose2::new(0.0, 0.0, -0.1 * truth.y_m - 0.3 * truth.theta_rad);
        (truth, odom) = (truth.compose(&steer), odom.compose(&steer));
        let at = i * 200_000_000;
        fuser.apply_odometry(at, odom).unwrap();
        let ahead = (0..4).find(|&l| (1.0..4.0).contains(&(places[l].x_m - truth.x_m)));
        if let Some(l) = ahead.filter(|_| i % 3 == 0) {
            let pan = if places[l].y_m > 0.0 { 0.6 } else { -0.6 };
            let believed = CameraExtrinsics {
                robot_from_camera: pan_tilt(pan, 0.0, Vector3::new(0.1, 0.0, 1.3)),
                covariance: base.covariance,
            };
            let (turn, shift) = (wrong.fixed_rows::<3>(0).into(), wrong.fixed_rows::<3>(3).into());
            let mounted = perturbed(&believed.robot_from_camera, &turn, &shift);
            let view =
                mounted.inverse() * truth.to_isometry3().inverse() * true_places[l].map_from_landmark();
            let points = corner_points(&true_places[l].size).map(|p| {
                let noise = Vector2::new(random.normal(), random.normal()) * SIGMA_PX;
                pixel(&view, &p, &camera).map_or(Point2::new(-1e3, 0.0), |px| px + noise)
            });
            let inside = |p: &Point2<f64>| (0.0..640.0).contains(&p.x) && (0.0..480.0).contains(&p.y);
            if !points.iter().all(inside) {
                continue;
            }
            let claimed = [Matrix2::identity() * SIGMA_PX * SIGMA_PX; 4];
            let seen = landmark_pose(&Corners::new(points).unwrap(), &claimed, SIZE, &camera).unwrap();
            let observation =
                LandmarkObservation { landmark: LandmarkId(l as u64), seen: &seen, place: &places[l] };
            let prior = fuser.pose_at(at);
            let answer = robot_pose(&[observation], &believed, prior.as_ref(), &LocaliseParams::default());
            if let FixResult::Fixed(fix) = answer.unwrap() {
                fuser.apply_fix(at, &fix).unwrap();
            }
        }
        if let Some(fused) = fuser.pose() {
            squares += (fused.pose.pose.x_m - truth.x_m).powi(2);
            n += 1.0;
        }
    }
    let fused = fuser.pose().unwrap();
    let e = fused.pose.pose.minus(&truth);
    let nees = e.dot(&fused.pose.covariance.cholesky().unwrap().solve(&e));
    (squares / n, nees, fused.corrections)
}

#[test]
fn the_error_along_the_corridor_is_below_twenty_centimetres() {
    let mut random = Random::new(1);
    let (mut squares, mut nees, drives) = (0.0, 0.0, 60);
    for _ in 0..drives {
        let (s, e, corrections) = corridor(&Matrix6::zeros(), false, &mut random);
        assert!(corrections >= 8, "{corrections}");
        (squares, nees) = (squares + s, nees + e);
    }
    let (rms, nees) = ((squares / f64::from(drives)).sqrt(), nees / f64::from(drives));
    // Paper: below 20 cm along the corridor. NEES: 99 % band of the mean of 60 draws, 3 degrees of
    // freedom.
    assert!(rms < 0.2, "{rms} m along");
    assert!((2.25..3.85).contains(&nees), "{nees}");
}

#[test]
fn what_all_places_have_in_common_does_not_average_out() {
    // The map is shifted by 8 cm and turned by 0.2 degrees.
    let shared = Matrix6::from_diagonal(&Vector6::new(0.08, 0.08, 0.0035, 0.0, 0.0, 0.0));
    let mean = |is_known| {
        let mut random = Random::new(2);
        (0..60).map(|_| corridor(&shared, is_known, &mut random).1).sum::<f64>() / 60.0
    };
    let (known, unknown) = (mean(true), mean(false));
    assert!((2.25..3.85).contains(&known), "{known}");
    assert!(unknown > 4.5, "{unknown}");
}
