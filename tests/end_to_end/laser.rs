//! Claim: a robot with odometry, a laser and a single landmark is localised on a map with walls:
//! across a corridor within centimetres over any distance, in a room in all directions. Scans alone
//! give no first pose; the first frames with a unique landmark do; every correction can be read.
//! From a reference run the server learns modality statistics.

use client::{Capture, Delivery, RobotClient, RobotOptions, api::NewMap, v1};
use map::pose2::Pose2;
use reqwest::{Method, StatusCode};
use serde_json::{Value, json};
use server::config::Limits;
use sim::{
    building::Building,
    corridor::CorridorParams,
    drive::{DriveParams, Step},
    robot::{Robot, RobotParams, SensorReadings},
};
use std::{
    sync::Arc,
    time::{SystemTime, UNIX_EPOCH},
};
use tests::{
    Inside, SOON, eventually,
    robots::{MAP, call, jpeg, put_walls, scan_message, teach},
};

/// Most frames with the landmark until there is a pose.
const FIRST_FIX_FRAMES: usize = 3;

struct Run {
    inside: Inside,
    building: Arc<Building>,
    client: RobotClient,
    robot: Robot,
    poses: tokio::sync::broadcast::Receiver<v1::RobotPose>,
    scans: u64,
    last: Option<v1::RobotPose>,
    /// True pose at every scan, by the robot's clock.
    path: Vec<(i64, Pose2)>,
}

impl Run {
    /// A building with one landmark taught, and a robot at the start of its drive.
    async fn start(params: &CorridorParams, drive: DriveParams) -> Self {
        let inside = Inside::start(Limits::default()).await;
        let building = Arc::new(Building::corridor_with(params, 3));
        inside.maps().create_map(&NewMap::new(MAP)).await.expect("map");
        put_walls(&inside, &building).await;
        teach(&inside, &building, &["poster-0"], 6).await;
        inside.maps().put_robot("r1", MAP).await.expect("robot");
        let options = RobotOptions {
            delivery: Delivery::Every,
            ..RobotOptions::new(&inside.server.zenoh_endpoint, "default", "r1")
        };
        let client = RobotClient::connect(&options).await.expect("connected");
        let robot = Robot::new(building.clone(), &RobotParams { drive, ..RobotParams::default() });
        let poses = client.poses();
        Self { inside, building, client, robot, poses, scans: 0, last: None, path: Vec::new() }
    }

    async fn corrections(&self) -> Value {
        let (status, log) = call(&self.inside, Method::GET, "/robots/r1/corrections", None).await;
        assert_eq!(status, StatusCode::OK, "{log}");
        log
    }

    /// Sends a scan and waits until the server has processed it.
    async fn scan(&mut self, readings: &SensorReadings) {
        let captured_ns = now_ns();
        self.path.push((captured_ns, readings.step.map_from_robot));
        self.client.publish_scan(scan_message(readings, captured_ns)).await.expect("sent");
        self.scans += 1;
        eventually("the scan is processed", || async {
            let log = self.corrections().await;
            let ends = log["totals"]["laser"].as_object()?;
            (ends.values().filter_map(Value::as_u64).sum::<u64>() == self.scans).then_some(())
        })
        .await;
    }

    /// Sends a frame; whether the landmark was named in it, and whether it gave a pose.
    async fn frame(&mut self, readings: &SensorReadings) -> [bool; 2] {
        let capture = Capture::encoded(jpeg(&readings.frame.image))
            .expect("a picture")
            .with_intrinsics(sim::camera::Camera::vga().intrinsics())
            .with_mounting(&readings.step.robot_from_camera)
            .with_odometry(&readings.step.odom_from_robot)
            .with_deadline_ms(60_000);
        let answer = self.client.recognise("front", capture, SOON).await.expect("an answer");
        [answer.quads.iter().any(|q| q.landmark == "poster-0"), answer.map_from_robot.is_some()]
    }

    /// The pose after an odometry message with the present time.
    async fn pose(&mut self, step: &Step) -> Option<v1::RobotPose> {
        let before = now_ns();
        self.client.publish_odometry(&step.odom_from_robot).await.expect("sent");
        self.last.as_ref()?;
        let newest = async {
            loop {
                let pose = self.poses.recv().await.expect("poses");
                if pose.captured_ns >= before {
                    return pose;
                }
            }
        };
        Some(tokio::time::timeout(SOON, newest).await.expect("a pose"))
    }
}

fn now_ns() -> i64 {
    SystemTime::now().duration_since(UNIX_EPOCH).expect("after 1970").as_nanos() as i64
}

/// Error of a pose on the wire: x, y (m), heading (rad).
fn errors(pose: &v1::RobotPose, truth: &Pose2) -> [f64; 3] {
    let at = pose.map_from_robot.as_ref().and_then(|p| p.pose).expect("a pose");
    let e = Pose2::new(at.x_m, at.y_m, at.theta_rad).minus(truth);
    [e.x, e.y, e.z]
}

/// Drives; sends a scan at each step, and a frame if the camera is aimed at the landmark. Errors
/// after the first fix.
async fn drive(run: &mut Run, every: usize) -> Vec<[f64; 3]> {
    let mut steps = Vec::new();
    while let Some(step) = run.robot.drive_mut().next() {
        steps.push(step);
    }
    let (mut shown, mut errors_after) = (0, Vec::new());
    for step in steps.iter().step_by(every) {
        let readings = run.robot.look(step);
        run.scan(&readings).await;
        let is_aimed = step.target.as_deref() == Some("poster-0");
        if run.last.is_none() {
            let log = run.corrections().await;
            assert_eq!(log["totals"]["laser"]["applied"], Value::Null, "a scan gave a first pose: {log}");
        }
        if is_aimed {
            let [named, posed] = run.frame(&readings).await;
            shown += usize::from(named);
            if posed && run.last.is_none() {
                // The answer is sent before the pose is updated.
                let started = || async {
                    (run.corrections().await["totals"]["landmarks"]["started"] == 1).then_some(())
                };
                eventually("started", started).await;
                run.last = Some(v1::RobotPose::default());
            }
            let known = run.last.is_some();
            assert!(known || shown < FIRST_FIX_FRAMES, "no pose after {shown} frames that show the landmark");
        }
        if let Some(pose) = run.pose(step).await {
            errors_after.push(errors(&pose, &step.map_from_robot));
            run.last = Some(pose);
        }
    }
    errors_after
}

fn rms(errors: &[[f64; 3]], of: usize) -> f64 {
    (errors.iter().map(|e| e[of] * e[of]).sum::<f64>() / errors.len() as f64).sqrt()
}

#[tokio::test(flavor = "multi_thread")]
async fn in_a_corridor_the_laser_bounds_the_error_across() {
    let params = CorridorParams { posters: 1, column: false, ..CorridorParams::default() };
    let drive_params = DriveParams { start_m: 9.0, ..DriveParams::default() };
    let mut run = Run::start(&params, drive_params).await;
    let begun = call(&run.inside, Method::POST, "/robots/r1/recording", None).await;
    assert_eq!((begun.0, &begun.1["active"]), (StatusCode::CREATED, &Value::from(true)), "{begun:?}");
    let errors = drive(&mut run, 2).await;
    assert!(errors.len() > 40, "{}", errors.len());
    let (across, heading) = (rms(&errors, 1), rms(&errors, 2));
    assert!(across < 0.03 && heading < 0.01, "{across} m across, {heading} rad");
    let log = run.corrections().await;
    let ends = &log["totals"]["laser"];
    assert!(ends["applied"].as_u64() > Some(40), "{ends}");
    let modalities: Vec<_> = log["modalities"].as_array().expect("as promised").iter().collect();
    assert!(modalities.contains(&&Value::from("laser")), "{log}");
    let each = log["corrections"].as_array().expect("as promised");
    let first = each.iter().find(|c| c["outcome"] == "started").expect("a first fix");
    assert_eq!((&first["modality"], &first["landmarks"][0]), (&"landmarks".into(), &"poster-0".into()));
    assert!(
        each.iter().any(|c| c["modality"] == "laser" && c["chi2"].is_number() && c["across_m"].is_number())
    );
    let (status, _) = call(&run.inside, Method::GET, "/robots/nobody/corrections", None).await;
    assert_eq!(status, StatusCode::NOT_FOUND);
    learnt_from(&run).await;
    run.client.close().await.expect("closed");
    run.inside.server.stop().await;
}

/// Finishes the recording with a reference trajectory; the server learns modality statistics.
async fn learnt_from(run: &Run) {
    let ask = async |method, path: &str, body| call(&run.inside, method, path, body).await;
    let (status, problem) = ask(Method::POST, "/robots/r1/recording", None).await;
    assert_eq!((status, &problem["code"]), (StatusCode::CONFLICT, &"in_use".into()));
    let (_, recorded) = ask(Method::GET, "/robots/r1/recording", None).await;
    assert!(recorded["laser"].as_u64() > Some(40) && recorded["landmarks"].as_u64() > Some(0), "{recorded}");
    let reference = "/robots/r1/recording/reference";
    let poses = |shift_ns: i64| {
        let pose = |(t, p): &(i64, Pose2)| json!([t + shift_ns, p.x_m, p.y_m, p.theta_rad]);
        json!({ "poses": run.path.iter().map(pose).collect::<Vec<_>>() })
    };
    let refusals = [
        (json!({ "poses": [[2, 0.0, 0.0, 0.0], [1, 0.0, 0.0, 0.0]] }), "not_in_order", "poses[1]"),
        (json!({ "poses": [[1, 0.0, 1e9, 0.0], [2, 0.0, 0.0, 0.0]] }), "out_of_range", "poses[0].y_m"),
        (poses(1 << 50), "no_overlap", "poses"),
    ];
    for (body, code, field) in refusals {
        let (status, problem) = ask(Method::POST, reference, Some(body)).await;
        assert_eq!(status, StatusCode::UNPROCESSABLE_ENTITY, "{problem}");
        assert_eq!((&problem["code"], &problem["field"]), (&code.into(), &field.into()));
    }
    let (status, learnt) = ask(Method::POST, reference, Some(poses(0))).await;
    assert_eq!(status, StatusCode::CREATED, "{learnt}");
    assert!(learnt["distance_m"].as_f64() > Some(5.0) && learnt["cells"].as_u64() > Some(5), "{learnt}");
    let laser = &learnt["statistics"][1];
    let availability = laser["availability"].as_f64();
    assert!(laser["modality"] == "laser" && availability > Some(0.5), "{learnt}");
    assert!(laser["sigma"][1].as_f64() < Some(0.03), "{learnt}");
    let modalities = format!("/maps/{MAP}/modalities");
    let corridor =
        json!([{ "name": "corridor", "corners_m": [[-1.0, -3.0], [40.0, -3.0], [40.0, 3.0], [-1.0, 3.0]] }]);
    let (status, known) =
        ask(Method::PUT, &modalities, Some(json!({ "fusion_mode": "near_best", "areas": corridor }))).await;
    assert_eq!((status, &known["fusion_mode"]), (StatusCode::OK, &"near_best".into()), "{known}");
    assert_eq!(known["cells"].as_array().map(Vec::len), learnt["cells"].as_u64().map(|n| n as usize));
    let at = &run.path[run.path.len() / 2].1;
    let at = format!("{modalities}/at?x_m={}&y_m={}&theta_rad={}", at.x_m, at.y_m, at.theta_rad);
    let (_, here) = ask(Method::GET, &at, None).await;
    assert_eq!(here["advice"]["scope"], "area", "{here}");
    assert!(
        here["advice"]["best"].is_string() && here["statistics"][0]["steps"].as_u64() > Some(0),
        "{here}"
    );
    let twice = json!({ "areas": [corridor[0], corridor[0]] });
    let (status, problem) = ask(Method::PUT, &modalities, Some(twice)).await;
    assert_eq!((status, &problem["field"]), (StatusCode::UNPROCESSABLE_ENTITY, &"areas[1].name".into()));
    let one = format!("/maps/{MAP}/reference-runs/{}", learnt["id"]);
    assert_eq!(ask(Method::DELETE, &one, None).await.0, StatusCode::NO_CONTENT);
    assert_eq!(ask(Method::DELETE, &one, None).await.1["code"], "unknown_reference_run");
    let (_, known) = ask(Method::GET, &modalities, None).await;
    assert_eq!(known["cells"], json!([]));
    assert_eq!(ask(Method::GET, "/robots/r1/recording", None).await.1["code"], "not_recording");
    // Deleting a robot deletes its recording.
    assert_eq!(ask(Method::POST, "/robots/r1/recording", None).await.0, StatusCode::CREATED);
    assert_eq!(ask(Method::DELETE, "/robots/r1", None).await.0, StatusCode::NO_CONTENT);
    assert_eq!(ask(Method::PUT, "/robots/r1", Some(json!({ "map": MAP }))).await.0, StatusCode::OK);
    assert_eq!(ask(Method::POST, "/robots/r1/recording", None).await.0, StatusCode::CREATED);
}

#[tokio::test(flavor = "multi_thread")]
async fn in_a_room_the_laser_bounds_all_errors_after_a_first_fix() {
    let params = CorridorParams { posters: 1, length_m: 9.0, width_m: 5.0, ..CorridorParams::default() };
    let mut run = Run::start(&params, DriveParams { legs: 2, ..DriveParams::default() }).await;
    let errors = drive(&mut run, 2).await;
    assert!(errors.len() > 40, "{}", errors.len());
    let [x, y, heading] = [0, 1, 2].map(|k| rms(&errors, k));
    assert!(x < 0.03 && y < 0.03 && heading < 0.01, "{x} m, {y} m, {heading} rad");
    assert_eq!(run.building.posters().count(), 1);
    run.client.close().await.expect("closed");
    run.inside.server.stop().await;
}
