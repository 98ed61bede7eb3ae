//! Claim: the messages of a robot of ROS become the frames, odometry and scans of Waymark, and
//! whatever is missing is said with topic and age.

use protos::{Name, v1};
use ros2::{
    convert::{CameraError, LookupError},
    messages::{
        AnyMessage, CameraInfo, CompressedImage, Header, Image, LaserScan, MessageKind, Odometry, Pose,
        PoseWithCovariance, Quaternion, TFMessage, Time, Transform, TransformStamped, Vector3,
    },
    robot::{
        CameraSettings, ConvertedMessage, ImageForm, Input, MAX_WAIT_NS, MissingInput, MissingReason,
        Problem, RobotAdapter, RobotMessage, RobotSettings,
    },
};

const EPOCH: u64 = 77;
pub(super) const IMAGE: &str = "/camera/image_raw";
pub(super) const CAMERA_INFO: &str = "/camera/camera_info";
pub(super) const OPTICAL: &str = "camera_optical_frame";
/// Axes of an optical frame in those of a body.
const OPTICAL_AXES: Quaternion = Quaternion { x: -0.5, y: 0.5, z: -0.5, w: 0.5 };

pub(super) fn settings() -> RobotSettings {
    let camera = CameraSettings::conventional(Name::new("front").expect("a name"), "/camera", ImageForm::Raw);
    RobotSettings { cameras: vec![camera], ..RobotSettings::default() }
}

pub(super) fn robot() -> RobotAdapter {
    RobotAdapter::new(settings(), EPOCH).expect("settings")
}

pub(super) fn header(ms: i64, frame_id: &str) -> Header<'_> {
    Header { stamp: Time::from_ns(ms * 1_000_000).expect("a time"), frame_id }
}

pub(super) fn info(ms: i64) -> CameraInfo<'static> {
    CameraInfo {
        header: header(ms, OPTICAL),
        height: 2,
        width: 4,
        distortion_model: "plumb_bob",
        d: vec![0.1, 0.2, 0.3, 0.4, 0.5],
        k: [50.0, 0.0, 2.0, 0.0, 60.0, 1.0, 0.0, 0.0, 1.0],
        ..CameraInfo::default()
    }
}

pub(super) fn image(ms: i64) -> AnyMessage<'static> {
    let data = &[10, 20, 30, 40, 50, 60, 70, 80];
    let (height, width) = (2, 4);
    AnyMessage::Image(Image {
        header: header(ms, OPTICAL),
        height,
        width,
        encoding: "mono8",
        is_bigendian: 0,
        step: 4,
        data,
    })
}

fn link<'a>(
    ms: i64,
    parent: &'a str,
    child: &'a str,
    at: [f64; 3],
    turn: Quaternion,
) -> TransformStamped<'a> {
    let translation = Vector3 { x: at[0], y: at[1], z: at[2] };
    let transform = Transform { translation, rotation: turn };
    TransformStamped { header: header(ms, parent), child_frame_id: child, transform }
}

fn tf(transforms: Vec<TransformStamped<'_>>) -> AnyMessage<'_> {
    AnyMessage::TFMessage(TFMessage { transforms })
}

/// Camera and laser on the robot, over a link between.
pub(super) fn mountings() -> AnyMessage<'static> {
    let level = Quaternion::default();
    tf(vec![
        link(0, "base_link", "mast", [0.1, 0.0, 1.0], level),
        link(0, "/mast", OPTICAL, [0.2, 0.0, 0.5], OPTICAL_AXES),
        link(0, "base_link", "laser", [0.3, 0.0, 0.2], Quaternion { x: 0.0, y: 0.0, z: 1.0, w: 0.0 }),
    ])
}

pub(super) fn wheels(ms: i64, x_m: f64) -> AnyMessage<'static> {
    let position = Vector3 { x: x_m, y: 0.0, z: 0.0 };
    let pose = Pose { position, orientation: Quaternion::default() };
    AnyMessage::Odometry(Odometry {
        header: header(ms, "odom"),
        child_frame_id: "base_link",
        pose: PoseWithCovariance { pose, ..PoseWithCovariance::default() },
        ..Odometry::default()
    })
}

pub(super) fn turn(ms: i64) -> LaserScan<'static> {
    LaserScan {
        header: header(ms, "laser"),
        angle_min: -0.5,
        angle_max: 0.5,
        angle_increment: 0.5,
        time_increment: 0.01,
        scan_time: 0.1,
        range_min: 0.1,
        range_max: 10.0,
        ranges: vec![1.0, 0.05, 2.0],
        intensities: vec![],
    }
}

fn scan(ms: i64) -> AnyMessage<'static> {
    AnyMessage::LaserScan(turn(ms))
}

pub(super) fn frames(taken: &ConvertedMessage) -> Vec<(&v1::Frame, &[MissingInput])> {
    let frames = taken.messages.iter().filter_map(|message| match message {
        RobotMessage::Frame { frame, lacks, .. } => Some((frame, lacks.as_slice())),
        _ => None,
    });
    frames.collect()
}

pub(super) fn scans(taken: &ConvertedMessage) -> Vec<&v1::Scan> {
    let scans = taken.messages.iter().filter_map(|message| match message {
        RobotMessage::Scan(scan) => Some(scan),
        _ => None,
    });
    scans.collect()
}

#[test]
fn an_image_becomes_a_frame_with_all_that_is_known() {
    let mut robot = robot();
    assert_eq!(robot.take("/tf_static", &mountings()), ConvertedMessage::default());
    assert_eq!(robot.take(CAMERA_INFO, &AnyMessage::CameraInfo(info(900))), ConvertedMessage::default());
    robot.take("/odom", &wheels(1000, 1.0));
    robot.take("/odom", &wheels(2000, 3.0));
    let taken = robot.take(IMAGE, &image(1500));
    assert_eq!(taken.problems, []);
    let [(frame, lacks)] = frames(&taken)[..] else { panic!("{taken:?}") };
    assert_eq!(lacks, []);
    assert_eq!((frame.epoch, frame.seq, frame.captured_ns), (EPOCH, 1, 1_500_000_000));
    assert_eq!((frame.encoding(), frame.width_px, frame.height_px), (v1::ImageEncoding::Gray8, 4, 2));
    assert_eq!(frame.image[..], [10, 20, 30, 40, 50, 60, 70, 80]);
    let camera = v1::Intrinsics {
        fx_px: 50.0,
        fy_px: 60.0,
        cx_px: 2.0,
        cy_px: 1.0,
        plumb_bob: vec![0.1, 0.2, 0.3, 0.4, 0.5],
        ..v1::Intrinsics::default()
    };
    assert_eq!(frame.intrinsics, Some(camera));
    let mounting = frame.robot_from_camera.unwrap();
    let off = [mounting.x_m - 0.3, mounting.y_m, mounting.z_m - 1.5, mounting.qx + 0.5, mounting.qy - 0.5];
    assert!(off.iter().all(|d| d.abs() < 1e-12), "{mounting:?}");
    let odometry = frame.odometry.unwrap();
    assert!((odometry.x_m - 2.0).abs() < 1e-9, "{odometry:?}");
    let RobotMessage::Frame { camera, frame_id, .. } = &taken.messages[0] else { panic!("{taken:?}") };
    assert_eq!((camera.as_str(), frame_id.as_str()), ("front", OPTICAL));
    let again = robot.take(IMAGE, &image(1600));
    assert_eq!(frames(&again)[0].0.seq, 2);
}

#[test]
fn a_raw_image_travels_in_colour_up_to_its_bound() {
    let travels = |width: u32, height: u32| {
        let (step, data) = (3 * width, vec![9; 3 * (width * height) as usize]);
        let raw = Image {
            header: header(1500, OPTICAL),
            height,
            width,
            encoding: "bgr8",
            is_bigendian: 0,
            step,
            data: &data,
        };
        let taken = robot().take(IMAGE, &AnyMessage::Image(raw));
        let [(frame, _)] = frames(&taken)[..] else { panic!("{taken:?}") };
        (frame.encoding(), frame.image.len())
    };
    assert_eq!(travels(960, 540), (v1::ImageEncoding::Rgb8, 3 * 960 * 540));
    assert_eq!(travels(960, 541), (v1::ImageEncoding::Gray8, 960 * 541));
}

#[test]
fn what_a_frame_lacks_is_said_with_topic_and_age() {
    let mut robot = robot();
    let taken = robot.take(IMAGE, &image(1500));
    let [(frame, lacks)] = frames(&taken)[..] else { panic!("{taken:?}") };
    assert!(frame.intrinsics.is_none() && frame.robot_from_camera.is_none() && frame.odometry.is_none());
    let said: Vec<_> = lacks.iter().map(|l| (l.input, l.topic.as_str(), l.age_ns, &l.reason)).collect();
    let nothing = &MissingReason::NotReceived;
    let expected = [
        (Input::CameraInfo, CAMERA_INFO, None, nothing),
        (Input::Transforms, "/tf_static", None, nothing),
        (Input::Odometry, "/odom", None, nothing),
    ];
    assert_eq!(said, expected);

    robot.take(CAMERA_INFO, &AnyMessage::CameraInfo(CameraInfo { width: 8, ..info(1000) }));
    let moved = tf(vec![link(1200, "odom", "base_link", [0.0; 3], Quaternion::default())]);
    assert_eq!(robot.take("/tf", &moved), ConvertedMessage::default(), "odometry has a topic of its own");
    robot.take("/odom", &wheels(100, 0.0));
    let taken = robot.take(IMAGE, &image(1600));
    let lacks = frames(&taken)[0].1;
    let size = MissingReason::ImageSize { calibrated: (8, 2), given: (4, 2) };
    assert_eq!((&lacks[0].reason, lacks[0].age_ns), (&size, Some(600_000_000)));
    let unknown = MissingReason::from(LookupError::Unknown(OPTICAL.into()));
    assert_eq!((&lacks[1].reason, lacks[1].age_ns), (&unknown, Some(400_000_000)));
    assert_eq!((&lacks[2].reason, lacks[2].age_ns), (&MissingReason::NotAtThatTime, Some(1_500_000_000)));
    assert_eq!(
        lacks[0].to_string(),
        "no calibration from `/camera/camera_info`: it is of images of (8, 2) px, these have (4, 2) (newest 0.600 s \
         before)"
    );
    let k = [0.0; 9];
    robot.take(CAMERA_INFO, &AnyMessage::CameraInfo(CameraInfo { k, ..info(1600) }));
    let taken = robot.take(IMAGE, &image(1600));
    assert_eq!(frames(&taken)[0].1[0].reason, MissingReason::Camera(CameraError::Uncalibrated));
}

#[test]
fn each_lens_model_has_its_field() {
    let lens = |distortion_model, d: Vec<f64>, is_rectified| {
        let mut settings = settings();
        settings.cameras[0].is_rectified = is_rectified;
        let mut robot = RobotAdapter::new(settings, EPOCH).unwrap();
        let mut p = [0.0; 12];
        (p[0], p[5], p[2], p[6]) = (40.0, 41.0, 2.0, 1.0);
        robot.take(CAMERA_INFO, &AnyMessage::CameraInfo(CameraInfo { distortion_model, d, p, ..info(1) }));
        let taken = robot.take(IMAGE, &image(2));
        frames(&taken)[0].0.intrinsics.clone().unwrap()
    };
    let rational: Vec<f64> = (1..=8).map(f64::from).collect();
    assert_eq!(lens("rational_polynomial", rational.clone(), false).rational_polynomial, rational);
    assert_eq!(lens("equidistant", vec![1.0; 4], false).equidistant, [1.0; 4]);
    assert_eq!(lens("plumb_bob", vec![1.0; 4], false).plumb_bob, [1.0, 1.0, 1.0, 1.0, 0.0]);
    let rectified = lens("plumb_bob", vec![1.0; 5], true);
    assert!(rectified.plumb_bob.is_empty() && (rectified.fx_px - 40.0).abs() < 1e-12);
}

#[test]
fn compressed_images_stay_as_they_are() {
    let mut settings = settings();
    settings.cameras[0] =
        CameraSettings::conventional(Name::new("front").unwrap(), "/camera", ImageForm::Compressed);
    let mut robot = RobotAdapter::new(settings, EPOCH).unwrap();
    // SOI, APP0, SOF0 of 64 x 48.
    let jpeg = [0xFF, 0xD8, 0xFF, 0xE0, 0, 4, 0, 0, 0xFF, 0xC0, 0, 17, 8, 0, 48, 0, 64, 3];
    let message = |data| {
        AnyMessage::CompressedImage(CompressedImage { header: header(5, OPTICAL), format: "jpeg", data })
    };
    let topic = "/camera/image_raw/compressed";
    let taken = robot.take(topic, &message(&jpeg));
    let frame = frames(&taken)[0].0;
    assert_eq!((frame.encoding(), frame.width_px, frame.height_px), (v1::ImageEncoding::Jpeg, 64, 48));
    assert_eq!(frame.image[..], jpeg);
    assert_eq!(robot.take(topic, &message(&jpeg[..12])).problems, [Problem::ImageHeader(topic.into())]);
    assert_eq!(robot.take(topic, &message(b"GIF89a")).problems[0].word(), "bad_image");
}

#[test]
fn a_scan_has_the_lasers_place_and_the_time_of_its_middle() {
    let mut robot = robot();
    robot.take("/tf_static", &mountings());
    robot.take("/odom", &wheels(1000, 1.0));
    robot.take("/odom", &wheels(2000, 3.0));
    let taken = robot.take("/scan", &scan(1490));
    assert_eq!(taken.problems, []);
    let made = scans(&taken)[0];
    assert_eq!((made.epoch, made.seq, made.captured_ns), (EPOCH, 1, 1_500_000_000));
    assert!((made.odom_from_robot.unwrap().x_m - 2.0).abs() < 1e-9);
    let place = made.robot_from_laser.unwrap();
    assert!((place.x_m - 0.3).abs() < 1e-12 && (place.theta_rad.abs() - std::f64::consts::PI).abs() < 1e-9);
    assert!((made.first_bearing_rad + 0.5).abs() < 1e-9 && (made.bearing_step_rad - 0.5).abs() < 1e-9);
    assert!(made.ranges_m[1].is_nan() && (made.ranges_m[2] - 2.0).abs() < 1e-9);

    let askew = LaserScan { header: header(1500, OPTICAL), ..turn(0) };
    let taken = robot.take("/scan", &AnyMessage::LaserScan(askew));
    let Problem::Lacks { lack, .. } = &taken.problems[0] else { panic!("{taken:?}") };
    assert!(matches!(lack.reason, MissingReason::Laser(_)));
    let empty = LaserScan { ranges: vec![], ..turn(1500) };
    assert_eq!(robot.take("/scan", &AnyMessage::LaserScan(empty)).problems[0].word(), "bad_scan");
}

#[test]
fn frames_and_scans_wait_for_odometry_of_their_time() {
    let mut robot = robot();
    robot.take("/tf_static", &mountings());
    assert_eq!(robot.take("/scan", &scan(1000)).problems[0].word(), "no_odometry");
    robot.take("/odom", &wheels(1000, 1.0));
    assert_eq!(robot.take("/scan", &scan(1100)), ConvertedMessage::default());
    let replaced = robot.take("/scan", &scan(1140));
    assert_eq!(replaced.problems, [Problem::Superseded("/scan".into())]);
    assert_eq!(robot.take(IMAGE, &image(1150)), ConvertedMessage::default());
    let taken = robot.take("/odom", &wheels(1200, 2.0));
    assert_eq!(taken.messages.len(), 3, "odometry, scan, frame");
    assert_eq!((scans(&taken)[0].seq, scans(&taken)[0].captured_ns), (1, 1_150_000_000));
    assert!((frames(&taken)[0].0.odometry.unwrap().x_m - 1.75).abs() < 1e-9);

    // A second picture finds the first still waiting: that one goes without odometry, before it.
    assert_eq!(robot.take(IMAGE, &image(1300)), ConvertedMessage::default());
    let taken = robot.take(IMAGE, &image(1400));
    let [(frame, lacks)] = frames(&taken)[..] else { panic!("{taken:?}") };
    assert_eq!((frame.seq, frame.odometry, lacks.last().unwrap().input), (2, None, Input::Odometry));
    assert_eq!(frames(&robot.take("/odom", &wheels(1500, 3.0)))[0].0.seq, 3);
    // Odometry that has stopped is not waited for.
    let late = 1501 + MAX_WAIT_NS / 1_000_000;
    assert_eq!(frames(&robot.take(IMAGE, &image(late))).len(), 1);
}

#[test]
fn odometry_is_that_of_the_base_frame() {
    let mut robot = robot();
    let footprint = |ms| {
        let AnyMessage::Odometry(odometry) = wheels(ms, 1.0) else { unreachable!() };
        AnyMessage::Odometry(Odometry { child_frame_id: "base_footprint", ..odometry })
    };
    let early = robot.take("/odom", &footprint(10));
    assert_eq!((early.messages.len(), early.problems[0].word()), (0, "no_transform"));
    let up = link(0, "base_footprint", "base_link", [0.5, 0.0, 0.1], Quaternion::default());
    robot.take("/tf_static", &tf(vec![up]));
    let taken = robot.take("/odom", &footprint(20));
    let RobotMessage::Odometry(odometry) = &taken.messages[0] else { panic!("{taken:?}") };
    assert!((odometry.odom_from_robot.unwrap().x_m - 1.5).abs() < 1e-12);
    assert_eq!((odometry.epoch, odometry.seq, odometry.captured_ns), (EPOCH, 1, 20_000_000));
    assert!((robot.odom_from_base(20_000_000).unwrap().translation.z - 0.1).abs() < 1e-12);
    assert_eq!(robot.odom_from_base(30_000_000), None);

    let AnyMessage::Odometry(other) = wheels(30, 1.0) else { unreachable!() };
    let other = Odometry { header: header(30, "world"), ..other };
    assert_eq!(robot.take("/odom", &AnyMessage::Odometry(other)).problems[0].word(), "odometry_frame");
    assert_eq!(robot.take("/odom", &wheels(20, 5.0)), ConvertedMessage::default(), "not newer");
    assert_eq!(robot.take("/odom", &wheels(0, 5.0)).problems, [Problem::NoStamp("/odom".into())]);
}

#[test]
fn odometry_may_come_by_transforms() {
    let settings = RobotSettings { odometry: None, ..settings() };
    let mut robot = RobotAdapter::new(settings, EPOCH).unwrap();
    let level = Quaternion::default();
    let moved = |ms| tf(vec![link(ms, "odom", "base_footprint", [2.0, 0.0, 0.0], level)]);
    assert_eq!(robot.take("/tf", &moved(10)), ConvertedMessage::default(), "no link to the base yet");
    robot.take("/tf_static", &tf(vec![link(0, "base_footprint", "base_link", [0.5, 0.0, 0.0], level)]));
    let taken = robot.take("/tf", &moved(20));
    let RobotMessage::Odometry(odometry) = &taken.messages[0] else { panic!("{taken:?}") };
    assert!((odometry.odom_from_robot.unwrap().x_m - 2.5).abs() < 1e-12);
    assert_eq!(robot.take("/odom", &wheels(30, 1.0)).problems[0].word(), "not_used");
}

#[test]
fn bad_transforms_and_other_topics_are_told() {
    let mut robot = robot();
    let level = Quaternion::default();
    let unit = |child| link(1, "base_link", child, [0.0; 3], level);
    let nothing = Quaternion { w: 0.0, ..level };
    let taken = robot.take(
        "/tf_static",
        &tf(vec![
            unit("a"),
            link(1, "a", "base_link", [0.0; 3], level),
            link(1, "a", "b", [0.0; 3], nothing),
            unit(OPTICAL),
        ]),
    );
    assert_eq!(taken.problems.iter().map(Problem::word).collect::<Vec<_>>(), ["bad_transform"; 2]);
    let mounted = robot.take(IMAGE, &image(5));
    assert!(frames(&mounted)[0].0.robot_from_camera.is_some(), "the others are used");
    let other = Problem::NotUsed { topic: "/other".into(), kind: MessageKind::Image };
    assert_eq!(robot.take("/other", &image(5)).problems, [other]);
    assert_eq!(robot.take(IMAGE, &scan(5)).problems[0].word(), "not_used");
    assert_eq!(robot.take(IMAGE, &image(0)).problems, [Problem::NoStamp(IMAGE.into())]);
    let depth =
        AnyMessage::Image(Image { header: header(5, OPTICAL), encoding: "16UC1", ..Image::default() });
    assert_eq!(robot.take(IMAGE, &depth).problems[0].word(), "bad_image");
}

#[test]
fn a_camera_frame_may_be_named_by_the_settings() {
    let mut settings = settings();
    (settings.cameras[0].frame, settings.cameras[0].has_body_axes) = (Some("camera_link".into()), true);
    let mut robot = RobotAdapter::new(settings, EPOCH).unwrap();
    let mast = link(0, "base_link", "camera_link", [0.1, 0.0, 1.0], Quaternion::default());
    robot.take("/tf_static", &tf(vec![mast]));
    let mounting = frames(&robot.take(IMAGE, &image(5)))[0].0.robot_from_camera.unwrap();
    let axes = [mounting.qx - OPTICAL_AXES.x, mounting.qy - OPTICAL_AXES.y, mounting.qz - OPTICAL_AXES.z];
    assert!(axes.iter().all(|d| d.abs() < 1e-12) && (mounting.z_m - 1.0).abs() < 1e-12);
}
