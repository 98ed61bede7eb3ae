//! Odometry and laser scans on arrival.

use super::geometry;
use crate::{Code, Rejection, v1};
use map::{
    check::OutOfRange,
    laser::{Scan, ScanError},
    pose2::Pose2,
};

/// Checked odometry.
#[derive(Debug, Clone, PartialEq)]
pub struct CheckedOdometry {
    /// Epoch of the robot's software, drawn at its start.
    pub epoch: u64,
    /// Sequence number, rising within the epoch.
    pub seq: u64,
    /// Robot's clock at capture, ns since the Unix epoch.
    pub captured_ns: i64,
    /// Pose of the robot in its odometry frame.
    pub odom_from_robot: Pose2,
}

impl TryFrom<v1::Odometry> for CheckedOdometry {
    type Error = Rejection;

    fn try_from(o: v1::Odometry) -> Result<Self, Rejection> {
        Ok(Self {
            epoch: o.epoch,
            seq: o.seq,
            captured_ns: o.captured_ns,
            odom_from_robot: needed("odom_from_robot", o.odom_from_robot.as_ref())?,
        })
    }
}

/// A checked laser scan.
#[derive(Debug, Clone, PartialEq)]
pub struct CheckedScan {
    /// Epoch of the robot's software, drawn at its start.
    pub epoch: u64,
    /// Sequence number, rising within the epoch.
    pub seq: u64,
    /// Robot's clock at capture, ns since the Unix epoch.
    pub captured_ns: i64,
    /// Pose of the robot in its odometry frame.
    pub odom_from_robot: Pose2,
    /// Bearings and ranges. A range that is not a number is a beam without return, as drivers send
    /// it.
    pub scan: Scan,
}

impl TryFrom<v1::Scan> for CheckedScan {
    type Error = Rejection;

    fn try_from(s: v1::Scan) -> Result<Self, Rejection> {
        let robot_from_laser = needed("robot_from_laser", s.robot_from_laser.as_ref())?;
        let odom_from_robot = needed("odom_from_robot", s.odom_from_robot.as_ref())?;
        let scan =
            Scan::new(robot_from_laser, s.first_bearing_rad, s.bearing_step_rad, s.max_range_m, s.ranges_m);
        let scan = scan.map_err(|error| match &error {
            ScanError::OutOfRange(inner @ OutOfRange { field: "fan_rad", .. }) => {
                let refused = geometry::refused(inner);
                let detail =
                    format!("{}: bearing_step_rad times the beams is more than a turn", refused.detail);
                Rejection { detail, ..refused }
            }
            ScanError::OutOfRange(inner) => geometry::refused(inner),
            ScanError::Beams(_) => Rejection::new(Code::OutOfRange, "ranges_m", error.to_string()),
        })?;
        Ok(Self { epoch: s.epoch, seq: s.seq, captured_ns: s.captured_ns, odom_from_robot, scan })
    }
}

fn needed(field: &str, pose: Option<&v1::Pose2>) -> Result<Pose2, Rejection> {
    let pose = pose.ok_or_else(|| Rejection::new(Code::Missing, field, "the pose is absent"))?;
    geometry::pose2(pose).map_err(|r| r.inside(field))
}

#[cfg(test)]
mod tests {
    use super::*;
    use map::laser::{MAX_BEAMS, MAX_RANGE_M};

    fn scan(beams: usize) -> v1::Scan {
        v1::Scan {
            odom_from_robot: Some(v1::Pose2::default()),
            robot_from_laser: Some(v1::Pose2::default()),
            first_bearing_rad: -1.5,
            bearing_step_rad: 0.0001,
            max_range_m: 30.0,
            ranges_m: vec![2.0; beams],
            ..v1::Scan::default()
        }
    }

    fn refused(change: impl FnOnce(&mut v1::Scan)) -> (Code, String) {
        let mut wire = scan(3);
        change(&mut wire);
        let r = CheckedScan::try_from(wire).unwrap_err();
        (r.code, r.field)
    }

    #[test]
    fn beams_at_the_bound() {
        assert!(CheckedScan::try_from(scan(MAX_BEAMS)).is_ok());
        assert_eq!(refused(|s| s.ranges_m = vec![1.0; MAX_BEAMS + 1]), (Code::OutOfRange, "ranges_m".into()));
        assert_eq!(refused(|s| s.ranges_m.clear()), (Code::OutOfRange, "ranges_m".into()));
    }

    #[test]
    fn each_fault_names_its_field() {
        assert_eq!(
            refused(|s| s.first_bearing_rad = f64::NAN),
            (Code::NotFinite, "first_bearing_rad".into())
        );
        assert_eq!(refused(|s| s.bearing_step_rad = 4.0), (Code::OutOfRange, "fan_rad".into()));
        assert_eq!(refused(|s| s.bearing_step_rad = 0.0), (Code::OutOfRange, "bearing_step_rad".into()));
        assert_eq!(refused(|s| s.max_range_m = f64::INFINITY), (Code::NotFinite, "max_range_m".into()));
        assert_eq!(refused(|s| s.max_range_m = 0.0), (Code::OutOfRange, "max_range_m".into()));
        assert_eq!(refused(|s| s.max_range_m = MAX_RANGE_M + 1.0), (Code::OutOfRange, "max_range_m".into()));
        assert_eq!(refused(|s| s.robot_from_laser = None), (Code::Missing, "robot_from_laser".into()));
        let far = v1::Pose2 { x_m: 1e39, ..v1::Pose2::default() };
        assert_eq!(
            refused(|s| s.odom_from_robot = Some(far)),
            (Code::OutOfRange, "odom_from_robot.x_m".into())
        );
    }

    /// LDS-01 in Gazebo: 360 rays, the last one a hair more than a turn after the first.
    #[test]
    fn the_first_ray_may_come_again() {
        let wire = v1::Scan { bearing_step_rad: 0.017_501_922_324_299_812, ..scan(360) };
        assert_eq!(CheckedScan::try_from(wire).unwrap().scan.ranges_m().len(), 359);
    }

    #[test]
    fn odometry_needs_its_pose() {
        assert_eq!(CheckedOdometry::try_from(v1::Odometry::default()).unwrap_err().field, "odom_from_robot");
    }
}
