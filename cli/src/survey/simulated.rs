//! A simulated drive as a recording has it: scans of uneven walls, odometry, and frames with a
//! camera whose intrinsics and mounting are stated wrongly. Errors are as large as an estimate
//! believes them to be: only there can its covariance be evaluated.

use super::drive_log::DriveLog;
use crate::{pictures, simulated_errors::SimulatedRobotErrors};
use anyhow::Context as _;
use client::protos::convert::frame::{CheckedFrame, EncodedImage, Encoding, Pixels};
use engine::survey::{Drive, DriveFrame, ScanStamp};
use map::{extrinsics::CameraExtrinsics, fuse::FuseParams};
use nalgebra::{Isometry3, Vector3, Vector6};
use sim::{
    building::Building,
    drive::DriveParams,
    laser::LaserParams,
    odometry::OdometryParams,
    robot::{Robot, RobotParams, SensorReadings},
};
use std::sync::Arc;
use vision::{pose::reprojection::perturbed, random::Random};

/// Error of a mounting that was measured with a tape: each angle (radians) and coordinate (metres).
const MOUNTING: [f64; 2] = [0.6 * std::f64::consts::PI / 180.0, 0.01];

/// How far walls are off their lines, metres: so far lines of public laser logs spread about
/// theirs.
pub const UNEVEN_M: f64 = 0.01;

/// A drive, and what its robot did not know.
#[derive(Debug)]
pub struct SimulatedDrive {
    /// What it recorded; its map begins at the true first pose.
    pub log: DriveLog,
    /// True mounting of the first frame.
    pub mounting: Isometry3<f64>,
}

/// Errors of odometry, as large as an estimate believes of an unknown robot.
fn odometry(random: &mut Random) -> OdometryParams {
    let believed = FuseParams::default();
    OdometryParams {
        scale_error: believed.scale_sigma * random.normal(),
        heading_bias_rad_per_m: believed.turn_bias_sigma_rad_per_m * random.normal(),
        length_sigma_m: believed.along_m,
        heading_sigma_rad: believed.turn_rad,
        turn_sigma_rad: believed.turn_per_turn_rad,
    }
}

/// Drives through a building; `sensed` is told of every step.
pub fn simulated_drive(
    building: &Arc<Building>,
    drive: DriveParams,
    mut sensed: impl FnMut(&SensorReadings),
) -> anyhow::Result<SimulatedDrive> {
    let seed = drive.seed;
    let mut random = Random::new(seed ^ 2);
    let drive = DriveParams { odometry: odometry(&mut random), ..drive };
    let laser = LaserParams { uneven_m: UNEVEN_M, ..LaserParams::default() };
    let robot = Robot::new(building.clone(), &RobotParams { drive, laser, ..RobotParams::default() });
    let stated = SimulatedRobotErrors::drawn(robot.camera().intrinsics(), seed ^ 1).camera;
    let [turn, shift] = MOUNTING;
    let error = Vector6::new(turn, turn, turn, shift, shift, shift).map(|s| s * random.normal());
    let (turn, shift): (Vector3<f64>, Vector3<f64>) =
        (error.fixed_rows::<3>(0).into(), error.fixed_rows::<3>(3).into());
    let (mut drive, mut scans, mut first) = (Drive::default(), Vec::new(), None);
    for readings in robot {
        sensed(&readings);
        let step = &readings.step;
        first = first.or(Some((step.map_from_robot, step.robot_from_camera)));
        let captured_ns = (step.time_s * 1e9) as i64;
        let odom = step.odom_from_robot;
        let image = &readings.frame.image;
        let bytes = pictures::jpeg(image)?.into();
        let frame = CheckedFrame {
            epoch: 1,
            seq: step.index,
            captured_ns,
            width_px: image.width() as u32,
            height_px: image.height() as u32,
            pixels: Pixels::Image(EncodedImage { encoding: Encoding::Jpeg, bytes }),
            intrinsics: Some(stated),
            mounting: Some(CameraExtrinsics::new(perturbed(&step.robot_from_camera, &turn, &shift))?),
            odometry: Some(odom),
            prior: None,
            deadline_ms: None,
            map: None,
        };
        drive.frames.push(DriveFrame { odom, frame });
        drive.scans.push(ScanStamp { captured_ns, odom });
        scans.push(readings.scan);
    }
    let (origin, mounting) = first.context("a drive without a step")?;
    Ok(SimulatedDrive { log: DriveLog { origin: Some(origin), scans, drive }, mounting })
}

#[cfg(test)]
mod tests {
    use super::{super::surveyed, *};
    use engine::survey::SurveyedObject;
    use sim::{
        building::{LandmarkKind, LandmarkTruth},
        corridor::CorridorParams,
    };
    use vision::params::Params;

    #[test]
    fn doors_and_look_alikes_are_no_landmarks_and_posters_are() {
        let corridor = CorridorParams { posters: 4, ..CorridorParams::default() };
        let building = Arc::new(Building::corridor_with(&corridor, 22));
        let drive = DriveParams { seed: 3, legs: 2, rate_hz: 3.0, ..DriveParams::default() };
        let log = simulated_drive(&building, drive, |_| ()).unwrap().log;
        let found = surveyed(&log, &Params::default()).unwrap();
        let there = |object: &SurveyedObject| {
            let at = object.place.map_from_landmark().translation.vector;
            let off = |l: &LandmarkTruth| (l.map_from_landmark.translation.vector - at).norm();
            building.landmarks().iter().find(|l| off(l) < 0.3).map(|l| l.kind)
        };
        let accepted = found.objects.iter().filter(|object| object.refused.is_none());
        let kinds: Vec<_> = accepted.map(there).collect();
        assert!(kinds.iter().filter(|kind| **kind == Some(LandmarkKind::Poster)).count() >= 2, "{kinds:?}");
        assert!(!kinds.contains(&Some(LandmarkKind::Door)), "{kinds:?}");
        let why: Vec<_> = found.objects.iter().map(|object| (there(object), &object.refused)).collect();
        let because = |of: LandmarkKind, word: &str| {
            let those = why.iter().filter(|(kind, why)| {
                *kind == Some(of) && why.as_ref().is_some_and(|why| why.contains(word))
            });
            those.count()
        };
        assert!(because(LandmarkKind::Door, "stands on the floor") >= 2, "{why:?}");
        assert!(because(LandmarkKind::Window, "looks like it") >= 1, "{why:?}");
    }
}
