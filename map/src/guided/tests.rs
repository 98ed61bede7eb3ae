//! A corridor with twelve identical doors and one poster, drawn with the errors that map,
//! extrinsics and prior state.

mod associate;
mod doors;
mod expect;
mod schedule;

use super::*;
use crate::{
    extrinsics::{CameraExtrinsics, pan_tilt},
    place::{LandmarkPlace, PlaceSigmas},
    pose2::{Pose2, Pose2Covariance},
};
use nalgebra::{Matrix2, Matrix3, Matrix6, Point2, Vector2, Vector3, Vector6};
use std::{collections::BTreeMap, f64::consts::FRAC_PI_2};
use vision::{
    frame::{Distortion, Intrinsics},
    geometry::Corners,
    model::LandmarkId,
    pose::{
        LandmarkSize,
        reprojection::{MIN_DEPTH_M, corner_points, perturbed},
    },
    random::Random,
};

const IMAGE_PX: [f64; 2] = [640.0, 480.0];
const DOORS: u64 = 12;
const POSTER: LandmarkId = LandmarkId(100);
/// Distance of the wall with the doors from the robot's path.
const WALL_M: f64 = 4.0;
const CORNER_PX: f64 = 0.5;

fn camera() -> Intrinsics {
    Intrinsics::new(512.0, 512.0, 319.5, 239.5, Distortion::None).unwrap()
}

/// Turned left by 60 degrees, towards the wall.
fn mounting() -> CameraExtrinsics {
    CameraExtrinsics::new(pan_tilt(60.0_f64.to_radians(), 0.0, Vector3::new(0.1, 0.02, 1.2))).unwrap()
}

fn on_wall(x_m: f64, z_m: f64, width_m: f64, height_m: f64) -> LandmarkPlace {
    let size = LandmarkSize { width_m, height_m };
    let centre = Vector3::new(x_m, WALL_M, z_m);
    LandmarkPlace::by_hand(centre, -FRAC_PI_2, size, PlaceSigmas::default()).unwrap()
}

/// Doors 1 to 12, and a poster behind the last.
fn corridor(spacing_m: f64) -> BTreeMap<LandmarkId, LandmarkPlace> {
    let door = |i: u64| (LandmarkId(i), on_wall(spacing_m * i as f64, 1.0, 0.9, 2.0));
    let poster = (POSTER, on_wall(spacing_m * 13.0, 1.5, 0.6, 0.84));
    (1..=DOORS).map(door).chain([poster]).collect()
}

fn known(places: &BTreeMap<LandmarkId, LandmarkPlace>) -> Vec<KnownLandmark<'_>> {
    places
        .iter()
        .map(|(landmark, place)| KnownLandmark { landmark: *landmark, place, visible: None })
        .collect()
}

fn prior(pose: Pose2, sigma_m: f64, sigma_deg: f64) -> Pose2Covariance {
    let sigmas = Vector3::new(sigma_m, sigma_m, sigma_deg.to_radians());
    Pose2Covariance::new(pose, Matrix3::from_diagonal(&sigmas.component_mul(&sigmas))).unwrap()
}

fn draw6(covariance: &Matrix6<f64>, random: &mut Random) -> Vector6<f64> {
    covariance.cholesky().unwrap().l() * Vector6::from_fn(|_, _| random.normal())
}

fn draw3(covariance: &Matrix3<f64>, random: &mut Random) -> Vector3<f64> {
    covariance.cholesky().unwrap().l() * Vector3::from_fn(|_, _| random.normal())
}

/// A true place, drawn from the covariance of the map's `place`.
fn drawn_place(place: &LandmarkPlace, random: &mut Random) -> LandmarkPlace {
    let e = draw6(&place.covariance, random);
    let size = LandmarkSize { width_m: place.size.width_m + e[4], height_m: place.size.height_m + e[5] };
    let (x_m, y_m, z_m) = (place.x_m + e[0], place.y_m + e[1], place.z_m + e[3]);
    LandmarkPlace { x_m, y_m, z_m, theta_rad: place.theta_rad + e[2], size, ..*place }
}

/// True extrinsics, drawn from the covariance of the stated ones.
fn drawn_mounting(mounting: &CameraExtrinsics, random: &mut Random) -> CameraExtrinsics {
    let e = draw6(&mounting.covariance, random);
    let (turn, shift) = (e.fixed_rows::<3>(0).into(), e.fixed_rows::<3>(3).into());
    CameraExtrinsics {
        robot_from_camera: perturbed(&mounting.robot_from_camera, &turn, &shift),
        ..mounting.clone()
    }
}

/// Corners in an image by the camera model alone; `None` when one is behind the camera.
fn project(
    pose: &Pose2,
    place: &LandmarkPlace,
    mounting: &CameraExtrinsics,
    camera: &Intrinsics,
) -> Option<[Point2<f64>; 4]> {
    let map_from_camera = pose.to_isometry3() * mounting.robot_from_camera;
    let camera_from_landmark = map_from_camera.inverse() * place.map_from_landmark();
    let mut px = [Point2::origin(); 4];
    for (px, corner) in px.iter_mut().zip(corner_points(&place.size)) {
        let p = camera_from_landmark.rotation * corner + camera_from_landmark.translation.vector;
        if p.z <= MIN_DEPTH_M {
            return None;
        }
        *px = camera.project(&p);
    }
    Some(px)
}

fn is_inside(px: &Point2<f64>) -> bool {
    px.x >= -0.5 && px.y >= -0.5 && px.x <= IMAGE_PX[0] - 0.5 && px.y <= IMAGE_PX[1] - 0.5
}

/// Corners of all true places in full view, with noise.
fn full_views(
    pose: &Pose2,
    places: &BTreeMap<LandmarkId, LandmarkPlace>,
    mounting: &CameraExtrinsics,
    random: &mut Random,
) -> Vec<(LandmarkId, Corners)> {
    let mut made = Vec::new();
    for (landmark, place) in places {
        let Some(px) = project(pose, place, mounting, &camera()) else { continue };
        let Ok(corners) = Corners::new(px) else { continue };
        if !px.iter().all(is_inside) || corners.min_side_px() < 30.0 {
            continue;
        }
        let noisy = px.map(|p| p + Vector2::new(random.normal(), random.normal()) * CORNER_PX);
        made.push((*landmark, Corners::new(noisy).unwrap()));
    }
    made
}

/// An observation of a door has all doors as candidates; that of the poster only the poster.
fn observation(landmark: LandmarkId, corners: Corners) -> Observation {
    let candidate = |landmark, picture_nats| Candidate { landmark, picture_nats, prior_nats: 0.0 };
    let candidates = if landmark == POSTER {
        vec![candidate(POSTER, 30.0)]
    } else {
        (1..=DOORS).map(|i| candidate(LandmarkId(i), 8.0)).collect()
    };
    Observation::new(corners, &[Matrix2::identity() * CORNER_PX.powi(2); 4], candidates)
}

fn expectations(prior: &Pose2Covariance, places: &BTreeMap<LandmarkId, LandmarkPlace>) -> Expectations {
    let (mounting, intrinsics) = (mounting(), camera());
    let view = CameraView { mounting: &mounting, intrinsics: &intrinsics, image_px: IMAGE_PX };
    super::expect(prior, &view, &known(places), &[], &ExpectParams::default()).unwrap()
}
