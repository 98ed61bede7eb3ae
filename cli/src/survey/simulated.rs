//! A simulated drive as a recording has it: scans, odometry, and frames with a camera whose
//! intrinsics and mounting are stated wrongly.

use super::drive_log::DriveLog;
use crate::{pictures, simulated_errors::SimulatedRobotErrors};
use anyhow::Context as _;
use client::protos::convert::frame::{CheckedFrame, EncodedImage, Encoding, Pixels};
use engine::survey::{Drive, DriveFrame, ScanStamp};
use map::extrinsics::CameraExtrinsics;
use nalgebra::{Isometry3, Vector3, Vector6};
use sim::{
    building::Building,
    drive::DriveParams,
    robot::{Robot, RobotParams, SensorReadings},
};
use std::sync::Arc;
use vision::{pose::reprojection::perturbed, random::Random};

/// Error of a mounting that was measured with a tape: each angle (radians) and coordinate (metres).
const MOUNTING: [f64; 2] = [0.6 * std::f64::consts::PI / 180.0, 0.01];

/// A drive, and what its robot did not know.
#[derive(Debug)]
pub struct SimulatedDrive {
    /// What it recorded; its map begins at the true first pose.
    pub log: DriveLog,
    /// True mounting of the first frame.
    pub mounting: Isometry3<f64>,
}

/// Drives through a building; `sensed` is told of every step.
pub fn simulated_drive(
    building: &Arc<Building>,
    drive: DriveParams,
    mut sensed: impl FnMut(&SensorReadings),
) -> anyhow::Result<SimulatedDrive> {
    let seed = drive.seed;
    let robot = Robot::new(building.clone(), &RobotParams { drive, ..RobotParams::default() });
    let stated = SimulatedRobotErrors::drawn(robot.camera().intrinsics(), seed ^ 1).camera;
    let mut random = Random::new(seed ^ 2);
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
    Ok(SimulatedDrive { log: DriveLog { origin, scans, drive }, mounting })
}
