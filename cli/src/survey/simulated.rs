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
    /// What it recorded.
    pub log: DriveLog,
    /// True mounting of the first frame.
    pub mounting: Isometry3<f64>,
}

/// Errors of odometry, as large as an estimate believes of an unknown robot.
pub fn believed_odometry(random: &mut Random) -> OdometryParams {
    let believed = FuseParams::default();
    OdometryParams {
        scale_error: believed.scale_sigma * random.normal(),
        heading_bias_rad_per_m: believed.turn_bias_sigma_rad_per_m * random.normal(),
        length_sigma_m: believed.along_m,
        heading_sigma_rad: believed.turn_rad,
        turn_sigma_rad: believed.turn_per_turn_rad,
    }
}

/// Drives through a building with the errors of a robot, which are drawn from a seed of its own;
/// `sensed` is told of every step.
pub fn simulated_drive(
    building: &Arc<Building>,
    drive: DriveParams,
    robot_seed: u64,
    mut sensed: impl FnMut(&SensorReadings),
) -> anyhow::Result<SimulatedDrive> {
    let mut random = Random::new(robot_seed ^ 2);
    let drive = DriveParams { odometry: believed_odometry(&mut random), ..drive };
    let laser = LaserParams { uneven_m: UNEVEN_M, ..LaserParams::default() };
    let robot = Robot::new(building.clone(), &RobotParams { drive, laser, ..RobotParams::default() });
    let stated = SimulatedRobotErrors::drawn(robot.camera().intrinsics(), robot_seed ^ 1).camera;
    let [turn, shift] = MOUNTING;
    let error = Vector6::new(turn, turn, turn, shift, shift, shift).map(|s| s * random.normal());
    let (turn, shift): (Vector3<f64>, Vector3<f64>) =
        (error.fixed_rows::<3>(0).into(), error.fixed_rows::<3>(3).into());
    let (mut drive, mut scans, mut mounting) = (Drive::default(), Vec::new(), None);
    for readings in robot {
        sensed(&readings);
        let step = &readings.step;
        mounting = mounting.or(Some(step.robot_from_camera));
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
    let mounting = mounting.context("a drive without a step")?;
    Ok(SimulatedDrive { log: DriveLog { scans, drive }, mounting })
}

#[cfg(test)]
mod tests {
    use super::{super::surveyed, *};
    use engine::survey::SurveyedObject;
    use sim::{
        building::{LandmarkKind, LandmarkTruth},
        corridor::CorridorParams,
    };
    use std::collections::BTreeSet;
    use vision::params::Params;

    #[test]
    fn two_drives_of_a_robot_make_one_map() {
        let corridor = CorridorParams { length_m: 12.0, posters: 4, ..CorridorParams::default() };
        let building = Arc::new(Building::corridor_with(&corridor, 22));
        let mut path = Vec::new();
        let logs = [3, 4].map(|seed| {
            let drive = DriveParams { seed, legs: 2, rate_hz: 2.0, ..DriveParams::default() };
            let start = |readings: &SensorReadings| {
                path.push(readings.step.map_from_robot.position().into());
            };
            simulated_drive(&building, drive, 3, start).unwrap().log
        });
        let found = surveyed(&logs, None, &Params::default()).unwrap().laid_on_path(&path);
        let first = logs[0].drive.frames.len();
        assert_eq!(found.frames.len(), first + logs[1].drive.frames.len());
        let mut posters = BTreeSet::new();
        let mut from_both = 0;
        for object in found.objects.iter().filter(|object| object.refused.is_none()) {
            let at = object.place.map_from_landmark().translation.vector;
            let off = |l: &&LandmarkTruth| (l.map_from_landmark.translation.vector - at).norm();
            let mut near = building.landmarks().iter().filter(|l| l.kind == LandmarkKind::Poster);
            // Of a window that nothing else looks like, a pane may be a landmark, too.
            let Some(truth) = near.find(|truth| off(truth) < 0.5) else { continue };
            assert!(off(&truth) < 0.05, "{}: {:.3} m", truth.name, off(&truth));
            assert!(posters.insert(truth.name.clone()), "{} is two landmarks", truth.name);
            from_both += usize::from(
                object.views.iter().any(|view| view.frame < first)
                    && object.views.iter().any(|view| view.frame >= first),
            );
        }
        assert!(posters.len() >= 3 && from_both >= 2, "{posters:?}, {from_both} from both");
    }

    #[test]
    fn doors_and_look_alikes_are_no_landmarks_and_posters_are() {
        let corridor = CorridorParams { posters: 4, ..CorridorParams::default() };
        let building = Arc::new(Building::corridor_with(&corridor, 22));
        let drive = DriveParams { seed: 3, legs: 2, rate_hz: 3.0, ..DriveParams::default() };
        let mut origin = None;
        let start = |readings: &SensorReadings| {
            origin.get_or_insert(readings.step.map_from_robot);
        };
        let log = simulated_drive(&building, drive, 3, start).unwrap().log;
        let found = surveyed(&[log], origin.as_ref(), &Params::default()).unwrap();
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
