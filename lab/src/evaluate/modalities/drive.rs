//! A drive along the way: where the robot is, what odometry, camera and laser measure, and what fusing it gives.

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
/// Standard deviations of what one robot's odometry always gets wrong: scale, turn per metre.
const LASTING: [f64; 2] = [0.015, 0.004];
/// What the hall's floor does to odometry, a metre: measured too long, and pushed aside towards -y.
const FLOOR: [f64; 2] = [0.06, 0.03];

/// What is measured at one moment.
struct Step {
    at_ns: i64,
    truth: Pose2,
    odometry: Pose2,
    scan: Scan,
    /// Posters in the picture, by number.
    seen: Vec<(usize, LandmarkPose)>,
}

/// A drive with everything that is measured on it.
pub(super) struct Drive {
    steps: Vec<Step>,
    mounting: CameraExtrinsics,
    seed: u64,
}

/// Where the robot was, and how far off it was thought to be.
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
    /// All that fixes said, by time.
    pub(super) fixes: Vec<(i64, Fix)>,
}

fn camera() -> Intrinsics {
    Intrinsics::new(500.0, 500.0, 320.0, 240.0, Distortion::None).expect("in range")
}

/// Two cameras, half to the left and half to the right.
fn mounting(pan: f64) -> Isometry3<f64> {
    pan_tilt(pan, 0.0, Vector3::new(0.1, 0.0, 1.3))
}

impl Drive {
    /// Draws a drive; `back` from the far end.
    pub(super) fn new(world: &World, seed: u64, back: bool) -> Self {
        let mut random = Random::new(seed);
        let lasting = LASTING.map(|s| s * random.normal());
        let hung: Vec<LandmarkPlace> = world.posters.iter().map(|place| drawn(place, &mut random)).collect();
        let laser = LaserParams::default();
        let count = (LENGTH_M / STEP_M) as usize;
        let (mut steps, mut odometry): (Vec<Step>, Pose2) = (Vec::with_capacity(count), Pose2::default());
        for i in 0..=count {
            let truth = way(i as f64 * STEP_M, back);
            if let Some(before) = steps.last() {
                odometry = odometry.compose(&measured(&before.truth, &truth, lasting, &mut random));
            }
            steps.push(Step {
                at_ns: i as i64 * STEP_NS,
                truth,
                odometry,
                scan: scan_among(&world.walls, &truth, &laser, seed.wrapping_add(i as u64)),
                seen: looked(&truth, world, &hung, &mut random),
            });
        }
        Self { steps, mounting: CameraExtrinsics::new(mounting(0.0)).expect("in range"), seed }
    }

    /// `odom_from_robot` by time.
    pub(super) fn odometry(&self) -> Vec<(i64, Pose2)> {
        self.steps.iter().map(|step| (step.at_ns, step.odometry)).collect()
    }

    /// The path as somebody who measures it tells it.
    pub(super) fn told(&self, [sigma_m, sigma_rad]: [f64; 2]) -> Vec<(i64, Pose2)> {
        let mut random = Random::new(!self.seed);
        let mut noisy = |truth: &Pose2| {
            let e = Vector3::new(random.normal(), random.normal(), random.normal());
            truth.plus(&e.component_mul(&Vector3::new(sigma_m, sigma_m, sigma_rad)))
        };
        self.steps.iter().map(|step| (step.at_ns, noisy(&step.truth))).collect()
    }
}

/// Where the robot is after some way.
fn way(way_m: f64, back: bool) -> Pose2 {
    let x = START_M + if back { LENGTH_M - way_m } else { way_m };
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
    // It slides towards -y and odometry does not see it: measured, the robot is further towards +y than it is.
    let aside = from.theta_rad.cos().signum() * aside * length_m;
    let lasting = Vector3::new((scale + long) * length_m, aside, turn * length_m);
    motion.plus(&(noise + lasting))
}

/// A poster as it really hangs.
fn drawn(place: &LandmarkPlace, random: &mut Random) -> LandmarkPlace {
    let e = place.covariance.map_diagonal(f64::sqrt).map(|s| s * random.normal());
    LandmarkPlace { x_m: place.x_m + e[0], y_m: place.y_m + e[1], z_m: place.z_m + e[3], ..*place }
}

/// The posters ahead, in the camera that is turned to their wall.
fn looked(
    truth: &Pose2,
    world: &World,
    hung: &[LandmarkPlace],
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
        let seen =
            landmark_pose(&Corners::new(points).ok()?, &claimed, world.posters[number].size, &camera).ok()?;
        Some((number, seen))
    };
    hung.iter().enumerate().filter_map(one).collect()
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
        let mut found: Vec<Fix> = Vec::new();
        if let Some(prior) = fuser.pose_at(step.at_ns) {
            let laid = laser_fix(&world.index, &step.scan, &prior, &LaserFixParams::default());
            found.extend(laid.ok().and_then(Result::ok).map(|laid| laid.fix()));
        }
        found.extend(
            step.seen
                .iter()
                .filter_map(|seen| by_poster(world, drive, step, seen, fuser.pose_at(step.at_ns))),
        );
        for fix in found {
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
    (number, seen): &(usize, LandmarkPose),
    prior: Option<Pose2Covariance>,
) -> Option<Fix> {
    let place = &world.posters[*number];
    let side = step.truth.inverse().apply(&Point2::new(place.x_m, place.y_m)).y;
    let mounting =
        CameraExtrinsics { robot_from_camera: mounting(pan_to(side)), covariance: drive.mounting.covariance };
    let sighting = LandmarkObservation { landmark: LandmarkId(*number as u64), seen, place };
    let ask = |prior: Option<&Pose2Covariance>| {
        robot_pose(&[sighting], &mounting, prior, &LocaliseParams::default())
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
