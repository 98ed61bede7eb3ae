//! Claim: a robot gathers views of untaught posters that it passes; a person accepts their tracks
//! over HTTP; from then on they are recognised and placed, never one as another, about as often as
//! posters taught by a photograph each. Views of a known landmark are added only if it was
//! recognised, and only on request.

mod figures;

use client::{Capture, Delivery, LandmarkRegion, RobotClient, RobotOptions, api::NewMap, v1};
use figures::{Figures, figures};
use map::pose2::{Pose2, Pose2Covariance};
use nalgebra::{Matrix3, Vector3};
use reqwest::{Method, StatusCode};
use serde_json::{Value, json};
use server::config::Limits;
use sim::{
    building::Building,
    drive::DriveParams,
    lesson::{LessonParams, stops},
    robot::{Robot, RobotParams, SensorReadings},
};
use std::{collections::BTreeMap, sync::Arc, time::Duration};
use tests::{
    Inside, SOON,
    command::waymark,
    eventually,
    robots::{call, jpeg},
};

const MAP: &str = "corridor";

/// A map with walls and a robot, without landmarks.
async fn walls(inside: &Inside, building: &Building) -> RobotClient {
    inside.maps().create_map(&NewMap::new(MAP)).await.expect("map");
    let walls: Vec<_> = building
        .walls()
        .iter()
        .map(|w| json!({ "a": [w.a_m.x, w.a_m.y], "b": [w.b_m.x, w.b_m.y] }))
        .collect();
    let path = format!("/maps/{MAP}/walls");
    assert_eq!(call(inside, Method::PUT, &path, Some(json!({ "segments": walls }))).await.0, 200);
    inside.maps().put_robot("r1", MAP).await.expect("robot");
    let options = RobotOptions {
        delivery: Delivery::Every,
        ..RobotOptions::new(&inside.server.zenoh_endpoint, "default", "r1")
    };
    RobotClient::connect(&options).await.expect("connected")
}

fn robot(building: &Arc<Building>, seed: u64, legs: u32, reverse: bool) -> Robot {
    let drive = DriveParams {
        seed,
        reverse,
        legs,
        start_m: if reverse { 22.0 } else { 0.0 },
        ..DriveParams::default()
    };
    Robot::new(building.clone(), &RobotParams { drive, ..RobotParams::default() })
}

/// The robot's own pose by its laser: 1 cm and 2 mrad off, in another direction at every step.
fn prior(readings: &SensorReadings) -> Pose2Covariance {
    let phase = readings.step.index as f64;
    let off = Vector3::new(0.014 * phase.sin(), 0.014 * (2.3 * phase).sin(), 0.0028 * (3.7 * phase).sin());
    let covariance = Matrix3::from_diagonal(&Vector3::new(1e-4, 1e-4, 4e-6));
    let t = readings.step.map_from_robot;
    let pose = Pose2::new(t.x_m + off.x, t.y_m + off.y, t.theta_rad + off.z);
    Pose2Covariance::new(pose, covariance).expect("in range")
}

/// Every other picture of a drive, answered.
async fn drive(client: &RobotClient, mut robot: Robot, localised: bool) -> Vec<(SensorReadings, v1::Answer)> {
    let steps: Vec<_> = robot.drive_mut().collect();
    let mut answered = Vec::new();
    let began = tokio::time::Instant::now();
    for step in steps.iter().step_by(2) {
        let readings = robot.look(step);
        // In real time: the server rejects faster clocks, and gathering ends tracks by time.
        tokio::time::sleep_until(began + Duration::from_secs_f64(step.time_s - steps[0].time_s)).await;
        let mut capture = Capture::encoded(jpeg(&readings.frame.image))
            .expect("a picture")
            .with_intrinsics(sim::camera::Camera::vga().intrinsics())
            .with_mounting(&readings.step.robot_from_camera)
            .with_odometry(&readings.step.odom_from_robot)
            .with_deadline_ms(60_000);
        if localised {
            capture = capture.with_prior(&prior(&readings));
        }
        let answer = client.recognise("front", capture, SOON).await.expect("an answer");
        answered.push((readings, answer));
    }
    answered
}

fn list<'a>(value: &'a Value, name: &str) -> &'a [Value] {
    value[name].as_array().map_or(&[], Vec::as_slice)
}

/// The poster at the estimated place of a track, as a person would read it from the picture.
fn poster_of(building: &Building, track: &Value) -> Option<String> {
    let at = |field: &str| track["place"][field].as_f64();
    let (x, y, width) = (at("x_m")?, at("y_m")?, at("width_m")?);
    let near = building.posters().find(|p| {
        let c = p.map_from_landmark.translation.vector;
        (c.x - x).hypot(c.y - y) < 0.15 && (width - p.width_m).abs() < 0.1
    });
    near.map(|p| p.name.clone())
}

async fn lesson(inside: &Inside, job: &Value) -> Value {
    let path = format!("/jobs/{}", job["id"]);
    eventually("the lesson", || async {
        let (_, job) = call(inside, Method::GET, &path, None).await;
        assert!(job["state"] != "failed", "{job}");
        (job["state"] == "done").then_some(job["result"].clone())
    })
    .await
}

#[tokio::test(flavor = "multi_thread")]
async fn untaught_posters_are_gathered_accepted_and_recognised() {
    let building = Arc::new(Building::corridor(11));
    let (gathered, inside, client) = {
        let inside = Inside::start(Limits::default()).await;
        let client = walls(&inside, &building).await;
        gather_all(&inside, &client, &building).await;
        let gathering = begun(&inside, json!({ "robot": "r1", "known": true })).await;
        let second = drive(&client, robot(&building, 5, 1, true), false).await;
        known_landmarks_keep_their_names(&inside, &building, &gathering).await;
        (figures(&second), inside, client)
    };
    let photographed = photographed(&building).await;
    eprintln!("gathered {gathered:?}\nby photograph {photographed:?}");
    assert!(gathered.shown[0] >= 50, "{gathered:?}");
    assert_eq!((gathered.wrong, photographed.wrong), (0, 0), "{gathered:?} {photographed:?}");
    assert!(20 * gathered.right[0] >= 19 * gathered.shown[0], "{gathered:?}");
    assert!(20 * gathered.right[0] >= 19 * photographed.right[0], "{gathered:?} {photographed:?}");
    assert!(gathered.poses > 0 && gathered.worst_m < 0.5, "{gathered:?}");
    more_of_one(&inside, &client, &building).await;
    client.close().await.expect("closed");
    inside.server.stop().await;
}

/// The first drive, the decision, the lesson.
async fn gather_all(inside: &Inside, client: &RobotClient, building: &Arc<Building>) {
    let path = format!("/maps/{MAP}/gatherings");
    let (status, gathering) = call(inside, Method::POST, &path, Some(json!({ "robot": "r1" }))).await;
    assert_eq!(status, StatusCode::CREATED, "{gathering}");
    let path = format!("{path}/{}", gathering["id"]);
    drive(client, robot(building, 3, 2, false), true).await;
    let (status, stopped) = call(inside, Method::POST, &format!("{path}/stop"), None).await;
    assert_eq!((status, &stopped["open"]), (StatusCode::OK, &json!(false)), "{stopped}");
    eprintln!("counts {}", stopped["counts"]);
    let (_, waiting) = call(inside, Method::GET, &format!("{path}/tracks"), None).await;
    let mut picks = Vec::new();
    let mut taken = BTreeMap::new();
    for track in list(&waiting, "tracks") {
        let poster = poster_of(building, track);
        eprintln!(
            "{:?} {}: {} views, {} apart, of {}, angles {}, sides {}, v_c {}, passes {} {}",
            poster,
            track["number"],
            list(track, "views").len(),
            track["inconsistent_views"],
            track["sightings"],
            track["place"]["angle_rad"],
            track["side_px"],
            track["v_c"],
            track["passes"],
            track["failed_gates"]
        );
        let Some(name) = poster else { continue };
        taken.insert(name.clone(), track.clone());
        picks.push(json!({ "track": track["number"], "name": name }));
    }
    assert!(taken.len() == 6, "{} of 6 posters were gathered", taken.len());
    // The same at the command line, with a picture of each.
    let folder = tempfile::tempdir().expect("a directory");
    let pictures = folder.path().to_str().expect("text");
    let number = gathering["id"].to_string();
    let url = inside.url();
    let show = ["gathering", "show", &number, "--map", MAP, "--server", &url, "--pictures", pictures];
    let shown = waymark(show, SOON);
    let count = list(&waiting, "tracks").len();
    assert_eq!((shown.status, shown.stdout.lines().count()), (0, count), "{shown:?}");
    assert_eq!(std::fs::read_dir(folder.path()).expect("pictures").count(), count);
    let listed = waymark(["gathering", "list", "--map", MAP, "--server", &url], SOON);
    assert!(listed.stdout.contains("\tr1\twhatever is new\tended\t"), "{listed:?}");
    // Each has a picture.
    let first = &list(&waiting, "tracks")[0];
    let icon =
        format!("{}/api/v1{path}/tracks/{}/views/{}/icon", inside.url(), first["number"], first["best_view"]);
    let picture = tests::http(&inside.url()).await.get(icon).send().await.expect("an answer");
    assert_eq!(picture.headers()["content-type"], "image/png");
    // Nothing is accepted if one of the decisions is invalid.
    let mut bad = picks.clone();
    bad.push(json!({ "track": 9999, "name": "nothing" }));
    let (status, problem) =
        call(inside, Method::POST, &format!("{path}/accept"), Some(json!({ "tracks": bad }))).await;
    assert_eq!((status, &problem["code"]), (StatusCode::NOT_FOUND, &json!("unknown_track")));
    assert!(inside.maps().landmarks(MAP).await.expect("landmarks").is_empty());
    let (status, accepted) =
        call(inside, Method::POST, &format!("{path}/accept"), Some(json!({ "tracks": picks }))).await;
    assert_eq!(status, StatusCode::ACCEPTED, "{accepted}");
    assert!(list(&accepted, "landmarks").iter().all(|l| l["placing"]["placed"] == true), "{accepted}");
    let result = lesson(inside, &accepted["job"]).await;
    assert_eq!(result["active"].as_u64(), Some(taken.len() as u64), "{result}");
    for landmark in inside.maps().landmarks(MAP).await.expect("landmarks") {
        let truth = building.landmark(&landmark.name).expect("a poster").map_from_landmark.translation.vector;
        let place = landmark.place.expect("placed");
        assert!((place.x_m - truth.x).hypot(place.y_m - truth.y) < 0.05, "{landmark:?}");
    }
    // Accepted tracks leave the list and cannot be accepted twice.
    let again = json!({ "tracks": [picks[0]] });
    assert_eq!(call(inside, Method::POST, &format!("{path}/accept"), Some(again)).await.0, 404);
}

/// The same second drive after teaching one frontal photograph of each poster.
async fn photographed(building: &Arc<Building>) -> Figures {
    let inside = Inside::start(Limits::default()).await;
    let client = walls(&inside, building).await;
    let frontal = LessonParams {
        seed: 1,
        views: 1,
        max_view_angle_rad: 0.35,
        distance_m: [1.3, 2.0],
        ..LessonParams::default()
    };
    let mut teacher = Robot::new(building.clone(), &RobotParams::default());
    for stop in stops(building, &frontal) {
        let readings = teacher.look(&stop.step);
        let corners = readings.frame.truth.landmark(&stop.landmark).expect("aimed at").corners_px;
        let maps = inside.maps();
        maps.add_landmark(MAP, &stop.landmark, None, None).await.expect("landmark");
        let extent = LandmarkRegion::Corners(corners.into());
        maps.upload_view(MAP, &stop.landmark, jpeg(&readings.frame.image), extent).await.expect("view");
    }
    let job = inside.maps().learn(MAP, None, None).await.expect("job");
    inside.maps().wait_for_job(job, 3 * SOON, |_| {}).await.expect("the lesson ends");
    let second = drive(&client, robot(building, 5, 1, true), false).await;
    client.close().await.expect("closed");
    inside.server.stop().await;
    figures(&second)
}

async fn begun(inside: &Inside, body: Value) -> String {
    let path = format!("/maps/{MAP}/gatherings");
    let (status, gathering) = call(inside, Method::POST, &path, Some(body)).await;
    assert_eq!(status, StatusCode::CREATED, "{gathering}");
    format!("{path}/{}", gathering["id"])
}

/// Tracks of a drive on which every landmark is known: each view in the track of its landmark, none
/// as new.
async fn known_landmarks_keep_their_names(inside: &Inside, building: &Building, path: &str) {
    let (_, stopped) = call(inside, Method::POST, &format!("{path}/stop"), None).await;
    let (_, waiting) = call(inside, Method::GET, &format!("{path}/tracks"), None).await;
    let all = list(&waiting, "tracks");
    let (of_landmarks, new): (Vec<_>, Vec<_>) = all.iter().partition(|c| c["landmark"].is_string());
    eprintln!(
        "known: {} tracks of landmarks, {} others, {}",
        of_landmarks.len(),
        new.len(),
        stopped["counts"]
    );
    assert!(of_landmarks.len() >= 4, "{stopped}");
    for track in of_landmarks {
        let there = poster_of(building, track);
        assert!(there.is_none() || track["landmark"] == json!(there), "{track}");
    }
    for track in new {
        assert_eq!(poster_of(building, track), None, "{track}");
    }
    assert_eq!(call(inside, Method::DELETE, path, None).await.0, 204);
}

/// Views of one landmark only, then a lesson of it alone.
async fn more_of_one(inside: &Inside, client: &RobotClient, building: &Arc<Building>) {
    let before = inside.maps().landmark(MAP, "poster-0").await.expect("a landmark").views;
    let path = begun(inside, json!({ "robot": "r1", "landmark": "poster-0" })).await;
    let near: Vec<_> = stops(building, &LessonParams { seed: 9, views: 10, ..LessonParams::default() })
        .into_iter()
        .filter(|s| s.landmark == "poster-0" || s.landmark == "poster-1")
        .collect();
    let mut robot_at_stops = Robot::new(building.clone(), &RobotParams::default());
    for stop in near {
        let readings = robot_at_stops.look(&stop.step);
        let capture = Capture::encoded(jpeg(&readings.frame.image))
            .expect("a picture")
            .with_intrinsics(sim::camera::Camera::vga().intrinsics())
            .with_mounting(&readings.step.robot_from_camera)
            .with_prior(&prior(&readings))
            .with_deadline_ms(60_000);
        client.recognise("front", capture, SOON).await.expect("an answer");
    }
    let (_, stopped) = call(inside, Method::POST, &format!("{path}/stop"), None).await;
    let (_, waiting) = call(inside, Method::GET, &format!("{path}/tracks"), None).await;
    let [one] = list(&waiting, "tracks") else { panic!("{waiting} {stopped}") };
    assert_eq!(one["landmark"], "poster-0");
    let stored = list(one, "views").len() as u64;
    assert!((4..=10).contains(&stored), "{stopped}");
    let other = json!({ "tracks": [{ "track": one["number"], "name": "poster-1" }] });
    let (status, problem) = call(inside, Method::POST, &format!("{path}/accept"), Some(other)).await;
    assert_eq!((status, &problem["code"]), (StatusCode::CONFLICT, &json!("in_use")), "{problem}");
    let its_own = json!({ "tracks": [{ "track": one["number"] }] });
    let (_, accepted) = call(inside, Method::POST, &format!("{path}/accept"), Some(its_own)).await;
    let result = lesson(inside, &accepted["job"]).await;
    let others = inside.maps().landmarks(MAP).await.expect("landmarks").len() - 1;
    assert_eq!((&result["learnt"], &result["refitted"]), (&json!(1), &json!(others)), "{result}");
    assert_eq!(inside.maps().landmark(MAP, "poster-0").await.expect("a landmark").views, before + stored);
}

#[tokio::test(flavor = "multi_thread")]
async fn invalid_requests_are_refused_and_ended_gatherings_stay_ended() {
    let inside = Inside::start(Limits::default()).await;
    let building = Building::corridor(11);
    let client = walls(&inside, &building).await;
    inside.maps().create_map(&NewMap::new("cellar")).await.expect("map");
    inside.maps().add_landmark(MAP, "blank", None, None).await.expect("landmark");
    let all = format!("/maps/{MAP}/gatherings");
    for (path, body, status, code) in [
        (all.as_str(), json!({ "robot": "nobody" }), 404, "unknown_robot"),
        (&all, json!({ "robot": "r1", "landmark": "none" }), 404, "unknown_landmark"),
        (&all, json!({ "robot": "r1", "landmark": "blank" }), 409, "not_learnt"),
        (&all, json!({ "robot": "r1", "auto_accept": true }), 422, "invalid_value"),
        ("/maps/cellar/gatherings", json!({ "robot": "r1" }), 409, "in_use"),
        ("/maps/nowhere/gatherings", json!({ "robot": "r1" }), 404, "unknown_map"),
    ] {
        let (got, problem) = call(&inside, Method::POST, path, Some(body)).await;
        assert_eq!((got.as_u16(), problem["code"].as_str()), (status, Some(code)), "{problem}");
    }
    let (_, one) = call(&inside, Method::POST, &all, Some(json!({ "robot": "r1", "known": true }))).await;
    let path = format!("{all}/{}", one["id"]);
    let (status, problem) = call(&inside, Method::POST, &all, Some(json!({ "robot": "r1" }))).await;
    assert_eq!((status.as_u16(), problem["code"].as_str()), (409, Some("in_use")), "{problem}");
    for (body, status, code) in [
        (json!({ "tracks": [] }), 422, "out_of_range"),
        (json!({ "tracks": [{ "track": 1, "name": "A/B" }] }), 422, "bad_name"),
        (json!({ "tracks": [{ "track": 1, "name": "a" }] }), 404, "unknown_track"),
        (json!({ "tracks": [{ "track": -1 }] }), 422, "invalid_value"),
    ] {
        let (got, problem) = call(&inside, Method::POST, &format!("{path}/accept"), Some(body)).await;
        assert_eq!((got.as_u16(), problem["code"].as_str()), (status, Some(code)), "{problem}");
    }
    assert_eq!(call(&inside, Method::DELETE, &format!("{path}/tracks/1"), None).await.0, 404);
    let (_, stopped) = call(&inside, Method::POST, &format!("{path}/stop"), None).await;
    let (_, again) = call(&inside, Method::POST, &format!("{path}/stop"), None).await;
    assert_eq!((&stopped, stopped["open"].as_bool()), (&again, Some(false)));
    // A new gathering may start; the list has both; a deleted one is gone.
    let (status, two) = call(&inside, Method::POST, &all, Some(json!({ "robot": "r1" }))).await;
    assert_eq!(status, StatusCode::CREATED);
    let (_, page) = call(&inside, Method::GET, &all, None).await;
    assert_eq!(list(&page, "items").len(), 2);
    let path = format!("{all}/{}", two["id"]);
    assert_eq!(call(&inside, Method::DELETE, &path, None).await.0, 204);
    let (status, problem) = call(&inside, Method::GET, &path, None).await;
    assert_eq!((status.as_u16(), problem["code"].as_str()), (404, Some("unknown_gathering")));
    assert_eq!(call(&inside, Method::POST, &all, Some(json!({ "robot": "r1" }))).await.0, 201);
    client.close().await.expect("closed");
    inside.server.stop().await;
}
