//! What the process of the robots is told, and what it tells.

use serde::{Deserialize, Serialize};
use std::{collections::BTreeMap, path::PathBuf};

/// What to send.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Plan {
    pub(super) endpoint: String,
    /// Who signs the server's certificate.
    pub(super) authority: PathBuf,
    /// Folder of the frames, `0.jpg` and so on, along the drive.
    pub(super) folder: PathBuf,
    pub(super) frames: usize,
    /// Of building and drive.
    pub(super) seed: u64,
    /// Frames a second of each robot, and of the drive.
    pub(super) rate_hz: f64,
    pub(super) robots: Vec<PlannedRobot>,
    pub(super) phases: Vec<Phase>,
    /// Whether robots also leave, come back, and send what is refused.
    pub(super) has_faults: bool,
}

impl Plan {
    /// Frames a second of a robot in a phase: the first half of the robots stays at the usual rate.
    pub(super) fn rate_hz(&self, robot: usize, phase: &Phase) -> f64 {
        if self.is_quiet(robot) {
            return self.rate_hz;
        }
        let (all, loud) =
            (self.robots.len() as f64, (self.robots.len() - self.robots.len().div_ceil(2)) as f64);
        self.rate_hz * (phase.factor * all - (all - loud)) / loud
    }

    /// Whether a robot never sends more than usual.
    pub(super) fn is_quiet(&self, robot: usize) -> bool {
        robot < self.robots.len().div_ceil(2)
    }
}

/// A robot with its certificate.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct PlannedRobot {
    pub(super) name: String,
    pub(super) fleet: String,
    pub(super) certificate: PathBuf,
    pub(super) key: PathBuf,
}

/// A time with one load.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Phase {
    pub(super) name: String,
    pub(super) seconds: f64,
    /// Of the usual number of frames, over all robots.
    pub(super) factor: f64,
}

/// What became of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum End {
    /// Searched for landmarks and answered.
    Processed,
    /// Too old when its turn came.
    Expired,
    /// Refused.
    Rejected,
    /// Not answered: superseded by a newer one, or lost on the way.
    Unanswered,
}

#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub(super) struct Sent {
    /// When it was to be sent, s after the start.
    pub(super) intended_s: f32,
    pub(super) end: End,
    /// From then to its answer, ms.
    pub(super) latency_ms: f32,
    /// Age when the work on it began, by the answer, ms.
    pub(super) age_ms: f32,
    /// Work on it, by the answer, ms.
    pub(super) work_ms: f32,
    /// It was guided by a known pose alone.
    pub(super) is_guided: bool,
    /// A landmark was named in it.
    pub(super) is_named: bool,
}

/// What one robot sent.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(super) struct RobotOutcome {
    pub(super) frames: Vec<Sent>,
    /// Refusals, by code.
    pub(super) refusals: BTreeMap<String, u64>,
    /// Frames sent on purpose that the server refuses, and sessions opened anew.
    pub(super) faults: u64,
}

/// What all robots sent, and what that cost.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(super) struct Outcome {
    pub(super) robots: Vec<RobotOutcome>,
    /// Until every robot was connected, s.
    pub(super) connected_s: f64,
    /// Of one connection, ms.
    pub(super) connect_ms: Vec<f32>,
    /// Processor time of the robots' process while it sent, s.
    pub(super) processor_s: f64,
    /// Memory of the robots' process, MB.
    pub(super) rss_mb: f64,
}
