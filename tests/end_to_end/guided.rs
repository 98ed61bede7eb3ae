//! Claim: a robot with a known pose is corrected by posters with one picture: each is named by
//! guided recognition, and marked as guided. Guided names never give a pose to a robot without one,
//! and the API shows which fixes were guided.

use client::{api::NewMap, v1};
use map::pose2::Pose2Covariance;
use nalgebra::{Matrix3, Vector3};
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
    Inside, SOON,
    robots::{MAP, call, capture, connect, put_walls, teach},
};
use vision::geometry::{Corners, polygon};

/// Twelve posters with one picture, then two with pictures of their own, on the end walls.
const POSTERS: usize = 14;

/// Guided names: right and wrong ones.
fn score(answer: &v1::Answer, readings: &SensorReadings) -> (usize, usize) {
    let named = answer.quads.iter().filter(|q| q.sighting() == v1::Sighting::Guided);
    let is_right = |quad: &v1::QuadAnswer| {
        let points: Vec<[f64; 2]> = quad.corners.iter().map(|p| [p.u_px, p.v_px]).collect();
        let found = Corners::try_from(<[[f64; 2]; 4]>::try_from(points).expect("four corners"));
        let truth = readings.frame.truth.landmark(&quad.guided_landmark);
        truth.is_some_and(|t| found.is_ok_and(|f| polygon::iou(f.points(), t.corners_px.points()) > 0.5))
    };
    let (mut right, mut wrong) = (0, 0);
    for quad in named {
        assert_ne!(quad.verdict(), v1::Verdict::Unique, "the picture alone leaves several");
        assert!(quad.landmark.is_empty() && quad.pose.is_some(), "{quad:?}");
        if is_right(quad) { right += 1 } else { wrong += 1 }
    }
    (right, wrong)
}

#[tokio::test(flavor = "multi_thread")]
async fn posters_with_one_picture_correct_a_known_pose() {
    let params = CorridorParams {
        length_m: 40.0,
        posters: POSTERS,
        pictures: 1,
        unique_posters: 2,
        column: false,
        ..CorridorParams::default()
    };
    let building = Arc::new(Building::corridor_with(&params, 5));
    let inside = Inside::start(Limits::default()).await;
    inside.maps().create_map(&NewMap::new(MAP)).await.expect("map");
    put_walls(&inside, &building).await;
    let names: Vec<String> = (0..POSTERS).map(|i| format!("poster-{i}")).collect();
    teach(&inside, &building, &names.iter().map(String::as_str).collect::<Vec<_>>(), 3).await;
    inside.maps().put_robot("r1", MAP).await.expect("robot");
    let client = connect(&inside.server.zenoh_endpoint, "r1").await;
    let drive = DriveParams { start_m: 12.0, ..DriveParams::default() };
    let mut robot = Robot::new(building.clone(), &RobotParams { drive, ..RobotParams::default() });
    let steps: Vec<_> = std::iter::from_fn(|| robot.drive_mut().next()).collect();
    // At first nothing unique is in view: without a pose there are no guided names.
    let first = robot.look(&steps[0]);
    let answer = client.recognise("front", capture(&first), SOON).await.expect("an answer");
    assert!(answer.guided_landmarks.is_empty() && answer.map_from_robot.is_none(), "{answer:?}");
    assert_eq!(score(&answer, &first), (0, 0));
    // With a prior pose of the robot the posters are named.
    let (mut right, mut wrong, mut posed) = (0, 0, 0);
    for step in steps.iter().step_by(3).take(40) {
        let readings = robot.look(step);
        let at = &step.map_from_robot;
        let sigmas = Vector3::new(0.1, 0.1, 0.017);
        let covariance = Matrix3::from_diagonal(&sigmas.component_mul(&sigmas));
        let believed = Pose2Covariance { pose: *at, covariance };
        let answer = client
            .recognise("front", capture(&readings).with_prior(&believed), SOON)
            .await
            .expect("an answer");
        let named = score(&answer, &readings);
        (right, wrong) = (right + named.0, wrong + named.1);
        if let Some(pose) = &answer.guided_map_from_robot {
            posed += 1;
            let pose = pose.pose.expect("a pose");
            let off_m = (pose.x_m - at.x_m).hypot(pose.y_m - at.y_m);
            assert!(off_m < 0.3 && !answer.guided_landmarks.is_empty(), "{off_m} m off: {answer:?}");
        }
        let unique = answer.quads.iter().any(|q| q.verdict() == v1::Verdict::Unique);
        assert!(unique || answer.map_from_robot.is_none(), "a global pose from guided names");
    }
    assert!(right >= 15 && posed >= 10 && wrong == 0, "{right} right, {wrong} wrong, {posed} poses");
    let (_, log) = call(&inside, Method::GET, "/robots/r1/corrections", None).await;
    println!("{right} guided names, {posed} poses; {}", log["totals"]);
    client.close().await.expect("closed");
    inside.server.stop().await;
}
