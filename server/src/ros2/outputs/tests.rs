//! What is sent, and what is not.

use super::*;
use ros2::{
    convert::isometry_of_transform,
    messages::{AnyMessage, Odometry, Pose, Quaternion, Vector3},
};

fn settings(pose_source: PoseSource) -> Ros2Outputs {
    Ros2Outputs {
        pose: Some(("/pose".into(), pose_source)),
        initial_pose: Some("/initialpose".into()),
        detections: Some("/detections".into()),
        map_to_odom_ahead_ns: Some(1_000_000_000),
    }
}

fn outputs(pose_source: PoseSource) -> Outputs {
    Outputs::new(settings(pose_source), &RobotSettings::default())
}

/// A robot with odometry: at `ms`, `x_m` ahead of its start.
fn robot(odometry: &[(i64, f64)]) -> RobotAdapter {
    let mut robot = RobotAdapter::new(RobotSettings::default(), 1).unwrap();
    for (ms, x_m) in odometry {
        let position = Vector3 { x: *x_m, y: 0.0, z: 0.0 };
        let pose = Pose { position, orientation: Quaternion::default() };
        let odometry = Odometry {
            header: Header { stamp: Time::from_ns(ms * 1_000_000).unwrap(), frame_id: "odom" },
            child_frame_id: "base_link",
            pose: PoseWithCovariance { pose, ..PoseWithCovariance::default() },
            ..Odometry::default()
        };
        assert_eq!(robot.take("/odom", &AnyMessage::Odometry(odometry)).problems, []);
    }
    robot
}

fn at(x_m: f64) -> v1::Pose2Covariance {
    let covariance = vec![0.04, -0.01, 0.0, -0.01, 0.05, 0.0, 0.0, 0.0, 0.01];
    v1::Pose2Covariance { pose: Some(v1::Pose2 { x_m, y_m: 2.0, theta_rad: 0.0 }), covariance }
}

fn fused(ms: i64, x_m: f64, trust: v1::PoseTrust) -> v1::RobotPose {
    v1::RobotPose {
        captured_ns: ms * 1_000_000,
        map: "hall".into(),
        map_from_robot: Some(at(x_m)),
        trust: trust.into(),
        ..v1::RobotPose::default()
    }
}

fn topics(outgoing: &[Outgoing]) -> Vec<&str> {
    outgoing.iter().map(|o| o.topic.as_str()).collect()
}

#[test]
fn a_fix_goes_out_with_its_covariance_and_time() {
    let answer = v1::Answer {
        captured_ns: 5_000_000_007,
        status: v1::Status::Matched.into(),
        map_from_robot: Some(at(3.0)),
        ..v1::Answer::default()
    };
    let outgoing = outputs(PoseSource::Fixes).of_answer(&answer, "camera");
    assert_eq!(topics(&outgoing), ["/pose", "/detections"]);
    let sent = PoseWithCovarianceStamped::decode(&outgoing[0].payload).unwrap();
    assert_eq!((sent.header.frame_id, sent.header.stamp), ("map", Time { sec: 5, nanosec: 7 }));
    assert!((sent.pose.pose.position.x - 3.0).abs() < 1e-12);
    let c = sent.pose.covariance;
    let given = [c[0], c[1], c[7], c[35], c[14]];
    assert!(
        given.iter().zip([0.04, -0.01, 0.05, 0.01, UNKNOWN_VARIANCE]).all(|(a, b)| (a - b).abs() < 1e-12)
    );
    assert_eq!(topics(&outputs(PoseSource::Fused).of_answer(&answer, "camera")), ["/detections"]);
}

#[test]
fn what_is_not_known_is_not_sent() {
    let outputs = outputs(PoseSource::Fixes);
    let no_match = v1::Answer { status: v1::Status::NoMatch.into(), ..v1::Answer::default() };
    assert_eq!(topics(&outputs.of_answer(&no_match, "camera")), ["/detections"]);
    let mut without = v1::Answer {
        status: v1::Status::Matched.into(),
        map_from_robot: Some(at(1.0)),
        ..v1::Answer::default()
    };
    without.map_from_robot.as_mut().unwrap().covariance.clear();
    assert_eq!(topics(&outputs.of_answer(&without, "camera")), ["/detections"], "no covariance, no pose");
    for status in [v1::Status::Rejected, v1::Status::Expired, v1::Status::Overloaded, v1::Status::NotReady] {
        let refused =
            v1::Answer { status: status.into(), map_from_robot: Some(at(1.0)), ..v1::Answer::default() };
        assert_eq!(outputs.of_answer(&refused, "camera"), []);
    }
    let robot = robot(&[(1000, 0.0)]);
    for trust in [v1::PoseTrust::Unspecified, v1::PoseTrust::Unsupported, v1::PoseTrust::Contradicted] {
        assert_eq!(super::tests::outputs(PoseSource::Fused).of_pose(&fused(1000, 1.0, trust), &robot), []);
    }
    let absent = v1::RobotPose { map_from_robot: None, ..fused(1000, 1.0, v1::PoseTrust::Supported) };
    assert_eq!(super::tests::outputs(PoseSource::Fused).of_pose(&absent, &robot), []);
}

#[test]
fn map_to_odom_fits_the_odometry_of_the_same_time() {
    let mut outputs = outputs(PoseSource::Fixes);
    let robot = robot(&[(1000, 4.0), (1100, 4.2)]);
    let outgoing = outputs.of_pose(&fused(1050, 10.0, v1::PoseTrust::Stale), &robot);
    assert_eq!(topics(&outgoing), ["/tf"], "a stale pose begins nothing");
    let sent = TFMessage::decode(&outgoing[0].payload).unwrap();
    let transform = &sent.transforms[0];
    assert_eq!((transform.header.frame_id, transform.child_frame_id), ("map", "odom"));
    assert_eq!(transform.header.stamp, Time { sec: 2, nanosec: 100_000_000 }, "newest odometry and a second");
    let offset = isometry_of_transform(&transform.transform).unwrap().translation.vector;
    assert!((offset.x - (10.0 - 4.1)).abs() < 1e-9 && (offset.y - 2.0).abs() < 1e-9);
    // The same stamp again would be refused by tf2; without odometry of the time there is no
    // transform.
    assert_eq!(outputs.of_pose(&fused(1100, 10.1, v1::PoseTrust::Stale), &robot), []);
    let later = super::tests::robot(&[(1200, 4.4)]);
    assert_eq!(outputs.of_pose(&fused(1250, 10.4, v1::PoseTrust::Stale), &later), []);
    assert_eq!(topics(&outputs.of_pose(&fused(1200, 10.4, v1::PoseTrust::Stale), &later)), ["/tf"]);
    // After the robot's clock was set back it goes on.
    let back = super::tests::robot(&[(100, 4.4)]);
    assert_eq!(topics(&outputs.of_pose(&fused(100, 10.4, v1::PoseTrust::Stale), &back)), ["/tf"]);
}

#[test]
fn the_robots_own_localisation_is_restarted_at_first_and_after_a_jump() {
    let mut outputs = outputs(PoseSource::Fused);
    outputs.settings.map_to_odom_ahead_ns = None;
    let robot = robot(&[(1000, 0.0), (9000, 8.0)]);
    let mut sent = |ms, x_m, trust| {
        let outgoing = outputs.of_pose(&fused(ms, x_m, trust), &robot);
        topics(&outgoing).into_iter().map(str::to_owned).collect::<Vec<_>>()
    };
    let supported = v1::PoseTrust::Supported;
    assert_eq!(sent(1000, 5.0, v1::PoseTrust::Unsupported), [""; 0]);
    assert_eq!(sent(1000, 5.0, supported), ["/pose", "/initialpose"]);
    assert_eq!(sent(5000, 9.0, supported), ["/pose"], "as far as odometry says");
    assert_eq!(sent(6000, 10.0 + JUMP_M + 0.1, v1::PoseTrust::Stale), ["/pose"]);
    assert_eq!(sent(6000, 10.0 + JUMP_M - 0.1, supported), ["/pose"]);
    assert_eq!(sent(7000, 8.0, supported), ["/pose", "/initialpose"], "a jump back");
    assert_eq!(sent(20_000, 0.0, supported), ["/pose"], "without odometry there is no jump");
}

#[test]
fn the_initial_pose_is_one_that_nav2_takes() {
    let mut outputs = outputs(PoseSource::Fixes);
    let outgoing = outputs.of_pose(&fused(1000, 5.0, v1::PoseTrust::Supported), &robot(&[(1000, 0.0)]));
    let sent = PoseWithCovarianceStamped::decode(&outgoing[0].payload).unwrap();
    assert_eq!(outgoing[0].topic, "/initialpose");
    assert!(sent.pose.covariance.iter().all(|c| *c >= 0.0), "a negative correlation is refused");
}

#[test]
fn a_detection_has_the_box_the_name_and_the_pose_in_the_cameras_frame() {
    let corner = |u_px, v_px| v1::Point { u_px, v_px };
    let covariance: Vec<f64> = (0..36).map(f64::from).collect();
    let pose = v1::LandmarkPose {
        camera_from_landmark: Some(v1::Pose3 { qw: 1.0, z_m: 2.0, ..v1::Pose3::default() }),
        covariance,
        ..v1::LandmarkPose::default()
    };
    let quad = v1::QuadAnswer {
        corners: vec![corner(10.0, 20.0), corner(110.0, 22.0), corner(108.0, 70.0), corner(12.0, 68.0)],
        landmark: "poster".into(),
        confidence: 0.9,
        pose: Some(pose),
        ..v1::QuadAnswer::default()
    };
    let guided = v1::QuadAnswer { landmark: String::new(), guided_landmark: "door".into(), ..quad.clone() };
    let answer = v1::Answer {
        status: v1::Status::Matched.into(),
        quads: vec![quad.clone(), guided, v1::QuadAnswer { pose: None, ..quad }],
        ..v1::Answer::default()
    };
    let outgoing = outputs(PoseSource::Fixes).of_answer(&answer, "camera_optical_frame");
    let sent = Detection2DArray::decode(&outgoing[0].payload).unwrap();
    let [first, without] = sent.detections.as_slice() else { panic!("{sent:?}") };
    assert_eq!((sent.header.frame_id, first.id), ("camera_optical_frame", "poster"));
    let found = &first.results[0];
    assert_eq!((found.class_id, found.score.to_bits()), ("poster", 0.9_f64.to_bits()));
    let size = [first.bbox.center.x, first.bbox.center.y, first.bbox.size_x, first.bbox.size_y];
    assert!(size.iter().zip([60.0, 45.0, 100.0, 50.0]).all(|(a, b)| (a - b).abs() < 1e-12), "{size:?}");
    assert!((found.pose.pose.position.z - 2.0).abs() < 1e-12);
    // Translation comes first with ROS: row 3, column 3 of ours is row 0, column 0 of theirs.
    let c = found.pose.covariance;
    assert!(
        [c[0], c[3], c[18], c[21]].iter().zip([21.0, 18.0, 3.0, 0.0]).all(|(a, b)| (a - b).abs() < 1e-12)
    );
    assert!((without.results[0].pose.covariance[0] - UNKNOWN_VARIANCE).abs() < 1e-9, "known to be unknown");
}
