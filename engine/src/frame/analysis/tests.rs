//! Cameras mounted at any roll.

use super::*;
use crate::{
    frame::{
        fixes::{NoFix, photograph_pose, unique_landmarks},
        guided::recognise_guided,
    },
    localise::{Localisation, LocaliseFrame, LocaliseInput, LocaliseReason, localise},
    scene::Scene,
};
use map::{
    extrinsics::pan_tilt,
    place::LandmarkPlace,
    pose2::{Pose2, Pose2Covariance},
};
use nalgebra::{Isometry3, Matrix3, Point2, Vector3};
use sim::robot::SensorReadings;
use std::{f64::consts::TAU, sync::Arc};
use vision::{frame::GrayImage, geometry::homography::Homography, model::LandmarkId};

/// The first poster that is taught.
const POSTER: LandmarkId = LandmarkId(1);

/// A robot in front of the first poster, its camera turned clockwise about its axis by each of
/// twelve angles.
struct Rolled {
    scene: Scene,
    map: Arc<MapSnapshot>,
    readings: Vec<(f64, SensorReadings)>,
}

impl Rolled {
    fn new() -> Self {
        let mut scene = Scene::new();
        let map = scene.taught();
        let name = map.landmarks[&POSTER].name.clone();
        let stop = scene.stops(5, 1).into_iter().find(|(landmark, _)| *landmark == name).unwrap().1.step;
        let readings = (0..12).map(|i| f64::from(i) * TAU / 12.0).map(|roll_rad| {
            let mut step = stop.clone();
            step.robot_from_camera *= Isometry3::rotation(Vector3::new(0.0, 0.0, roll_rad));
            (roll_rad, scene.look(&step))
        });
        let readings = readings.collect();
        Self { scene, map, readings }
    }

    fn localised(&self, image: &GrayImage, robot_from_camera: &Isometry3<f64>) -> Localisation {
        let (camera, extrinsics) =
            (self.scene.intrinsics(), CameraExtrinsics::new(*robot_from_camera).unwrap());
        let frame = LocaliseFrame { picture: image.into(), camera: &camera, extrinsics: &extrinsics };
        localise(&LocaliseInput { map: &self.map, frame: Some(frame), scan: None }, &|| false)
    }
}

#[test]
fn a_camera_mounted_at_any_roll_gives_the_robots_pose() {
    let rolled = Rolled::new();
    for (roll_rad, readings) in &rolled.readings {
        let found = rolled.localised(&readings.frame.image, &readings.step.robot_from_camera);
        let [pose] = &found.hypotheses[..] else { panic!("roll {roll_rad}: {found:?}") };
        assert!(pose.landmarks.contains(&POSTER) && found.reason.is_none(), "roll {roll_rad}: {found:?}");
        let error = readings.step.map_from_robot.inverse().compose(&pose.pose.pose);
        assert!(error.x_m.hypot(error.y_m) < 0.05, "roll {roll_rad}: {error:?}");
        assert!(error.theta_rad.abs() < 0.03, "roll {roll_rad}: {error:?}");
    }
}

#[test]
fn a_camera_whose_mounting_is_not_known_is_recognised_at_any_roll() {
    let rolled = Rolled::new();
    let camera = rolled.scene.intrinsics();
    for (roll_rad, readings) in &rolled.readings {
        let of = frame_camera(Some(&camera), None, &rolled.map);
        let analysis = analyse_frame(&readings.frame.image, of, &rolled.map, &mut StageTimes::start());
        let named: Vec<LandmarkId> = unique_landmarks(&analysis).iter().map(|(id, _)| *id).collect();
        assert!(named.contains(&POSTER), "roll {roll_rad}: {named:?}");
        let pose = photograph_pose(&analysis, &rolled.map).unwrap();
        let error = pose.map_from_camera.inverse() * readings.frame.truth.map_from_camera;
        let (apart_m, angle_rad) = (error.translation.vector.norm(), error.rotation.angle());
        assert!(apart_m < 0.1 && angle_rad < 0.05, "roll {roll_rad}: {apart_m} {angle_rad}");
    }
}

#[test]
fn an_expected_landmark_is_found_by_a_rolled_camera() {
    let rolled = Rolled::new();
    let (camera, nothing) = (rolled.scene.intrinsics(), FrameAnalysis { quads: Vec::new() });
    for (roll_rad, SensorReadings { step, frame, .. }) in &rolled.readings {
        let extrinsics = CameraExtrinsics::new(step.robot_from_camera).unwrap();
        let context = FrameContext {
            analysis: &nothing,
            map: &rolled.map,
            extrinsics: Some(&extrinsics),
            camera: Some(&camera),
            is_whole: true,
            image_px: [640.0, 480.0],
            prior: None,
        };
        let covariance = Matrix3::from_diagonal(&Vector3::new(4e-4, 4e-4, 1e-4));
        let prior = Pose2Covariance { pose: step.map_from_robot, covariance };
        let guided = recognise_guided(&frame.image, &context, &prior);
        let found = guided.observations.iter().find(|o| o.landmark == POSTER);
        let found = found.unwrap_or_else(|| panic!("roll {roll_rad}: {guided:?}"));
        let truth = frame.truth.landmark(&rolled.map.landmarks[&POSTER].name).unwrap();
        let off_px = found.corners_px.furthest_px(&truth.corners_px);
        assert!(off_px < 3.0, "roll {roll_rad}: {off_px}");
    }
}

#[test]
fn a_mounting_that_is_turned_wrongly_gives_a_name_and_no_pose() {
    let rolled = Rolled::new();
    let (_, upright) = &rolled.readings[0];
    for (roll_rad, other) in &rolled.readings[2..11] {
        let found = rolled.localised(&upright.frame.image, &other.step.robot_from_camera);
        let answer = found.answer.as_ref().unwrap();
        let is_named = answer.quads.iter().any(|q| q.landmark == rolled.map.landmarks[&POSTER].name);
        assert!(is_named, "roll {roll_rad}: {answer:?}");
        assert_eq!(found.hypotheses, [], "roll {roll_rad}");
        let Some(LocaliseReason::Frame(reason)) = found.reason else { panic!("roll {roll_rad}: {found:?}") };
        let refused = [NoFix::GateReprojection, NoFix::Degenerate];
        assert!(refused.contains(&reason), "roll {roll_rad}: {reason:?}");
    }
}

/// The poster of a photograph at `place`, alone in a grey image.
fn hung_up(
    photograph: &SensorReadings,
    (name, place): (&str, &LandmarkPlace),
    camera: &Intrinsics,
    map_from_camera: &Isometry3<f64>,
) -> GrayImage {
    let unit = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(Point2::from);
    let corners_px = photograph.frame.truth.landmark(name).unwrap().corners_px;
    let photograph_from_unit = Homography::from_points(&unit, corners_px.points()).unwrap();
    let landmark_from_camera = place.map_from_landmark().inverse() * map_from_camera;
    let from = landmark_from_camera.translation.vector;
    GrayImage::from_fn(640, 480, |u, v| {
        let (x, y) = ((u as f64 - camera.cx_px) / camera.fx_px, (v as f64 - camera.cy_px) / camera.fy_px);
        let ray = landmark_from_camera.rotation * Vector3::new(x, y, 1.0);
        let at = from - ray * (from.x / ray.x);
        let on = Point2::new(0.5 + at.y / place.size.width_m, 0.5 - at.z / place.size.height_m);
        let is_on = from.x * ray.x < 0.0 && on.iter().all(|x| (0.0..=1.0).contains(x));
        let px = photograph_from_unit.apply(&on);
        if is_on { photograph.frame.image.sample(px.x, px.y).round() as u8 } else { 210 }
    })
}

#[test]
fn a_landmark_under_a_ceiling_is_recognised_from_any_side() {
    let mut scene = Scene::new();
    let (mut map, camera) = ((*scene.taught()).clone(), scene.intrinsics());
    let info = map.landmarks.get_mut(&POSTER).unwrap();
    let name = info.name.clone();
    let photograph = scene.stops(1, 1).into_iter().find(|(landmark, _)| *landmark == name).unwrap().1;
    let place = info.place.as_mut().unwrap();
    (place.x_m, place.y_m, place.z_m, place.tilt_rad) = (4.0, 1.0, 2.7, TAU / 4.0);
    let place = *place;
    // Tilted up by 50 degrees: lines of sight rise by 25 to 75.
    let mounting = pan_tilt(0.0, 0.87, Vector3::new(0.1, 0.0, 1.0));
    let extrinsics = CameraExtrinsics::new(mounting).unwrap();
    for heading_rad in (0..12).map(|i| f64::from(i) * TAU / 12.0) {
        let back_m = 1.4;
        let map_from_robot =
            Pose2::new(4.0 - back_m * heading_rad.cos(), 1.0 - back_m * heading_rad.sin(), heading_rad);
        let map_from_camera = map_from_robot.to_isometry3() * mounting;
        let image = hung_up(&photograph, (&name, &place), &camera, &map_from_camera);
        let frame = LocaliseFrame { picture: (&image).into(), camera: &camera, extrinsics: &extrinsics };
        let found = localise(&LocaliseInput { map: &map, frame: Some(frame), scan: None }, &|| false);
        let [pose] = &found.hypotheses[..] else { panic!("heading {heading_rad}: {found:?}") };
        let error = map_from_robot.inverse().compose(&pose.pose.pose);
        assert!(error.x_m.hypot(error.y_m) < 0.05, "heading {heading_rad}: {error:?}");
        assert!(error.theta_rad.abs() < 0.03, "heading {heading_rad}: {error:?}");
    }
}

#[test]
fn landmarks_under_a_ceiling_are_expected_at_any_turn() {
    let rolled = Rolled::new();
    let mounting = CameraExtrinsics::new(rolled.readings[0].1.step.robot_from_camera).unwrap();
    let up = Up::new(mounting.camera_up()).unwrap();
    let mut map = (*rolled.map).clone();
    assert_eq!(frame_camera(None, Some(&mounting), &map).up, Some(up));
    let place = map.landmarks.get_mut(&POSTER).unwrap().place.as_mut().unwrap();
    place.tilt_rad = TAU / 4.0;
    assert_eq!(frame_camera(None, Some(&mounting), &map).up, Some(up.with_level_landmarks()));
    assert_eq!(frame_camera(None, None, &map).up, None);
}
