//! The robot's pose on the floor from one, two or three landmarks at once, and fused over drives
//! (method 13.6, 15).

use super::{
    single::{Cost, cost_of},
    stated_camera::{Cameras, StatedCamera},
};
use map::{
    extrinsics::{CameraExtrinsics, pan_tilt},
    fuse::{FuseParams, Fuser},
    localise::{FixResult, LandmarkObservation, LocaliseParams, robot_pose},
    place::{LandmarkPlace, PlaceSigmas},
    pose2::Pose2,
};
use nalgebra::{Matrix6, Vector3, Vector6};
use serde::Serialize;
use std::{f64::consts::FRAC_PI_2, time::Instant};
use vision::{
    frame::{Distortion, Intrinsics},
    model::LandmarkId,
    pose::{LandmarkPose, LandmarkSize, reprojection::perturbed},
    random::Random,
};

const SIZE: LandmarkSize = LandmarkSize { width_m: 0.6, height_m: 0.84 };
const CAMERA: Intrinsics = Intrinsics {
    fx_px: 500.0,
    fy_px: 500.0,
    cx_px: 320.0,
    cy_px: 240.0,
    distortion: Distortion::None,
    sigmas: None,
};
const SIGMA_PX: f64 = 0.5;

/// Fixes from `landmarks` posters in one frame.
#[derive(Debug, Clone, Serialize)]
pub(super) struct Joint {
    pub(super) cameras: Cameras,
    pub(super) landmarks: usize,
    pub(super) frames: usize,
    /// Frames with one pose; the others were reported as ambiguous.
    pub(super) fixed: usize,
    /// Of the fixes: root mean square error of the position (m) and of the heading (degrees).
    pub(super) rms_m: f64,
    pub(super) rms_deg: f64,
    /// Mean squared Mahalanobis distance, 3 degrees of freedom.
    pub(super) nees: f64,
    pub(super) inside_99: bool,
    pub(super) cost: Cost,
}

/// A true place, drawn from the covariance of the map's.
pub(crate) fn drawn(place: &LandmarkPlace, random: &mut Random) -> LandmarkPlace {
    let e: Vector6<f64> = place.covariance.map_diagonal(f64::sqrt).map(|s| s * random.normal());
    let size = LandmarkSize { width_m: place.size.width_m + e[4], height_m: place.size.height_m + e[5] };
    let (x_m, y_m, z_m) = (place.x_m + e[0], place.y_m + e[1], place.z_m + e[3]);
    LandmarkPlace { x_m, y_m, z_m, theta_rad: place.theta_rad + e[2], size, ..*place }
}

/// True extrinsics: the stated ones moved by an error.
pub(crate) fn with_error(believed: &CameraExtrinsics, error: &Vector6<f64>) -> CameraExtrinsics {
    let (turn, shift) = (error.fixed_rows::<3>(0).into(), error.fixed_rows::<3>(3).into());
    CameraExtrinsics {
        robot_from_camera: perturbed(&believed.robot_from_camera, &turn, &shift),
        covariance: believed.covariance,
    }
}

pub(crate) fn mounting_error(covariance: &Matrix6<f64>, random: &mut Random) -> Vector6<f64> {
    covariance.map_diagonal(f64::sqrt).map(|s| s * random.normal())
}

fn observe(
    robot: &Pose2,
    true_place: &LandmarkPlace,
    (real, camera): (&CameraExtrinsics, &StatedCamera),
    random: &mut Random,
) -> Option<LandmarkPose> {
    let view =
        real.robot_from_camera.inverse() * robot.to_isometry3().inverse() * true_place.map_from_landmark();
    camera.observe(&view, (true_place.size, SIZE), SIGMA_PX, random)
}

fn mean_nees(fix: &map::pose2::Pose2Covariance, truth: &Pose2) -> f64 {
    let e = fix.pose.minus(truth);
    fix.covariance.cholesky().map_or(f64::INFINITY, |c| e.dot(&c.solve(&e)))
}

/// Fixes by posters beside one another on a wall, from 3 to 5 m.
pub(super) fn joint(landmarks: usize, frames: usize, cameras: Cameras, seed: u64) -> Joint {
    let mut random = Random::new(seed);
    let places: Vec<LandmarkPlace> = (0..landmarks)
        .filter_map(|i| {
            let centre = Vector3::new((i as f64 - 0.5 * (landmarks as f64 - 1.0)) * 1.1, 0.0, 1.5);
            LandmarkPlace::by_hand(centre, FRAC_PI_2, SIZE, PlaceSigmas::default()).ok()
        })
        .collect();
    let (mut sum, mut squares, mut turns, mut fixed, mut times) = (0.0, 0.0, 0.0, 0_usize, vec![]);
    let mut tried = 0;
    while tried < frames {
        let (d, psi) = (random.range(3.0, 5.0), random.range(-0.9, 0.9));
        let truth = Pose2::new(d * f64::sin(psi), d * f64::cos(psi), -FRAC_PI_2 - psi);
        let Ok(believed) = CameraExtrinsics::new(pan_tilt(0.0, 0.0, Vector3::new(0.1, 0.0, 1.3))) else {
            break;
        };
        let real = with_error(&believed, &mounting_error(&believed.covariance, &mut random));
        let true_places: Vec<LandmarkPlace> = places.iter().map(|p| drawn(p, &mut random)).collect();
        let camera = StatedCamera::drawn(&CAMERA, cameras, &mut random);
        let observed: Option<Vec<LandmarkPose>> =
            true_places.iter().map(|h| observe(&truth, h, (&real, &camera), &mut random)).collect();
        let Some(observed) = observed else { continue };
        tried += 1;
        let observations: Vec<LandmarkObservation<'_>> = observed
            .iter()
            .zip(&places)
            .enumerate()
            .map(|(i, (seen, place))| LandmarkObservation { landmark: LandmarkId(i as u64), seen, place })
            .collect();
        let started = Instant::now();
        let answer = robot_pose(&observations, &believed, None, &LocaliseParams::default());
        times.push(started.elapsed().as_secs_f64() * 1e6);
        if let Ok(FixResult::Fixed(fix)) = answer {
            let e = fix.pose.pose.minus(&truth);
            fixed += 1;
            sum += mean_nees(&fix.pose, &truth);
            squares += e.x * e.x + e.y * e.y;
            turns += e.z * e.z;
        }
    }
    let n = fixed.max(1) as f64;
    Joint {
        cameras,
        landmarks,
        frames: tried,
        fixed,
        rms_m: (squares / n).sqrt(),
        rms_deg: (turns / n).sqrt().to_degrees(),
        nees: sum / n,
        inside_99: (sum / n - 3.0).abs() <= 2.576 * (6.0 / n).sqrt(),
        cost: cost_of(times),
    }
}

/// Drives through a corridor; all that is uncertain is drawn anew for each.
#[derive(Debug, Clone, Serialize)]
pub(super) struct Drives {
    pub(super) cameras: Cameras,
    pub(super) count: usize,
    /// Of the pose at the end of each drive, 3 degrees of freedom.
    pub(super) nees: f64,
    pub(super) inside_95: bool,
    pub(super) inside_99: bool,
    /// Along the corridor after the first fix.
    pub(super) rms_along_m: f64,
    pub(super) corrections: u64,
}

pub(super) fn drives(count: usize, cameras: Cameras, seed: u64) -> Drives {
    let mut random = Random::new(seed);
    let (mut nees, mut squares, mut n, mut corrections) = (0.0, 0.0, 0.0, 0);
    for _ in 0..count {
        let drive = drive(cameras, &mut random);
        nees += drive.nees;
        squares += drive.squares;
        n += drive.steps;
        corrections += drive.corrections;
    }
    let mean = nees / count.max(1) as f64;
    // Variance of chi2 with 3 degrees of freedom is 6.
    let inside = |z: f64| (mean - 3.0).abs() <= z * (6.0 / count.max(1) as f64).sqrt();
    Drives {
        cameras,
        count,
        nees: mean,
        inside_95: inside(1.960),
        inside_99: inside(2.576),
        rms_along_m: (squares / f64::max(n, 1.0)).sqrt(),
        corrections,
    }
}

struct Drive {
    nees: f64,
    squares: f64,
    steps: f64,
    corrections: u64,
}

/// 25 m; four posters, alternately left and right, observed from 1 to 4 m ahead.
fn drive(cameras: Cameras, random: &mut Random) -> Drive {
    let mut made = Drive { nees: f64::INFINITY, squares: 0.0, steps: 0.0, corrections: 0 };
    let places: Vec<LandmarkPlace> = (0..4)
        .filter_map(|i| {
            let (y, theta) = if i % 2 == 0 { (1.2, -FRAC_PI_2) } else { (-1.2, FRAC_PI_2) };
            let centre = Vector3::new(4.0 + 6.0 * f64::from(i), y, 1.5);
            LandmarkPlace::by_hand(centre, theta, SIZE, PlaceSigmas::default()).ok()
        })
        .collect();
    let true_places: Vec<LandmarkPlace> = places.iter().map(|p| drawn(p, random)).collect();
    let mounted = |pan| CameraExtrinsics::new(pan_tilt(pan, 0.0, Vector3::new(0.1, 0.0, 1.3)));
    let Ok(base) = mounted(0.0) else { return made };
    let error = mounting_error(&base.covariance, random);
    let camera = StatedCamera::drawn(&CAMERA, cameras, random);
    let params = FuseParams::default();
    let mut fuser = Fuser::new(params.clone());
    let (mut truth, mut odom) = (Pose2::new(1.0, 0.1, 0.0), Pose2::default());
    for i in 0..230_i64 {
        let motion = Pose2::new(0.1, 0.0, 0.0);
        let noise = params.motion_noise(&motion).map_diagonal(f64::sqrt);
        let slip = noise.map(|s| s * random.normal());
        (truth, odom) = (truth.compose(&motion.plus(&slip)), odom.compose(&motion));
        // The robot keeps to the middle: the commanded turn is measured, with noise.
        let steer = Pose2::new(0.0, 0.0, -0.1 * truth.y_m - 0.3 * truth.theta_rad);
        (truth, odom) = (truth.compose(&steer), odom.compose(&steer));
        let at = i * 200_000_000;
        if fuser.apply_odometry(at, odom).is_err() {
            return made;
        }
        let ahead = (0..4).find(|&l: &usize| (1.0..4.0).contains(&(places[l].x_m - truth.x_m)));
        if let Some(l) = ahead.filter(|_| i % 3 == 0) {
            let Ok(believed) = mounted(if places[l].y_m > 0.0 { 0.6 } else { -0.6 }) else { return made };
            let real = with_error(&believed, &error);
            if let Some(observed) = observe(&truth, &true_places[l], (&real, &camera), random) {
                let observation = LandmarkObservation {
                    landmark: LandmarkId(l as u64),
                    seen: &observed,
                    place: &places[l],
                };
                let prior = fuser.pose_at(at);
                let answer =
                    robot_pose(&[observation], &believed, prior.as_ref(), &LocaliseParams::default());
                if let Ok(FixResult::Fixed(fix)) = answer {
                    // The outcome is ignored; it shows in the pose.
                    if fuser.apply_fix(at, &fix).is_err() {
                        return made;
                    }
                }
            }
        }
        if let Some(fused) = fuser.pose() {
            made.squares += (fused.pose.pose.x_m - truth.x_m).powi(2);
            made.steps += 1.0;
        }
    }
    if let Some(fused) = fuser.pose() {
        made.nees = mean_nees(&fused.pose, &truth);
        made.corrections = fused.corrections;
    }
    made
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn covariances_of_fixes_and_of_drives_are_consistent() {
        let [one, three] = [1, 3].map(|n| joint(n, 120, Cameras::Exact, 5));
        assert!(three.rms_m < one.rms_m && three.fixed > 100, "{one:?} {three:?}");
        assert!((1.5..4.2).contains(&three.nees), "{three:?}");
        let driven = drives(20, Cameras::Exact, 2);
        assert!((1.4..4.6).contains(&driven.nees) && driven.rms_along_m < 0.2, "{driven:?}");
    }

    #[test]
    fn stated_sigmas_of_intrinsics_keep_covariances_consistent() {
        let of = |cameras| joint(3, 150, cameras, 6).nees;
        let (stated, unstated) = (of(Cameras::WithSigmas), of(Cameras::WithoutSigmas));
        assert!((2.2..3.9).contains(&stated) && unstated > 1.3 * stated, "{stated} {unstated}");
    }
}
