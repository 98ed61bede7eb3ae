//! `search_frames`: when frames are searched for all landmarks of their map. In: a word. Out: the
//! policy of the workers.

use engine::workers::SearchPolicy;
use serde::{Deserialize, Serialize};

/// The server is busy from so many waiting frames on, for each vision thread: a frame then waits
/// for two others.
pub const BUSY_FRAMES_PER_WORKER: usize = 2;

/// `search_frames`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FrameSearch {
    /// Every frame.
    Every,
    /// Every frame while the server keeps up. While at least [`BUSY_FRAMES_PER_WORKER`] frames wait
    /// for each thread, as [`FrameSearch::Scheduled`].
    #[default]
    UnlessBusy,
    /// While a robot's pose is supported and the landmarks that it expects are found, every third
    /// frame of a camera.
    Scheduled,
}

impl FrameSearch {
    /// The policy of so many vision threads.
    pub fn policy(self, workers: usize) -> SearchPolicy {
        match self {
            Self::Every => SearchPolicy::Every,
            Self::UnlessBusy => SearchPolicy::UnlessWaiting((workers * BUSY_FRAMES_PER_WORKER) as u64),
            Self::Scheduled => SearchPolicy::Scheduled,
        }
    }
}
