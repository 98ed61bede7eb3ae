//! Fused poses, as poses and as transforms, and laser scans.

use super::Shown;
use crate::{
    foxglove::{FrameTransform, FrameTransforms, LaserScan, Pose, PoseInFrame, Timestamp},
    topics,
};
use map::pose2::Pose2;
use protos::{Name, v1};

fn level(pose: &v1::Pose2) -> Pose {
    Pose2 { x_m: pose.x_m, y_m: pose.y_m, theta_rad: pose.theta_rad }.to_isometry3().into()
}

/// Nothing of a message without a pose.
pub(super) fn pose(robot: &Name, message: &v1::RobotPose) -> Vec<Shown> {
    let Some(at) = message.map_from_robot.as_ref().and_then(|p| p.pose.as_ref()) else { return Vec::new() };
    let (pose, time) = (level(at), Some(Timestamp::from_ns(message.captured_ns)));
    let frame_id = topics::map_frame(&message.map);
    let transform = FrameTransform {
        timestamp: time,
        parent_frame_id: frame_id.clone(),
        child_frame_id: topics::robot_frame(robot),
        translation: pose.position,
        rotation: pose.orientation,
    };
    let transforms = FrameTransforms { transforms: vec![transform] };
    let pose = PoseInFrame { timestamp: time, frame_id, pose: Some(pose) };
    vec![
        Shown::new(topics::TRANSFORMS.to_owned(), "foxglove.FrameTransforms", &transforms),
        Shown::new(topics::pose(robot), "foxglove.PoseInFrame", &pose),
    ]
}

/// Nothing of a scan without ranges.
pub(super) fn scan(robot: &Name, scan: &v1::Scan) -> Option<Shown> {
    let last = scan.ranges_m.len().checked_sub(1)?;
    let message = LaserScan {
        timestamp: Some(Timestamp::from_ns(scan.captured_ns)),
        frame_id: topics::robot_frame(robot),
        pose: Some(level(&scan.robot_from_laser.unwrap_or_default())),
        start_angle: scan.first_bearing_rad,
        end_angle: scan.first_bearing_rad + scan.bearing_step_rad * last as f64,
        ranges: scan.ranges_m.iter().map(|r| f64::from(*r)).collect(),
        intensities: Vec::new(),
    };
    Some(Shown::new(topics::scan(robot), "foxglove.LaserScan", &message))
}
