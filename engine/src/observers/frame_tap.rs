//! What gatherings of training views take of an answered frame.

use crate::{
    frame::{analysis::Effect, workers::AnsweredFrame},
    snapshot::MapSnapshot,
};
use map::pose2::Pose2Covariance;
use protos::CheckedFrame;
use std::sync::Arc;
use vision::{frame::GrayImage, pipeline::QuadAnalysis};

/// What is learnt from.
#[derive(Debug)]
pub struct GatheredFrame {
    /// The decoded picture, in grey: what is learnt of it is texture.
    pub image: GrayImage,
    /// Its quads with verdicts.
    pub quads: Vec<QuadAnalysis>,
    /// The version of the map they were recognised against.
    pub map: Arc<MapSnapshot>,
    /// The robot's pose at the frame, as the robot states it, or the fused pose without this frame
    /// (map frame, m and rad).
    pub map_from_robot: Option<Pose2Covariance>,
}

impl GatheredFrame {
    /// The frame, with a capture time that can be used. `None` of one that is not to be gathered.
    /// Of quads, no photograph is there to learn from.
    pub fn of(answered: &AnsweredFrame<'_>) -> Option<(CheckedFrame, Self)> {
        let (frame, found) = (answered.frame, answered.analysed?);
        let captured_ns = match found.effect {
            Effect::Full => frame.captured_ns,
            Effect::Gather { captured_ns } => captured_ns,
            Effect::AnswerOnly | Effect::OtherMap => return None,
        };
        if !frame.is_whole() || found.evaluation.only_expected {
            return None;
        }
        let gathered = Self {
            image: found.picture.grey().clone(),
            quads: found.analysis.quads.clone(),
            map: found.map.clone(),
            map_from_robot: frame.prior.or(found.evaluation.prior),
        };
        Some((CheckedFrame { captured_ns, ..frame.clone() }, gathered))
    }
}
