//! Claim: a robot may ask about any map, and is answered; but its pose and what the map knows follow only from frames
//! against the map it stands on. A frame that names another map does not disturb the fused pose.

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

/// Sends what was seen, compared with `map`.
async fn ask(robot: &RobotClient, seen: &SensorReadings, map: &str) -> v1::Answer {
    let answer = robot.recognise("front", capture(seen).against_map(map), SOON).await.expect("an answer");
    assert_eq!(answer.map, map);
    answer
}

/// What became of the fixes of a robot.
async fn fixes(inside: &Inside, robot: &str) -> Value {
    call(inside, Method::GET, &format!("/robots/{robot}/corrections"), None).await.1
}

/// Fault F4. Before, the second robot got fused poses on a map it does not stand on, and the first lost its pose.
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

    // The first robot finds out where it is.
    let r1 = connect(&inside.server.zenoh_endpoint, "r1").await;
    let seen = find_itself(&inside, &building, &r1, "r1").await;
    let before = fixes(&inside, "r1").await;

    // It asks about another map: answered, and its pose goes on.
    let elsewhere = ask(&r1, &seen, OTHER).await;
    assert_eq!(elsewhere.status(), v1::Status::NoMatch, "{elsewhere:?}");
    assert!(elsewhere.map_from_robot.is_none() && elsewhere.hypotheses.is_empty());
    let mut poses = r1.poses();
    r1.publish_odometry(&seen.step.odom_from_robot).await.expect("sent");
    let pose = tokio::time::timeout(SOON, poses.recv()).await.expect("its pose goes on").expect("a pose");
    assert_eq!((pose.map.as_str(), pose.corrections), (MAP, 1));
    assert_eq!(fixes(&inside, "r1").await, before);

    // The other robot sees the poster on a map it does not stand on: a pose in the answer, nothing anywhere else.
    let r2 = connect(&inside.server.zenoh_endpoint, "r2").await;
    let mut poses = r2.poses();
    let version = maps.map(MAP).await.expect("the map").version;
    let answer = ask(&r2, &seen, MAP).await;
    assert_eq!(answer.status(), v1::Status::Matched, "{answer:?}");
    assert!(answer.map_from_robot.is_some() && answer.pose_landmarks == ["poster-0"], "{answer:?}");
    // On its own map it is answered after that: whatever came of the frame before has come by now.
    ask(&r2, &seen, OTHER).await;
    r2.publish_odometry(&seen.step.odom_from_robot).await.expect("sent");
    ask(&r2, &seen, OTHER).await;
    assert_eq!(fixes(&inside, "r2").await["totals"], serde_json::json!({}));
    assert!(poses.try_recv().is_err(), "a pose on a map it does not stand on");
    assert_eq!(maps.map(MAP).await.expect("the map").version, version);
    r1.close().await.expect("closed");
    r2.close().await.expect("closed");
    inside.server.stop().await;
}
