//! A scan on its way to the map.

use map::{laser::Scan, pose2::Pose2};

/// A checked scan.
#[derive(Debug, Clone)]
pub struct ScanJob {
    /// The robot's map.
    pub map: String,
    /// Echo of the scan.
    pub epoch: u64,
    /// Robot's clock.
    pub captured_ns: i64,
    /// Odometry of its moment.
    pub odom_from_robot: Pose2,
    /// Bearings and ranges.
    pub scan: Scan,
}
