//! Odometry and laser scans as they enter.

use super::geometry::{self, MAX_COORDINATE_M, between, within};
use crate::{Code, Rejection, v1};
use nalgebra::Isometry2;

/// Most beams in one scan.
pub const MAX_BEAMS: usize = 10_000;
/// Longest range of a laser, in metres.
pub const MAX_RANGE_M: f64 = 1000.0;

/// Odometry that can be relied on.
#[derive(Debug, Clone, PartialEq)]
pub struct CheckedOdometry {
    /// Which start of the robot's software.
    pub epoch: u64,
    /// Counts up within the epoch.
    pub seq: u64,
    /// Robot's clock.
    pub captured_ns: i64,
    /// The robot in its odometry frame.
    pub odom_from_robot: Isometry2<f64>,
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

/// A laser scan that can be relied on.
#[derive(Debug, Clone, PartialEq)]
pub struct CheckedScan {
    /// Which start of the robot's software.
    pub epoch: u64,
    /// Counts up within the epoch.
    pub seq: u64,
    /// Robot's clock.
    pub captured_ns: i64,
    /// The robot in its odometry frame.
    pub odom_from_robot: Isometry2<f64>,
    /// Laser on robot.
    pub robot_from_laser: Isometry2<f64>,
    /// Bearing of the first beam, laser frame, counter-clockwise from ahead.
    pub first_bearing_rad: f64,
    /// Between beams; its sign is the direction of turning.
    pub bearing_step_rad: f64,
    /// At or beyond this there was no return.
    pub max_range_m: f64,
    /// Ranges, each 0 or more and finite; "no return" is `max_range_m`.
    pub ranges_m: Vec<f32>,
}

impl TryFrom<v1::Scan> for CheckedScan {
    type Error = Rejection;

    fn try_from(s: v1::Scan) -> Result<Self, Rejection> {
        let turn = std::f64::consts::TAU;
        if s.ranges_m.is_empty() || s.ranges_m.len() > MAX_BEAMS {
            let detail = format!("{} beams are outside 1 to {MAX_BEAMS}", s.ranges_m.len());
            return Err(Rejection::new(Code::OutOfRange, "ranges_m", detail));
        }
        let step = within("bearing_step_rad", s.bearing_step_rad, turn)?;
        if step.abs() * (s.ranges_m.len() - 1) as f64 > turn * 1.001 {
            return Err(Rejection::new(
                Code::OutOfRange,
                "bearing_step_rad",
                "the scan is more than a full turn",
            ));
        }
        let max_range_m = between("max_range_m", s.max_range_m, 0.1, MAX_RANGE_M)?;
        let mut ranges_m = s.ranges_m;
        for (i, range) in ranges_m.iter_mut().enumerate() {
            // Drivers say "no return" as infinity (REP-117); NaN and negative numbers are faults.
            if *range == f32::INFINITY {
                *range = max_range_m as f32;
            }
            if !(0.0..=MAX_COORDINATE_M as f32).contains(range) {
                let code = if range.is_nan() { Code::NotFinite } else { Code::OutOfRange };
                return Err(Rejection::new(code, format!("ranges_m[{i}]"), format!("{range} is no range")));
            }
        }
        Ok(Self {
            epoch: s.epoch,
            seq: s.seq,
            captured_ns: s.captured_ns,
            odom_from_robot: needed("odom_from_robot", s.odom_from_robot.as_ref())?,
            robot_from_laser: needed("robot_from_laser", s.robot_from_laser.as_ref())?,
            first_bearing_rad: within("first_bearing_rad", s.first_bearing_rad, turn)?,
            bearing_step_rad: step,
            max_range_m,
            ranges_m,
        })
    }
}

fn needed(field: &str, pose: Option<&v1::Pose2>) -> Result<Isometry2<f64>, Rejection> {
    let pose = pose.ok_or_else(|| Rejection::new(Code::Missing, field, "the pose is absent"))?;
    geometry::pose2(pose).map_err(|r| r.inside(field))
}

#[cfg(test)]
mod tests {
    use super::*;

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
        assert_eq!(refused(|s| s.ranges_m[1] = f32::NAN), (Code::NotFinite, "ranges_m[1]".into()));
        assert_eq!(refused(|s| s.ranges_m[2] = -0.5), (Code::OutOfRange, "ranges_m[2]".into()));
        assert_eq!(refused(|s| s.bearing_step_rad = 4.0), (Code::OutOfRange, "bearing_step_rad".into()));
        assert_eq!(refused(|s| s.max_range_m = 0.0), (Code::OutOfRange, "max_range_m".into()));
        assert_eq!(refused(|s| s.max_range_m = MAX_RANGE_M + 1.0), (Code::OutOfRange, "max_range_m".into()));
        assert_eq!(refused(|s| s.robot_from_laser = None), (Code::Missing, "robot_from_laser".into()));
        let far = v1::Pose2 { x_m: 1e39, ..v1::Pose2::default() };
        assert_eq!(
            refused(|s| s.odom_from_robot = Some(far)),
            (Code::OutOfRange, "odom_from_robot.x_m".into())
        );
    }

    #[test]
    fn no_return_becomes_the_range_limit() {
        let mut wire = scan(2);
        wire.ranges_m[0] = f32::INFINITY;
        let ranges = CheckedScan::try_from(wire).unwrap().ranges_m;
        assert!((ranges[0] - 30.0).abs() < 1e-6 && (ranges[1] - 2.0).abs() < 1e-6);
    }

    #[test]
    fn odometry_needs_its_pose() {
        assert_eq!(CheckedOdometry::try_from(v1::Odometry::default()).unwrap_err().field, "odom_from_robot");
    }
}
