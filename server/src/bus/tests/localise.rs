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
