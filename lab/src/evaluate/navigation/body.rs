//! What moves the robot: its own estimate, or its true path. Out: what it senses at every step.

use super::{
    pilot::{Path, Pilot},
    world::{FirstMapBy, World},
};
use crate::evaluate::experiment::{mixed, robot_server::Server};
use cli::survey::UNEVEN_M;
use map::pose2::Pose2;
use nalgebra::Vector3;
use sim::{
    drive::{DriveParams, middle},
    laser::LaserParams,
    robot::{Robot, RobotParams, SensorReadings},
    steered::Steered,
};
use vision::{frame::Intrinsics, model::LandmarkId, random::Random};

/// Settings of a drive.
#[derive(Debug, Clone, Copy)]
pub(super) struct DriveSettings {
    pub(super) seed: u64,
    /// From the far end.
    pub(super) back: bool,
    pub(super) rate_hz: f64,
    /// They have a laser.
    pub(super) laser: bool,
    /// Distance that the robot is carried forwards, m; 0: none.
    pub(super) kidnap_m: f64,
}

/// Start beyond any corridor: the simulator clamps it to the end.
const FAR_END_M: f64 = 1e3;
/// How far a steered robot starts from the start of its path: standard deviations of x, y (m) and
/// heading (rad).
const START_SIGMA: [f64; 3] = [0.05, 0.05, 0.02];
/// A steered robot gives up after as many times the time that its path takes.
const PATIENCE: f64 = 3.0;

/// A robot and what moves it.
pub(super) struct Body {
    robot: Robot,
    steered: Option<Autonomy>,
}

/// A robot that goes by its own estimate.
struct Autonomy {
    steered: Steered,
    path: Path,
    pilot: Pilot,
    most_steps: u64,
    state: State,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    Driving,
    Arrived,
    GaveUp,
}

impl Body {
    pub(super) fn new(world: &World, way: DriveSettings) -> Self {
        let start_m = if way.back { FAR_END_M } else { 0.0 };
        let (seed, reverse, rate_hz) = (way.seed, way.back, way.rate_hz);
        let drive = DriveParams { seed, start_m, reverse, rate_hz, ..DriveParams::default() };
        let [near, far] = middle(&world.building, drive.end_gap_m);
        let path = if way.back { Path { from: far, to: near } } else { Path { from: near, to: far } };
        let steered = (world.course.first_map != FirstMapBy::Truth).then(|| {
            let mut random = Random::new(mixed(&[seed, 15]));
            let error = Vector3::from(START_SIGMA).map(|s| s * random.normal());
            let seconds = (far - near).norm() / drive.speed_mps;
            Autonomy {
                steered: Steered::new(path.start().plus(&error), path.start(), &drive),
                path,
                pilot: Pilot::new(path, rate_hz),
                most_steps: (PATIENCE * seconds * rate_hz) as u64,
                state: State::Driving,
            }
        });
        // The same walls as in the survey.
        let uneven_m = if world.course.first_map.is_survey() { UNEVEN_M } else { 0.0 };
        let laser = LaserParams { uneven_m, ..LaserParams::default() };
        let robot =
            Robot::new(world.building.clone(), &RobotParams { drive, laser, ..RobotParams::default() });
        Self { robot, steered }
    }

    pub(super) fn camera(&self) -> &Intrinsics {
        self.robot.camera().intrinsics()
    }

    /// What it senses at the next step; none at the end of its drive.
    pub(super) fn sense(&mut self) -> Option<SensorReadings> {
        match &self.steered {
            None => self.robot.next(),
            Some(auto) => (auto.state == State::Driving).then(|| self.robot.look(auto.steered.step())),
        }
    }

    /// Moves a robot that goes by its own estimate, which has named these landmarks.
    pub(super) fn steer(
        &mut self,
        server: &Server,
        odom_from_robot: &Pose2,
        named: &[LandmarkId],
    ) -> anyhow::Result<()> {
        let Some(auto) = &mut self.steered else { return Ok(()) };
        match auto.pilot.command(server, auto.steered.step(), odom_from_robot, named)? {
            None => auto.state = State::Arrived,
            Some(_) if auto.steered.step().index >= auto.most_steps => auto.state = State::GaveUp,
            Some(command) => auto.steered.obey(&command),
        }
        Ok(())
    }

    /// How far a true pose is to the left of the path that a steered robot was to follow.
    pub(super) fn off_path_m(&self, truth: &Pose2) -> Option<f64> {
        Some(self.steered.as_ref()?.path.coordinates(truth)[1])
    }

    /// It is at the end of its path, as far as it knows.
    pub(super) fn has_arrived(&self) -> bool {
        self.steered.as_ref().is_none_or(|auto| auto.state == State::Arrived)
    }
}
