//! A simulated robot against a server: its building as a map, its landmarks taught, its readings as
//! messages.

use crate::{Inside, SOON, eventually, http};
use client::{
    Capture, Delivery, LandmarkRegion, RobotClient, RobotOptions,
    api::{Place, Size},
    v1,
};
use image::{ExtendedColorType, codecs::jpeg::JpegEncoder};
use map::{laser::Scan, pose2::Pose2};
use reqwest::{Method, StatusCode};
use serde_json::{Value, json};
use sim::{
    building::Building,
    lesson::{LessonParams, stops},
    robot::{Robot, RobotParams, SensorReadings},
    truth::ViewState,
};
use std::sync::Arc;
use vision::frame::GrayImage;

/// The map of the building.
pub const MAP: &str = "building";

/// A grey image as a JPEG file.
pub fn jpeg(image: &GrayImage) -> Vec<u8> {
    let mut out = Vec::new();
    let (width, height) = (image.width() as u32, image.height() as u32);
    JpegEncoder::new_with_quality(&mut out, 90)
        .encode(image.data(), width, height, ExtendedColorType::L8)
        .expect("in memory");
    out
}

/// A request to the server's interface, that changes whatever is there: status and JSON.
pub async fn call(inside: &Inside, method: Method, path: &str, body: Option<Value>) -> (StatusCode, Value) {
    let url = inside.url();
    let request = http(&url).await.request(method, format!("{url}/api/v1{path}"));
    let request = request.header("if-match", "*");
    let request = match body {
        Some(body) => request.json(&body),
        None => request,
    };
    let answer = request.send().await.expect("an answer");
    (answer.status(), answer.json().await.unwrap_or_default())
}

/// The building's walls as those of the map.
pub async fn put_walls(inside: &Inside, building: &Building) {
    let walls: Vec<_> = building
        .walls()
        .iter()
        .map(|w| json!({ "a": [w.a_m.x, w.a_m.y], "b": [w.b_m.x, w.b_m.y] }))
        .collect();
    let path = format!("/maps/{MAP}/walls");
    assert_eq!(call(inside, Method::PUT, &path, Some(json!({ "segments": walls }))).await.0, StatusCode::OK);
}

/// Teaches landmarks of the building, each from `views` photographs, at their true places.
pub async fn teach(inside: &Inside, building: &Arc<Building>, names: &[&str], views: usize) {
    let maps = inside.maps();
    for name in names {
        let truth = building.landmark(name).expect("a landmark of the building");
        let centre = truth.map_from_landmark.translation.vector;
        let outward = truth.map_from_landmark.rotation * nalgebra::Vector3::x();
        let place = Place {
            x_m: centre.x,
            y_m: centre.y,
            z_m: centre.z,
            theta_rad: outward.y.atan2(outward.x),
            ..Place::default()
        };
        let size = Size { width_m: truth.width_m, height_m: truth.height_m };
        maps.add_landmark(MAP, name, Some(size), Some(place)).await.expect("landmark");
    }
    let mut robot = Robot::new(building.clone(), &RobotParams::default());
    for stop in stops(building, &LessonParams { seed: 1, views, ..LessonParams::default() }) {
        if !names.contains(&stop.landmark.as_str()) {
            continue;
        }
        let readings = robot.look(&stop.step);
        let view = readings.frame.truth.landmark(&stop.landmark).filter(|v| v.state == ViewState::Full);
        if let Some(view) = view {
            let corners = LandmarkRegion::Corners(view.corners_px.into());
            let view = maps.upload_view(MAP, &stop.landmark, jpeg(&readings.frame.image), corners).await;
            view.expect("view");
        }
    }
    let job = maps.learn(MAP, None, None).await.expect("job");
    maps.wait_for_job(job, 3 * SOON, |_| {}).await.expect("the lesson ends");
}

/// Connects as a robot; its messages are not dropped on a full link.
pub async fn connect(endpoint: &str, robot: &str) -> RobotClient {
    let options = RobotOptions { delivery: Delivery::Every, ..RobotOptions::new(endpoint, "default", robot) };
    RobotClient::connect(&options).await.expect("connected")
}

/// A frame with intrinsics, extrinsics and odometry.
pub fn capture(readings: &SensorReadings) -> Capture {
    Capture::encoded(jpeg(&readings.frame.image))
        .expect("a picture")
        .with_intrinsics(sim::camera::Camera::vga().intrinsics())
        .with_mounting(&readings.step.robot_from_camera)
        .with_odometry(&readings.step.odom_from_robot)
        .with_deadline_ms(60_000)
}

/// Shows robot `name` views of the landmark `poster-0`, until its pose on [`MAP`] is known; the
/// last view.
pub async fn find_itself(
    inside: &Inside,
    building: &Arc<Building>,
    client: &RobotClient,
    name: &str,
) -> SensorReadings {
    let mut robot = Robot::new(building.clone(), &RobotParams::default());
    let near = LessonParams { seed: 9, views: 12, ..LessonParams::default() };
    let stops: Vec<_> = stops(building, &near).into_iter().filter(|s| s.landmark == "poster-0").collect();
    for stop in &stops {
        let readings = robot.look(&stop.step);
        let answer = client.recognise("front", capture(&readings), SOON).await.expect("an answer");
        if answer.map_from_robot.is_some() {
            let started = || async {
                let path = format!("/robots/{name}/corrections");
                let (_, log) = call(inside, Method::GET, &path, None).await;
                (log["totals"]["landmarks"]["started"] == 1).then_some(())
            };
            // The answer is sent before the pose is updated.
            eventually("started", started).await;
            return readings;
        }
    }
    panic!("none of {} views gave a pose", stops.len());
}

/// The scan of the readings, as a message.
pub fn scan_message(readings: &SensorReadings, captured_ns: i64) -> v1::Scan {
    scan_of(&readings.scan, &readings.step.odom_from_robot, captured_ns)
}

/// A scan with odometry of the same time, as a message.
pub fn scan_of(scan: &Scan, odom_from_robot: &Pose2, captured_ns: i64) -> v1::Scan {
    let pose = |p: &Pose2| v1::Pose2 { x_m: p.x_m, y_m: p.y_m, theta_rad: p.theta_rad };
    v1::Scan {
        captured_ns,
        odom_from_robot: Some(pose(odom_from_robot)),
        robot_from_laser: Some(pose(scan.robot_from_laser())),
        first_bearing_rad: scan.bearing_rad(0),
        bearing_step_rad: scan.bearing_step_rad(),
        max_range_m: scan.max_range_m(),
        ranges_m: scan.ranges_m().to_vec(),
        ..v1::Scan::default()
    }
}
