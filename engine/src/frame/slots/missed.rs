//! Frames that were sent and lost on the way, counted by gaps in their numbers.

use crate::limits::MAX_ROBOTS;
use protos::Name;
use std::collections::BTreeMap;

/// Frames whose numbers were left out: sent, and lost on the way.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct MissedFrames {
    /// Of all robots.
    pub total: u64,
    /// By robot, at most [`MAX_ROBOTS`].
    pub by_robot: BTreeMap<Name, u64>,
}

impl MissedFrames {
    pub(super) fn add(&mut self, robot: &Name, count: u64) {
        self.total += count;
        if let Some(all) = self.by_robot.get_mut(robot) {
            *all += count;
        } else if self.by_robot.len() < MAX_ROBOTS {
            self.by_robot.insert(robot.clone(), count);
        }
    }
}
