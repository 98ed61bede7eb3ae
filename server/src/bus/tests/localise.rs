//! Questions where a robot is.

use super::*;
use client::{ClientError, LocaliseQuery, api::LocaliseStatus};

fn refused(result: Result<client::api::LocaliseResult, ClientError>) -> (String, String) {
    match result {
        Err(ClientError::Rejected { code, field, .. }) => (code, field),
        other => panic!("{other:?}"),
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_robot_asks_where_it_is_and_its_fused_pose_stays() {
    let mut scene = Scene::new();
    let running = running(scene::engine(&[scene.taught()]), 1).await;
    let robot = running.robot("r1").await;
    let mut located = 0;
    for (_, readings) in scene.stops(99, 3) {
        let frame = Capture::gray(&readings.frame.image)
            .with_intrinsics(&scene.intrinsics())
            .with_mounting(&readings.step.robot_from_camera);
        let found = robot.localise(LocaliseQuery::default().with_frame(frame), WAIT).await.unwrap();
        assert_eq!((found.map.as_str(), found.map_version), (scene::MAP, 3));
        assert!(found.answer.is_some());
        if found.status == LocaliseStatus::Located {
            let pose = found.map_from_robot.unwrap().pose.unwrap();
            let truth = &readings.step.map_from_robot;
            let off_m = (pose.x_m - truth.x_m).hypot(pose.y_m - truth.y_m);
            assert!(off_m < 0.3, "{off_m} m off");
            located += 1;
        }
    }
    assert!(located >= 2, "{located} of 6");
    let r1 = protos::Name::new("r1").unwrap();
    assert!(running.engine.motion.pose(&r1, scene::MAP, std::time::Instant::now()).is_none());
    running.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_robot_has_one_question_at_a_time_and_no_larger_one_than_a_frame() {
    let mut scene = Scene::new();
    let running = running(scene::engine(&[scene.taught()]), 1).await;
    let robot = running.robot("r1").await;
    let (_, readings) = scene.stops(99, 3).into_iter().next().unwrap();
    let frame = Capture::gray(&readings.frame.image)
        .with_intrinsics(&scene.intrinsics())
        .with_mounting(&readings.step.robot_from_camera);
    let query = LocaliseQuery::default().with_frame(frame);
    // Searching a picture takes far longer than a message.
    let asked = (0..6).map(|_| robot.localise(query.clone(), WAIT));
    let answers = futures::future::join_all(asked).await;
    let (done, others): (Vec<_>, Vec<_>) = answers.into_iter().partition(Result::is_ok);
    assert!(!done.is_empty() && !others.is_empty(), "{} answered at once", done.len());
    for other in others {
        assert_eq!(refused(other), ("too_many".to_owned(), "robot".to_owned()));
    }
    assert!(robot.localise(query, WAIT).await.is_ok(), "its place is free again");
    let rows = crate::config::Limits::default().frame_bytes / 4096 + 1;
    let large = Capture::gray(&GrayImage::from_fn(4096, rows, |_, _| 9));
    let query = LocaliseQuery::default().with_frame(large);
    assert_eq!(refused(robot.localise(query, WAIT).await), ("too_large".to_owned(), "message".to_owned()));
    running.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_question_that_cannot_be_answered_is_refused_with_code_and_field() {
    let running = running(scene::engine(&[Arc::new(MapSnapshot::empty("hall", 3))]), 1).await;
    let (robot, stranger) = (running.robot("r1").await, running.robot("stranger").await);
    let is = |code: &str, field: &str| (code.to_owned(), field.to_owned());
    let query = LocaliseQuery::default;
    assert_eq!(refused(robot.localise(query(), WAIT).await), is("missing", "frame"));
    let bare = query().with_frame(plain());
    assert_eq!(refused(robot.localise(bare.clone(), WAIT).await), is("missing", "frame.intrinsics"));
    let scan = v1::Scan {
        robot_from_laser: Some(v1::Pose2::default()),
        bearing_step_rad: 0.01,
        max_range_m: 30.0,
        ranges_m: vec![2.0; 100],
        ..v1::Scan::default()
    };
    let asked = query().with_scan(scan);
    let elsewhere = asked.clone().in_map("cellar");
    assert_eq!(refused(robot.localise(elsewhere, WAIT).await), is("unknown_map", "map"));
    assert_eq!(refused(stranger.localise(asked.clone(), WAIT).await), is("unknown_robot", "robot"));
    let found = robot.localise(asked, WAIT).await.unwrap();
    assert_eq!((found.status, found.reason.as_deref()), (LocaliseStatus::NoMatch, Some("few_points")));
    running.stop().await;
}
