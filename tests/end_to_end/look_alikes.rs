//! Claim: a robot with an unknown start pose that observes only look-alikes gets several pose
//! hypotheses and no pose until one is left; then it has that pose, and guided recognition names
//! the landmarks.

use client::{Capture, Delivery, RobotClient, RobotOptions, api::NewMap, named_landmarks, v1};
use map::pose2::{Pose2, wrap_rad};
use nalgebra::Point2;
use reqwest::Method;
use server::config::Limits;
use sim::{
    building::Building,
    corridor::CorridorParams,
    drive::DriveParams,
    robot::{Robot, RobotParams, SensorReadings},
};
use std::sync::Arc;
use tests::{
    Inside, SOON, eventually,
    robots::{MAP, call, jpeg, put_walls, teach},
};
use vision::geometry::polygon::iou;

/// Three posters with the same picture, left, right and left.
const LOOK_ALIKES: [&str; 3] = ["poster-0", "poster-1", "poster-2"];

async fn ask(client: &RobotClient, readings: &SensorReadings) -> v1::Answer {
    let capture = Capture::encoded(jpeg(&readings.frame.image))
        .expect("a picture")
        .with_intrinsics(sim::camera::Camera::vga().intrinsics())
        .with_mounting(&readings.step.robot_from_camera)
        .with_odometry(&readings.step.odom_from_robot)
        .with_deadline_ms(60_000);
    client.recognise("front", capture, SOON).await.expect("an answer")
}

/// Distance and turn between a pose on the wire and the truth.
fn off(pose: &v1::Pose2Covariance, truth: &Pose2) -> (f64, f64) {
    let at = pose.pose.expect("a pose");
    ((at.x_m - truth.x_m).hypot(at.y_m - truth.y_m), wrap_rad(at.theta_rad - truth.theta_rad).abs())
}

/// The API has the same hypotheses as the robot's answer, and what is missing for a pose.
async fn check_hypotheses_over_http(inside: &Inside, answer: &v1::Answer) {
    let (_, found) = call(inside, Method::GET, "/robots/r1/relocalisation", None).await;
    assert_eq!((&found["relocalising"], &found["map"]), (&true.into(), &MAP.into()), "{found}");
    assert_eq!(found["missing"][0], "higher_probability", "{found}");
    let all = found["hypotheses"].as_array().expect("a list");
    assert_eq!(all.len(), answer.hypotheses.len(), "{found}");
    for (shown, sent) in all.iter().zip(&answer.hypotheses) {
        let pose = sent.map_from_robot.as_ref().expect("a pose");
        let same =
            |shown: &serde_json::Value, sent: f64| shown.as_f64().is_some_and(|v| (v - sent).abs() < 1e-9);
        assert!(same(&shown["probability"], sent.probability), "{found}");
        assert!(same(&shown["x_m"], pose.pose.expect("a pose").x_m), "{found}");
        assert!(same(&shown["covariance"][4], pose.covariance[4]), "{found}");
    }
    assert!(found["entropy_nats"].as_f64().is_some_and(|e| e > 0.5), "{found}");
}

#[tokio::test(flavor = "multi_thread")]
async fn twelve_equal_doors_give_no_wrong_pose() {
    let params = CorridorParams {
        length_m: 40.0,
        posters: 12,
        pictures: 1,
        column: false,
        ..CorridorParams::default()
    };
    let building = Arc::new(Building::corridor_with(&params, 3));
    let inside = Inside::start(Limits::default()).await;
    inside.maps().create_map(&NewMap::new(MAP)).await.expect("map");
    put_walls(&inside, &building).await;
    let names: Vec<String> = (0..12).map(|i| format!("poster-{i}")).collect();
    teach(&inside, &building, &names.iter().map(String::as_str).collect::<Vec<_>>(), 3).await;
    inside.maps().put_robot("r1", MAP).await.expect("robot");
    let options = RobotOptions {
        delivery: Delivery::Every,
        ..RobotOptions::new(&inside.server.zenoh_endpoint, "default", "r1")
    };
    let client = RobotClient::connect(&options).await.expect("connected");
    let drive = DriveParams { start_m: 12.0, ..DriveParams::default() };
    let mut robot = Robot::new(building.clone(), &RobotParams { drive, ..RobotParams::default() });
    let steps: Vec<_> = std::iter::from_fn(|| robot.drive_mut().next()).collect();
    let mut poses = client.poses();
    let (mut several, mut most) = (0, 0);
    for step in steps.iter().step_by(3).take(40) {
        let answer = ask(&client, &robot.look(step)).await;
        assert!(answer.map_from_robot.is_none(), "nothing here is unique");
        most = most.max(answer.hypotheses.len());
        let true_one = |h: &v1::Hypothesis| {
            let (m, rad) = off(h.map_from_robot.as_ref().expect("a pose"), &step.map_from_robot);
            m < 0.8 && rad < 0.5
        };
        several += usize::from(answer.hypotheses.len() >= 2 && answer.hypotheses.iter().any(true_one));
        if let Ok(pose) = poses.try_recv() {
            // The doors are nearly evenly spaced; a pose, if any, comes at the end of the row, and
            // is right.
            let (m, rad) = off(pose.map_from_robot.as_ref().expect("a pose"), &step.map_from_robot);
            assert!(m < 0.8 && rad < 0.3, "{m} m, {rad} rad off");
            break;
        }
    }
    assert!(several >= 3 && most >= 5, "{several} frames with the true place among several, {most} at most");
    client.close().await.expect("closed");
    inside.server.stop().await;
}

/// From then on guided recognition names each of them; the API shows these fixes as guided.
async fn named_by_pose(inside: &Inside, client: &RobotClient, drive: impl Iterator<Item = SensorReadings>) {
    let mut poses = client.poses();
    let (mut right, mut trust) = (0, Vec::new());
    for readings in drive {
        let answer = ask(client, &readings).await;
        for named in named_landmarks(&answer) {
            assert!(named.is_guided(), "nothing here is unique: {named:?}");
            let truth = readings.frame.truth.landmark(named.name).expect("a landmark in view");
            let corners: Vec<_> = named.quad.corners.iter().map(|c| Point2::new(c.u_px, c.v_px)).collect();
            assert!(iou(&corners, truth.corners_px.points()) > 0.5, "{named:?} is not there");
            right += 1;
        }
        trust.extend(std::iter::from_fn(|| poses.try_recv().ok()).map(|pose| pose.trust()));
    }
    assert!(right >= 3, "{right} guided names");
    assert!(trust.iter().all(|t| [v1::PoseTrust::Supported, v1::PoseTrust::Stale].contains(t)), "{trust:?}");
    let logged = || async {
        let (_, log) = call(inside, Method::GET, "/robots/r1/corrections", None).await;
        log["totals"]["guided"]["applied"].as_u64().is_some_and(|n| n > 0).then_some(log)
    };
    let log = eventually("logged as guided", logged).await;
    assert_eq!(log["totals"]["landmarks"], serde_json::Value::Null, "none has a global name: {log}");
}

#[tokio::test(flavor = "multi_thread")]
async fn look_alikes_give_hypotheses_and_no_pose_until_one_is_left() {
    let params = CorridorParams { posters: 3, pictures: 1, column: false, ..CorridorParams::default() };
    let building = Arc::new(Building::corridor_with(&params, 3));
    let inside = Inside::start(Limits::default()).await;
    inside.maps().create_map(&NewMap::new(MAP)).await.expect("map");
    put_walls(&inside, &building).await;
    teach(&inside, &building, &LOOK_ALIKES, 6).await;
    inside.maps().put_robot("r1", MAP).await.expect("robot");
    let options = RobotOptions {
        delivery: Delivery::Every,
        ..RobotOptions::new(&inside.server.zenoh_endpoint, "default", "r1")
    };
    let client = RobotClient::connect(&options).await.expect("connected");
    let drive = DriveParams { start_m: 2.0, ..DriveParams::default() };
    let mut robot = Robot::new(building.clone(), &RobotParams { drive, ..RobotParams::default() });
    let mut steps = Vec::new();
    while let Some(step) = robot.drive_mut().next() {
        steps.push(step);
    }
    let mut poses = client.poses();
    let (mut several, mut checked, mut left) = (0, false, None);
    let mut ahead = steps.iter().step_by(2);
    for step in ahead.by_ref() {
        let answer = ask(&client, &robot.look(step)).await;
        assert!(answer.map_from_robot.is_none(), "nothing here is unique");
        let true_one = |h: &v1::Hypothesis| {
            let (m, rad) = off(h.map_from_robot.as_ref().expect("a pose"), &step.map_from_robot);
            m < 0.8 && rad < 0.5
        };
        several += usize::from(answer.hypotheses.len() >= 2 && answer.hypotheses.iter().any(true_one));
        if several == 1 && !checked {
            checked = true;
            check_hypotheses_over_http(&inside, &answer).await;
        }
        if answer.hypotheses.first().is_some_and(|h| h.probability > 0.95) {
            // A pose needs observations of two different landmarks.
            if let Ok(Ok(pose)) =
                tokio::time::timeout(std::time::Duration::from_millis(300), poses.recv()).await
            {
                left = Some((step.clone(), pose));
                break;
            }
        }
        assert!(poses.try_recv().is_err(), "a pose while several hypotheses are left");
    }
    assert!(several >= 2, "{several} frames with several hypotheses, the true one among them");
    let (step, pose) = left.expect("one is left in the end");
    let (m, rad) = off(pose.map_from_robot.as_ref().expect("a pose"), &step.map_from_robot);
    assert!(m < 0.5 && rad < 0.25, "{m} m, {rad} rad off");
    assert_eq!(pose.modalities, ["odometry", "relocalisation"]);
    let logged = || async {
        let (_, log) = call(&inside, Method::GET, "/robots/r1/corrections", None).await;
        (log["totals"]["relocalisation"]["started"] == 1).then_some(log)
    };
    let log = eventually("logged", logged).await;
    let names = log["corrections"][0]["landmarks"].as_array().map_or(0, Vec::len);
    assert!(names >= 2 && log["corrections"][0]["modality"] == "relocalisation", "{log}");
    named_by_pose(&inside, &client, ahead.take(20).map(|step| robot.look(step))).await;
    client.close().await.expect("closed");
    inside.server.stop().await;
}
