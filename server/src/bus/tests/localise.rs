//! Questions where a robot is.

use super::*;
use client::{ClientError, LocaliseQuery, api::LocaliseStatus};
use protos::{api::RobotCertificate, convert::geometry::pose3_wire, v1::LocaliseRequest};
use sim::robot::SensorReadings;

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
    assert_eq!(
        refused(robot.localise(query, WAIT).await),
        ("too_large".to_owned(), "frame.image".to_owned())
    );
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

/// A picture with a landmark: searching it takes far longer than a message.
fn pictured(scene: &Scene, readings: &SensorReadings) -> LocaliseRequest {
    let image = &readings.frame.image;
    let k = scene.intrinsics();
    let frame = v1::Frame {
        encoding: v1::ImageEncoding::Gray8.into(),
        width_px: image.width() as u32,
        height_px: image.height() as u32,
        image: image.data().to_vec().into(),
        intrinsics: Some(v1::Intrinsics {
            fx_px: k.fx_px,
            fy_px: k.fy_px,
            cx_px: k.cx_px,
            cy_px: k.cy_px,
            ..v1::Intrinsics::default()
        }),
        robot_from_camera: Some(pose3_wire(&readings.step.robot_from_camera)),
        ..v1::Frame::default()
    };
    LocaliseRequest { frame: Some(frame), ..LocaliseRequest::default() }
}

/// A session without the SDK: its questions may be in the name of any robot, and many at a time.
async fn session(running: &Running) -> zenoh::Session {
    let config = format!(
        r#"{{ mode: "client", connect: {{ endpoints: ["{}"] }}, scouting: {{ multicast: {{ enabled: false }} }} }}"#,
        running.bus.endpoint()
    );
    zenoh::open(zenoh::Config::from_json5(&config).unwrap()).await.unwrap()
}

type Replies = zenoh::handlers::FifoChannelHandler<zenoh::query::Reply>;

async fn ask(session: &zenoh::Session, robot: &str, request: &LocaliseRequest) -> Replies {
    let key = format!("waymark/1/test/robot/{robot}/rpc/localise");
    session.get(key).payload(request.encode_to_vec()).timeout(WAIT).await.unwrap()
}

/// Code and field of the refusal; `None` for a result.
async fn refusal(replies: Replies) -> Option<(String, String)> {
    let reply = replies.recv_async().await.expect("a reply");
    let bytes = reply.result().expect("no error").payload().to_bytes().into_owned();
    v1::LocaliseReply::decode(&*bytes).unwrap().rejection.map(|r| (r.code, r.field))
}

#[tokio::test(flavor = "multi_thread")]
async fn a_robot_without_a_valid_certificate_is_refused_before_its_question_is_read() {
    let registry = Arc::new(CertificateRegistry::default());
    let engine = scene::engine(&[Arc::new(MapSnapshot::empty("hall", 3))]);
    let running = running_with(engine, 1, Some(registry.clone())).await;
    let robot = running.robot("r1").await;
    let is = |code: &str, field: &str| (code.to_owned(), field.to_owned());
    let rows = crate::config::Limits::default().frame_bytes / 4096 + 1;
    let large =
        || LocaliseQuery::default().with_frame(Capture::gray(&GrayImage::from_fn(4096, rows, |_, _| 9)));
    let publish = |revoked_ms| {
        registry.publish([RobotCertificate {
            serial: "a".into(),
            robot: "r1".into(),
            sha256: String::new(),
            issued_ms: 0,
            expires_ms: i64::MAX,
            revoked_ms,
        }]);
    };
    publish(Some(5));
    for query in [LocaliseQuery::default(), LocaliseQuery::default().in_map("cellar"), large()] {
        assert_eq!(refused(robot.localise(query, WAIT).await), is("unknown_robot", "robot"));
    }
    publish(None);
    assert_eq!(refused(robot.localise(large(), WAIT).await), is("too_large", "frame.image"));
    assert_eq!(refused(robot.localise(LocaliseQuery::default(), WAIT).await), is("missing", "frame"));
    running.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_question_whose_time_has_passed_in_the_queue_is_refused_and_not_searched() {
    let mut scene = Scene::new();
    let running = running(scene::engine(&[scene.taught()]), 1).await;
    running.engine.snapshots.set_robot("r2", Some(scene::MAP));
    let session = session(&running).await;
    let (_, readings) = scene.stops(99, 3).into_iter().next().unwrap();
    let long = pictured(&scene, &readings);
    let short = LocaliseRequest { deadline_ms: 1, ..long.clone() };
    let mut expired = 0;
    // In vain where this machine stops between the two questions for as long as the search takes.
    for _ in 0..20 {
        let (first, second) = (ask(&session, "r1", &long).await, ask(&session, "r2", &short).await);
        assert_eq!(refusal(first).await, None);
        expired += usize::from(refusal(second).await == Some(("expired".into(), "deadline_ms".into())));
    }
    assert!(expired > 0, "no question of 20 expired behind another");
    assert_eq!(refusal(ask(&session, "r2", &long).await).await, None, "its place is free again");
    running.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn questions_beyond_the_queue_are_refused_and_leave_no_place_taken() {
    let mut scene = Scene::new();
    let running = running(scene::engine(&[scene.taught()]), 1).await;
    let session = session(&running).await;
    let (_, readings) = scene.stops(99, 3).into_iter().next().unwrap();
    let question = pictured(&scene, &readings);
    let robots: Vec<String> = (0..4 * crate::bus::localise::MAX_WAITING).map(|i| format!("q{i}")).collect();
    for robot in &robots {
        running.engine.snapshots.set_robot(robot, Some(scene::MAP));
    }
    let mut asked = Vec::new();
    for robot in &robots {
        asked.push(ask(&session, robot, &question).await);
    }
    let (mut answered, mut full) = (0, Vec::new());
    for (robot, replies) in robots.iter().zip(asked) {
        match refusal(replies).await {
            None => answered += 1,
            Some((code, field)) => {
                assert_eq!((code.as_str(), field.as_str()), ("too_many", "message"));
                full.push(robot);
            }
        }
    }
    assert!(answered >= crate::bus::localise::MAX_WAITING, "{answered} answered");
    assert!(!full.is_empty(), "none of {} was refused", robots.len());
    for robot in full {
        assert_eq!(refusal(ask(&session, robot, &question).await).await, None, "{robot} holds a place");
    }
    running.stop().await;
}
