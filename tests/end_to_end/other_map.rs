//! Claim: a frame may name any map and is answered; but only frames against the robot's own map
//! affect its fused pose and that map's landmarks.

use client::{RobotClient, api::NewMap, v1};
use reqwest::Method;
use serde_json::Value;
use server::config::Limits;
use sim::{building::Building, corridor::CorridorParams, robot::SensorReadings};
use std::sync::Arc;
use tests::{
    Inside, SOON,
    robots::{MAP, call, capture, connect, find_itself, teach},
};

/// A map without landmarks.
const OTHER: &str = "cellar";

/// Sends a frame to be recognised in `map`.
async fn ask(robot: &RobotClient, readings: &SensorReadings, map: &str) -> v1::Answer {
    let answer = robot.recognise("front", capture(readings).against_map(map), SOON).await.expect("an answer");
    assert_eq!(answer.map, map);
    answer
}

/// Outcomes of a robot's fixes.
async fn fixes(inside: &Inside, robot: &str) -> Value {
    call(inside, Method::GET, &format!("/robots/{robot}/corrections"), None).await.1
}

/// The second robot must get no fused pose on another map than its own, and the first must keep its
/// pose.
#[tokio::test(flavor = "multi_thread")]
async fn a_frame_against_another_map_is_answered_and_changes_nothing() {
    let inside = Inside::start(Limits::default()).await;
    let params = CorridorParams { posters: 1, column: false, ..CorridorParams::default() };
    let building = Arc::new(Building::corridor_with(&params, 3));
    let maps = inside.maps();
    maps.create_map(&NewMap::new(MAP)).await.expect("map");
    maps.create_map(&NewMap::new(OTHER)).await.expect("map");
    teach(&inside, &building, &["poster-0"], 6).await;
    maps.put_robot("r1", MAP).await.expect("robot");
    maps.put_robot("r2", OTHER).await.expect("robot");

    // The first robot gets a pose.
    let r1 = connect(&inside.server.zenoh_endpoint, "r1").await;
    let readings = find_itself(&inside, &building, &r1, "r1").await;
    let before = fixes(&inside, "r1").await;

    // A frame against another map is answered, and the pose continues.
    let elsewhere = ask(&r1, &readings, OTHER).await;
    assert_eq!(elsewhere.status(), v1::Status::NoMatch, "{elsewhere:?}");
    assert!(elsewhere.map_from_robot.is_none() && elsewhere.hypotheses.is_empty());
    let mut poses = r1.poses();
    r1.publish_odometry(&readings.step.odom_from_robot).await.expect("sent");
    let pose = tokio::time::timeout(SOON, poses.recv()).await.expect("its pose continues").expect("a pose");
    assert_eq!((pose.map.as_str(), pose.corrections), (MAP, 1));
    assert_eq!(fixes(&inside, "r1").await, before);

    // The other robot recognises the poster in a map that is not its own: a pose in the answer, and
    // no other effect.
    let r2 = connect(&inside.server.zenoh_endpoint, "r2").await;
    let mut poses = r2.poses();
    let version = maps.map(MAP).await.expect("the map").version;
    let answer = ask(&r2, &readings, MAP).await;
    assert_eq!(answer.status(), v1::Status::Matched, "{answer:?}");
    assert!(answer.map_from_robot.is_some() && answer.pose_landmarks == ["poster-0"], "{answer:?}");
    // A later frame is answered, so that effects of the frame before would have happened by now.
    ask(&r2, &readings, OTHER).await;
    r2.publish_odometry(&readings.step.odom_from_robot).await.expect("sent");
    ask(&r2, &readings, OTHER).await;
    assert_eq!(fixes(&inside, "r2").await["totals"], serde_json::json!({}));
    assert!(poses.try_recv().is_err(), "a pose on a map that is not its own");
    assert_eq!(maps.map(MAP).await.expect("the map").version, version);
    r1.close().await.expect("closed");
    r2.close().await.expect("closed");
    inside.server.stop().await;
}
