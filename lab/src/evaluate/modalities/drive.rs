//! A simulated drive: true poses, measurements of odometry, camera and laser, and the fused pose.

use super::world::World;
use map::{
    extrinsics::{CameraExtrinsics, pan_tilt},
    fuse::{FuseParams, Fuser},
    laser::Scan,
    laser_fix::{LaserFixParams, laser_fix},
    localise::{Fix, FixResult, LandmarkObservation, LocaliseParams, robot_pose},
    modality_stats::ModalityMap,
    place::LandmarkPlace,
    pose2::{Pose2, Pose2Covariance},
};
use nalgebra::{Isometry3, Matrix2, Point2, Vector2, Vector3};
use sim::laser::{LaserParams, scan_among};
use std::{f64::consts::PI, sync::Arc};
use vision::{
    frame::{Distortion, Intrinsics},
    geometry::Corners,
    model::LandmarkId,
    pose::{
        LandmarkPose, landmark_pose,
        reprojection::{corner_points, pixel},
    },
    random::Random,
};

const STEP_M: f64 = 0.1;
const STEP_NS: i64 = 200_000_000;
const LENGTH_M: f64 = 52.0;
const START_M: f64 = 1.5;
const WEAVE_M: f64 = 0.15;
const CORNER_SIGMA_PX: f64 = 0.5;
/// Standard deviations of a robot's systematic odometry error: scale (share), drift (rad/m).
const SYSTEMATIC: [f64; 2] = [0.015, 0.004];
/// Error of odometry per metre on the hall's floor: too long, and a slip towards -y.
const FLOOR: [f64; 2] = [0.06, 0.03];

/// Measurements at one time.
struct Step {
    at_ns: i64,
    truth: Pose2,
    odometry: Pose2,
    scan: Scan,
    /// Observed posters: number, pose in the camera frame.
    observed: Vec<(usize, LandmarkPose)>,
}

/// A drive with all its measurements.
pub(super) struct Drive {
    steps: Vec<Step>,
    mounting: CameraExtrinsics,
    seed: u64,
}

/// Error of the fused pose at one place.
pub(super) struct Moment {
    pub(super) zone: &'static str,
    pub(super) x_m: f64,
    pub(super) error_m: f64,
    pub(super) nees: f64,
}

/// A drive, fused.
pub(super) struct Driven {
    /// From the first fix on.
    pub(super) moments: Vec<Moment>,
    /// All fixes, by time.
    pub(super) fixes: Vec<(i64, Fix)>,
}

fn camera() -> Intrinsics {
    Intrinsics::new(500.0, 500.0, 320.0, 240.0, Distortion::None).expect("in range")
}

/// `robot_from_camera` of a camera with this pan: one of two looks half left, one half right.
fn mounting(pan: f64) -> Isometry3<f64> {
    pan_tilt(pan, 0.0, Vector3::new(0.1, 0.0, 1.3))
}

impl Drive {
    /// Draws a drive; `back` from the far end.
    pub(super) fn new(world: &World, seed: u64, back: bool) -> Self {
        let mut random = Random::new(seed);
        let systematic = SYSTEMATIC.map(|s| s * random.normal());
        let true_places: Vec<LandmarkPlace> =
            world.posters.iter().map(|place| drawn(place, &mut random)).collect();
        let laser = LaserParams::default();
        let count = (LENGTH_M / STEP_M) as usize;
        let (mut steps, mut odometry): (Vec<Step>, Pose2) = (Vec::with_capacity(count), Pose2::default());
        for i in 0..=count {
            let truth = way(i as f64 * STEP_M, back);
            if let Some(before) = steps.last() {
                odometry = odometry.compose(&measured(&before.truth, &truth, systematic, &mut random));
            }
            steps.push(Step {
                at_ns: i as i64 * STEP_NS,
                truth,
                odometry,
                scan: scan_among(&world.walls, &truth, &laser, seed.wrapping_add(i as u64)),
                observed: observations(&truth, world, &true_places, &mut random),
            });
        }
        Self { steps, mounting: CameraExtrinsics::new(mounting(0.0)).expect("in range"), seed }
    }

    /// `odom_from_robot` by time.
    pub(super) fn odometry(&self) -> Vec<(i64, Pose2)> {
        self.steps.iter().map(|step| (step.at_ns, step.odometry)).collect()
    }

    /// The path as a reference trajectory with noise.
    pub(super) fn reference(&self, [sigma_m, sigma_rad]: [f64; 2]) -> Vec<(i64, Pose2)> {
        let mut random = Random::new(!self.seed);
        let mut noisy = |truth: &Pose2| {
            let e = Vector3::new(random.normal(), random.normal(), random.normal());
            truth.plus(&e.component_mul(&Vector3::new(sigma_m, sigma_m, sigma_rad)))
        };
        self.steps.iter().map(|step| (step.at_ns, noisy(&step.truth))).collect()
    }
}

/// True pose after `distance_m`; with `back`, of a drive from the far end.
fn way(distance_m: f64, back: bool) -> Pose2 {
    let x = START_M + if back { LENGTH_M - distance_m } else { distance_m };
    let phase = x * 2.0 * PI / 9.0;
    let slope = WEAVE_M * phase.cos() * 2.0 * PI / 9.0;
    Pose2::new(x, WEAVE_M * phase.sin(), slope.atan() + if back { PI } else { 0.0 })
}

/// A motion as odometry measures it.
fn measured(from: &Pose2, to: &Pose2, [scale, turn]: [f64; 2], random: &mut Random) -> Pose2 {
    let p = FuseParams::default();
    let motion = from.between(to);
    let noise = p.motion_noise(&motion).map_diagonal(f64::sqrt).map(|s| 0.7 * s * random.normal());
    let length_m = motion.position().norm();
    let hall = World::zone(from.x_m).name == "hall";
    let [long, aside] = if hall { FLOOR } else { [0.0; 2] };
    // The slip towards -y is not measured: by odometry the robot is further towards +y than it is.
    let aside = from.theta_rad.cos().signum() * aside * length_m;
    let systematic = Vector3::new((scale + long) * length_m, aside, turn * length_m);
    motion.plus(&(noise + systematic))
}

/// The true place of a poster, drawn from its covariance.
fn drawn(place: &LandmarkPlace, random: &mut Random) -> LandmarkPlace {
    let e = place.covariance.map_diagonal(f64::sqrt).map(|s| s * random.normal());
    LandmarkPlace { x_m: place.x_m + e[0], y_m: place.y_m + e[1], z_m: place.z_m + e[3], ..*place }
}

/// Observations of the posters ahead, by the camera that is turned to their wall.
fn observations(
    truth: &Pose2,
    world: &World,
    true_places: &[LandmarkPlace],
    random: &mut Random,
) -> Vec<(usize, LandmarkPose)> {
    let camera = camera();
    let one = |(number, place): (usize, &LandmarkPlace)| {
        let at = truth.inverse().apply(&Point2::new(place.x_m, place.y_m));
        if !(0.5..4.5).contains(&at.x) {
            return None;
        }
        let map_from_camera = truth.to_isometry3() * mounting(pan_to(at.y));
        let view = map_from_camera.inverse() * place.map_from_landmark();
        let mut points = [Point2::origin(); 4];
        for (px, corner) in points.iter_mut().zip(corner_points(&place.size)) {
            let noise = Vector2::new(random.normal(), random.normal()) * CORNER_SIGMA_PX;
            *px = pixel(&view, &corner, &camera)? + noise;
            if !(1.0..639.0).contains(&px.x) || !(1.0..479.0).contains(&px.y) {
                return None;
            }
        }
        let claimed = [Matrix2::identity() * CORNER_SIGMA_PX * CORNER_SIGMA_PX; 4];
        let observed =
            landmark_pose(&Corners::new(points).ok()?, &claimed, world.posters[number].size, &camera).ok()?;
        Some((number, observed))
    };
    true_places.iter().enumerate().filter_map(one).collect()
}

/// The pan of the camera that looks to the side of a poster.
fn pan_to(y_m: f64) -> f64 {
    if y_m > 0.0 { 0.6 } else { -0.6 }
}

/// Fuses a drive as the server does, from its first fix on.
pub(super) fn follow(world: &World, drive: &Drive, areas: &Arc<ModalityMap>) -> Driven {
    let mut fuser = Fuser::new(FuseParams::default());
    fuser.set_modality_map(areas.clone());
    let mut driven = Driven { moments: Vec::new(), fixes: Vec::new() };
    for step in &drive.steps {
        fuser.apply_odometry(step.at_ns, step.odometry).ok();
        let mut fixes: Vec<Fix> = Vec::new();
        if let Some(prior) = fuser.pose_at(step.at_ns) {
            let result = laser_fix(&world.index, &step.scan, &prior, &LaserFixParams::default());
            fixes.extend(result.ok().and_then(Result::ok).map(|aligned| aligned.fix()));
        }
        fixes.extend(
            step.observed
                .iter()
                .filter_map(|observed| by_poster(world, drive, step, observed, fuser.pose_at(step.at_ns))),
        );
        for fix in fixes {
            let outcome = fuser.apply_fix(step.at_ns, &fix);
            if !matches!(outcome, Ok(map::fuse::FixOutcome::Repeated)) {
                driven.fixes.push((step.at_ns, fix));
            }
        }
        let Some(fused) = fuser.pose() else { continue };
        let e = fused.pose.pose.minus(&step.truth);
        let nees = fused.pose.covariance.cholesky().map_or(0.0, |c| e.dot(&c.solve(&e)));
        driven.moments.push(Moment {
            zone: World::zone(step.truth.x_m).name,
            x_m: step.truth.x_m,
            error_m: e.xy().norm(),
            nees,
        });
    }
    driven
}

fn by_poster(
    world: &World,
    drive: &Drive,
    step: &Step,
    (number, observed): &(usize, LandmarkPose),
    prior: Option<Pose2Covariance>,
) -> Option<Fix> {
    let place = &world.posters[*number];
    let side = step.truth.inverse().apply(&Point2::new(place.x_m, place.y_m)).y;
    let mounting =
        CameraExtrinsics { robot_from_camera: mounting(pan_to(side)), covariance: drive.mounting.covariance };
    let observation = LandmarkObservation { landmark: LandmarkId(*number as u64), seen: observed, place };
    let ask = |prior: Option<&Pose2Covariance>| {
        robot_pose(&[observation], &mounting, prior, &LocaliseParams::default())
    };
    let fix = match ask(None).ok()? {
        FixResult::Ambiguous(_) => ask(prior.as_ref()).ok()?,
        fix => fix,
    };
    match fix {
        FixResult::Fixed(fix) => Some(*fix),
        _ => None,
    }
}
