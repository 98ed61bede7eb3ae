//! What watches frames: pages, counts, stored answers, gatherings.

pub mod answer_records;
pub mod cameras;
pub mod findings;
pub mod frame_tap;
pub mod frame_times;
pub mod kept_frames;
pub mod live;
pub mod mapping_tap;
pub mod prior_check;
pub mod robot_activity;
pub mod unknown_robots;

use std::sync::Arc;

/// The observers that pages and the API read.
#[derive(Debug, Clone)]
pub struct Observers {
    /// What pages show.
    pub live: Arc<live::LiveHub>,
    /// How long frames take.
    pub times: Arc<frame_times::FrameTimes>,
    /// The frames of stored answers.
    pub kept_frames: Arc<kept_frames::KeptFrames>,
}

impl Observers {
    /// They have seen nothing yet; at most `kept_bytes` of frames are kept.
    pub fn new(kept_bytes: usize) -> Self {
        let kept_frames = Arc::new(kept_frames::KeptFrames::new(kept_bytes));
        Self { live: Arc::default(), times: Arc::default(), kept_frames }
    }
}
