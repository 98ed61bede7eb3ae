//! Laser scans as plain numbers, and how the laser is mounted.
//!
//! Source: `ros2/common_interfaces sensor_msgs/msg/LaserScan.msg`: the stamp is the time of the
//! first ray, angles run counter-clockwise about the laser's z axis from its x axis, ranges outside
//! of `range_min` to `range_max` are invalid.

use super::planar::{PlanarPose, tilt_rad};
use crate::messages::LaserScan;
use map::laser::{MAX_BEAMS, MAX_FAN_RAD, MAX_RANGE_M};
use nalgebra::Isometry3;
use std::f64::consts::PI;

/// Largest tilt of a laser that counts as level, or as upside down, radians: 5 degrees.
pub const MAX_LASER_TILT_RAD: f64 = 5.0 * PI / 180.0;
/// Longest accepted time of a scan, seconds.
pub const MAX_SCAN_S: f64 = 10.0;

/// Largest accepted angle of the first ray, smallest step and smallest `range_max`, as of
/// [`map::laser::Scan`].
const MAX_ANGLE_RAD: f32 = MAX_FAN_RAD as f32;
const MIN_STEP_RAD: f32 = 1e-5;
const MIN_RANGE_MAX_M: f32 = 0.1;

const NS_PER_S: f64 = 1e9;

/// A scan: beam i has bearing `first_bearing_rad + i * bearing_step_rad`.
#[derive(Debug, Clone, PartialEq)]
pub struct PlanarScan {
    /// Time of the first ray, ns by the robot's clock: the scan's time.
    pub first_ray_ns: i64,
    /// Time of the last ray.
    pub last_ray_ns: i64,
    /// Bearing of the first ray, radians.
    pub first_bearing_rad: f64,
    /// Angle from one ray to the next, radians, signed.
    pub bearing_step_rad: f64,
    /// Largest valid range, metres, at most [`MAX_RANGE_M`]: drivers without a limit send the
    /// largest number, or infinity.
    pub max_range_m: f64,
    /// Ranges, metres; NaN where invalid.
    pub ranges_m: Vec<f32>,
}

/// Why a scan or a mounting cannot be used.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum LaserError {
    /// No ray.
    #[error("a scan without rays")]
    Empty,
    /// More rays than [`MAX_BEAMS`].
    #[error("a scan of {0} rays, {MAX_BEAMS} accepted")]
    Rays(usize),
    /// The rays span more than [`MAX_FAN_RAD`].
    #[error(
        "`angle_increment` times the rays of the scan is {0} rad, more than a turn: angles are in radians"
    )]
    Fan(f64),
    /// A number is not finite or makes no sense: a step of 0, `range_max` not above `range_min`, a
    /// negative time.
    #[error("`{field}` of the scan is {value}")]
    Field {
        /// Name of the field.
        field: &'static str,
        /// Its value.
        value: f64,
    },
    /// The laser's plane is not that of the floor.
    #[error("the laser is tilted by {0} rad")]
    Tilted(f64),
}

impl PlanarScan {
    /// Checks the numbers and makes invalid ranges NaN.
    pub fn of(scan: &LaserScan<'_>) -> Result<Self, LaserError> {
        let steps = scan.ranges.len().checked_sub(1).ok_or(LaserError::Empty)? as f64;
        if scan.ranges.len() > MAX_BEAMS {
            return Err(LaserError::Rays(scan.ranges.len()));
        }
        let wanted = |field, value: f32, is_right: bool| {
            let value = f64::from(value);
            if is_right && value.is_finite() { Ok(value) } else { Err(LaserError::Field { field, value }) }
        };
        let step_ns = wanted("time_increment", scan.time_increment, scan.time_increment >= 0.0)? * NS_PER_S;
        if step_ns * steps > MAX_SCAN_S * NS_PER_S {
            return Err(LaserError::Field { field: "time_increment", value: step_ns / NS_PER_S });
        }
        let first_bearing_rad = wanted("angle_min", scan.angle_min, scan.angle_min.abs() <= MAX_ANGLE_RAD)?;
        let is_step = scan.angle_increment.abs() >= MIN_STEP_RAD;
        let bearing_step_rad = wanted("angle_increment", scan.angle_increment, is_step)?;
        if bearing_step_rad.abs() * steps > MAX_FAN_RAD {
            return Err(LaserError::Fan(bearing_step_rad.abs() * steps));
        }
        wanted("range_min", scan.range_min, true)?;
        let farthest = scan.range_max.min(MAX_RANGE_M as f32);
        let is_above = scan.range_max > scan.range_min.max(MIN_RANGE_MAX_M);
        let max_range_m = wanted("range_max", if is_above { farthest } else { scan.range_max }, is_above)?;
        let valid = scan.range_min..=farthest;
        let first_ray_ns = scan.header.stamp.to_ns();
        Ok(Self {
            first_ray_ns,
            last_ray_ns: first_ray_ns + (step_ns * steps).round() as i64,
            first_bearing_rad,
            bearing_step_rad,
            max_range_m,
            ranges_m: scan.ranges.iter().map(|r| if valid.contains(r) { *r } else { f32::NAN }).collect(),
        })
    }

    /// The same scan with bearings about the floor's z axis, for a laser that hangs upside down.
    #[must_use]
    pub fn mounted(mut self, mounting: &LaserMounting) -> Self {
        if mounting.is_upside_down {
            self.first_bearing_rad = -self.first_bearing_rad;
            self.bearing_step_rad = -self.bearing_step_rad;
        }
        self
    }
}

/// How a planar laser sits on a robot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LaserMounting {
    /// Pose of the laser on the robot: its origin, and the heading of its x axis.
    pub robot_from_laser: PlanarPose,
    /// Whether its z axis points down: angles then run clockwise as seen from above.
    pub is_upside_down: bool,
}

impl LaserMounting {
    /// Of a level laser, upright or upside down.
    pub fn of(robot_from_laser: &Isometry3<f64>) -> Result<Self, LaserError> {
        let tilt_rad = tilt_rad(robot_from_laser);
        let is_upside_down = tilt_rad > 0.5 * PI;
        let from_level = if is_upside_down { PI - tilt_rad } else { tilt_rad };
        if from_level > MAX_LASER_TILT_RAD {
            return Err(LaserError::Tilted(from_level));
        }
        Ok(Self { robot_from_laser: PlanarPose::of(robot_from_laser), is_upside_down })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::messages::{Header, Time};
    use nalgebra::{Point3, Translation3, UnitQuaternion};

    fn scan() -> LaserScan<'static> {
        LaserScan {
            header: Header { stamp: Time { sec: 7, nanosec: 500 }, frame_id: "laser" },
            angle_min: -1.0,
            angle_max: 1.0,
            angle_increment: 0.5,
            time_increment: 0.25,
            scan_time: 2.0,
            range_min: 0.5,
            range_max: 10.0,
            ranges: vec![0.5, 0.4, f32::INFINITY, 10.0, f32::NAN],
            intensities: vec![],
        }
    }

    #[test]
    fn the_stamp_is_the_first_ray_and_invalid_ranges_are_none() {
        let planar = PlanarScan::of(&scan()).unwrap();
        assert_eq!([planar.first_ray_ns, planar.last_ray_ns], [7_000_000_500, 8_000_000_500]);
        let valid: Vec<bool> = planar.ranges_m.iter().map(|r| r.is_finite()).collect();
        assert_eq!(valid, [true, false, false, true, false]);
        let expected = [-1.0, 0.5, 10.0];
        let numbers = [planar.first_bearing_rad, planar.bearing_step_rad, planar.max_range_m];
        assert!(numbers.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12));
    }

    #[test]
    fn numbers_without_sense_are_named() {
        let field = |change: fn(&mut LaserScan<'_>)| {
            let mut changed = scan();
            change(&mut changed);
            match PlanarScan::of(&changed) {
                Err(LaserError::Field { field, .. }) => field,
                other => panic!("{other:?}"),
            }
        };
        assert_eq!(field(|s| s.angle_increment = 0.0), "angle_increment");
        assert_eq!(field(|s| s.angle_increment = f32::NAN), "angle_increment");
        assert_eq!(field(|s| s.angle_min = f32::INFINITY), "angle_min");
        assert_eq!(field(|s| s.range_max = 0.5), "range_max");
        assert_eq!(field(|s| s.range_min = f32::NAN), "range_min");
        assert_eq!(field(|s| s.time_increment = -0.1), "time_increment");
        assert_eq!(field(|s| s.time_increment = 2.6), "time_increment");
        let empty = LaserScan { ranges: vec![], ..scan() };
        assert_eq!(PlanarScan::of(&empty), Err(LaserError::Empty));
    }

    #[test]
    fn an_upside_down_laser_sees_the_same_points() {
        let robot_from_laser = Isometry3::from_parts(
            Translation3::new(0.2, -0.1, 0.3),
            UnitQuaternion::from_euler_angles(PI, 0.0, 0.7),
        );
        let mounting = LaserMounting::of(&robot_from_laser).unwrap();
        assert!(mounting.is_upside_down);
        let (bearing, range) = (0.4_f64, 3.0);
        let truth = robot_from_laser * Point3::new(range * bearing.cos(), range * bearing.sin(), 0.0);
        let first = LaserScan { angle_min: bearing as f32, ..scan() };
        let planar = PlanarScan::of(&first).unwrap().mounted(&mounting);
        let b = planar.first_bearing_rad;
        let found =
            mounting.robot_from_laser.to_isometry() * Point3::new(range * b.cos(), range * b.sin(), 0.0);
        assert!((truth.xy() - found.xy()).norm() < 1e-6);
        assert!(planar.bearing_step_rad < 0.0);
    }

    #[test]
    fn a_tilted_laser_is_refused() {
        let of = |roll| LaserMounting::of(&Isometry3::rotation(nalgebra::Vector3::new(roll, 0.0, 0.0)));
        assert!(!of(0.0).unwrap().is_upside_down);
        assert!(of(MAX_LASER_TILT_RAD - 1e-6).is_ok());
        assert!(matches!(of(MAX_LASER_TILT_RAD + 1e-6), Err(LaserError::Tilted(_))));
        assert!(of(PI - 0.05).unwrap().is_upside_down);
        assert!(of(0.5 * PI).is_err());
    }
}
