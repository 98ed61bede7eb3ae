//! Where frames of robots that gather training views go, besides being answered.

use crate::{slots::SlotKey, snapshot::MapSnapshot};
use map::pose2::Pose2Covariance;
use protos::CheckedFrame;
use std::{fmt::Debug, sync::Arc};
use vision::{frame::GrayImage, pipeline::QuadAnalysis};

/// What a worker found in a frame.
#[derive(Debug)]
pub struct AnalysedFrame {
    /// The decoded picture.
    pub image: GrayImage,
    /// Its quads with verdicts.
    pub quads: Vec<QuadAnalysis>,
    /// The version of the map they were recognised against.
    pub map: Arc<MapSnapshot>,
    /// `map_from_robot` at the frame: as the robot states it, or the fused pose without this frame.
    pub believed: Option<Pose2Covariance>,
}

/// Takes frames of robots that gather. Called by the workers: it never waits.
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
