//! Claim: an invalid frame gets a `rejected` answer with a stable code and the field at fault; the
//! server answers the next good frame, and every frame is counted.

use client::{
    Delivery, RobotClient, RobotOptions,
    api::NewMap,
    protos::prost::Message,
    robot::CameraAnswer,
    v1::{self, ImageEncoding, Status},
};
use server::config::Limits;
use tests::{Inside, SOON, pictures};
use tokio::sync::broadcast::Receiver;

const CAMERA: &str = "front";

fn good(seq: u64) -> v1::Frame {
    v1::Frame {
        epoch: 9,
        seq,
        captured_ns: 1,
        encoding: ImageEncoding::Png.into(),
        width_px: 160,
        height_px: 120,
        image: pictures::picture(5).into(),
        deadline_ms: 60_000,
        ..v1::Frame::default()
    }
}

fn camera() -> v1::Intrinsics {
    v1::Intrinsics { fx_px: 150.0, fy_px: 150.0, cx_px: 80.0, cy_px: 60.0, ..v1::Intrinsics::default() }
}

type Spoil = fn(&mut v1::Frame);

/// A defect, and the code and field of its refusal.
const ROWS: &[(Spoil, &str, &str)] = &[
    // Not an image.
    (|f| f.image = b"no image at all".to_vec().into(), "wrong_encoding", "image"),
    (|f| f.image = f.image.slice(..f.image.len() / 2), "bad_image", "image"),
    (|f| f.encoding = ImageEncoding::Jpeg.into(), "wrong_encoding", "image"),
    (|f| f.encoding = ImageEncoding::Unspecified.into(), "out_of_range", "encoding"),
    (|f| f.encoding = 77, "out_of_range", "encoding"),
    (|f| f.image = vec![].into(), "missing", "image"),
    // A wrong size.
    (|f| f.width_px = 161, "size_mismatch", "width_px"),
    (|f| f.height_px = 119, "size_mismatch", "height_px"),
    (|f| f.width_px = 0, "out_of_range", "width_px"),
    (|f| f.height_px = 4_097, "out_of_range", "height_px"),
    (
        |f| {
            f.encoding = ImageEncoding::Gray8.into();
            f.image = vec![0; 160 * 120 - 1].into();
        },
        "size_mismatch",
        "image",
    ),
    (
        |f| {
            f.encoding = ImageEncoding::Rgb8.into();
            f.image = vec![0; 160 * 120].into();
        },
        "size_mismatch",
        "image",
    ),
    (
        |f| {
            f.encoding = ImageEncoding::Bgr8.into();
            f.image = vec![0; 3 * 160 * 120 + 1].into();
        },
        "size_mismatch",
        "image",
    ),
    // Numbers that are not finite or out of range.
    (
        |f| f.intrinsics = Some(v1::Intrinsics { fx_px: f64::NAN, ..camera() }),
        "not_finite",
        "intrinsics.fx_px",
    ),
    (
        |f| f.intrinsics = Some(v1::Intrinsics { cy_px: f64::INFINITY, ..camera() }),
        "not_finite",
        "intrinsics.cy_px",
    ),
    (
        |f| f.intrinsics = Some(v1::Intrinsics { fy_px: -150.0, ..camera() }),
        "out_of_range",
        "intrinsics.fy_px",
    ),
    (
        |f| f.odometry = Some(v1::Pose2 { x_m: f64::NAN, y_m: 0.0, theta_rad: 0.0 }),
        "not_finite",
        "odometry.x_m",
    ),
    // Unknown maps, values out of range, old numbers.
    (|f| f.map = "nowhere".into(), "unknown_map", "map"),
    (|f| f.map = "No/Name".into(), "bad_name", "map"),
    (|f| f.deadline_ms = 600_001, "out_of_range", "deadline_ms"),
    (|f| f.seq = 1, "not_newer", "seq"),
];

async fn next(answers: &mut Receiver<CameraAnswer>) -> v1::Answer {
    let received = tokio::time::timeout(SOON, answers.recv()).await.expect("an answer in time");
    let received = received.expect("no answer missed");
    assert_eq!(received.camera.as_str(), CAMERA);
    received.answer
}

async fn connect(inside: &Inside, robot: &str) -> RobotClient {
    let options = RobotOptions {
        delivery: Delivery::Every,
        epoch: Some(9),
        ..RobotOptions::new(&inside.server.zenoh_endpoint, "default", robot)
    };
    RobotClient::connect(&options).await.expect("a connection")
}

fn refusal(answer: &v1::Answer) -> (String, String) {
    assert_eq!(answer.status(), Status::Rejected, "{answer:?}");
    let rejection = answer.rejection.as_ref().expect("why");
    assert!(!rejection.detail.is_empty());
    assert!(answer.quads.is_empty() && answer.map_from_robot.is_none());
    (rejection.code.clone(), rejection.field.clone())
}

#[tokio::test(flavor = "multi_thread")]
async fn invalid_frames_are_refused_with_code_and_field() {
    let inside = Inside::start(Limits { frame_bytes: 100_000, ..Limits::default() }).await;
    inside.maps().create_map(&NewMap::new("hall")).await.expect("map");
    inside.maps().put_robot("r1", "hall").await.expect("robot");
    let robot = connect(&inside, "r1").await;
    let mut answers = robot.answers();
    let send = async |bytes: Vec<u8>| robot.publish_raw_frame(CAMERA, bytes).await.expect("sent");

    send(good(1).encode_to_vec()).await;
    assert_eq!(next(&mut answers).await.status(), Status::NoMatch);
    for (index, (spoil, code, field)) in ROWS.iter().enumerate() {
        let mut frame = good(10 + 2 * index as u64);
        spoil(&mut frame);
        send(frame.encode_to_vec()).await;
        let answer = next(&mut answers).await;
        assert_eq!((answer.epoch, answer.seq), (9, frame.seq), "row {index}");
        assert_eq!(refusal(&answer), ((*code).to_owned(), (*field).to_owned()), "row {index}");
        let after = good(11 + 2 * index as u64);
        send(after.encode_to_vec()).await;
        assert_eq!(next(&mut answers).await.status(), Status::NoMatch, "after row {index}");
    }
    send(b"\xff\xff\xff no message".to_vec()).await;
    assert_eq!(refusal(&next(&mut answers).await), ("bad_message".into(), "frame".into()));
    send(vec![0; 100_001]).await;
    assert_eq!(refusal(&next(&mut answers).await), ("too_large".into(), "frame".into()));
    // A restart of the robot's program is another epoch: refused until the live one ends.
    send(v1::Frame { epoch: 10, ..good(1) }.encode_to_vec()).await;
    assert_eq!(refusal(&next(&mut answers).await), ("epoch_conflict".into(), "epoch".into()));
    send(good(1_000).encode_to_vec()).await;
    assert_eq!(next(&mut answers).await.status(), Status::NoMatch);

    let counts = inside.server.slots.counts();
    assert_eq!(counts.received, 2 * ROWS.len() as u64 + 5, "{counts:?}");
    assert_eq!(counts.rejected_total(), ROWS.len() as u64 + 3, "{counts:?}");
    assert_eq!(counts.missing(), 0, "{counts:?}");
    robot.close().await.expect("closed");
    inside.server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn an_unregistered_robot_is_refused() {
    let inside = Inside::start(Limits::default()).await;
    inside.maps().create_map(&NewMap::new("hall")).await.expect("map");
    let robot = connect(&inside, "unregistered").await;
    let mut answers = robot.answers();
    robot.publish_raw_frame(CAMERA, good(1).encode_to_vec()).await.expect("sent");
    assert_eq!(refusal(&next(&mut answers).await), ("unknown_robot".into(), "robot".into()));
    inside.maps().put_robot("unregistered", "hall").await.expect("robot");
    robot.publish_raw_frame(CAMERA, good(2).encode_to_vec()).await.expect("sent");
    assert_eq!(next(&mut answers).await.status(), Status::NoMatch);
    robot.close().await.expect("closed");
    inside.server.stop().await;
}
