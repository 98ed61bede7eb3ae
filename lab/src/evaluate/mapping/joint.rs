//! The path of a log when walls and keyframes are solved for together, as a survey does without
//! frames.

use map::{
    fuse::FuseParams,
    joint::{CameraState, CameraStated, Datum, JointParams, LaserDrive},
    pose2::Pose2,
    slam::SlamMap,
};
use nalgebra::{Isometry3, Point2, SVector};

/// `map_from_robot` of every scan.
pub(super) fn path(map: &SlamMap) -> anyhow::Result<Vec<Pose2>> {
    let scans_ns: Vec<i64> = (0..map.path.len() as i64).collect();
    let drive = LaserDrive { map, scans_ns: &scans_ns, frames: &[], objects: &[] };
    // No frame is looked at.
    let camera = CameraState {
        robot_from_camera: Isometry3::identity(),
        focal_px: 500.0,
        aspect: 1.0,
        centre_px: Point2::new(320.0, 240.0),
        k1: 0.0,
    };
    let camera = CameraStated { camera, sigmas: Some(SVector::repeat(1.0)) };
    Ok(drive.joint_map(camera, (&JointParams::default(), &FuseParams::default()), Datum::FirstPose)?.path)
}
