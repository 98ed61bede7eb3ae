//! Claim: a driving robot that sends scans over zenoh makes the walls of a map, the same as
//! `waymark map build` from a scan log of them; they are stored when the mapping is finished, not
//! before. One that sends frames, too, makes its landmarks in the same drive, and nobody clicks.

use client::{
    Capture, Delivery, RobotClient, RobotOptions,
    api::{LandmarkStatus, MappingStageBody, NewMap, NewMapping, WallBody, WallsBody},
};
use nalgebra::Vector3;
use reqwest::{Method, StatusCode};
use serde_json::{Value, json};
use server::config::Limits;
use sim::{
    building::{Building, LandmarkTruth},
    corridor::CorridorParams,
    drive::{Drive, DriveParams, Step},
    laser::{LaserParams, scan},
    robot::{Robot, RobotParams},
};
use std::{fmt::Write as _, sync::Arc, time::Duration};
use tests::{
    Child, Inside, SOON,
    command::waymark,
    eventually,
    robots::{MAP, call, jpeg, scan_of},
};

/// Unprocessed scans at a time: fewer than the server's queue holds.
const AHEAD: u64 = 20;

fn drive(building: &Arc<Building>) -> Vec<Step> {
    let params = DriveParams { legs: 2, ..DriveParams::default() };
    Drive::new(building.clone(), &params).step_by(2).collect()
}

/// The same scans as a file, through the command.
fn walls_of_file(building: &Building, steps: &[Step]) -> Vec<[f64; 4]> {
    let folder = tempfile::tempdir().expect("a folder");
    let (log, out) = (folder.path().join("drive.jsonl"), folder.path().join("map.json"));
    let mut text = String::new();
    for (i, step) in steps.iter().enumerate() {
        let measured = scan(building, &step.map_from_robot, &LaserParams::default(), i as u64);
        if i == 0 {
            let mount = measured.robot_from_laser();
            let head = json!({
                "waymark_recording": 1, "robot_from_laser": [mount.x_m, mount.y_m, mount.theta_rad],
                "first_bearing_rad": measured.bearing_rad(0), "bearing_step_rad": measured.bearing_step_rad(),
                "max_range_m": measured.max_range_m(),
            });
            writeln!(text, "{head}").expect("in memory");
        }
        let odom = &step.odom_from_robot;
        let odom = [odom.x_m, odom.y_m, odom.theta_rad];
        let line = json!({ "t_s": step.time_s, "odom": odom, "ranges_m": measured.ranges_m() });
        writeln!(text, "{line}").expect("in memory");
    }
    std::fs::write(&log, text).expect("a recording");
    let (log, out_text) = (log.display().to_string(), out.display().to_string());
    let run = waymark(["map", "build", &log, "--out", &out_text], 6 * SOON);
    assert_eq!(run.status, 0, "{run:?}");
    let map: Value = serde_json::from_slice(&std::fs::read(&out).expect("a map")).expect("JSON");
    ends(&map)
}

fn ends(map: &Value) -> Vec<[f64; 4]> {
    let of = |s: &Value, end: &str, k: usize| s[end][k].as_f64().expect("a number");
    let segments = map["segments"].as_array().expect("segments").iter();
    segments.map(|s| [of(s, "a", 0), of(s, "a", 1), of(s, "b", 0), of(s, "b", 1)]).collect()
}

async fn mapping(inside: &Inside) -> Value {
    let (status, progress) = call(inside, Method::GET, &format!("/maps/{MAP}/mapping"), None).await;
    assert_eq!(status, StatusCode::OK, "{progress}");
    progress
}

#[tokio::test(flavor = "multi_thread")]
async fn a_drive_over_zenoh_gives_the_walls_of_its_scan_log() {
    let inside = Inside::start(Limits::default()).await;
    let params = CorridorParams { length_m: 12.0, posters: 0, ..CorridorParams::default() };
    let building = Arc::new(Building::corridor_with(&params, 4));
    inside.maps().create_map(&NewMap::new(MAP)).await.expect("map");
    inside.maps().put_robot("r1", MAP).await.expect("robot");
    let path = format!("/maps/{MAP}/mapping");
    refusals(&inside, &path).await;
    let body = json!({ "robot": "r1" });
    let (status, begun) = call(&inside, Method::POST, &path, Some(body.clone())).await;
    assert_eq!((status, &begun["stage"]), (StatusCode::CREATED, &json!("mapping")));
    assert_eq!(call(&inside, Method::POST, &path, Some(body)).await.1["code"], "in_use");
    let options = RobotOptions {
        delivery: Delivery::Every,
        ..RobotOptions::new(&inside.server.zenoh_endpoint, "default", "r1")
    };
    let client = RobotClient::connect(&options).await.expect("connected");
    let steps = drive(&building);
    for (i, step) in steps.iter().enumerate() {
        let measured = scan(&building, &step.map_from_robot, &LaserParams::default(), i as u64);
        client.publish_scan(scan_of(&measured, &step.odom_from_robot, i as i64)).await.expect("sent");
        let due = (i as u64 + 1).saturating_sub(AHEAD);
        eventually("mapped", || async {
            (mapping(&inside).await["scans"].as_u64() >= Some(due)).then_some(())
        })
        .await;
    }
    let sent = steps.len() as u64;
    let all = || async { (mapping(&inside).await["scans"] == sent).then_some(()) };
    eventually("all mapped", all).await;
    assert_eq!(mapping(&inside).await["dropped"], 0);
    let (_, before) = call(&inside, Method::GET, &format!("/maps/{MAP}/walls"), None).await;
    assert_eq!(before["segments"], json!([]), "nothing is stored before it is finished");
    let (status, _) = call(&inside, Method::POST, &format!("{path}/finish?hold=true"), None).await;
    assert_eq!(status, StatusCode::ACCEPTED);
    let over = || async { Some(mapping(&inside).await).filter(|p| p["stage"] != "finishing") };
    let held = eventually("held", over).await;
    assert_eq!(held["stage"], "found", "{held}");
    let (_, before) = call(&inside, Method::GET, &format!("/maps/{MAP}/walls"), None).await;
    assert_eq!(before["segments"], json!([]), "nothing is stored before somebody has accepted it");
    let (status, _) = call(&inside, Method::POST, &format!("{path}/finish"), None).await;
    assert_eq!(status, StatusCode::ACCEPTED);
    let progress = eventually("stored", over).await;
    assert_eq!((&progress["stage"], progress.get("walls")), (&json!("done"), None), "{progress}");
    let (_, stored) = call(&inside, Method::GET, &format!("/maps/{MAP}/walls"), None).await;
    assert_eq!(held["walls"], stored["segments"], "what was shown is what is stored");
    let (live, file) = (ends(&stored), walls_of_file(&building, &steps));
    assert_eq!((live.len(), progress["segments"].as_u64()), (file.len(), Some(file.len() as u64)));
    assert!(live.len() >= 4, "{live:?}");
    let off = live.iter().zip(&file).flat_map(|(a, b)| a.iter().zip(b).map(|(a, b)| (a - b).abs()));
    let off = off.fold(0.0, f64::max);
    assert!(off < 1e-6, "{off} m");
    client.close().await.expect("closed");
    inside.server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn one_drive_over_zenoh_gives_walls_and_landmarks_in_use() {
    let inside = Inside::start(Limits::default()).await;
    let params = CorridorParams { length_m: 12.0, posters: 4, ..CorridorParams::default() };
    let building = Arc::new(Building::corridor_with(&params, 4));
    let maps = inside.maps();
    maps.create_map(&NewMap::new(MAP)).await.expect("map");
    maps.put_robot("r1", MAP).await.expect("robot");
    let drive = DriveParams { legs: 2, rate_hz: 2.0, ..DriveParams::default() };
    let robot = Robot::new(building.clone(), &RobotParams { drive, ..RobotParams::default() });
    let camera = *robot.camera().intrinsics();
    let options = RobotOptions::new(&inside.server.zenoh_endpoint, "default", "r1");
    let client = RobotClient::connect(&options).await.expect("connected");
    let first = robot.clone().next().expect("a step").step.map_from_robot;
    let origin = Some([first.x_m, first.y_m, first.theta_rad]);
    let new = NewMapping { robot: "r1".into(), origin, landmarks: true };
    maps.start_mapping(MAP, &new).await.expect("begun");
    for (sent, readings) in (1_u64..).zip(robot) {
        let step = &readings.step;
        client.publish_scan(scan_of(&readings.scan, &step.odom_from_robot, sent as i64)).await.expect("sent");
        let mapped = || async { (maps.mapping(MAP).await.ok()?.scans >= sent).then_some(()) };
        eventually("mapped", mapped).await;
        let image = jpeg(&readings.frame.image);
        let frame = Capture::encoded(image).expect("a picture").with_intrinsics(&camera);
        let frame = frame.with_mounting(&step.robot_from_camera).with_odometry(&step.odom_from_robot);
        client.recognise("front", frame, SOON).await.expect("answered");
    }
    let driven = maps.mapping(MAP).await.expect("progress");
    assert!(driven.frames > Some(30) && driven.frames_refused.is_none(), "{driven:?}");
    maps.accept_mapping(MAP).await.expect("finished");
    let over = || async { maps.mapping(MAP).await.ok().filter(|p| p.stage != MappingStageBody::Finishing) };
    let done = eventually("stored", over).await;
    assert_eq!((done.stage, &done.reason), (MappingStageBody::Done, &None), "{done:?}");
    assert!(done.gathering.is_some() && done.landmarks >= Some(3), "{done:?}");
    let learnt = || async {
        let landmarks = maps.landmarks(MAP).await.ok()?;
        let in_use = landmarks.iter().filter(|l| l.status == LandmarkStatus::Active).count();
        (in_use >= 3).then_some(landmarks)
    };
    for landmark in eventually("learnt", learnt).await {
        let place = landmark.place.expect("a place");
        let at = Vector3::new(place.x_m, place.y_m, place.z_m);
        let off = |truth: &LandmarkTruth| (truth.map_from_landmark.translation.vector - at).norm();
        let nearest = building.landmarks().iter().map(off).fold(f64::INFINITY, f64::min);
        assert!(nearest < 0.15 && landmark.name.starts_with(MAP), "{nearest} m off: {landmark:?}");
    }
    client.close().await.expect("closed");
    inside.server.stop().await;
}

/// Refused starts and ends, and cancelling.
async fn refusals(inside: &Inside, path: &str) {
    for (method, path, body, status, code) in [
        (Method::GET, path.to_owned(), None, 404, "not_mapping"),
        (Method::POST, format!("{path}/finish"), None, 404, "not_mapping"),
        (Method::POST, path.to_owned(), Some(json!({ "robot": "nobody" })), 404, "unknown_robot"),
        (Method::POST, "/maps/none/mapping".to_owned(), Some(json!({ "robot": "r1" })), 404, "unknown_map"),
        (
            Method::POST,
            path.to_owned(),
            Some(json!({ "robot": "r1", "origin": [1e9, 0, 0] })),
            422,
            "out_of_range",
        ),
    ] {
        let (got, problem) = call(inside, method, &path, body).await;
        assert_eq!((got.as_u16(), &problem["code"]), (status, &json!(code)), "{problem}");
    }
    // Cancelled, or without any wall: the map does not change.
    call(inside, Method::POST, path, Some(json!({ "robot": "r1" }))).await;
    assert_eq!(call(inside, Method::DELETE, path, None).await.0, StatusCode::NO_CONTENT);
    call(inside, Method::POST, path, Some(json!({ "robot": "r1" }))).await;
    call(inside, Method::POST, &format!("{path}/finish"), None).await;
    let failed = || async { Some(mapping(inside).await).filter(|p| p["stage"] == "failed") };
    let progress = tokio::time::timeout(Duration::from_secs(20), eventually("failed", failed)).await;
    let progress = progress.expect("at once");
    assert!(progress["reason"].as_str().is_some_and(|r| r.contains("no wall")), "{progress}");
}

/// A request about the mapping to a server that can be killed.
async fn ask(server: &Child, method: Method, path: &str, body: Option<Value>) -> Value {
    let http = tests::http(&server.url).await;
    let request = http.request(method, format!("{}/api/v1/maps/{MAP}/{path}", server.url));
    let request = match body {
        Some(body) => request.json(&body),
        None => request,
    };
    request.send().await.expect("an answer").json().await.unwrap_or_default()
}

async fn connected(server: &Child, epoch: u64) -> RobotClient {
    let options = RobotOptions {
        delivery: Delivery::Every,
        epoch: Some(epoch),
        ..RobotOptions::new(&server.zenoh, "default", "r1")
    };
    RobotClient::connect(&options).await.expect("connected")
}

#[tokio::test(flavor = "multi_thread")]
async fn a_mapping_continues_after_the_server_is_killed() {
    let data = tempfile::tempdir().expect("a folder");
    let mut server = Child::start(data.path());
    let params = CorridorParams { length_m: 12.0, posters: 0, ..CorridorParams::default() };
    let building = Arc::new(Building::corridor_with(&params, 4));
    server.maps().create_map(&NewMap::new(MAP)).await.expect("map");
    server.maps().put_robot("r1", MAP).await.expect("robot");
    let begun = ask(&server, Method::POST, "mapping", Some(json!({ "robot": "r1" }))).await;
    assert_eq!((&begun["stage"], &begun["journal_error"]), (&json!("mapping"), &Value::Null), "{begun}");
    let (steps, mut client) = (drive(&building), connected(&server, 77).await);
    for (i, step) in steps.iter().enumerate() {
        if i == steps.len() / 3 || i == 2 * steps.len() / 3 {
            client.close().await.expect("closed");
            server.kill();
            server = Child::start(data.path());
            client = connected(&server, 77).await;
        }
        let measured = scan(&building, &step.map_from_robot, &LaserParams::default(), i as u64);
        client.publish_scan(scan_of(&measured, &step.odom_from_robot, i as i64)).await.expect("sent");
        let taken = || async {
            (ask(&server, Method::GET, "mapping", None).await["scans"].as_u64() > Some(i as u64))
                .then_some(())
        };
        eventually("mapped", taken).await;
    }
    let progress = ask(&server, Method::GET, "mapping", None).await;
    assert_eq!((&progress["stage"], &progress["dropped"]), (&json!("mapping"), &json!(0)), "{progress}");
    ask(&server, Method::POST, "mapping/finish", None).await;
    let done =
        || async { Some(ask(&server, Method::GET, "mapping", None).await).filter(|p| p["stage"] == "done") };
    eventually("stored", done).await;
    let (live, file) =
        (ends(&ask(&server, Method::GET, "walls", None).await), walls_of_file(&building, &steps));
    assert!(live.len() == file.len() && live.len() >= 4, "{live:?}");
    let off =
        live.iter().flatten().zip(file.iter().flatten()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(off < 1e-6, "{off} m");
    let walls: WallsBody =
        serde_json::from_value(ask(&server, Method::GET, "walls", None).await).expect("walls");
    // Of scans of 1 cm, relative to the first pose of the drive.
    let offset_m = |w: &WallBody| w.covariance.expect("a wall of scans is known so well")[2].sqrt();
    assert!(walls.segments.iter().map(offset_m).all(|m| (1e-4..0.5).contains(&m)), "{walls:?}");
    // They are taken as they are given.
    let again = server.maps();
    let stored = again.walls_revised(MAP).await.expect("walls");
    again.if_match(&stored.revision).set_walls(MAP, &stored.value).await.expect("set");
    let taken = server.maps().walls(MAP).await.expect("walls");
    let off = |(a, b): (&WallBody, &WallBody)| (offset_m(a) - offset_m(b)).abs();
    assert!(taken.segments.iter().zip(&walls.segments).map(off).all(|m| m < 1e-9), "{taken:?}");
    let left = std::fs::read_dir(data.path().join("mapping")).expect("the folder").count();
    assert_eq!(left, 0, "the journal of a stored map is deleted");
    client.close().await.expect("closed");
    server.kill();
}
