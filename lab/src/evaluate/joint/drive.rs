//! What a robot measures in a drive through the building: odometry, lines of scans, corners.

use super::building::{Building, OBJECTS};
use map::{
    joint::{CameraState, LandmarkState, Motion},
    pose2::{Pose2, wrap_rad},
};
use nalgebra::{
    Isometry3, Matrix2, Matrix3, Point2, Point3, Rotation2, SVector, Translation3, UnitQuaternion, Vector2,
    Vector3,
};
use std::f64::consts::PI;
use vision::{pose::reprojection::corner_points, random::Random};

const DEGREE: f64 = PI / 180.0;
/// Random error of odometry: share of a step along; rad/m and rad/rad across and in heading.
const ODOMETRY: [f64; 3] = [0.05, 0.02, 0.02];
/// Systematic error of odometry: standard deviations of scale and drift, rad/m.
pub(super) const SYSTEMATIC: [f64; 2] = [0.02, 0.005];
/// Laser: reach, error of a range, angle between beams; unevenness of walls.
const LASER_M: [f64; 2] = [8.0, 0.01];
const BEAM_RAD: f64 = 0.5 * DEGREE;
const ROUGH: [f64; 2] = [0.001, 0.002];
/// Error of a corner, px.
pub(super) const CORNER_PX: f64 = 0.5;
/// Errors of the camera as stated: rotation, translation, share of the focal length, centre, k1.
const MOUNTING: [f64; 2] = [DEGREE, 0.02];
const FOCAL: f64 = 0.005;
const CENTRE_PX: f64 = 3.0;
const K1: f64 = 0.01;
/// Image, px.
const IMAGE_PX: [f64; 2] = [1280.0, 960.0];

/// A line of a scan with the number of its section.
#[derive(Debug, Clone, Copy)]
pub(super) struct MeasuredLine {
    pub(super) keyframe: usize,
    pub(super) section: usize,
    pub(super) facing_rad: f64,
    pub(super) offset_m: f64,
    pub(super) covariance: Matrix2<f64>,
}

/// Corners with the number of their object.
#[derive(Debug, Clone, Copy)]
pub(super) struct MeasuredQuad {
    pub(super) keyframe: usize,
    pub(super) object: usize,
    pub(super) corners_px: [Point2<f64>; 4],
}

/// A drive.
#[derive(Debug, Clone)]
pub(super) struct SimulatedDrive {
    /// True keyframes.
    pub(super) truth: Vec<Pose2>,
    /// Way driven at each, metres.
    pub(super) way_m: Vec<f64>,
    pub(super) motions: Vec<Motion>,
    pub(super) lines: Vec<MeasuredLine>,
    pub(super) quads: Vec<MeasuredQuad>,
}

/// A camera as stated and as it is.
pub(super) struct SimulatedCamera {
    pub(super) stated: CameraState,
    /// Wrong in mounting and focal length.
    pub(super) truth: CameraState,
    /// Wrong in principal point and distortion besides.
    pub(super) bent: CameraState,
    /// Standard deviations where principal point and distortion are as stated, and where not.
    pub(super) sigmas: SVector<f64, 10>,
    pub(super) bent_sigmas: SVector<f64, 10>,
}

impl SimulatedCamera {
    pub(super) fn drawn(random: &mut Random) -> Self {
        let optical = Matrix3::new(0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0);
        let pitch = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), -5.0 * DEGREE);
        let rotation = pitch * UnitQuaternion::from_matrix(&optical);
        let stated = CameraState {
            robot_from_camera: Isometry3::from_parts(Translation3::new(0.15, 0.0, 1.15), rotation),
            focal_px: 700.0,
            aspect: 1.0,
            centre_px: Point2::new(640.0, 480.0),
            k1: -0.05,
        };
        let mut unit = || Vector3::from([(); 3].map(|()| random.normal())).normalize();
        let turn = UnitQuaternion::from_scaled_axis(unit() * MOUNTING[0]);
        let shift = unit() * MOUNTING[1];
        let sign = if random.unit() < 0.5 { -1.0 } else { 1.0 };
        let truth = CameraState {
            robot_from_camera: Isometry3::from_parts(
                (stated.robot_from_camera.translation.vector + shift).into(),
                turn * rotation,
            ),
            focal_px: stated.focal_px * (1.0 + sign * FOCAL),
            ..stated
        };
        let centre = Vector2::new(random.normal(), random.normal()) * CENTRE_PX;
        let bent =
            CameraState { centre_px: truth.centre_px + centre, k1: truth.k1 + K1 * random.normal(), ..truth };
        let [turn, shift] = MOUNTING.map(|most| most / 3.0_f64.sqrt());
        let with = |centre: f64, k1: f64| {
            let focal = FOCAL * stated.focal_px;
            SVector::from([turn, turn, turn, shift, shift, shift, focal, centre, centre, k1])
        };
        let (sigmas, bent_sigmas) = (with(1e-3, 1e-6), with(CENTRE_PX, K1));
        Self { stated, truth, bent, sigmas, bent_sigmas }
    }
}

impl SimulatedDrive {
    pub(super) fn drawn(
        building: &Building,
        camera: &CameraState,
        way_m: (f64, f64),
        back: bool,
        random: &mut Random,
    ) -> Self {
        let (truth, way_m) = building.path(way_m, back, random);
        let motions = motions(&truth, random);
        let lines = lines(building, &truth, random);
        let quads = quads(building, &truth, camera, random);
        Self { truth, way_m, motions, lines, quads }
    }
}

fn motions(truth: &[Pose2], random: &mut Random) -> Vec<Motion> {
    let (scale, drift) = (SYSTEMATIC[0] * random.normal(), SYSTEMATIC[1] * random.normal());
    let motion = |pair: &[Pose2]| {
        let exact = pair[0].between(&pair[1]);
        let (step, turn) = (exact.position().norm(), exact.theta_rad.abs());
        let [along, across, heading] = ODOMETRY;
        let sigmas = [along * step + 1e-3, across * step + 1e-3, heading * (step + turn) + 1e-3];
        let measured = exact.position() / (1.0 + scale);
        let noise = Vector3::from(sigmas.map(|s| s * random.normal()));
        let motion =
            Pose2::new(measured.x, measured.y, exact.theta_rad - drift * measured.norm()).plus(&noise);
        Motion { motion, covariance: Matrix3::from_diagonal(&Vector3::from(sigmas.map(|s| s * s))) }
    };
    truth.windows(2).map(motion).collect()
}

fn lines(building: &Building, truth: &[Pose2], random: &mut Random) -> Vec<MeasuredLine> {
    let mut lines = Vec::new();
    for (section, wall) in building.sections.iter().enumerate() {
        let (n, d, line) = (wall.normal(), wall.direction(), wall.line());
        let points = (0..).map(|i| 0.05 + 0.15 * f64::from(i)).take_while(|u| *u < (wall.b - wall.a).norm());
        let points: Vec<f64> = points.collect();
        for (keyframe, x) in truth.iter().enumerate() {
            let robot = Point2::from(x.position());
            let seen = |u: &&f64| {
                let p = wall.a + d * **u;
                let ray = p - robot;
                let far = ray.norm();
                far < LASER_M[0] && -ray.dot(&n) / far > 0.12 && !building.hidden(&robot, &(p + n * 0.01))
            };
            let seen: Vec<f64> = points.iter().filter(seen).copied().collect();
            let (Some(first), Some(last)) = (seen.first(), seen.last()) else { continue };
            let bearing = |u: f64| {
                let ray = wall.a + d * u - robot;
                ray.y.atan2(ray.x)
            };
            // Of a straight wall the bearings are monotonic, within half a turn.
            let beams = wrap_rad(bearing(*last) - bearing(*first)).abs() / BEAM_RAD;
            let span = last - first;
            if seen.len() <= 3 || beams < 6.0 || span < 0.5 {
                continue;
            }
            let error = LASER_M[1] / beams.sqrt();
            let sigmas = [(error / (span / 12.0_f64.sqrt())).hypot(ROUGH[0]), error.hypot(ROUGH[1])];
            let mean = seen.iter().sum::<f64>() / seen.len() as f64;
            let middle = Rotation2::new(-x.theta_rad) * (wall.a + d * mean - robot);
            let at = line.facing_rad - x.theta_rad;
            let unit = |angle: f64| Vector2::new(angle.cos(), angle.sin());
            let (turn, off) = (sigmas[0] * random.normal(), sigmas[1] * random.normal());
            let along = unit(at + PI / 2.0).dot(&middle);
            let [va, vo] = sigmas.map(|s| s * s);
            lines.push(MeasuredLine {
                keyframe,
                section,
                facing_rad: wrap_rad(at) + turn,
                offset_m: unit(at + turn).dot(&(middle + unit(at) * off)),
                covariance: Matrix2::new(va, along * va, along * va, along * along * va + vo),
            });
        }
    }
    lines
}

fn quads(
    building: &Building,
    truth: &[Pose2],
    camera: &CameraState,
    random: &mut Random,
) -> Vec<MeasuredQuad> {
    let mut quads = Vec::new();
    for (keyframe, x) in truth.iter().enumerate() {
        for (object, landmark) in building.objects.iter().enumerate().take(OBJECTS) {
            let robot = Point2::from(x.position());
            let d = landmark.centre.xy() - robot.coords;
            let facing = Vector2::new(landmark.theta_rad.cos(), landmark.theta_rad.sin());
            let ahead = (d.y.atan2(d.x) - x.theta_rad).cos();
            let near = d.norm() < 6.0 && -d.dot(&facing) / d.norm() > (73.0 * DEGREE).cos() && ahead > 0.3;
            let corners = near.then(|| projected(x, landmark, camera)).flatten();
            let Some(corners) = corners.filter(is_large_and_inside) else { continue };
            let before = Point2::from(landmark.centre.xy() + facing * 0.05);
            if random.unit() < 0.85 && !building.hidden(&robot, &before) {
                let noise = |p: Point2<f64>| p + Vector2::new(random.normal(), random.normal()) * CORNER_PX;
                quads.push(MeasuredQuad { keyframe, object, corners_px: corners.map(noise) });
            }
        }
    }
    quads
}

fn is_large_and_inside(corners: &[Point2<f64>; 4]) -> bool {
    let side = |i: usize| (corners[i] - corners[(i + 1) % 4]).norm();
    let inside = |v: f64, size: f64| v > 10.0 && v < size - 10.0;
    (0..4).all(|i| side(i) > 18.0)
        && corners.iter().all(|p| inside(p.x, IMAGE_PX[0]) && inside(p.y, IMAGE_PX[1]))
}

/// True pixels of an object's corners; `None` behind the camera.
fn projected(x: &Pose2, landmark: &LandmarkState, camera: &CameraState) -> Option<[Point2<f64>; 4]> {
    let about = |axis, angle| UnitQuaternion::from_axis_angle(&axis, angle);
    let turn = about(Vector3::z_axis(), landmark.theta_rad)
        * about(Vector3::y_axis(), landmark.tilt_rad)
        * about(Vector3::x_axis(), landmark.roll_rad);
    let map_from_landmark = Isometry3::from_parts(landmark.centre.into(), turn);
    let camera_from_landmark = (x.to_isometry3() * camera.robot_from_camera).inverse() * map_from_landmark;
    let corners = corner_points(&landmark.size()).map(|local| {
        let p = camera_from_landmark * Point3::from(local);
        (p.z > 0.1).then(|| {
            let a = Vector2::new(p.x / p.z, p.y / p.z);
            camera.centre_px + a * camera.focal_px * (1.0 + camera.k1 * a.norm_squared())
        })
    });
    let [a, b, c, d] = corners;
    Some([a?, b?, c?, d?])
}
