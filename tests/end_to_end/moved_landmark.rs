//! Claim: a poster that was moved is flagged within five observations, then quarantined; no other
//! landmark is flagged, and it corrects no pose until a person decides. The map has visibility
//! areas of its landmarks and gives gaze advice.

use client::{
    Capture, Delivery, LandmarkRegion, RobotClient, RobotOptions,
    api::{NewMap, Place, Size},
    v1::{self, GazeAction, Verdict},
};
use reqwest::{Method, StatusCode};
use serde_json::{Value, json};
use server::config::Limits;
use sim::{
    building::Building,
    lesson::{LessonParams, stops},
    robot::{Robot, RobotParams, SensorReadings},
    truth::ViewState,
};
use std::sync::Arc;
use tests::{
    Inside, SOON, eventually,
    robots::{call, jpeg},
};

const MAP: &str = "corridor";
/// On a side wall; the robot passes others before it.
const MOVED: &str = "poster-3";

async fn teach(inside: &Inside, building: &Arc<Building>) {
    let maps = inside.maps();
    maps.create_map(&NewMap::new(MAP)).await.expect("map");
    let walls: Vec<_> = building
        .walls()
        .iter()
        .map(|w| json!({ "a": [w.a_m.x, w.a_m.y], "b": [w.b_m.x, w.b_m.y] }))
        .collect();
    let path = format!("/maps/{MAP}/walls");
    assert_eq!(call(inside, Method::PUT, &path, Some(json!({ "segments": walls }))).await.0, 200);
    for poster in building.posters() {
        let mut centre = poster.map_from_landmark.translation.vector;
        if poster.name == MOVED {
            // It was moved by a metre since.
            centre += poster.map_from_landmark * nalgebra::Vector3::y();
        }
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
    let mut robot = Robot::new(building.clone(), &RobotParams::default());
    for stop in stops(building, &LessonParams { seed: 1, views: 6, ..LessonParams::default() }) {
        let readings = robot.look(&stop.step);
        let Some(view) = readings.frame.truth.landmark(&stop.landmark).filter(|v| v.state == ViewState::Full)
        else {
            continue;
        };
        let corners = LandmarkRegion::Corners(view.corners_px.into());
        maps.upload_view(MAP, &stop.landmark, jpeg(&readings.frame.image), corners).await.expect("view");
    }
    let job = maps.learn(MAP, None, None).await.expect("job");
    maps.wait_for_job(job, 3 * SOON, |_| {}).await.expect("the lesson ends");
    call(inside, Method::PUT, "/robots/r1", Some(json!({ "map": MAP }))).await;
}

async fn healths(inside: &Inside) -> Vec<(String, String)> {
    let (_, page) = call(inside, Method::GET, &format!("/maps/{MAP}/landmarks?limit=100"), None).await;
    let text = |v: &Value| v.as_str().unwrap_or_default().to_owned();
    page["items"]
        .as_array()
        .expect("landmarks")
        .iter()
        .map(|l| (text(&l["name"]), text(&l["health"])))
        .collect()
}

async fn health(inside: &Inside) -> String {
    let all = healths(inside).await;
    for (name, health) in &all {
        assert!(name == MOVED || health == "sound", "{name} is not sound: {all:?}");
    }
    all.into_iter().find(|(name, _)| name == MOVED).expect("the poster").1
}

/// Sends a frame with intrinsics, extrinsics and odometry.
async fn ask(robot: &RobotClient, readings: &SensorReadings) -> v1::Answer {
    let camera = sim::camera::Camera::vga();
    let capture = Capture::encoded(jpeg(&readings.frame.image))
        .expect("a picture")
        .with_intrinsics(camera.intrinsics())
        .with_mounting(&readings.step.robot_from_camera)
        .with_odometry(&readings.step.odom_from_robot)
        .with_deadline_ms(60_000);
    robot.recognise("front", capture, SOON).await.expect("an answer")
}

#[tokio::test(flavor = "multi_thread")]
async fn a_moved_poster_is_quarantined_and_gaze_advice_is_given() {
    let inside = Inside::start(Limits::default()).await;
    let building = Arc::new(Building::corridor(3));
    teach(&inside, &building).await;
    areas_and_coverage(&inside, &building).await;
    let options = RobotOptions {
        delivery: Delivery::Every,
        ..RobotOptions::new(&inside.server.zenoh_endpoint, "default", "r1")
    };
    let client = RobotClient::connect(&options).await.expect("connected");
    gaze(&inside, &client, &building).await;
    let mut robot = Robot::new(building.clone(), &RobotParams::default());
    let (mut observations, mut flagged_after) = (0, None);
    let mut others = std::collections::BTreeSet::new();
    let mut used_after_quarantine = 0;
    let mut steps = Vec::new();
    while let Some(step) = robot.drive_mut().next() {
        steps.push(step);
    }
    for step in steps.iter().step_by(2) {
        let readings = robot.look(step);
        let before = health(&inside).await;
        let answer = ask(&client, &readings).await;
        let named = answer
            .quads
            .iter()
            .any(|q| q.verdict() == Verdict::Unique && q.landmark == MOVED && q.pose.is_some());
        // With one other landmark either could have moved: counted from when two others support the
        // pose.
        observations += u32::from(named && flagged_after.is_none() && others.len() >= 2);
        others.extend(answer.pose_landmarks.iter().filter(|l| *l != MOVED).cloned());
        if flagged_after.is_none() && health(&inside).await != "sound" {
            flagged_after = Some(observations);
        }
        if before == "quarantined" {
            used_after_quarantine += usize::from(answer.pose_landmarks.iter().any(|l| l == MOVED));
        }
    }
    let settled = || async { (health(&inside).await == "quarantined").then_some(()) };
    eventually("quarantined", settled).await;
    assert!(flagged_after.is_some_and(|n| n <= 5), "flagged after {flagged_after:?}");
    assert_eq!(used_after_quarantine, 0);
    decision(&inside, &building).await;
    client.close().await.expect("closed");
    inside.server.stop().await;
}

/// The finding over HTTP, and a person's decision.
async fn decision(inside: &Inside, building: &Building) {
    let path = format!("/maps/{MAP}/landmarks/{MOVED}");
    let (_, landmark) = call(inside, Method::GET, &path, None).await;
    assert_eq!(landmark["finding"]["kind"], "moved", "{landmark}");
    let offset_m = landmark["finding"]["offset_m"].as_f64().expect("as promised");
    assert!((offset_m - 1.0).abs() < 0.25, "{landmark}");
    // At its true place it is sound again.
    let truth = building.landmark(MOVED).expect("the poster");
    let (at, out) =
        (truth.map_from_landmark.translation.vector, truth.map_from_landmark * nalgebra::Vector3::x());
    let place = json!({ "x_m": at.x, "y_m": at.y, "z_m": at.z, "theta_rad": out.y.atan2(out.x) });
    let (status, landmark) = call(inside, Method::PATCH, &path, Some(json!({ "place": place }))).await;
    assert_eq!(
        (status, &landmark["health"], &landmark["finding"]),
        (StatusCode::OK, &json!("sound"), &Value::Null)
    );
    let (_, landmark) = call(inside, Method::PATCH, &path, Some(json!({ "health": "quarantined" }))).await;
    assert_eq!(landmark["health"], "quarantined");
    let (status, _) = call(inside, Method::PATCH, &path, Some(json!({ "health": "lost" }))).await;
    assert_eq!(status, StatusCode::UNPROCESSABLE_ENTITY);
}

async fn areas_and_coverage(inside: &Inside, building: &Building) {
    let poster = building.landmark("poster-0").expect("a poster");
    let path = format!("/maps/{MAP}/landmarks/poster-0/visibility");
    let (status, area) = call(inside, Method::GET, &path, None).await;
    assert_eq!((status, &area["geometry"]["type"]), (StatusCode::OK, &json!("MultiPolygon")));
    assert!(area["properties"]["area_m2"].as_f64().expect("as promised") > 1.0, "{area}");
    // In front of it, 1.6 m from the wall; and behind its wall.
    let at = |ahead: f64| poster.map_from_landmark * nalgebra::Point3::new(ahead, 0.0, 0.0);
    for (ahead, expected) in [(1.6, true), (-1.6, false)] {
        let pose = json!({ "x_m": at(ahead).x, "y_m": at(ahead).y, "theta_rad": 0.0 });
        let (_, visible) =
            call(inside, Method::POST, &format!("/maps/{MAP}/visible"), Some(json!({ "pose": pose }))).await;
        let names: Vec<_> =
            visible["landmarks"].as_array().expect("as promised").iter().map(|l| &l["landmark"]).collect();
        assert_eq!(names.contains(&&json!("poster-0")), expected, "{visible}");
    }
    let walk = json!({ "path": [[1.2, 0.0], [23.8, 0.0]], "step_m": 0.2 });
    let (status, cover) = call(inside, Method::POST, &format!("/maps/{MAP}/coverage"), Some(walk)).await;
    assert_eq!(status, StatusCode::OK);
    let share = cover["share"].as_f64().expect("as promised");
    assert!(
        share > 0.3 && share < 1.0 && !cover["gaps"].as_array().expect("as promised").is_empty(),
        "{cover}"
    );
    for (path, body, field) in [
        ("visible", json!({ "pose": { "x_m": 1e9, "y_m": 0, "theta_rad": 0 } }), "pose.x_m"),
        ("coverage", json!({ "path": [] }), "path.path"),
        ("coverage", json!({ "path": [[0, 0]], "step_m": 0.001 }), "path.step_m"),
        (
            "gaze",
            json!({ "pose": { "x_m": 0, "y_m": 0, "theta_rad": 0 }, "head": { "rate_radps": 0 } }),
            "question.head.rate_radps",
        ),
    ] {
        let (status, problem) = call(inside, Method::POST, &format!("/maps/{MAP}/{path}"), Some(body)).await;
        assert_eq!(
            (status, &problem["field"]),
            (StatusCode::UNPROCESSABLE_ENTITY, &json!(field)),
            "{problem}"
        );
    }
    call(inside, Method::POST, &format!("/maps/{MAP}/landmarks"), Some(json!({ "name": "loose" }))).await;
    let path = format!("/maps/{MAP}/landmarks/loose");
    let (status, problem) = call(inside, Method::GET, &format!("{path}/visibility"), None).await;
    assert_eq!((status, &problem["code"]), (StatusCode::CONFLICT, &json!("not_placed")));
    call(inside, Method::DELETE, &path, None).await;
}

/// The same question over HTTP and zenoh has the same answer, and it centres the landmark.
async fn gaze(inside: &Inside, client: &RobotClient, building: &Building) {
    let poster = building.landmark("poster-0").expect("a poster");
    let at = poster.map_from_landmark * nalgebra::Point3::new(1.6, -0.3, 0.0);
    let question = json!({ "pose": { "x_m": at.x, "y_m": at.y, "theta_rad": 0.0 } });
    let (_, advice) = call(inside, Method::POST, &format!("/maps/{MAP}/gaze"), Some(question)).await;
    let best = &advice["ranked"][0];
    assert_eq!(best["landmark"], "poster-0", "{advice}");
    let request = v1::GazeRequest {
        map_from_robot: Some(v1::Pose2Covariance {
            pose: Some(v1::Pose2 { x_m: at.x, y_m: at.y, theta_rad: 0.0 }),
            covariance: vec![0.0; 9],
        }),
        ..v1::GazeRequest::default()
    };
    let advised = client.gaze(&request, SOON).await.expect("advice");
    assert_eq!(
        (advised.action(), advised.landmark.as_str(), advised.map.as_str()),
        (GazeAction::Landmark, "poster-0", MAP)
    );
    assert!((advised.pan_rad - best["pan_rad"].as_f64().expect("as promised")).abs() < 1e-9);
    let to = poster.map_from_landmark.translation.vector;
    let bearing = (to.y - at.y).atan2(to.x - at.x);
    assert!((advised.pan_rad - bearing).abs() < 0.01, "{} for {bearing}", advised.pan_rad);
    let nothing_known = client.gaze(&v1::GazeRequest::default(), SOON).await.expect("advice");
    assert_eq!(nothing_known.rejection.expect("refused").field, "map_from_robot");
}
