//! A robot drives up and down a corridor: true pose, odometry and camera direction, step by step.
//! It follows its true path, unlike [`crate::steered`]; [`crate::robot`] adds what camera and laser
//! measure.

use std::sync::Arc;

use map::pose2::{Pose2, wrap_rad};
use nalgebra::{Isometry3, Point2, Vector2};
use rand::RngExt;
use serde::{Deserialize, Serialize};

use crate::building::Building;
use crate::gaze::{Gaze, GazeParams};
use crate::odometry::{Odometry, OdometryParams};
use crate::seed;

/// Most steps of a drive.
pub const MAX_STEPS: u64 = 1_000_000;

/// The motion of one robot, step by step; it ends after the last leg.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DriveParams {
    /// Seed of path, odometry and noise.
    pub seed: u64,
    /// Start along the path, metres.
    pub start_m: f64,
    /// Whether the robot starts towards the path's beginning.
    pub reverse: bool,
    /// Number of drives to an end of the path; the robot turns on the spot between them.
    pub legs: u32,
    /// Speed, 0.01 to 3 m/s.
    pub speed_mps: f64,
    /// Rate of turning on the spot, 0.05 to 3 rad/s.
    pub turn_rate_radps: f64,
    /// Steps per second, 0.1 to 100.
    pub rate_hz: f64,
    /// Largest deviation to either side of the path, metres.
    pub weave_m: f64,
    /// Length of one period of the deviation, 2 m or more.
    pub weave_length_m: f64,
    /// Distance of the path from the end walls, metres.
    pub end_gap_m: f64,
    /// Errors of the odometry.
    pub odometry: OdometryParams,
    /// Parameters of the camera's direction.
    pub gaze: GazeParams,
}

impl Default for DriveParams {
    fn default() -> Self {
        Self {
            seed: 0,
            start_m: 0.0,
            reverse: false,
            legs: 1,
            speed_mps: 0.5,
            turn_rate_radps: 0.6,
            rate_hz: 5.0,
            weave_m: 0.2,
            weave_length_m: 9.0,
            end_gap_m: 1.2,
            odometry: OdometryParams::default(),
            gaze: GazeParams::default(),
        }
    }
}

/// The state of the robot at one step.
#[derive(Debug, Clone, PartialEq)]
pub struct Step {
    /// Number of the step, from 0.
    pub index: u64,
    /// Time since the start, seconds.
    pub time_s: f64,
    /// True pose of the robot.
    pub map_from_robot: Pose2,
    /// Pose by odometry; equal to the true pose at the start.
    pub odom_from_robot: Pose2,
    /// Extrinsics of the camera, pan and tilt included.
    pub robot_from_camera: Isometry3<f64>,
    /// Pan of the camera, radians, left positive.
    pub pan_rad: f64,
    /// Tilt of the camera, radians, up positive.
    pub tilt_rad: f64,
    /// Angular speed of the camera in the map, rad/s, left positive.
    pub sweep_radps: f64,
    /// Name of the landmark that the camera is aimed at.
    pub target: Option<String>,
}

impl Step {
    /// True pose of the camera.
    pub fn map_from_camera(&self) -> Isometry3<f64> {
        self.map_from_robot.to_isometry3() * self.robot_from_camera
    }
}

/// Motion of one robot, step by step; ends after its last leg.
#[derive(Debug, Clone)]
pub struct Drive {
    building: Arc<Building>,
    p: DriveParams,
    path: [Point2<f64>; 2],
    along_m: f64,
    forward: bool,
    heading_rad: f64,
    legs_left: u32,
    weave_phase: f64,
    gaze: Gaze,
    odometry: Odometry,
    index: u64,
}

impl Drive {
    /// A drive along the middle of the building's longer side. Parameters are clamped to their
    /// ranges.
    pub fn new(building: Arc<Building>, params: &DriveParams) -> Self {
        let p = clamped(params);
        let path = middle(&building, p.end_gap_m);
        let weave_phase = seed::stream(p.seed, 60).random_range(0.0..std::f64::consts::TAU);
        let length = (path[1] - path[0]).norm();
        let mut drive = Self {
            building,
            path,
            along_m: p.start_m.clamp(0.0, length),
            forward: !p.reverse,
            heading_rad: 0.0,
            legs_left: p.legs,
            weave_phase,
            gaze: Gaze::new(p.gaze.clone()),
            odometry: Odometry::new(p.odometry.clone(), Pose2::default(), p.seed),
            index: 0,
            p,
        };
        drive.heading_rad = drive.course().theta_rad;
        drive.odometry = Odometry::new(drive.p.odometry.clone(), drive.pose(), drive.p.seed);
        drive
    }

    /// Present true pose.
    pub fn pose(&self) -> Pose2 {
        Pose2 { theta_rad: self.heading_rad, ..self.course() }
    }

    /// Pose on the path here, with the heading of the present direction.
    fn course(&self) -> Pose2 {
        let d = self.path[1] - self.path[0];
        let length = d.norm().max(1e-9);
        let d = d / length;
        // The swerve fades out towards the ends, so that turning on the spot starts from the
        // middle.
        let fade = |s: f64| (s / 1.5).clamp(0.0, 1.0).powi(2) * (3.0 - 2.0 * (s / 1.5).clamp(0.0, 1.0));
        let side = |s: f64| {
            let wave = (std::f64::consts::TAU * s / self.p.weave_length_m + self.weave_phase).sin();
            self.p.weave_m * wave * fade(s) * fade(length - s)
        };
        let s = self.along_m;
        let slope = (side(s + 1e-4) - side(s - 1e-4)) / 2e-4;
        let position = self.path[0] + d * s + Vector2::new(-d.y, d.x) * side(s);
        let heading = d.y.atan2(d.x) + slope.atan() + if self.forward { 0.0 } else { std::f64::consts::PI };
        Pose2::new(position.x, position.y, heading)
    }

    fn advance(&mut self) {
        let dt = 1.0 / self.p.rate_hz;
        let length = (self.path[1] - self.path[0]).norm();
        let wanted = self.course().theta_rad;
        let error = wrap_rad(wanted - self.heading_rad);
        let most = self.p.turn_rate_radps * dt;
        if error.abs() > most.max(0.15) {
            self.heading_rad = wrap_rad(self.heading_rad + error.clamp(-most, most));
            return;
        }
        let step = self.p.speed_mps * dt;
        self.along_m = (self.along_m + if self.forward { step } else { -step }).clamp(0.0, length);
        self.heading_rad = self.course().theta_rad;
        let end = if self.forward { length } else { 0.0 };
        if (self.along_m - end).abs() < 1e-9 {
            self.legs_left = self.legs_left.saturating_sub(1);
            self.forward = !self.forward;
        }
    }
}

impl Iterator for Drive {
    type Item = Step;

    fn next(&mut self) -> Option<Step> {
        if self.legs_left == 0 || self.index >= MAX_STEPS {
            return None;
        }
        let before = self.pose();
        if self.index > 0 {
            self.advance();
        }
        let map_from_robot = self.pose();
        let dt = 1.0 / self.p.rate_hz;
        let motion = before.between(&map_from_robot);
        let pan_before = self.gaze.pan_rad();
        let target =
            self.gaze.follow(&self.building, &map_from_robot, if self.index > 0 { Some(dt) } else { None });
        let turned = motion.theta_rad + self.gaze.pan_rad() - pan_before;
        let step = Step {
            index: self.index,
            time_s: self.index as f64 * dt,
            map_from_robot,
            odom_from_robot: self.odometry.advance(&motion),
            robot_from_camera: self.gaze.robot_from_camera(),
            pan_rad: self.gaze.pan_rad(),
            tilt_rad: self.gaze.tilt_rad(),
            sweep_radps: if self.index > 0 { turned / dt } else { 0.0 },
            target,
        };
        self.index += 1;
        Some(step)
    }
}

pub(crate) fn clamped(p: &DriveParams) -> DriveParams {
    let within = |x: f64, low: f64, high: f64| if x.is_finite() { x.clamp(low, high) } else { low };
    DriveParams {
        start_m: within(p.start_m, 0.0, 1e6),
        speed_mps: within(p.speed_mps, 0.01, 3.0),
        turn_rate_radps: within(p.turn_rate_radps, 0.05, 3.0),
        rate_hz: within(p.rate_hz, 0.1, 100.0),
        weave_m: within(p.weave_m, 0.0, 5.0),
        weave_length_m: within(p.weave_length_m, 2.0, 1e3),
        end_gap_m: within(p.end_gap_m, 0.3, 100.0),
        ..p.clone()
    }
}

/// The middle line of the walls' bounding box along its longer side, `gap_m` short of both ends.
pub fn middle(building: &Building, gap_m: f64) -> [Point2<f64>; 2] {
    let ends = || building.walls().iter().flat_map(|w| [w.a_m, w.b_m]);
    let bound =
        |f: fn(f64, f64) -> f64, of: fn(&Point2<f64>) -> f64| ends().map(|p| of(&p)).reduce(f).unwrap_or(0.0);
    let low = Point2::new(bound(f64::min, |p| p.x), bound(f64::min, |p| p.y));
    let high = Point2::new(bound(f64::max, |p| p.x), bound(f64::max, |p| p.y));
    let centre = nalgebra::center(&low, &high);
    let half = 0.5 * (high - low);
    let along = if half.x >= half.y { Vector2::x() } else { Vector2::y() };
    let reach = (half.x.max(half.y) - gap_m).max(0.01);
    [centre - along * reach, centre + along * reach]
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point3;

    fn corridor() -> Arc<Building> {
        Arc::new(Building::corridor(5))
    }

    #[test]
    fn drives_the_corridor_and_keeps_clear_of_the_walls() {
        let building = corridor();
        let p = DriveParams { legs: 2, ..DriveParams::default() };
        let steps: Vec<Step> = Drive::new(building.clone(), &p).collect();
        let furthest = steps.iter().map(|s| s.map_from_robot.x_m).fold(0.0, f64::max);
        assert!((furthest - 23.8).abs() < 1e-6);
        let last = steps.last().unwrap().map_from_robot;
        assert!((last.x_m - 1.2).abs() < 1e-6 && last.y_m.abs() < 1e-6);
        for pair in steps.windows(2) {
            let motion = pair[0].map_from_robot.between(&pair[1].map_from_robot);
            assert!(motion.position().norm() < 0.11 && motion.theta_rad.abs() < 0.2, "{motion:?}");
            let position = Point2::from(pair[1].map_from_robot.position());
            assert!(building.clearance_m(&position) > 0.5);
        }
    }

    #[test]
    fn the_camera_is_aimed_at_every_poster() {
        let building = corridor();
        let p = DriveParams { legs: 2, ..DriveParams::default() };
        let steps: Vec<Step> = Drive::new(building.clone(), &p).collect();
        for poster in building.posters() {
            let aimed = steps.iter().filter(|s| {
                let centre = Point3::from(poster.map_from_landmark.translation.vector);
                let centre = s.map_from_camera().inverse() * centre;
                s.target.as_deref() == Some(&poster.name)
                    && (centre.x / centre.z).abs() < 0.15
                    && centre.z > 0.0
            });
            assert!(aimed.count() >= 8, "{}", poster.name);
        }
    }

    #[test]
    fn drive_parameters_are_clamped() {
        let p =
            DriveParams { rate_hz: f64::NAN, speed_mps: -1.0, weave_length_m: 0.0, ..DriveParams::default() };
        assert!(Drive::new(corridor(), &p).take(1000).count() > 10);
        assert_eq!(Drive::new(corridor(), &DriveParams { legs: 0, ..DriveParams::default() }).count(), 0);
    }
}
