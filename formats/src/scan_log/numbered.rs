//! Numbered scans, the form of the Intel recording with raw odometry: `i dx dy dtheta r0 r1 ..`,
//! the odometry from scan i to scan i + 1 in the robot's frame, then the ranges over the fan, right
//! to left.

use super::{
    entry::{LaserDefaults, LogEntry},
    text::{BadLine, LineTokens},
};
use map::{
    laser::{MAX_BEAMS, Scan},
    pose2::Pose2,
};

/// State of reading: number of scans, and odometry.
#[derive(Debug, Default)]
pub(super) struct Numbered {
    odom: Pose2,
    scans: usize,
    /// Ranges of the scan before.
    ranges: usize,
}

impl Numbered {
    /// The scan of a line; lines are numbered from 0 without a gap.
    pub(super) fn record(
        &mut self,
        line: usize,
        text: &str,
        laser: &LaserDefaults,
    ) -> Result<LogEntry, BadLine> {
        let mut words = LineTokens::new(line, text);
        let index = words.count("scan number", usize::MAX)?;
        if index != self.scans {
            return Err(words.bad("scan number", format!("{index} where {} follows", self.scans)));
        }
        let motion = words.pose("odometry increment")?;
        let n = text.split_whitespace().count().saturating_sub(4);
        if n == 0 || n > MAX_BEAMS {
            return Err(words.bad("ranges", format!("{n} of them, 1 to {MAX_BEAMS} accepted")));
        }
        if n < self.ranges {
            return Err(words.bad("ranges", format!("{n} of them where {} were before", self.ranges)));
        }
        let ranges = words.ranges(n)?;
        let field = laser.field_deg.to_radians();
        let steps = if n % 2 == 1 { n.saturating_sub(1) } else { n };
        let scan =
            Scan::new(Pose2::default(), -0.5 * field, field / steps.max(1) as f64, laser.max_range_m, ranges)
                .map_err(|e| words.bad("scan", e.to_string()))?;
        let odom = self.odom;
        let next = odom.compose(&motion);
        next.check().map_err(|e| words.bad("odometry", e.to_string()))?;
        (self.odom, self.scans, self.ranges) = (next, self.scans + 1, n);
        Ok(LogEntry { odom, truth: None, time_s: None, scan })
    }
}
