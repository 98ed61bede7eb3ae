//! A second consumer of analysed frames: robots that gather training views.

use crate::{frame::slots::SlotKey, snapshot::MapSnapshot};
use map::pose2::Pose2Covariance;
use protos::CheckedFrame;
use std::{fmt::Debug, sync::Arc};
use vision::{frame::GrayImage, pipeline::QuadAnalysis};

/// A frame after its analysis.
#[derive(Debug)]
pub struct AnalysedFrame {
    /// The decoded picture, in grey: what is learnt of it is texture.
    pub image: GrayImage,
    /// Its quads with verdicts.
    pub quads: Vec<QuadAnalysis>,
    /// The version of the map they were recognised against.
    pub map: Arc<MapSnapshot>,
    /// The robot's pose at the frame, as the robot states it, or the fused pose without this frame (map frame, m and rad).
    pub map_from_robot: Option<Pose2Covariance>,
}

/// Takes frames of robots that gather. Workers call it: an implementation never waits.
pub trait FrameTap: Debug + Send + Sync {
    /// Whether frames of this camera are wanted.
    fn is_wanted(&self, key: &SlotKey) -> bool;

    /// Takes a frame, or drops it; for cameras whose frames are wanted.
    fn offer(&self, key: &SlotKey, frame: &CheckedFrame, analysed: AnalysedFrame);
}

/// Wants no frames.
#[derive(Debug, Clone, Copy, Default)]
pub struct NoTap;

impl FrameTap for NoTap {
    fn is_wanted(&self, _: &SlotKey) -> bool {
        false
    }

    fn offer(&self, _: &SlotKey, _: &CheckedFrame, _: AnalysedFrame) {}
}
