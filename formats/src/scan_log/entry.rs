//! Entries of a scan log: scans with odometry, and the truth if it is known.

use super::text::BadLine;
use map::{laser::Scan, pose2::Pose2};

/// A larger gap between entries is a pause or a changed clock, and does not count as recorded time.
const MAX_PAUSE_S: f64 = 60.0;
/// A log with a higher mean speed has wrong times.
const MAX_SPEED_MPS: f64 = 5.0;

/// Laser parameters for logs that do not state them (CARMEN `FLASER` lines, numbered scans).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LaserDefaults {
    /// Ranges from here on are "no return", metres.
    pub max_range_m: f64,
    /// Angle from the first beam to the last, degrees.
    pub field_deg: f64,
}

impl Default for LaserDefaults {
    fn default() -> Self {
        Self { max_range_m: 50.0, field_deg: 180.0 }
    }
}

/// One scan with the odometry of the same time.
#[derive(Debug, Clone, PartialEq)]
pub struct LogEntry {
    /// `odom_from_robot`, metres and radians.
    pub odom: Pose2,
    /// `map_from_robot` if the log has it: exact, or corrected.
    pub truth: Option<Pose2>,
    /// Time of the scan, seconds, by the clock of the log.
    pub time_s: Option<f64>,
    /// The ranges.
    pub scan: Scan,
}

/// A whole log, in order.
#[derive(Debug, Clone, Default)]
pub struct ScanLog {
    /// The scans, oldest first.
    pub records: Vec<LogEntry>,
    /// The last line, if it could not be used: the log was cut there.
    pub cut: Option<BadLine>,
}

impl ScanLog {
    /// Recorded time without pauses, seconds. `None` if entries have no times, or wrong ones: a
    /// mean speed over 5 m/s.
    pub fn duration_s(&self) -> Option<f64> {
        let times: Option<Vec<f64>> = self.records.iter().map(|r| r.time_s).collect();
        let steps = |t: &[f64]| Some((t[1] - t[0]).abs()).filter(|d| *d <= MAX_PAUSE_S);
        let duration_s: f64 = times?.windows(2).filter_map(steps).sum();
        let way = |r: &[LogEntry]| r[0].odom.between(&r[1].odom).position().norm();
        let way_m: f64 = self.records.windows(2).map(way).sum();
        Some(duration_s).filter(|d| *d > 0.0 && way_m <= MAX_SPEED_MPS * d)
    }
}
