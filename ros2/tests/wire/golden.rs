//! Claim: the payloads are those that rosbags, mcap-ros2-support and Fast-CDR write, byte for byte.

use crate::hex;
use ros2::messages::{
    BoundingBox2D, CameraInfo, CompressedImage, Detection2D, Detection2DArray, Header, Image, LaserScan,
    Message, ObjectHypothesisWithPose, Odometry, Pose, Pose2D, PoseWithCovariance, PoseWithCovarianceStamped,
    Quaternion, TFMessage, Time, Transform, TransformStamped, Twist, TwistWithCovariance, Vector3,
};

const STAMP: Time = Time { sec: 1_700_000_000, nanosec: 123_456_789 };

fn header(frame_id: &str) -> Header<'_> {
    Header { stamp: STAMP, frame_id }
}

fn camera() -> Header<'static> {
    header("camera_optical_frame")
}

fn position() -> Vector3 {
    Vector3 { x: 1.0, y: 2.0, z: 0.0 }
}

fn pose() -> PoseWithCovariance {
    let mut covariance = [0.0; 36];
    (covariance[0], covariance[7], covariance[35]) = (0.25, 0.25, 0.0625);
    PoseWithCovariance { pose: Pose { position: position(), orientation: Quaternion::default() }, covariance }
}

/// Encodes to `payload`, and back.
fn check<'a, M: Message<'a> + PartialEq + std::fmt::Debug>(message: &M, payload: &'a [u8]) {
    assert_eq!(message.encode(), payload);
    assert_eq!(M::decode(payload).as_ref(), Ok(message));
}

#[test]
fn a_pose_with_covariance() {
    let payload =
        hex::bytes("0001000000f1536515cd5b07040000006d6170z7.f03fz7.40z38.f03fz6.d03fz54.d03fz222.b03f");
    assert_eq!(hex::digest(&payload), (364, "cea6d8a7927485f5".into()));
    check(&PoseWithCovarianceStamped { header: header("map"), pose: pose() }, &payload);
}

#[test]
fn a_transform() {
    let payload =
        hex::bytes("0001000001z4.f1536515cd5b07040000006d617000050000006f646f6dz10.f03fz7.40z38.f03f");
    assert_eq!(hex::digest(&payload), (92, "0ea1585149a0d687".into()));
    let transform = Transform { translation: position(), rotation: Quaternion::default() };
    let link = TransformStamped { header: header("map"), child_frame_id: "odom", transform };
    check(&TFMessage { transforms: vec![link] }, &payload);
}

#[test]
fn a_scan() {
    let payload = hex::bytes(concat!(
        "0001000000f1536515cd5b07060000006c61736572z5.80bf0000803f0000803fz7.3e0000003f0000204103z5.",
        "803f000000400000807fz4.",
    ));
    assert_eq!(hex::digest(&payload), (72, "b82a908cfadf5ab7".into()));
    let scan = LaserScan {
        header: header("laser"),
        angle_min: -1.0,
        angle_max: 1.0,
        angle_increment: 1.0,
        time_increment: 0.0,
        scan_time: 0.125,
        range_min: 0.5,
        range_max: 10.0,
        ranges: vec![1.0, 2.0, f32::INFINITY],
        intensities: vec![],
    };
    check(&scan, &payload);
}

#[test]
fn an_image() {
    let payload = hex::bytes(concat!(
        "0001000000f1536515cd5b071500000063616d6572615f6f70746963616c5f6672616d65z4.0200000002000000",
        "0500000072676238z4.060000000c0000000102030405060708090a0b0c",
    ));
    assert_eq!(hex::digest(&payload), (80, "c7273bc9598e876f".into()));
    let data: Vec<u8> = (1..=12).collect();
    let image = Image {
        header: camera(),
        height: 2,
        width: 2,
        encoding: "rgb8",
        is_bigendian: 0,
        step: 6,
        data: &data,
    };
    check(&image, &payload);
    let decoded = Image::decode(&payload).unwrap();
    assert!(payload.as_ptr_range().contains(&decoded.data.as_ptr()), "the pixels are borrowed");
}

#[test]
fn a_calibration() {
    let payload = hex::bytes(concat!(
        "0001000000f1536515cd5b071500000063616d6572615f6f70746963616c5f6672616d65z4.e001000080020000",
        "0a000000706c756d625f626f6200000005z9.e03fz6.d03fz29.407f40z14.7440z13.407f40z6.6e40z22.f03f",
        "z6.f03fz30.f03fz30.f03fz5.407f40z14.7440z21.407f40z6.6e40z30.f03fz33.",
    ));
    assert_eq!(hex::digest(&payload), (373, "95ca0437e98a37c1".into()));
    let info = CameraInfo {
        header: camera(),
        height: 480,
        width: 640,
        distortion_model: "plumb_bob",
        d: vec![0.5, 0.25, 0.0, 0.0, 0.0],
        k: [500.0, 0.0, 320.0, 0.0, 500.0, 240.0, 0.0, 0.0, 1.0],
        r: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        p: [500.0, 0.0, 320.0, 0.0, 0.0, 500.0, 240.0, 0.0, 0.0, 0.0, 1.0, 0.0],
        ..CameraInfo::default()
    };
    check(&info, &payload);
}

#[test]
fn an_odometry() {
    let payload = hex::bytes(concat!(
        "0001000000f1536515cd5b07050000006f646f6dz4.0a000000626173655f6c696e6bz13.f03fz7.40z38.f03fz6.",
        "d03fz54.d03fz222.b03fz6.e03fz38.d03fz288.",
    ));
    assert_eq!(hex::digest(&payload), (724, "ac8a6239d112735f".into()));
    let twist = Twist {
        linear: Vector3 { x: 0.5, ..Vector3::default() },
        angular: Vector3 { z: 0.25, ..Vector3::default() },
    };
    let odometry = Odometry {
        header: header("odom"),
        child_frame_id: "base_link",
        pose: pose(),
        twist: TwistWithCovariance { twist, covariance: [0.0; 36] },
    };
    check(&odometry, &payload);
}

#[test]
fn a_compressed_image() {
    let image = CompressedImage { header: camera(), format: "jpeg", data: &[0xff, 0xd8, 0xff, 0xd9] };
    let payload = image.encode();
    assert_eq!(hex::digest(&payload), (60, "5e5a2af915a77d95".into()));
    check(&image, &payload);
}

#[test]
fn detections() {
    let poster =
        ObjectHypothesisWithPose { class_id: "poster", score: 0.5, pose: PoseWithCovariance::default() };
    let bbox =
        BoundingBox2D { center: Pose2D { x: 320.0, y: 240.0, theta: 0.0 }, size_x: 100.0, size_y: 50.0 };
    let detection = Detection2D { header: camera(), results: vec![poster], bbox, id: "7" };
    let array = Detection2DArray { header: camera(), detections: vec![detection] };
    let payload = array.encode();
    assert_eq!(hex::digest(&payload), (498, "7774048cdef4f328".into()));
    check(&array, &payload);
}
