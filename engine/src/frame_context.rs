//! What a frame is judged by.

use super::snapshot::MapSnapshot;
use map::{extrinsics::CameraExtrinsics, pose2::Pose2Covariance};
use vision::{frame::Intrinsics, pipeline::FrameAnalysis};

/// An analysed frame with what is known of its camera and its robot.
#[derive(Debug, Clone, Copy)]
pub struct FrameContext<'a> {
    /// Its quads with verdicts.
    pub facts: &'a FrameAnalysis,
    /// The map it was compared with.
    pub map: &'a MapSnapshot,
    /// `robot_from_camera`, where it is known.
    pub mounting: Option<&'a CameraExtrinsics>,
    /// Intrinsics of the camera, where they are known.
    pub camera: Option<&'a Intrinsics>,
    /// Width and height of the image, px.
    pub image_px: [f64; 2],
    /// `map_from_robot` as the robot states it.
    pub prior: Option<&'a Pose2Covariance>,
}
