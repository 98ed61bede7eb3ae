//! Poses that a person gives.

use super::{guided::Robot, *};
use v1::PoseTrust;

const POSTER: LandmarkId = LandmarkId(2);

fn of_poster(x_m: f64) -> Fix {
    Fix { landmarks: vec![POSTER], ..fix(x_m) }
}

fn word(x_m: f64) -> Pose2Covariance {
    let covariance = Matrix3::from_diagonal(&nalgebra::Vector3::new(0.25, 0.25, 0.1225));
    Pose2Covariance { pose: Pose2::new(x_m, 1.0, 0.0), covariance }
}

impl Robot {
    /// A person says where the robot is now.
    fn put(&self, x_m: f64) -> Option<v1::RobotPose> {
        self.motion.set_pose_by_hand(&self.r1, "hall", &word(x_m), time(self.seconds as f64))
    }
}

fn x_m(pose: &v1::RobotPose) -> f64 {
    pose.map_from_robot.as_ref().unwrap().pose.unwrap().x_m
}

#[test]
fn a_persons_word_is_carried_on_by_odometry_and_is_unsupported() {
    let mut robot = Robot::new();
    assert!(robot.frame(None, None).is_none(), "no pose yet");
    let put = robot.put(20.0).unwrap();
    assert_eq!((x_m(&put), put.trust()), (20.0, PoseTrust::Unsupported));
    assert_eq!((put.modalities.as_slice(), put.corrections), (&["odometry".into(), "by_hand".into()][..], 0));
    robot.frame(None, None);
    let pose = robot.motion.odometry_of(&robot.r1, odometry(3, 1.5)).unwrap();
    assert!((x_m(&pose) - 21.0).abs() < 1e-9 && pose.trust() == PoseTrust::Unsupported, "{pose:?}");
    let log = robot.motion.corrections(&robot.r1);
    let words: Vec<_> = log.corrections.iter().map(|c| (c.modality, c.outcome, c.along_m)).collect();
    assert_eq!(words, [("by_hand", "started", None)]);
}

#[test]
fn a_landmark_that_agrees_supports_a_persons_word() {
    let mut robot = Robot::new();
    robot.frame(None, None);
    robot.put(20.0).unwrap();
    let pose = robot.frame(Some(&of_poster(20.7)), None).unwrap();
    assert_eq!(
        (pose.trust(), pose.modalities.as_slice()),
        (PoseTrust::Supported, &["odometry".into(), "landmarks".into()][..])
    );
    assert!(x_m(&pose) > 20.65 && robot.total("landmarks", "applied") == 1, "the word is half a metre wide");
}

#[test]
fn landmarks_that_contradict_a_persons_word_replace_it() {
    let mut robot = Robot::new();
    robot.frame(None, None);
    robot.put(20.0).unwrap();
    let mut frames = 0;
    while robot.total("landmarks", "reset") == 0 {
        frames += 1;
        assert!(frames <= 5, "{:?}", robot.motion.corrections(&robot.r1));
        let x_m = 7.0 + 0.5 * (robot.seconds + 1) as f64;
        robot.frame(Some(&of_poster(x_m)), None);
    }
    let pose = robot.motion.pose(&robot.r1, "hall", time(robot.seconds as f64)).unwrap().pose;
    assert!((pose.x_m - 7.0 - 0.5 * robot.seconds as f64).abs() < 0.05, "{pose:?}");
}

/// The frame was judged by the pose before: its support is not that of the person's word.
#[test]
fn a_word_replaces_a_supported_pose_and_frames_before_it_change_nothing() {
    let mut robot = Robot::new();
    assert_eq!(robot.frame(Some(&of_poster(7.5)), None).unwrap().trust(), PoseTrust::Supported);
    robot.frame(None, None);
    let put = robot.put(20.0).unwrap();
    assert_eq!((x_m(&put), put.trust()), (20.0, PoseTrust::Unsupported));
    let log = robot.motion.corrections(&robot.r1);
    let last = log.corrections.last().unwrap();
    assert_eq!((last.modality, last.outcome), ("by_hand", "reset"));
    assert!((last.along_m.unwrap() - 12.0).abs() < 1e-6, "{last:?}");
    let early = at(1_500_000_000, 0.75);
    assert!(
        robot.motion.apply_fix(&robot.r1, FrameStamp { odometry: None, ..early }, &of_poster(7.75)).is_none()
    );
    assert_eq!(robot.motion.corrections(&robot.r1), log);
    let pose = robot.motion.odometry_of(&robot.r1, odometry(3, 1.5)).unwrap();
    assert_eq!(pose.trust(), PoseTrust::Unsupported);
}

#[test]
fn a_word_needs_odometry_that_is_heard() {
    let (motion, r1) = motion();
    let put = |map: &str, seconds| motion.set_pose_by_hand(&r1, map, &word(3.0), time(seconds)).is_some();
    assert!(!put("hall", 1.0), "nothing was heard yet");
    motion.odometry_of(&r1, odometry(1, 0.0));
    assert!(put("hall", 1.0) && put("hall", 3.0) && motion.hears_odometry(&r1, "hall", time(3.0)));
    assert!(!put("hall", 3.1) && !motion.hears_odometry(&r1, "hall", time(3.1)));
    assert!(!put("yard", 1.0), "it stands on another map");
    // It was given another map, and has not moved there yet.
    motion.snapshots.set_robot("r1", Some("yard"));
    assert!(!put("yard", 1.5));
    motion.odometry_of(&r1, odometry(2, 0.0));
    assert!(put("yard", 2.0));
}
