//! Claim: while a program runs under a robot's name, another one under the same name is refused
//! with its own code and shown by the API; the first is not affected. When the first ends, the next
//! is admitted: at once after an orderly end, within the stated time after a kill.

use client::{Capture, Delivery, RobotClient, RobotOptions, api::NewMap, v1};
use engine::epochs::MESSAGE_LIVE;
use server::config::Limits;
use std::time::{Duration, Instant};
use tests::{Inside, SOON, eventually, pictures, robots::connect};

async fn ask(robot: &RobotClient) -> v1::Answer {
    let capture = Capture::encoded(pictures::picture(5)).expect("a picture").with_deadline_ms(60_000);
    robot.recognise("front", capture, SOON).await.expect("an answer")
}

fn code(answer: &v1::Answer) -> &str {
    answer.rejection.as_ref().map_or("", |r| r.code.as_str())
}

/// Of epochs that share a slot among the tokens, the later one would wait for silence instead.
async fn connect_as(endpoint: &str, epoch: u64) -> RobotClient {
    let options = RobotOptions::new(endpoint, "default", "r1");
    let options = RobotOptions { delivery: Delivery::Every, epoch: Some(epoch), ..options };
    RobotClient::connect(&options).await.expect("connected")
}

async fn started() -> Inside {
    let inside = Inside::start(Limits::default()).await;
    inside.maps().create_map(&NewMap::new("hall")).await.expect("map");
    inside.maps().put_robot("r1", "hall").await.expect("robot");
    inside
}

/// A frame of the second program must not lock out the first one.
#[tokio::test(flavor = "multi_thread")]
async fn a_second_program_is_refused_until_the_first_ends() {
    let inside = started().await;
    let maps = inside.maps();
    let endpoint = &inside.server.zenoh_endpoint;
    let first = connect_as(endpoint, 1).await;
    assert_eq!(ask(&first).await.status(), v1::Status::NoMatch);
    assert_eq!(maps.robot("r1").await.expect("the robot").conflict, None);

    let second = connect_as(endpoint, 2).await;
    for _ in 0..3 {
        let answer = ask(&second).await;
        assert_eq!((answer.status(), code(&answer)), (v1::Status::Rejected, "epoch_conflict"), "{answer:?}");
        assert_eq!(ask(&first).await.status(), v1::Status::NoMatch, "the first is still served");
    }
    let shown = maps.robot("r1").await.expect("the robot");
    assert_eq!((shown.alive, shown.epoch), (true, Some(first.epoch())));
    let conflict = shown.conflict.expect("a conflict");
    assert_eq!((conflict.epoch, conflict.refused), (second.epoch(), 3));

    // A silent but connected program keeps the name.
    tokio::time::sleep(MESSAGE_LIVE + Duration::from_millis(200)).await;
    assert_eq!(code(&ask(&second).await), "epoch_conflict");

    first.close().await.expect("closed");
    let closed = Instant::now();
    let admitted = || async { (ask(&second).await.status() == v1::Status::NoMatch).then_some(()) };
    eventually("the second is admitted", admitted).await;
    assert!(closed.elapsed() < MESSAGE_LIVE / 2, "after {:?}", closed.elapsed());
    let shown = maps.robot("r1").await.expect("the robot");
    assert_eq!((shown.epoch, shown.conflict), (Some(second.epoch()), None));
    second.close().await.expect("closed");
    inside.server.stop().await;
}

/// The session is dropped without an orderly end, as of a killed program.
#[tokio::test(flavor = "multi_thread")]
async fn a_restarted_robot_waits_no_longer_than_the_stated_time() {
    let inside = started().await;
    let endpoint = &inside.server.zenoh_endpoint;
    for _ in 0..3 {
        let killed = connect(endpoint, "r1").await;
        let began = Instant::now();
        let admitted = || async { (ask(&killed).await.status() == v1::Status::NoMatch).then_some(()) };
        eventually("admitted", admitted).await;
        assert!(began.elapsed() < MESSAGE_LIVE + Duration::from_secs(1), "after {:?}", began.elapsed());
        drop(killed);
    }
    inside.server.stop().await;
}

/// Eight invented camera names of the robot do not block its real camera.
#[tokio::test(flavor = "multi_thread")]
async fn a_camera_is_served_after_invented_ones() {
    let inside = started().await;
    let robot = connect(&inside.server.zenoh_endpoint, "r1").await;
    let send = async |camera: &str| {
        let capture = Capture::encoded(pictures::picture(5)).expect("a picture").with_deadline_ms(60_000);
        robot.recognise(camera, capture, SOON).await.expect("an answer")
    };
    for i in 0..8 {
        send(&format!("made-up-{i}")).await;
    }
    assert_eq!(code(&send("front").await), "too_many");
    let served = || async { (send("front").await.status() == v1::Status::NoMatch).then_some(()) };
    eventually("served", served).await;
    robot.close().await.expect("closed");
    inside.server.stop().await;
}
