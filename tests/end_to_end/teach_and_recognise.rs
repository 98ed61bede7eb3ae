//! Claim: posters taught over HTTP from a first round through a building are recognised over zenoh
//! from other viewpoints, never one as another, and give the robot's pose; in another building with
//! other posters nothing is recognised.

use client::{
    Capture, Delivery, LandmarkRegion, RobotClient, RobotOptions,
    api::{LandmarkStatus, NewMap, Place, Size},
    v1::{self, Verdict},
};
use server::config::Limits;
use sim::{
    building::Building,
    lesson::{LessonParams, Stop, stops},
    robot::{Robot, RobotParams, SensorReadings},
    truth::ViewState,
};
use std::{sync::Arc, time::Duration};
use tests::{Inside, SOON, robots::jpeg};
use vision::geometry::polygon::iou;

const MAP: &str = "corridor";

/// Readings in front of every poster, from viewpoints drawn from `seed`.
fn round(building: &Arc<Building>, seed: u64, views: usize) -> Vec<(Stop, SensorReadings)> {
    let mut robot = Robot::new(building.clone(), &RobotParams::default());
    let stops = stops(building, &LessonParams { seed, views, ..LessonParams::default() });
    stops
        .into_iter()
        .map(|stop| {
            let readings = robot.look(&stop.step);
            (stop, readings)
        })
        .collect()
}

async fn teach(inside: &Inside, building: &Arc<Building>) {
    let maps = inside.maps();
    maps.create_map(&NewMap::new(MAP)).await.expect("map");
    for poster in building.posters() {
        let centre = poster.map_from_landmark.translation.vector;
        let outward = poster.map_from_landmark.rotation * nalgebra::Vector3::x();
        let place = Place {
            x_m: centre.x,
            y_m: centre.y,
            z_m: centre.z,
            theta_rad: outward.y.atan2(outward.x),
            ..Place::default()
        };
        let size = Size { width_m: poster.width_m, height_m: poster.height_m };
        maps.add_landmark(MAP, &poster.name, Some(size), Some(place)).await.expect("landmark");
    }
    for (stop, readings) in round(building, 1, 8) {
        let Some(view) = readings.frame.truth.landmark(&stop.landmark).filter(|v| v.state == ViewState::Full)
        else {
            continue;
        };
        let corners = LandmarkRegion::Corners(view.corners_px.into());
        maps.upload_view(MAP, &stop.landmark, jpeg(&readings.frame.image), corners).await.expect("view");
    }
    let job = maps.learn(MAP, None, None).await.expect("job");
    let job = maps.wait_for_job(job, 3 * SOON, |_| {}).await.expect("the lesson ends");
    let landmarks = maps.landmarks(MAP).await.expect("landmarks");
    let active = landmarks.iter().filter(|l| l.status == LandmarkStatus::Active).count();
    assert!(active >= 5, "{active} of {} active: {:?}", landmarks.len(), job.result);
}

/// Sends a frame with intrinsics, extrinsics and odometry; returns the answer.
async fn ask(robot: &RobotClient, readings: &SensorReadings) -> v1::Answer {
    let camera = sim::camera::Camera::vga();
    let capture = Capture::encoded(jpeg(&readings.frame.image))
        .expect("a picture")
        .with_intrinsics(camera.intrinsics())
        .with_mounting(&readings.step.robot_from_camera)
        .with_deadline_ms(60_000);
    robot.recognise("front", capture, SOON).await.expect("an answer")
}

async fn connect(inside: &Inside) -> RobotClient {
    inside.maps().put_robot("r1", MAP).await.expect("robot");
    let options = RobotOptions {
        delivery: Delivery::Every,
        timeout: Duration::from_secs(10),
        ..RobotOptions::new(&inside.server.zenoh_endpoint, "default", "r1")
    };
    RobotClient::connect(&options).await.expect("a connection")
}

#[tokio::test(flavor = "multi_thread")]
async fn posters_taught_over_http_are_recognised_over_zenoh() {
    let inside = Inside::start(Limits::default()).await;
    let building = Arc::new(Building::corridor(11));
    teach(&inside, &building).await;
    let robot = connect(&inside).await;

    let (mut asked, mut right, mut wrong, mut errors_m) = (0, 0, Vec::new(), Vec::new());
    for (stop, readings) in round(&building, 2, 4) {
        let answer = ask(&robot, &readings).await;
        let truth = &readings.frame.truth;
        asked += usize::from(truth.landmark(&stop.landmark).is_some_and(|v| v.state == ViewState::Full));
        for quad in answer.quads.iter().filter(|q| q.verdict() == Verdict::Unique) {
            let corners: Vec<_> =
                quad.corners.iter().map(|c| nalgebra::Point2::new(c.u_px, c.v_px)).collect();
            // The landmark of the building that is there by the truth.
            let there = truth.landmarks.iter().find(|l| iou(&corners, l.corners_px.points()) > 0.5);
            match there {
                Some(l) if l.name == quad.landmark => right += usize::from(l.name == stop.landmark),
                other => wrong.push((quad.landmark.clone(), other.map(|l| l.name.clone()))),
            }
        }
        if let Some(found) = answer.map_from_robot.as_ref().and_then(|p| p.pose.as_ref()) {
            let truth = readings.step.map_from_robot;
            errors_m.push((found.x_m - truth.x_m).hypot(found.y_m - truth.y_m));
            assert!(!answer.pose_landmarks.is_empty());
        }
    }
    assert!(wrong.is_empty(), "named as another: {wrong:?}");
    assert!(asked >= 15, "only {asked} pictures with a whole poster");
    assert!(10 * right >= 7 * asked, "{right} of {asked} recognised");
    assert!(2 * errors_m.len() >= right, "{} poses from {right} recognitions", errors_m.len());
    errors_m.sort_by(f64::total_cmp);
    let (median, worst) = (errors_m[errors_m.len() / 2], errors_m[errors_m.len() - 1]);
    assert!(median < 0.15 && worst < 1.0, "position error: median {median} m, worst {worst} m");

    let elsewhere = Arc::new(Building::corridor(12));
    for (_, readings) in round(&elsewhere, 3, 4) {
        let answer = ask(&robot, &readings).await;
        let matched: Vec<_> = answer.quads.iter().filter(|q| q.verdict() == Verdict::Unique).collect();
        assert!(matched.is_empty(), "recognised in another building: {matched:?}");
        assert!(answer.map_from_robot.is_none());
    }
    robot.close().await.expect("closed");
    inside.server.stop().await;
}
