//! The mappings' side of answered frames. In: answered frames. Out: those of robots that make a map
//! with landmarks, queued. Never waits.

use crate::{
    frame::{
        analysis::Effect,
        workers::{AnsweredFrame, FrameObserver},
    },
    motion::MotionTracker,
};
use std::sync::Arc;

/// Gives frames to mappings.
#[derive(Debug)]
pub struct MappingTap(Arc<MotionTracker>);

impl MappingTap {
    /// For the mappings of these robots.
    pub fn new(motion: Arc<MotionTracker>) -> Self {
        Self(motion)
    }
}

impl FrameObserver for MappingTap {
    fn answered(&self, answered: &AnsweredFrame<'_>) {
        // A frame whose capture time cannot be right has no odometry.
        if let Some(found) = answered.analysed.filter(|found| matches!(found.effect, Effect::Full)) {
            let of = (&answered.key.robot, &answered.key.camera);
            self.0.mappings().offer_frame(of, &found.map.name, answered.frame);
        }
    }
}
