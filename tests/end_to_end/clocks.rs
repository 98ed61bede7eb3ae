//! Claim: a stray stamp has no influence on the fused pose, whatever message it is in; the pose
//! continues with the next message. A pose has its age, and a robot that falls silent soon has no
//! pose.

use client::{RobotClient, api::NewMap, v1};
use engine::motion::MAX_POSE_AGE;
use map::pose2::Pose2;
use server::config::Limits;
use sim::{building::Building, corridor::CorridorParams};
use std::{
    sync::Arc,
    time::{Duration, SystemTime, UNIX_EPOCH},
};
use tests::{
    Inside, SOON, eventually,
    robots::{MAP, capture, connect, find_itself, teach},
};

const HOUR_NS: i64 = 3_600_000_000_000;

fn now_ns() -> i64 {
    SystemTime::now().duration_since(UNIX_EPOCH).expect("after 1970").as_nanos() as i64
}

/// The pose after an odometry message with the present time.
async fn pose(
    client: &RobotClient,
    poses: &mut tokio::sync::broadcast::Receiver<v1::RobotPose>,
    odom: &Pose2,
) -> v1::RobotPose {
    let captured_ns = now_ns();
    client.publish_odometry_at(captured_ns, odom).await.expect("sent");
    let newest = async {
        loop {
            let pose = poses.recv().await.expect("poses");
            if pose.captured_ns == captured_ns {
                return pose;
            }
        }
    };
    tokio::time::timeout(SOON, newest).await.expect("the pose continues")
}

/// A stamp an hour ahead must not become the time of the poses after it.
#[tokio::test(flavor = "multi_thread")]
async fn one_message_an_hour_ahead_does_not_stop_the_pose() {
    let inside = Inside::start(Limits::default()).await;
    let params = CorridorParams { posters: 1, column: false, ..CorridorParams::default() };
    let building = Arc::new(Building::corridor_with(&params, 3));
    let maps = inside.maps();
    maps.create_map(&NewMap::new(MAP)).await.expect("map");
    teach(&inside, &building, &["poster-0"], 6).await;
    maps.put_robot("r1", MAP).await.expect("robot");
    let client = connect(&inside.server.zenoh_endpoint, "r1").await;
    let readings = find_itself(&inside, &building, &client, "r1").await;
    let mut poses = client.poses();
    let ahead = |distance_m: f64| readings.step.odom_from_robot.compose(&Pose2::new(distance_m, 0.0, 0.0));
    let first = pose(&client, &mut poses, &ahead(0.0)).await;

    // An hour ahead: an odometry message, and a frame, which is answered.
    client.publish_odometry_at(now_ns() + HOUR_NS, &ahead(0.05)).await.expect("sent");
    let stray = capture(&readings).captured_at_ns(now_ns() + HOUR_NS);
    let answer = client.recognise("front", stray, SOON).await.expect("an answer");
    assert!(answer.clock_suspect && answer.map_from_robot.is_some(), "{answer:?}");

    let at = |pose: &v1::RobotPose| pose.map_from_robot.as_ref().and_then(|p| p.pose).expect("a pose");
    for step in 1..=10 {
        let distance_m = 0.1 * f64::from(step);
        let after = pose(&client, &mut poses, &ahead(distance_m)).await;
        let driven = (at(&after).x_m - at(&first).x_m).hypot(at(&after).y_m - at(&first).y_m);
        let sigma = after.map_from_robot.as_ref().map_or(0.0, |p| p.covariance[0].sqrt());
        assert!((driven - distance_m).abs() <= sigma, "{driven} m of {distance_m} m, sigma {sigma} m");
        assert!((0.0..2000.0).contains(&after.age_ms) && after.corrections == 1, "{after:?}");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }

    // The API shows the pose, and then no longer.
    let shown = maps.robot("r1").await.expect("the robot").pose.expect("its pose");
    assert!(shown.age_ms <= MAX_POSE_AGE.as_secs_f64() * 1e3, "{shown:?}");
    let gone = || async { maps.robot("r1").await.expect("the robot").pose.is_none().then_some(()) };
    eventually("no pose of a silent robot", gone).await;
    client.close().await.expect("closed");
    inside.server.stop().await;
}
