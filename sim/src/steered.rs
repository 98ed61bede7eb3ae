//! A robot that is steered: wheels and pan-tilt unit obey commands, odometry measures what the
//! wheels did. In: commands. Out: steps as of [`crate::drive`]. Walls do not stop it.

use crate::{
    drive::{DriveParams, Step, clamped},
    gaze::Gaze,
    odometry::Odometry,
};
use map::pose2::Pose2;
use std::f64::consts::TAU;

/// What wheels and pan-tilt unit shall do until the next step.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Command {
    /// Speed ahead, m/s, at most that of the parameters.
    pub speed_mps: f64,
    /// Rate of turning, rad/s, left positive, at most that of the parameters.
    pub turn_radps: f64,
    /// Pan to reach, radians, left positive.
    pub pan_rad: f64,
    /// Tilt to reach, radians, up positive.
    pub tilt_rad: f64,
}

/// A robot that obeys commands.
#[derive(Debug, Clone)]
pub struct Steered {
    p: DriveParams,
    gaze: Gaze,
    odometry: Odometry,
    step: Step,
}

impl Steered {
    /// A robot at a true pose (map frame), whose odometry starts at another one: where it takes
    /// itself to be. It looks ahead. Of the parameters, those of path and legs are unused.
    pub fn new(map_from_robot: Pose2, odom_from_robot: Pose2, params: &DriveParams) -> Self {
        let p = clamped(params);
        let gaze = Gaze::new(p.gaze.clone());
        let step = Step {
            index: 0,
            time_s: 0.0,
            map_from_robot,
            odom_from_robot,
            robot_from_camera: gaze.robot_from_camera(),
            pan_rad: 0.0,
            tilt_rad: 0.0,
            sweep_radps: 0.0,
            target: None,
        };
        Self { gaze, odometry: Odometry::new(p.odometry.clone(), odom_from_robot, p.seed), step, p }
    }

    /// The present step.
    pub fn step(&self) -> &Step {
        &self.step
    }

    /// Obeys a command until the next step.
    pub fn obey(&mut self, command: &Command) {
        let dt = 1.0 / self.p.rate_hz;
        let limited = |x: f64, most: f64| if x.is_finite() { x.clamp(-most, most) } else { 0.0 };
        let length = dt * limited(command.speed_mps, self.p.speed_mps);
        let turn = dt * limited(command.turn_radps, self.p.turn_rate_radps);
        // An arc: its chord is turned by half the turn.
        let chord = length * if turn.abs() > 1e-9 { (0.5 * turn).sin() / (0.5 * turn) } else { 1.0 };
        let motion = Pose2::new(chord * (0.5 * turn).cos(), chord * (0.5 * turn).sin(), turn);
        let pan_before = self.gaze.pan_rad();
        self.gaze.turn_to(limited(command.pan_rad, TAU), limited(command.tilt_rad, TAU), Some(dt));
        let index = self.step.index + 1;
        self.step = Step {
            index,
            time_s: index as f64 * dt,
            map_from_robot: self.step.map_from_robot.compose(&motion),
            odom_from_robot: self.odometry.advance(&motion),
            robot_from_camera: self.gaze.robot_from_camera(),
            pan_rad: self.gaze.pan_rad(),
            tilt_rad: self.gaze.tilt_rad(),
            sweep_radps: (turn + self.gaze.pan_rad() - pan_before) / dt,
            target: None,
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_PI_2;

    #[test]
    fn a_quarter_of_a_circle_ends_where_geometry_says() {
        let p = DriveParams { rate_hz: 10.0, ..DriveParams::default() };
        let (start, elsewhere) = (Pose2::new(1.0, 2.0, FRAC_PI_2), Pose2::new(5.0, 0.0, 0.0));
        let mut robot = Steered::new(start, elsewhere, &p);
        // A radius of one metre: 0.5 m/s and 0.5 rad/s, ten times a second.
        let steps = 31;
        for _ in 0..steps {
            robot.obey(&Command { speed_mps: 0.5, turn_radps: 0.5, pan_rad: 9.0, tilt_rad: f64::NAN });
        }
        let (turned, end) = (0.05 * f64::from(steps), robot.step().map_from_robot);
        let expected = Pose2::new(1.0 - (1.0 - turned.cos()), 2.0 + turned.sin(), FRAC_PI_2 + turned);
        assert!(end.minus(&expected).norm() < 1e-9, "{end:?}");
        let by_odometry = elsewhere.between(&robot.step().odom_from_robot);
        let error = by_odometry.minus(&start.between(&end)).norm();
        assert!((1e-6..0.2).contains(&error), "odometry drifts: {error}");
        assert!((robot.step().pan_rad - p.gaze.max_pan_rad).abs() < 1e-9);
    }

    #[test]
    fn commands_are_limited_to_what_the_robot_can() {
        let mut robot = Steered::new(Pose2::default(), Pose2::default(), &DriveParams::default());
        robot.obey(&Command { speed_mps: 50.0, turn_radps: f64::NAN, pan_rad: 1.0, tilt_rad: 0.0 });
        let step = robot.step();
        assert!((step.map_from_robot.x_m - 0.1).abs() < 1e-12 && step.map_from_robot.theta_rad.abs() < 1e-12);
        assert!((step.pan_rad - 0.2).abs() < 1e-12 && (step.sweep_radps - 1.0).abs() < 1e-9);
    }
}
