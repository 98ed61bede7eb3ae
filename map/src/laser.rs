//! A planar laser scan, checked once. In: bearings and ranges. Out: points in the laser frame.

use crate::{
    check::{self, OutOfRange},
    pose2::Pose2,
};
use nalgebra::Point2;
use std::f64::consts::TAU;

/// Most beams accepted in a scan.
pub const MAX_BEAMS: usize = 16_384;
/// Largest accepted maximum range, metres.
pub const MAX_RANGE_M: f64 = 1000.0;
/// Widest fan of the rays that are used, radians: a turn, and what a step in 32 bits adds to it.
const FULL_TURN_RAD: f64 = TAU + 1e-6;
/// Widest accepted fan, radians. Lasers that turn give the first ray again after a turn (LDS-01 in
/// Gazebo: 5 µrad over a turn), or as many rays as fit at a nominal step, a few per cent over a
/// turn. Bearings in degrees are far over it.
pub const MAX_FAN_RAD: f64 = 1.05 * TAU;

/// Why a scan cannot be used.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum ScanError {
    /// A number is out of range.
    #[error(transparent)]
    OutOfRange(#[from] OutOfRange),
    /// No beam, or more than [`MAX_BEAMS`].
    #[error("ranges_m has {0} beams, 1 to {MAX_BEAMS} accepted")]
    Beams(usize),
}

/// One scan: beam i has bearing `first_bearing_rad + i * bearing_step_rad`, counter-clockwise from
/// the laser's x.
#[derive(Debug, Clone, PartialEq)]
pub struct Scan {
    robot_from_laser: Pose2,
    first_bearing_rad: f64,
    bearing_step_rad: f64,
    max_range_m: f64,
    ranges_m: Vec<f32>,
}

impl Scan {
    /// Checks everything but single ranges: those that are NaN, infinite, not positive or at least
    /// `max_range_m` are beams without a return. `bearing_step_rad` may be negative, not zero. The
    /// fan (`fan_rad`, step times beams less one) is at most [`MAX_FAN_RAD`]; beams that are more
    /// than a turn after the first are left out.
    pub fn new(
        robot_from_laser: Pose2,
        first_bearing_rad: f64,
        bearing_step_rad: f64,
        max_range_m: f64,
        mut ranges_m: Vec<f32>,
    ) -> Result<Self, ScanError> {
        if ranges_m.is_empty() || ranges_m.len() > MAX_BEAMS {
            return Err(ScanError::Beams(ranges_m.len()));
        }
        robot_from_laser.check()?;
        check::within("first_bearing_rad", first_bearing_rad.abs(), 0.0, MAX_FAN_RAD)?;
        check::within("bearing_step_rad", bearing_step_rad.abs(), 1e-5, TAU)?;
        let fan_rad = bearing_step_rad.abs() * (ranges_m.len() - 1) as f64;
        check::within("fan_rad", fan_rad, 0.0, MAX_FAN_RAD)?;
        check::within("max_range_m", max_range_m, 0.1, MAX_RANGE_M)?;
        ranges_m.truncate((FULL_TURN_RAD / bearing_step_rad.abs()) as usize + 1);
        Ok(Self { robot_from_laser, first_bearing_rad, bearing_step_rad, max_range_m, ranges_m })
    }

    /// Pose of the laser on the robot.
    pub fn robot_from_laser(&self) -> &Pose2 {
        &self.robot_from_laser
    }

    /// Angle from one beam to the next, radians, signed.
    pub fn bearing_step_rad(&self) -> f64 {
        self.bearing_step_rad
    }

    /// Ranges of at least this are beams without a return, metres.
    pub fn max_range_m(&self) -> f64 {
        self.max_range_m
    }

    /// All ranges, metres, as measured; some are not finite.
    pub fn ranges_m(&self) -> &[f32] {
        &self.ranges_m
    }

    /// Bearing of beam `i`, radians, laser frame.
    pub fn bearing_rad(&self, i: usize) -> f64 {
        self.first_bearing_rad + i as f64 * self.bearing_step_rad
    }

    /// Range of beam `i`, metres; `None` without a return.
    pub fn range_m(&self, i: usize) -> Option<f64> {
        self.ranges_m.get(i).map(|r| f64::from(*r)).filter(|r| *r > 0.0 && *r < self.max_range_m)
    }

    /// End point of beam `i` in the laser frame, metres; `None` without a return.
    pub fn point(&self, i: usize) -> Option<Point2<f64>> {
        let (s, c) = self.bearing_rad(i).sin_cos();
        self.range_m(i).map(|r| Point2::new(r * c, r * s))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_PI_2;

    #[test]
    fn beams_with_a_return_become_points() {
        let ranges = vec![2.0, f32::NAN, 9.0, 0.0, -1.0];
        let scan = Scan::new(Pose2::default(), -FRAC_PI_2, FRAC_PI_2, 8.0, ranges).unwrap();
        assert!((scan.point(0).unwrap() - Point2::new(0.0, -2.0)).norm() < 1e-12);
        assert!((1..6).all(|i| scan.point(i).is_none()));
    }

    /// Rays that a turn repeats: `(step, rays)` of lasers, and how many are used.
    #[test]
    fn rays_after_a_turn_are_left_out() {
        let fans = [
            ("LDS-01 in Gazebo", 0.017_501_922_324_299_812, 360, 359),
            ("LDS-01", 1_f64.to_radians(), 360, 360),
            ("first ray again at 32 bits", f64::from((TAU / 359.0) as f32), 360, 360),
            ("clockwise", -0.017_501_922_324_299_812, 360, 359),
            ("nominal step, 2.5 % more rays", TAU / 500.0, 513, 501),
            ("8 rays a turn", 0.5 * FRAC_PI_2, 9, 9),
        ];
        for (name, step, rays, used) in fans {
            let scan = Scan::new(Pose2::default(), 0.0, step, 3.5, vec![1.0; rays]).unwrap();
            assert_eq!(scan.ranges_m().len(), used, "{name}");
            assert!(scan.bearing_rad(used - 1).abs() <= FULL_TURN_RAD, "{name}");
        }
    }

    #[test]
    fn values_out_of_range_are_refused() {
        let scan = |step, max, n| Scan::new(Pose2::default(), 0.0, step, max, vec![1.0; n]);
        assert!(scan(TAU / MAX_BEAMS as f64, MAX_RANGE_M, MAX_BEAMS).is_ok());
        assert_eq!(scan(1e-4, 8.0, MAX_BEAMS + 1), Err(ScanError::Beams(MAX_BEAMS + 1)));
        assert_eq!(scan(1e-3, 8.0, 0), Err(ScanError::Beams(0)));
        assert!(scan(1e-3, MAX_RANGE_M * 1.01, 10).is_err());
        assert!(scan(0.0, 8.0, 10).is_err());
        let fan = OutOfRange { field: "fan_rad", value: 0.1 * 66.0 };
        assert_eq!(scan(0.1, 8.0, 67), Err(fan.into()), "more than 1.05 turns");
        assert!(scan(f64::NAN, 8.0, 10).is_err());
        assert!(Scan::new(Pose2::new(f64::NAN, 0.0, 0.0), 0.0, 0.1, 8.0, vec![1.0]).is_err());
    }
}
