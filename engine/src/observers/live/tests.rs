use super::*;

fn name(text: &str) -> Name {
    Name::new(text).unwrap()
}

fn key(camera: usize) -> SlotKey {
    SlotKey { robot: name("r1"), camera: name(&format!("c{camera}")) }
}

fn frame(seq: u64) -> LiveFrame {
    let answer = Arc::new(v1::Answer { seq, map: "hall".into(), ..v1::Answer::default() });
    let bytes = Bytes::from_static(&[0, 50, 100, 150, 200, 250]);
    let pixels = Pixels::Image(EncodedImage { encoding: Encoding::Gray8, bytes });
    LiveFrame { width_px: 3, height_px: 2, pixels, answer }
}

#[test]
fn the_camera_with_the_oldest_frame_is_replaced() {
    let hub = LiveHub::default();
    for c in 0..MAX_CAMERAS {
        hub.publish_answer(&key(c), frame(1), Instant::now());
    }
    hub.publish_answer(&key(0), frame(2), Instant::now());
    assert_eq!(hub.cameras(&name("r1")).len(), MAX_CAMERAS);
    hub.publish_answer(&key(MAX_CAMERAS), frame(1), Instant::now());
    assert_eq!(hub.cameras(&name("r1")).len(), MAX_CAMERAS);
    assert!(hub.frame(&name("r1"), &name("c1")).is_none());
    assert_eq!(hub.frame(&name("r1"), &name("c0")).unwrap().answer.seq, 2);
}

#[test]
fn trajectories_are_bounded() {
    let hub = LiveHub::default();
    for i in 0..=MAX_TRAJECTORY_POSES {
        hub.truth(&name("r1"), "hall", Pose2::new(i as f64, 0.0, 0.0));
    }
    let truth = hub.trajectories(&name("r1")).unwrap().truth;
    assert_eq!(truth.len(), MAX_TRAJECTORY_POSES);
    assert!((truth[0].x_m - 1.0).abs() < 1e-12);
    for r in 0..MAX_TRAJECTORIES {
        hub.odometry(&name(&format!("robot-{r}")), "hall", Pose2::default());
    }
    assert!(hub.trajectories(&name("r1")).is_none());
    assert!(hub.trajectories(&name("robot-0")).is_some());
}

#[test]
fn raw_grey_becomes_png() {
    let (media, bytes) = frame(1).for_browsers().unwrap();
    assert_eq!(media, "image/png");
    let back = crate::frame::decode::decode_upload(&bytes, crate::frame::decode::ImageLimits::UPLOAD);
    assert_eq!(back.unwrap().grey().data(), [0, 50, 100, 150, 200, 250]);
}

#[test]
fn raw_colour_becomes_png_of_the_same_colours() {
    for (encoding, image) in [(Encoding::Rgb8, [200, 100, 50]), (Encoding::Bgr8, [50, 100, 200])] {
        let pixels = Pixels::Image(EncodedImage { encoding, bytes: Bytes::copy_from_slice(&image) });
        let (media, bytes) =
            LiveFrame { width_px: 1, height_px: 1, pixels, ..frame(1) }.for_browsers().unwrap();
        assert_eq!(media, "image/png");
        let back = image::load_from_memory(&bytes).unwrap().into_rgb8();
        assert_eq!(back.get_pixel(0, 0).0, [200, 100, 50], "{encoding:?}");
    }
}

#[test]
fn events_read_as_the_page_expects() {
    let hub = LiveHub::default();
    let mut events = hub.events();
    hub.publish_answer(&key(0), frame(7), Instant::now());
    hub.odometry(&name("r1"), "hall", Pose2::new(1.0, 2.0, 0.5));
    hub.presence(&name("r1"), Some("hall".into()), true);
    let event = events.try_recv().unwrap();
    assert_eq!((event.kind(), event.map()), ("answer", "hall"));
    let json = serde_json::to_value(&*event).unwrap();
    assert_eq!(
        (&json["robot"], &json["camera"], &json["answer"]["seq"]),
        (&"r1".into(), &"c0".into(), &7.into())
    );
    let json = serde_json::to_value(&*events.try_recv().unwrap()).unwrap();
    assert_eq!(json["pose"]["y_m"], 2.0);
    assert_eq!(events.try_recv().unwrap().kind(), "presence");
    let pose = Pose2Covariance { pose: Pose2::default(), covariance: nalgebra::Matrix3::identity() };
    hub.pose(&name("r1"), "hall", &pose, (2, 7.5), v1::PoseTrust::Contradicted);
    let json = serde_json::to_value(&*events.try_recv().unwrap()).unwrap();
    assert_eq!((&json["corrections"], &json["age_ms"]), (&2.into(), &7.5.into()));
    assert_eq!(json["trust"], "contradicted");
}

#[test]
fn the_trust_is_that_of_the_last_pose_on_its_map() {
    let (hub, r1) = (LiveHub::default(), name("r1"));
    let pose = Pose2Covariance { pose: Pose2::default(), covariance: nalgebra::Matrix3::identity() };
    assert_eq!(hub.trust(&r1, "hall"), None);
    for trust in [v1::PoseTrust::Supported, v1::PoseTrust::Stale] {
        hub.pose(&r1, "hall", &pose, (1, 0.0), trust);
        assert_eq!(hub.trust(&r1, "hall"), Some(trust));
    }
    // The robot was given another map, and no pose has been published there yet.
    assert_eq!(hub.trust(&r1, "yard"), None);
    for r in 0..MAX_ROBOTS {
        hub.set_trust(&name(&format!("robot-{r}")), "hall", v1::PoseTrust::Supported);
    }
    assert_eq!(hub.lock().trust.len(), MAX_ROBOTS);
    hub.set_trust(&r1, "yard", v1::PoseTrust::Unsupported);
    assert_eq!(hub.trust(&r1, "yard"), Some(v1::PoseTrust::Unsupported));
}

#[test]
fn a_slow_reader_misses_events_and_is_told() {
    let hub = LiveHub::default();
    let mut events = hub.events();
    for _ in 0..=MAX_EVENTS {
        hub.map_changed("hall".into(), Some(1));
    }
    assert!(matches!(events.try_recv(), Err(broadcast::error::TryRecvError::Lagged(1))));
}
