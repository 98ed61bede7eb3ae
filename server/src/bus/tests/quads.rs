//! What a robot's own detector found, in place of the image.

use super::*;
use vision::{
    detect::{detector::detect, params::DetectParams, quad::Quad},
    trace::NoTrace,
};

fn found_in(image: &GrayImage) -> Vec<Quad> {
    detect(image, &DetectParams::default(), &mut NoTrace)
}

/// The landmarks that an answer names, in its order, with its pose.
fn said(answer: &v1::Answer) -> (Vec<String>, Option<v1::Pose2>) {
    let named = answer.quads.iter().filter(|quad| !quad.landmark.is_empty());
    let pose = answer.map_from_robot.as_ref().and_then(|pose| pose.pose);
    (named.map(|quad| quad.landmark.clone()).collect(), pose)
}

#[tokio::test(flavor = "multi_thread")]
async fn quads_found_on_board_are_answered_as_the_frame_they_are_of() {
    let mut scene = Scene::new();
    let engine = scene::engine(&[scene.taught()]);
    engine.0.snapshots.set_robot("r2", Some(scene::MAP));
    let running = running(engine, 1).await;
    let [sees, detects] = [running.robot("r1").await, running.robot("r2").await];
    let mut poses = detects.poses();
    let (mut named, mut posed) = (0, 0);
    for (_, readings) in scene.stops(99, 3) {
        let (image, step) = (&readings.frame.image, &readings.step);
        let complete = |capture: Capture| {
            let capture = capture.with_intrinsics(&scene.intrinsics()).with_odometry(&step.odom_from_robot);
            capture.with_mounting(&step.robot_from_camera)
        };
        let whole = sees.recognise("front", complete(Capture::gray(image)), WAIT).await.unwrap();
        let quads = Capture::quads(image, &found_in(image));
        let quads = detects.recognise("front", complete(quads), WAIT).await.unwrap();
        let ((names, pose), (names_of_quads, pose_of_quads)) = (said(&whole), said(&quads));
        assert_eq!(names, names_of_quads);
        assert_eq!(pose.is_some(), pose_of_quads.is_some(), "{whole:?}\n{quads:?}");
        named += names.len();
        if let (Some(a), Some(b)) = (pose, pose_of_quads) {
            let off_m = (a.x_m - b.x_m).hypot(a.y_m - b.y_m);
            // The border of a frame is estimated again from the edges beside it; that of quads is
            // as found.
            assert!(off_m < 0.02, "{off_m} m between frame and quads");
            let fused = tokio::time::timeout(WAIT, poses.recv()).await.unwrap().unwrap();
            assert!(fused.corrections > 0, "quads correct the fused pose");
            posed += 1;
        }
        assert!(quads.timings.iter().all(|t| t.stage != "edges"), "nothing is detected again");
    }
    assert!(named >= 4 && posed >= 2, "{named} of 6 named, {posed} poses");
    let r2 = protos::Name::new("r2").unwrap();
    let shown = running.observers.live.frame(&r2, &protos::Name::new("front").unwrap()).unwrap();
    assert_eq!(shown.for_browsers().unwrap().0, "image/png");
    running.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn quads_have_the_numbers_and_refusals_of_their_cameras_frames() {
    let running = running(scene::engine(&[Arc::new(MapSnapshot::empty("hall", 3))]), 1).await;
    let robot = running.robot("r1").await;
    let none =
        robot.recognise("front", Capture::quads(&GrayImage::from_fn(64, 48, |_, _| 9), &[]), WAIT).await;
    assert_eq!(none.unwrap().status(), v1::Status::NoMatch);
    let raw = zenoh::open(
        zenoh::Config::from_json5(&format!(
            r#"{{ mode: "client", connect: {{ endpoints: ["{}"] }}, scouting: {{ multicast: {{ enabled: false }} }} }}"#,
            running.bus.endpoint()
        ))
        .unwrap(),
    )
    .await
    .unwrap();
    let name = |text: &str| protos::Name::new(text).unwrap();
    let key = Key::Quads(name("r1"), name("front"));
    let (key, camera) = Keys::new(&name("test")).on_wire(&key);
    let mut answers = robot.answers();
    let mut refused = async |message: Vec<u8>| {
        raw.put(&key, message).attachment(camera).await.unwrap();
        let answer = tokio::time::timeout(WAIT, answers.recv()).await.unwrap().unwrap().answer;
        assert_eq!(answer.status(), v1::Status::Rejected, "{answer:?}");
        let refusal = answer.rejection.unwrap();
        (refusal.code, refusal.field, answer.seq)
    };
    let is = |code: &str, field: &str, seq| (code.to_owned(), field.to_owned(), seq);
    let empty =
        v1::Quads { epoch: robot.epoch(), seq: 100, width_px: 64, height_px: 48, ..v1::Quads::default() };
    let many = v1::Quads { quads: vec![v1::FoundQuad::default(); 25], ..empty.clone() };
    let bare = v1::Quads { quads: vec![v1::FoundQuad::default()], ..empty.clone() };
    let old = v1::Quads { seq: 1, ..empty.clone() };
    assert_eq!(refused(b"\xff\xff\xff".to_vec()).await, is("bad_message", "quads", 0));
    assert_eq!(refused(many.encode_to_vec()).await, is("too_many", "quads", 100));
    assert_eq!(refused(bare.encode_to_vec()).await, is("missing", "quads[0].border.corners", 100));
    assert_eq!(refused(old.encode_to_vec()).await, is("not_newer", "seq", 1));
    raw.close().await.unwrap();
    running.stop().await;
}
