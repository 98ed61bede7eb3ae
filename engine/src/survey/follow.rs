//! Objects of one drive. In: a drive with its laser map. Out: the objects that were followed
//! through it, and the map of this drive alone.
//!
//! Objects are followed twice: with the camera as stated, then as found.

use super::{
    drive::{Drive, DriveFrame},
    error::SurveyError,
    objects::{Known, ObjectView, SeenObject, objects},
    parallel::Effort,
    sightings::{sightings, straight},
    surveyed::with_focal,
};
use map::{
    extrinsics::CameraExtrinsics,
    fuse::FuseParams,
    joint::{
        CameraState, CameraStated, Datum, FrameSeen, JointError, JointLaserMap, JointParams, LaserDrive,
        LaserDrives, MappedWall, ObjectSeen, QuadView,
    },
    pose2::Pose2,
    segments::LaserSegment,
    slam::SlamMap,
};
use nalgebra::{Isometry3, Matrix6, Point2, SVector};
use vision::{
    frame::{Intrinsics, IntrinsicsSigmas},
    params::Params,
};

/// How far a stated mounting is believed: rotation (radians) and translation (metres). The drive
/// measures them better.
const MOUNTING_SIGMA: [f64; 2] = [std::f64::consts::PI / 180.0, 0.02];
/// How far a stated k1 is believed.
const K1_SIGMA: f64 = 1e-3;
/// Times that objects are followed.
const ROUNDS: usize = 2;

/// The camera of all drives as stated.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stated {
    pub(super) intrinsics: Intrinsics,
    /// The same with the mounting of the first frame, without its lens.
    pub(super) camera: CameraState,
}

impl Stated {
    /// As the first frame has it.
    pub(super) fn of(drive: &Drive) -> Result<Self, SurveyError> {
        let first = drive.frames.first().ok_or(SurveyError::NoFrame)?;
        let intrinsics = first.frame.intrinsics.ok_or(SurveyError::NoFrame)?;
        let mounting = first.frame.mounting.as_ref().ok_or(SurveyError::NoFrame)?;
        Ok(Self { intrinsics, camera: state_of(&intrinsics, &mounting.robot_from_camera) })
    }
}

/// The camera without its lens.
fn state_of(camera: &Intrinsics, robot_from_camera: &Isometry3<f64>) -> CameraState {
    CameraState {
        robot_from_camera: *robot_from_camera,
        focal_px: camera.fx_px,
        aspect: camera.fy_px / camera.fx_px,
        centre_px: Point2::new(camera.cx_px, camera.cy_px),
        k1: 0.0,
    }
}

/// A drive whose objects were followed.
pub(super) struct Followed<'a> {
    pub(super) drive: &'a Drive,
    pub(super) slam: &'a SlamMap,
    /// Objects that have a place.
    pub(super) found: Vec<SeenObject>,
    /// The map of this drive alone.
    pub(super) map: JointLaserMap,
    /// The pose of each frame by the laser map.
    pub(super) laser_frames: Vec<Pose2>,
    /// Frames that could not be decoded.
    pub(super) undecodable: usize,
}

pub(super) fn followed<'a>(
    (drive, slam): (&'a Drive, &'a SlamMap),
    stated: &Stated,
    datum: Datum,
    (params, effort): (&Params, Effort<'_>),
) -> Result<Followed<'a>, SurveyError> {
    let (seen, undecodable) = sightings(drive, params, effort);
    let mountings: Vec<CameraExtrinsics> =
        drive.frames.iter().filter_map(|frame| frame.frame.mounting.clone()).collect();
    if mountings.is_empty() || mountings.len() < drive.frames.len() {
        return Err(SurveyError::NoFrame);
    }
    let laser_frames = by_laser(drive, slam);
    let mut known = Known {
        walls: slam.walls.iter().enumerate().map(|(of, wall)| whole(of, wall)).collect(),
        frames: laser_frames.clone(),
        mountings,
        camera: stated.intrinsics,
    };
    let mut round = 0;
    loop {
        round += 1;
        let mut found = objects(drive, &seen, &known, (params, effort));
        let mut map = solved(&[(drive, slam, &found)], &[], stated, datum)?;
        if round == ROUNDS {
            let mut placed = map.objects.iter().map(Option::is_some);
            found.retain(|_| placed.next().unwrap_or(false));
            map.objects.retain(Option::is_some);
            return Ok(Followed { drive, slam, found, map, laser_frames, undecodable });
        }
        known = corrected(drive, &map, stated)?;
    }
}

fn whole(of: usize, wall: &LaserSegment) -> MappedWall {
    MappedWall { segment: wall.clone(), of, from_m: 0.0 }
}

/// The pose of each frame by the laser map: odometry since the scan before.
fn by_laser(drive: &Drive, slam: &SlamMap) -> Vec<Pose2> {
    let pose = |frame: &DriveFrame| {
        let after = drive.scans.partition_point(|scan| scan.captured_ns <= frame.frame.captured_ns);
        let scan = after.saturating_sub(1);
        slam.path[scan].compose(&drive.scans[scan].odom.between(&frame.odom))
    };
    drive.frames.iter().map(pose).collect()
}

/// Walls, objects and camera of drives, with pairs of objects that may be one, numbered through.
pub(super) fn solved(
    drives: &[(&Drive, &SlamMap, &[SeenObject])],
    same: &[[usize; 2]],
    stated: &Stated,
    datum: Datum,
) -> Result<JointLaserMap, JointError> {
    let scans_ns = |drive: &Drive| drive.scans.iter().map(|scan| scan.captured_ns).collect();
    let scans_ns: Vec<Vec<i64>> = drives.iter().map(|(drive, ..)| scans_ns(drive)).collect();
    let frame = |frame: &DriveFrame| FrameSeen { captured_ns: frame.frame.captured_ns, odom: frame.odom };
    let frames: Vec<Vec<FrameSeen>> =
        drives.iter().map(|(drive, ..)| drive.frames.iter().map(frame).collect()).collect();
    let objects: Vec<Vec<ObjectSeen>> = drives
        .iter()
        .map(|(drive, _, found)| found.iter().map(|object| object_seen(drive, object, stated)).collect())
        .collect();
    let sources = scans_ns.iter().zip(&frames).zip(&objects);
    let laser: Vec<LaserDrive<'_>> = drives
        .iter()
        .zip(sources)
        .map(|((_, map, _), ((scans_ns, frames), objects))| LaserDrive { map, scans_ns, frames, objects })
        .collect();
    let intrinsics =
        stated.intrinsics.sigmas.unwrap_or_else(|| IntrinsicsSigmas::usual(stated.intrinsics.fx_px));
    let [turn, shift] = MOUNTING_SIGMA;
    let (focal, centre) = (intrinsics.focal_px.max(1e-3), intrinsics.center_px.max(1e-3));
    let sigmas = SVector::from([turn, turn, turn, shift, shift, shift, focal, centre, centre, K1_SIGMA]);
    let camera = CameraStated { camera: stated.camera, sigmas: Some(sigmas) };
    let believed = (&JointParams::default(), &FuseParams::default());
    LaserDrives { drives: &laser, same }.joint_map(camera, believed, datum)
}

fn object_seen(drive: &Drive, object: &SeenObject, stated: &Stated) -> ObjectSeen {
    let view = |view: &ObjectView| {
        let mounting = drive.frames[view.frame].frame.mounting.as_ref()?;
        Some(QuadView {
            keyframe: view.frame,
            mounting_from_camera: stated.camera.robot_from_camera.inverse() * mounting.robot_from_camera,
            corners_px: straight(&view.corners_px, &stated.intrinsics)?,
            covariance_px2: view.covariance_px2,
        })
    };
    ObjectSeen { views: object.views.iter().filter_map(view).collect(), on_wall: Some(object.on_wall) }
}

/// What the next round starts from.
fn corrected(drive: &Drive, map: &JointLaserMap, stated: &Stated) -> Result<Known, SurveyError> {
    let turned = map.camera.robot_from_camera * stated.camera.robot_from_camera.inverse();
    let sigmas = map.camera_sigmas.fixed_rows::<6>(0);
    let covariance = Matrix6::from_diagonal(&sigmas.component_mul(&sigmas));
    let mounting = |frame: &DriveFrame| {
        let stated = frame.frame.mounting.as_ref()?;
        let made = CameraExtrinsics { robot_from_camera: turned * stated.robot_from_camera, covariance };
        made.check().ok().map(|()| made)
    };
    let mountings: Vec<CameraExtrinsics> = drive.frames.iter().filter_map(mounting).collect();
    if mountings.len() < drive.frames.len() {
        return Err(SurveyError::Camera);
    }
    Ok(Known {
        walls: map.walls.clone(),
        frames: map.frames.iter().map(|frame| frame.pose).collect(),
        mountings,
        camera: with_focal(&stated.intrinsics, map.camera.focal_px),
    })
}
