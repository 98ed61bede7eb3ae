//! What guided recognition and the landmark checks are told of a frame.

use crate::snapshot::MapSnapshot;
use map::{extrinsics::CameraExtrinsics, pose2::Pose2Covariance};
use protos::CheckedFrame;
use vision::{frame::Intrinsics, pipeline::FrameAnalysis};

/// What the evaluation of a frame needs: its quads, its map, its camera and its robot's own prior
/// pose.
#[derive(Debug, Clone, Copy)]
pub struct FrameContext<'a> {
    /// Its quads with verdicts.
    pub analysis: &'a FrameAnalysis,
    /// The map it was compared with.
    pub map: &'a MapSnapshot,
    /// `robot_from_camera`, where it is known.
    pub extrinsics: Option<&'a CameraExtrinsics>,
    /// Intrinsics of the camera, where they are known.
    pub camera: Option<&'a Intrinsics>,
    /// Width and height of the image, px.
    pub image_px: [f64; 2],
    /// Whether the whole image is there. If not, a landmark that was not found is not missing.
    pub is_whole: bool,
    /// `map_from_robot` as the robot states it.
    pub prior: Option<&'a Pose2Covariance>,
}

impl<'a> FrameContext<'a> {
    /// A checked frame with what was found in it.
    pub fn new(frame: &'a CheckedFrame, analysis: &'a FrameAnalysis, map: &'a MapSnapshot) -> Self {
        Self {
            analysis,
            map,
            extrinsics: frame.mounting.as_ref(),
            camera: frame.intrinsics.as_ref(),
            image_px: [f64::from(frame.width_px), f64::from(frame.height_px)],
            is_whole: frame.is_whole(),
            prior: frame.prior.as_ref(),
        }
    }
}
