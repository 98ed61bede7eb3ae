//! Claim: the API says of each robot what it does: frames answered and refused with the last
//! reason, when its last message came, and when a landmark was named. Robots that are refused
//! because nobody registered them are listed until somebody does. A person can say where a robot
//! is: odometry carries that on, unsupported until a landmark agrees.

use client::{
    Capture, ClientError,
    api::{AuditQuery, NewMap, PoseByHand, PoseTrust},
    v1,
};
use map::pose2::Pose2;
use server::config::Limits;
use std::{
    f64::consts::FRAC_PI_2,
    time::{Duration, Instant},
};
use tests::{Inside, SOON, command::waymark, eventually, pictures, robots::connect};

#[tokio::test(flavor = "multi_thread")]
async fn what_a_robot_does_is_told() {
    let inside = Inside::start(Limits::default()).await;
    let maps = inside.maps();
    maps.create_map(&NewMap::new("hall")).await.expect("map");
    maps.put_robot("r1", "hall").await.expect("robot");
    assert_eq!(maps.robot("r1").await.expect("the robot").activity, None, "nothing came yet");

    let robot = connect(&inside.server.zenoh_endpoint, "r1").await;
    let capture = || Capture::encoded(pictures::picture(5)).expect("a picture").with_deadline_ms(60_000);
    for _ in 0..3 {
        robot.recognise("front", capture(), SOON).await.expect("an answer");
    }
    let answered = Instant::now();
    let elsewhere = capture().against_map("cellar");
    let refused = robot.recognise("front", elsewhere, SOON).await.expect("an answer");
    assert_eq!(refused.rejection.expect("a refusal").code, "unknown_map");

    let activity = maps.robots().await.expect("robots")[0].activity.clone().expect("activity");
    let [frames] = activity.inputs.as_slice() else { panic!("{activity:?}") };
    assert_eq!(
        (frames.input.as_str(), frames.used, frames.refused, frames.refused_in_a_row),
        ("frame", 3, 1, 1)
    );
    let [last] = frames.reasons.as_slice() else { panic!("{frames:?}") };
    assert_eq!((last.code.as_str(), last.field.as_str(), last.count), ("unknown_map", "map", 1));
    assert!(last.detail.contains("cellar") && Duration::from_millis(last.ago_ms) <= answered.elapsed());
    assert_eq!(last.advice, "Name the map that the robot is registered on, or none.");
    assert_eq!(activity.last_recognised_ms, None, "the map has no landmark");
    assert!(activity.frames_per_s <= 3.0);

    robot.close().await.expect("closed");
    maps.delete_robot("r1").await.expect("deleted");
    let again = maps.put_robot("r1", "hall").await.expect("robot");
    assert_eq!(again.activity, None, "a robot of the same name begins anew");
    inside.server.stop().await;
}

/// Neither scans nor odometry are answered: the robot's own page, and `robot show`, are where their
/// refusal is seen.
#[tokio::test(flavor = "multi_thread")]
async fn a_robot_whose_every_scan_and_odometry_is_refused_says_so() {
    let inside = Inside::start(Limits::default()).await;
    let maps = inside.maps();
    maps.create_map(&NewMap::new("hall")).await.expect("map");
    maps.put_robot("r1", "hall").await.expect("robot");
    let robot = connect(&inside.server.zenoh_endpoint, "r1").await;
    for at in 0..40 {
        let odom_from_robot = Some(v1::Pose2 { x_m: 1.0, ..v1::Pose2::default() });
        let two_turns = v1::Scan {
            captured_ns: 1_000_000_000 + at * 25_000_000,
            odom_from_robot,
            robot_from_laser: Some(v1::Pose2::default()),
            max_range_m: 10.0,
            bearing_step_rad: 0.1,
            ranges_m: vec![2.0; 126],
            ..v1::Scan::default()
        };
        robot.publish_scan(two_turns).await.expect("sent");
    }
    // An hour before the odometry that came first.
    for captured_s in [10_000, 6_400, 6_401] {
        robot.publish_odometry_at(captured_s * 1_000_000_000, &Pose2::default()).await.expect("sent");
    }
    let input = async |name: &str| {
        let activity = maps.robot("r1").await.expect("the robot").activity;
        let inputs = activity.map(|activity| activity.inputs).unwrap_or_default();
        inputs.into_iter().find(|input| input.input == name).unwrap_or_default()
    };
    let (scans, odometry) = eventually("all are counted", async || {
        let (scans, odometry) = (input("scan").await, input("odometry").await);
        (scans.refused == 40 && odometry.used + odometry.refused == 3).then_some((scans, odometry))
    })
    .await;
    assert_eq!((scans.used, scans.refused_in_a_row, scans.reasons.len()), (0, 40, 1));
    let why = &scans.reasons[0];
    assert_eq!((why.code.as_str(), why.count), ("out_of_range", 40));
    assert!(why.field == "fan_rad" && !why.detail.is_empty() && !why.advice.is_empty(), "{why:?}");
    assert_eq!((odometry.used, odometry.refused_in_a_row), (1, 2));
    assert_eq!(odometry.reasons[0].code, "clock_behind");
    assert_eq!(odometry.reasons[0].advice, "Stamp all messages of a robot by one clock, at capture.");
    let shown = waymark(["robot", "show", "r1", "--server", &inside.url()], SOON);
    assert_eq!(shown.status, 0, "{shown:?}");
    assert!(shown.stdout.contains("scan         0 used, 40 refused, the last 40 in a row"), "{shown:?}");
    assert!(shown.stdout.contains(&why.detail) && shown.stdout.contains(&why.advice), "{shown:?}");
    robot.close().await.expect("closed");
    inside.server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn an_unknown_robot_is_listed_until_it_is_registered() {
    let inside = Inside::start(Limits::default()).await;
    let maps = inside.maps();
    maps.create_map(&NewMap::new("hall")).await.expect("map");
    assert!(maps.unknown_robots().await.expect("a list").robots.is_empty());
    let robot = connect(&inside.server.zenoh_endpoint, "stranger").await;
    let ask = async || {
        let capture = Capture::encoded(pictures::picture(5)).expect("a picture").with_deadline_ms(60_000);
        robot.recognise("front", capture, SOON).await.expect("an answer")
    };
    for _ in 0..2 {
        assert_eq!(ask().await.rejection.expect("a refusal").code, "unknown_robot");
    }
    let list = maps.unknown_robots().await.expect("a list").robots;
    let [unknown] = list.as_slice() else { panic!("{list:?}") };
    assert_eq!((unknown.name.as_str(), unknown.camera.as_deref()), ("stranger", Some("front")));
    assert_eq!(unknown.messages, 2);
    assert!(unknown.first_ms >= unknown.last_ms);

    maps.put_robot("stranger", "hall").await.expect("registered");
    assert!(maps.unknown_robots().await.expect("a list").robots.is_empty());
    assert_eq!(ask().await.status(), v1::Status::NoMatch);
    assert_eq!(maps.robot("stranger").await.expect("it").activity.expect("activity").answered, 1);
    robot.close().await.expect("closed");
    inside.server.stop().await;
}

fn code(result: Result<impl std::fmt::Debug, ClientError>) -> String {
    match result {
        Err(ClientError::Refused { code, .. }) => code,
        other => panic!("not refused: {other:?}"),
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_person_says_where_a_robot_is() {
    let inside = Inside::start(Limits::default()).await;
    let maps = inside.maps();
    maps.create_map(&NewMap::new("hall")).await.expect("map");
    maps.put_robot("r1", "hall").await.expect("robot");
    let said = PoseByHand { sigma_m: 0.4, ..PoseByHand::new(4.0, 1.5, FRAC_PI_2) };
    assert_eq!(code(maps.set_robot_pose("r1", &said).await), "no_odometry");
    assert_eq!(code(maps.set_robot_pose("nobody", &said).await), "unknown_robot");
    for wrong in [
        PoseByHand { x_m: 1e39, ..said },
        PoseByHand { theta_rad: 7.0, ..said },
        PoseByHand { sigma_m: 0.0, ..said },
        PoseByHand { sigma_rad: 4.0, ..said },
    ] {
        assert_eq!(code(maps.set_robot_pose("r1", &wrong).await), "out_of_range", "{wrong:?}");
    }

    let robot = connect(&inside.server.zenoh_endpoint, "r1").await;
    let mut poses = robot.poses();
    let mut x_m = 0.0;
    let mut drive = async || {
        x_m += 0.1;
        robot.publish_odometry(&Pose2::new(x_m, 0.0, 0.0)).await.expect("sent");
    };
    drive().await;
    let heard = || async { maps.robot("r1").await.expect("the robot").activity };
    eventually("odometry is heard", heard).await;
    let put = maps.set_robot_pose("r1", &said).await.expect("put");
    assert_eq!((put.x_m, put.y_m, put.trust), (4.0, 1.5, PoseTrust::Unsupported));
    assert!((put.covariance[0] - 0.16).abs() < 1e-9 && (put.covariance[8] - 0.35 * 0.35).abs() < 1e-9);

    // It is published at once, and odometry carries it on: the robot faces along y.
    let published = tokio::time::timeout(SOON, poses.recv()).await.expect("in time").expect("a pose");
    assert_eq!(
        (published.trust(), published.modalities),
        (v1::PoseTrust::Unsupported, vec!["odometry".into(), "by_hand".into()])
    );
    drive().await;
    let moved = tokio::time::timeout(SOON, poses.recv()).await.expect("in time").expect("a pose");
    let at = moved.map_from_robot.expect("a pose").pose.expect("a pose");
    assert!((at.x_m - 4.0).abs() < 1e-6 && (at.y_m - 1.6).abs() < 1e-6, "{at:?}");

    let log = maps.corrections("r1").await.expect("corrections");
    assert_eq!(
        (log.corrections[0].modality.as_str(), log.corrections[0].outcome.as_str()),
        ("by_hand", "started")
    );
    let audit = maps.audit(&AuditQuery::default()).await.expect("the log").items;
    let entries: Vec<_> = audit.iter().filter(|entry| entry.target.ends_with("/robots/r1/pose")).collect();
    let [entry] = entries.as_slice() else { panic!("{audit:?}") };
    assert!(entry.action.starts_with("PUT") && entry.actor == "local", "{entry:?}");
    robot.close().await.expect("closed");
    inside.server.stop().await;
}
