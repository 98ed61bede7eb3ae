//! Steers a robot along a straight path and points its camera. In: the pose that the robot takes
//! itself to have, and the server's advice on the gaze. Out: commands. Knows no truth.

use crate::evaluate::experiment::robot_server::Server;
use map::{
    gaze::{GazeAction, PanTiltUnit},
    pose2::{Pose2, wrap_rad},
};
use nalgebra::{Point2, Vector2};
use sim::{drive::Step, steered::Command};
use std::f64::consts::FRAC_PI_3;
use vision::model::LandmarkId;

/// The robot drives towards the point of the path so far ahead of it.
const AHEAD_M: f64 = 1.0;
/// It has arrived so far before the end of the path.
const ARRIVED_M: f64 = 0.05;
/// Speed, m/s.
const SPEED_MPS: f64 = 0.5;
/// Share of its speed without a pose, so slow that the camera, which looks about, sees what it
/// passes on both sides.
const LOST_PACE: f64 = 0.5;
/// It looks about to either side, rad, so fast, rad/s.
const SWEEP_RAD: f64 = 1.2;
const SWEEP_RADPS: f64 = 0.5;
/// The camera looks at a landmark when it points there this closely.
const AIMED_RAD: f64 = 0.1;

/// A straight path, map frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct Path {
    pub(super) from: Point2<f64>,
    pub(super) to: Point2<f64>,
}

impl Path {
    fn direction(&self) -> Vector2<f64> {
        (self.to - self.from).normalize()
    }

    /// Pose at its start.
    pub(super) fn start(&self) -> Pose2 {
        let d = self.direction();
        Pose2::new(self.from.x, self.from.y, d.y.atan2(d.x))
    }

    /// Coordinates of a pose on it: along it, and to its left, m.
    pub(super) fn coordinates(&self, pose: &Pose2) -> [f64; 2] {
        let (d, to) = (self.direction(), pose.position() - self.from.coords);
        [d.dot(&to), d.perp(&to)]
    }

    /// Speed and rate of turning from a pose (pure pursuit); none at the end.
    fn steering(&self, pose: &Pose2) -> Option<(f64, f64)> {
        let along_m = self.coordinates(pose)[0];
        if along_m >= (self.to - self.from).norm() - ARRIVED_M {
            return None;
        }
        let aim = pose.inverse().apply(&(self.from + self.direction() * (along_m + AHEAD_M)));
        let bearing = aim.y.atan2(aim.x);
        if bearing.abs() > FRAC_PI_3 {
            return Some((0.0, bearing));
        }
        Some((SPEED_MPS, 2.0 * SPEED_MPS * bearing.sin() / aim.coords.norm()))
    }
}

/// Drives one robot.
#[derive(Debug)]
pub(super) struct Pilot {
    path: Path,
    rate_hz: f64,
    /// The landmark that the camera was sent to, with pan and tilt.
    target: Option<(LandmarkId, [f64; 2])>,
    /// Sign of the pan that it sweeps to.
    side: f64,
}

impl Pilot {
    pub(super) fn new(path: Path, rate_hz: f64) -> Self {
        Self { path, rate_hz, target: None, side: 1.0 }
    }

    /// The next command, from the odometry and the names of this step; none at the end of the path.
    /// Until the server knows the pose, the robot takes itself to be where odometry says.
    pub(super) fn command(
        &mut self,
        server: &Server,
        step: &Step,
        odom_from_robot: &Pose2,
        named: &[LandmarkId],
    ) -> anyhow::Result<Option<Command>> {
        let fused = server.pose();
        let pose = fused.as_ref().map_or(*odom_from_robot, |fused| fused.pose);
        let Some((speed_mps, turn_radps)) = self.path.steering(&pose) else { return Ok(None) };
        let pace = if fused.is_some() { 1.0 } else { LOST_PACE };
        let (speed_mps, turn_radps) = (pace * speed_mps, pace * turn_radps);
        let is_aimed = |[pan, tilt]: [f64; 2]| {
            wrap_rad(step.pan_rad - pan).abs() < AIMED_RAD && (step.tilt_rad - tilt).abs() < AIMED_RAD
        };
        let looked = self.target.filter(|(_, angles)| is_aimed(*angles));
        let looked = looked.map(|(landmark, _)| (landmark, named.contains(&landmark)));
        let (pan_rad, tilt_rad) = (step.pan_rad, step.tilt_rad);
        let unit = PanTiltUnit { pan_rad, tilt_rad, ..PanTiltUnit::default() };
        let advice = server.gaze(unit, (step.time_s * 1e9) as i64, looked)?;
        self.target = None;
        let [pan_rad, tilt_rad] = match advice {
            Some(GazeAction::Landmark(target)) => {
                let angles = [target.pan_rad, target.tilt_rad];
                self.target = Some((target.landmark, angles));
                angles
            }
            Some(GazeAction::Ahead) => [0.0; 2],
            Some(GazeAction::Sweep) | None => [self.sweep(pan_rad), 0.0],
        };
        Ok(Some(Command { speed_mps, turn_radps, pan_rad, tilt_rad }))
    }

    /// The next pan of a camera that looks about.
    fn sweep(&mut self, pan_rad: f64) -> f64 {
        if self.side * pan_rad >= SWEEP_RAD {
            self.side = -self.side;
        }
        pan_rad + self.side * SWEEP_RADPS / self.rate_hz
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sim::{drive::DriveParams, steered::Steered};

    #[test]
    fn a_robot_beside_its_path_comes_back_to_it_and_stops_at_the_end() {
        let path = Path { from: Point2::new(10.0, 1.0), to: Point2::new(2.0, 1.0) };
        let start = path.start().compose(&Pose2::new(0.0, 0.3, 2.0));
        let mut robot = Steered::new(start, start, &DriveParams::default());
        let mut worst_m: f64 = 0.0;
        while let Some((speed_mps, turn_radps)) = path.steering(&robot.step().map_from_robot) {
            robot.obey(&Command { speed_mps, turn_radps, ..Command::default() });
            let [along_m, left_m] = path.coordinates(&robot.step().map_from_robot);
            if along_m > 3.0 {
                worst_m = worst_m.max(left_m.abs());
            }
            assert!(robot.step().index < 200, "it never arrives");
        }
        let end = robot.step().map_from_robot;
        assert!(worst_m < 0.05 && (end.x_m - 2.0).abs() < 0.15, "{worst_m} {end:?}");
    }
}
