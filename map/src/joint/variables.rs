//! The variables of the joint map, their parameters and their steps.

use crate::pose2::{Pose2, wrap_rad};
use nalgebra::{Isometry3, Matrix3, Point2, Rotation3, SVector, Vector2, Vector3};
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};
use vision::pose::{LandmarkSize, reprojection::perturbed};

/// Most a landmark leans or rolls away from level, radians.
const MAX_LEAN_RAD: f64 = 0.3;
/// Logarithms of the least and largest side of a landmark in metres.
const LOG_SIDE: [f64; 2] = [-3.0, 2.0];

/// A variable, by its number among its kind.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Variable {
    /// (x, y, theta) of the robot on the floor.
    Keyframe(usize),
    /// Facing angle and offset.
    Wall(usize),
    /// (x, y, theta, z, tilt, roll, log width, log height).
    Landmark(usize),
    /// Mounting (rotation, translation), focal length, principal point, k1.
    Camera(usize),
    /// Scale and drift.
    Odometry(usize),
    /// Height of a ceiling.
    Ceiling(usize),
}

impl Variable {
    /// Number of parameters.
    pub fn size(self) -> usize {
        match self {
            Self::Keyframe(_) => 3,
            Self::Wall(_) | Self::Odometry(_) => 2,
            Self::Landmark(_) => 8,
            Self::Camera(_) => 10,
            Self::Ceiling(_) => 1,
        }
    }
}

/// The line of a wall: `n(facing) . (p - anchor) = offset`, n towards the free side.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WallLine {
    /// A fixed point near the wall, which keeps the numbers well scaled; metres.
    pub anchor: Point2<f64>,
    /// Direction of the facing normal, radians.
    pub facing_rad: f64,
    /// Offset from the anchor along the normal, metres.
    pub offset_m: f64,
}

impl WallLine {
    /// The wall of a line (facing angle and offset in the robot frame) from this pose: its anchor
    /// is the foot of the robot.
    pub(super) fn observed(pose: &Pose2, facing_rad: f64, offset_m: f64) -> Self {
        let anchor = Point2::from(pose.position());
        let mut made = Self { anchor, facing_rad: wrap_rad(pose.theta_rad + facing_rad), offset_m: 0.0 };
        made.anchor += made.normal() * offset_m;
        made
    }

    /// Facing normal.
    pub fn normal(&self) -> Vector2<f64> {
        let (s, c) = self.facing_rad.sin_cos();
        Vector2::new(c, s)
    }

    /// Derivative of the normal by the facing angle: along the wall.
    pub fn along(&self) -> Vector2<f64> {
        let n = self.normal();
        Vector2::new(-n.y, n.x)
    }
}

/// A rectangle: centre, direction of its normal, tilt, roll and size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LandmarkState {
    /// Centre, metres.
    pub centre: Vector3<f64>,
    /// Direction of the outward normal on the floor, radians.
    pub theta_rad: f64,
    /// Rotation of the normal from level downwards, radians: pi/2 under a ceiling.
    pub tilt_rad: f64,
    /// Rotation about the normal, radians.
    pub roll_rad: f64,
    /// Natural logarithms of width and height in metres.
    pub log_size: Vector2<f64>,
}

impl LandmarkState {
    /// Width and height.
    pub fn size(&self) -> LandmarkSize {
        LandmarkSize { width_m: self.log_size.x.exp(), height_m: self.log_size.y.exp() }
    }

    /// Rotations about z, y and x: their product takes landmark axes to map axes.
    pub(super) fn turns(&self) -> [Matrix3<f64>; 3] {
        let about = |axis, angle| Rotation3::from_axis_angle(&axis, angle).into_inner();
        [
            about(Vector3::z_axis(), self.theta_rad),
            about(Vector3::y_axis(), self.tilt_rad),
            about(Vector3::x_axis(), self.roll_rad),
        ]
    }

    /// (x, y, theta, z, tilt, roll, log width, log height).
    pub fn parameters(&self) -> SVector<f64, 8> {
        let (c, s) = (&self.centre, &self.log_size);
        SVector::from([c.x, c.y, self.theta_rad, c.z, self.tilt_rad, self.roll_rad, s.x, s.y])
    }

    /// Parameters minus those of another landmark, theta wrapped.
    pub fn minus(&self, other: &Self) -> SVector<f64, 8> {
        let mut d = self.parameters() - other.parameters();
        d[2] = wrap_rad(d[2]);
        d
    }

    fn plus(&self, d: &[f64]) -> Self {
        let level = if self.tilt_rad > FRAC_PI_4 { FRAC_PI_2 } else { 0.0 };
        let side = |log: f64| log.clamp(LOG_SIDE[0], LOG_SIDE[1]);
        Self {
            centre: self.centre + Vector3::new(d[0], d[1], d[3]),
            theta_rad: wrap_rad(self.theta_rad + d[2]),
            tilt_rad: level + (self.tilt_rad + d[4] - level).clamp(-MAX_LEAN_RAD, MAX_LEAN_RAD),
            roll_rad: (self.roll_rad + d[5]).clamp(-MAX_LEAN_RAD, MAX_LEAN_RAD),
            log_size: Vector2::new(side(self.log_size.x + d[6]), side(self.log_size.y + d[7])),
        }
    }
}

/// Mounting and intrinsics of a camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CameraState {
    /// Camera coordinates to robot coordinates; metres.
    pub robot_from_camera: Isometry3<f64>,
    /// Focal length along x, px.
    pub focal_px: f64,
    /// Focal length along y over that along x; held.
    pub aspect: f64,
    /// Principal point, px.
    pub centre_px: Point2<f64>,
    /// Radial distortion of second order.
    pub k1: f64,
}

impl CameraState {
    fn plus(&self, d: &[f64]) -> Self {
        let (rotation, translation) = (Vector3::new(d[0], d[1], d[2]), Vector3::new(d[3], d[4], d[5]));
        Self {
            robot_from_camera: perturbed(&self.robot_from_camera, &rotation, &translation),
            focal_px: self.focal_px + d[6],
            centre_px: self.centre_px + Vector2::new(d[7], d[8]),
            k1: self.k1 + d[9],
            ..*self
        }
    }

    /// The step (rotation, translation, focal length, centre, k1) that leads here from another
    /// camera.
    pub fn minus(&self, other: &Self) -> SVector<f64, 10> {
        let (a, b) = (&self.robot_from_camera, &other.robot_from_camera);
        let turn = (a.rotation * b.rotation.inverse()).scaled_axis();
        let shift = a.translation.vector - b.translation.vector;
        let centre = self.centre_px - other.centre_px;
        let focal_px = self.focal_px - other.focal_px;
        let k1 = self.k1 - other.k1;
        let all = [turn.x, turn.y, turn.z, shift.x, shift.y, shift.z, focal_px, centre.x, centre.y, k1];
        SVector::from(all)
    }
}

/// Systematic errors of odometry in one drive.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct OdometryErrors {
    /// True length over measured length, minus 1.
    pub scale: f64,
    /// True minus measured turn, radians for each metre.
    pub drift_rad_per_m: f64,
}

/// Values of all variables.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct State {
    /// Keyframes.
    pub keyframes: Vec<Pose2>,
    /// Walls.
    pub walls: Vec<WallLine>,
    /// Landmarks.
    pub landmarks: Vec<LandmarkState>,
    /// Cameras.
    pub cameras: Vec<CameraState>,
    /// Odometry errors, by drive.
    pub odometry: Vec<OdometryErrors>,
    /// Heights of ceilings, metres.
    pub ceilings_m: Vec<f64>,
}

impl State {
    /// All variables, in the order of their kinds.
    pub fn variables(&self) -> impl Iterator<Item = Variable> {
        let keyframes = (0..self.keyframes.len()).map(Variable::Keyframe);
        let walls = (0..self.walls.len()).map(Variable::Wall);
        let landmarks = (0..self.landmarks.len()).map(Variable::Landmark);
        let cameras = (0..self.cameras.len()).map(Variable::Camera);
        let odometry = (0..self.odometry.len()).map(Variable::Odometry);
        let ceilings = (0..self.ceilings_m.len()).map(Variable::Ceiling);
        keyframes.chain(walls).chain(landmarks).chain(cameras).chain(odometry).chain(ceilings)
    }

    /// Whether a variable exists.
    pub(super) fn has(&self, variable: Variable) -> bool {
        match variable {
            Variable::Keyframe(i) => i < self.keyframes.len(),
            Variable::Wall(i) => i < self.walls.len(),
            Variable::Landmark(i) => i < self.landmarks.len(),
            Variable::Camera(i) => i < self.cameras.len(),
            Variable::Odometry(i) => i < self.odometry.len(),
            Variable::Ceiling(i) => i < self.ceilings_m.len(),
        }
    }

    /// Changes one variable by a step of its parameters.
    pub(super) fn step(&mut self, variable: Variable, d: &[f64]) {
        match variable {
            Variable::Keyframe(i) => {
                self.keyframes[i] = self.keyframes[i].plus(&Vector3::new(d[0], d[1], d[2]));
            }
            Variable::Wall(i) => {
                let wall = &mut self.walls[i];
                wall.facing_rad = wrap_rad(wall.facing_rad + d[0]);
                wall.offset_m += d[1];
            }
            Variable::Landmark(i) => self.landmarks[i] = self.landmarks[i].plus(d),
            Variable::Camera(i) => self.cameras[i] = self.cameras[i].plus(d),
            Variable::Odometry(i) => {
                self.odometry[i].scale += d[0];
                self.odometry[i].drift_rad_per_m += d[1];
            }
            Variable::Ceiling(i) => self.ceilings_m[i] += d[0],
        }
    }
}
