//! A scan that waits to be matched or mapped.

use map::{laser::Scan, pose2::Pose2};

/// A checked scan with its odometry.
#[derive(Debug, Clone)]
pub struct ScanJob {
    /// Name of the robot's map.
    pub map: String,
    /// Epoch of the scan.
    pub epoch: u64,
    /// Capture time by the robot's clock, ns.
    pub captured_ns: i64,
    /// Odometry at capture (odom frame).
    pub odom_from_robot: Pose2,
    /// Bearings and ranges.
    pub scan: Scan,
}
