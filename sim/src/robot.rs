//! A robot in a building: its drive with the readings of camera and laser at every step. Noise
//! depends on the robot's seed and the step, not on the order of calls.

use std::sync::Arc;

use map::laser::Scan;

use crate::building::Building;
use crate::camera::Camera;
use crate::drive::{Drive, DriveParams, Step};
use crate::laser::{self, LaserParams};
use crate::render::{Rendered, Renderer};
use crate::seed;
use crate::sensor::SensorParams;

/// Parameters of a robot's drive and sensors.
#[derive(Debug, Clone)]
pub struct RobotParams {
    /// Parameters of its drive.
    pub drive: DriveParams,
    /// Its camera; 640 x 480 px without distortion by default.
    pub camera: Option<Camera>,
    /// Parameters of the image sensor.
    pub sensor: SensorParams,
    /// Parameters of the laser.
    pub laser: LaserParams,
    /// Exposure time, seconds; motion blur follows from it and the angular speed. 0: none.
    pub exposure_s: f64,
}

impl Default for RobotParams {
    fn default() -> Self {
        Self {
            drive: DriveParams::default(),
            camera: None,
            sensor: SensorParams::default(),
            laser: LaserParams::default(),
            exposure_s: 0.005,
        }
    }
}

/// Readings of camera and laser at one step, with the truth.
#[derive(Debug, Clone)]
pub struct SensorReadings {
    /// Poses and camera direction.
    pub step: Step,
    /// The image and its truth.
    pub frame: Rendered,
    /// The laser scan.
    pub scan: Scan,
}

/// A robot in a building: an iterator over its readings along its drive.
#[derive(Debug, Clone)]
pub struct Robot {
    building: Arc<Building>,
    drive: Drive,
    renderer: Renderer,
    sensor: SensorParams,
    laser: LaserParams,
    exposure_s: f64,
    seed: u64,
}

impl Robot {
    /// A robot at the start of its drive.
    pub fn new(building: Arc<Building>, params: &RobotParams) -> Self {
        Self {
            drive: Drive::new(building.clone(), &params.drive),
            renderer: Renderer::new(params.camera.clone().unwrap_or_else(Camera::vga)),
            sensor: params.sensor.clone(),
            laser: params.laser.clone(),
            exposure_s: params.exposure_s,
            seed: params.drive.seed,
            building,
        }
    }

    /// The camera of the robot.
    pub fn camera(&self) -> &Camera {
        self.renderer.camera()
    }

    /// The drive alone: take steps here and call [`Robot::look`] for some of them.
    pub fn drive_mut(&mut self) -> &mut Drive {
        &mut self.drive
    }

    /// The readings at a step, its own or any other. Noise follows from the robot's seed and the
    /// step's index.
    pub fn look(&mut self, step: &Step) -> SensorReadings {
        let seed = seed::mix(self.seed ^ seed::mix(step.index));
        let blur_px = self.exposure_s * step.sweep_radps * self.camera().intrinsics().fx_px;
        let sensor = SensorParams {
            motion_px: [self.sensor.motion_px[0] + blur_px, self.sensor.motion_px[1]],
            ..self.sensor.clone()
        };
        let frame = self.renderer.render(&self.building, &step.map_from_camera(), &sensor, seed);
        let scan = laser::scan(&self.building, &step.map_from_robot, &self.laser, seed);
        SensorReadings { step: step.clone(), frame, scan }
    }
}

impl Iterator for Robot {
    type Item = SensorReadings;

    fn next(&mut self) -> Option<SensorReadings> {
        let step = self.drive.next()?;
        Some(self.look(&step))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_seeds_give_equal_bytes_and_others_differ() {
        let building = Arc::new(Building::corridor(5));
        let run = |seed, start_m| {
            let drive = DriveParams { seed, start_m, ..DriveParams::default() };
            let mut robot = Robot::new(building.clone(), &RobotParams { drive, ..RobotParams::default() });
            robot.nth(2).unwrap()
        };
        let (a, b, c) = (run(1, 3.0), run(1, 3.0), run(2, 3.0));
        assert_eq!(a.frame, b.frame);
        assert_eq!((a.scan, a.step), (b.scan, b.step));
        assert_ne!(a.frame.image, c.frame.image);
    }

    #[test]
    fn turning_blurs_along_the_rows() {
        let building = Arc::new(Building::corridor(5));
        let sharp = RobotParams { exposure_s: 0.0, sensor: SensorParams::ideal(), ..RobotParams::default() };
        let mut step = Drive::new(building.clone(), &sharp.drive).next().unwrap();
        step.sweep_radps = 1.0;
        let steps = |p: &RobotParams| {
            let image = Robot::new(building.clone(), p).look(&step).frame.image;
            let row = |v: usize| (1..640).map(move |u| (u, v));
            (100..380)
                .flat_map(row)
                .map(|(u, v)| u64::from(image.at(u, v).abs_diff(image.at(u - 1, v))))
                .sum::<u64>()
        };
        let blurred = RobotParams { exposure_s: 0.02, ..sharp.clone() };
        assert!(2 * steps(&blurred) < steps(&sharp));
    }
}
