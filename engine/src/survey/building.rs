//! The map of one drive: walls, objects and camera in one estimate. In: the drive. Out: the walls,
//! the objects with their places and views, the camera as it was found, and what each object fails.

use super::{
    drive::{Drive, DriveFrame},
    gates::{refusal, refuse_twins},
    look_alikes::refuse_look_alikes,
    objects::{Known, ObjectView, SeenObject, objects},
    parallel::Effort,
    sightings::{sightings, straight},
    surveyed::{SurveyedBuilding, SurveyedObject, with_focal},
};
use map::{
    extrinsics::CameraExtrinsics,
    fuse::FuseParams,
    joint::{
        CameraState, CameraStated, Datum, FrameSeen, JointError, JointLaserMap, JointParams, LaserDrive,
        MappedWall, ObjectSeen, QuadView,
    },
    pose2::{Pose2, Pose2Covariance},
    segments::LaserSegment,
    slam::SlamMap,
};
use nalgebra::{Isometry3, Matrix3, Matrix6, Point2, SVector};
use vision::{
    frame::{Intrinsics, IntrinsicsSigmas},
    params::Params,
};

/// How far a stated mounting is believed: rotation (radians) and translation (metres). The drive
/// measures them better.
const MOUNTING_SIGMA: [f64; 2] = [std::f64::consts::PI / 180.0, 0.02];
/// How far a stated k1 is believed.
const K1_SIGMA: f64 = 1e-3;
/// Times that objects are followed: with the camera as stated, then as found.
const ROUNDS: usize = 2;
/// Why a drive gives no building.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SurveyError {
    /// There is nothing to look at.
    #[error("no frame with intrinsics and the camera's mounting")]
    NoFrame,
    /// The laser map is not that of the drive's scans.
    #[error("{0} scans were driven, {1} are in the laser map")]
    Scans(usize, usize),
    /// Frames cannot be put between scans.
    #[error("the capture time of scan {0} is not after that of the scan before")]
    Times(usize),
    /// The estimate cannot be computed.
    #[error(transparent)]
    Joint(#[from] JointError),
    /// The camera as found is not on the robot.
    #[error("the drive puts the camera off its robot")]
    Camera,
}

/// Surveys a drive whose scans made this laser map. `origin` is the first pose where it is known in
/// the frame of the map; else the map begins at (0, 0, 0), and covariances are relative to the
/// drive as a whole.
pub fn surveyed(
    drive: &Drive,
    slam: SlamMap,
    origin: Option<&Pose2>,
    (params, effort): (&Params, Effort<'_>),
) -> Result<SurveyedBuilding, SurveyError> {
    if drive.scans.is_empty() || drive.scans.len() != slam.path.len() {
        return Err(SurveyError::Scans(drive.scans.len(), slam.path.len()));
    }
    if let Some(i) = drive.scans.windows(2).position(|pair| pair[1].captured_ns <= pair[0].captured_ns) {
        return Err(SurveyError::Times(i + 1));
    }
    let datum = if origin.is_some() { Datum::FirstPose } else { Datum::WholeDrive };
    let slam = &beginning_at(slam, origin.unwrap_or(&Pose2::default()));
    let (seen, undecodable) = sightings(drive, params, effort);
    let camera = drive.frames.first().and_then(|first| first.frame.intrinsics).ok_or(SurveyError::NoFrame)?;
    let mountings: Vec<CameraExtrinsics> =
        drive.frames.iter().filter_map(|frame| frame.frame.mounting.clone()).collect();
    if mountings.len() < drive.frames.len() {
        return Err(SurveyError::NoFrame);
    }
    let stated = state_of(&camera, &mountings[0].robot_from_camera);
    let laser_frames = by_laser(drive, slam);
    let mut known = Known {
        walls: slam.walls.iter().enumerate().map(|(of, wall)| whole(of, wall)).collect(),
        frames: laser_frames.clone(),
        mountings,
        camera,
    };
    let mut round = 0;
    loop {
        round += 1;
        let found = objects(drive, &seen, &known, (params, effort));
        let map = solved((drive, slam, datum), &found, &camera, &stated)?;
        if round == ROUNDS {
            let mut building = SurveyedBuilding {
                laser_walls: slam.walls.clone(),
                laser_frames,
                loops: slam.loops.len(),
                undecodable,
                ..made(found, map, stated)
            };
            refuse_look_alikes(drive, &mut building, (params, effort));
            return Ok(building);
        }
        known = corrected(drive, &map, &camera, &stated)?;
    }
}

/// The map in a frame where its first pose is `origin`.
fn beginning_at(mut map: SlamMap, origin: &Pose2) -> SlamMap {
    // A definition: it adds no error.
    let by = Pose2Covariance { pose: *origin, covariance: Matrix3::zeros() };
    map.path.iter_mut().for_each(|pose| *pose = origin.compose(pose));
    map.keys.iter_mut().for_each(|key| key.pose.pose = origin.compose(&key.pose.pose));
    map.walls.iter_mut().for_each(|wall| *wall = wall.transformed(&by));
    map
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

fn solved(
    (drive, slam, datum): (&Drive, &SlamMap, Datum),
    found: &[SeenObject],
    camera: &Intrinsics,
    stated: &CameraState,
) -> Result<JointLaserMap, SurveyError> {
    let scans_ns: Vec<i64> = drive.scans.iter().map(|scan| scan.captured_ns).collect();
    let frame = |frame: &DriveFrame| FrameSeen { captured_ns: frame.frame.captured_ns, odom: frame.odom };
    let frames: Vec<FrameSeen> = drive.frames.iter().map(frame).collect();
    let view = |view: &ObjectView| {
        let mounting = drive.frames[view.frame].frame.mounting.as_ref()?;
        Some(QuadView {
            keyframe: view.frame,
            mounting_from_camera: stated.robot_from_camera.inverse() * mounting.robot_from_camera,
            corners_px: straight(&view.corners_px, camera)?,
            covariance_px2: view.covariance_px2,
        })
    };
    let object = |object: &SeenObject| ObjectSeen {
        views: object.views.iter().filter_map(view).collect(),
        on_wall: Some(object.on_wall),
    };
    let objects: Vec<ObjectSeen> = found.iter().map(object).collect();
    let intrinsics = camera.sigmas.unwrap_or_else(|| IntrinsicsSigmas::usual(camera.fx_px));
    let [turn, shift] = MOUNTING_SIGMA;
    let (focal, centre) = (intrinsics.focal_px.max(1e-3), intrinsics.center_px.max(1e-3));
    let sigmas = SVector::from([turn, turn, turn, shift, shift, shift, focal, centre, centre, K1_SIGMA]);
    let laser = LaserDrive { map: slam, scans_ns: &scans_ns, frames: &frames, objects: &objects };
    let camera = CameraStated { camera: *stated, sigmas: Some(sigmas) };
    Ok(laser.joint_map(camera, (&JointParams::default(), &FuseParams::default()), datum)?)
}

/// What the next round starts from.
fn corrected(
    drive: &Drive,
    map: &JointLaserMap,
    camera: &Intrinsics,
    stated: &CameraState,
) -> Result<Known, SurveyError> {
    let turned = map.camera.robot_from_camera * stated.robot_from_camera.inverse();
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
        camera: with_focal(camera, map.camera.focal_px),
    })
}

/// The solution, without what is of the laser map and the frames.
fn made(found: Vec<SeenObject>, map: JointLaserMap, stated: CameraState) -> SurveyedBuilding {
    let mut objects = Vec::new();
    for (seen, mapped) in found.into_iter().zip(&map.objects) {
        let Some(mapped) = mapped else { continue };
        let poses = seen.views.iter().map(|view| map.frames[view.frame].pose);
        let refused = refusal(&mapped.place, mapped.agreement, &poses.collect::<Vec<_>>());
        objects.push(SurveyedObject { place: mapped.place, views: seen.views, refused });
    }
    refuse_twins(&mut objects);
    SurveyedBuilding {
        walls: map.walls.into_iter().map(|wall| wall.segment).collect(),
        laser_walls: Vec::new(),
        laser_frames: Vec::new(),
        objects,
        frames: map.frames,
        camera: (map.camera, map.camera_sigmas),
        stated,
        odometry_scale: map.odometry.scale,
        loops: 0,
        undecodable: 0,
    }
}

#[cfg(test)]
mod tests {
    use super::{super::drive::ScanStamp, *};
    use nalgebra::Vector2;

    #[test]
    fn a_drive_whose_scans_go_back_in_time_is_refused() {
        let (told, params) = (|_: &'static str, _: usize, _: usize| {}, Params::default());
        let effort = Effort { threads: std::num::NonZeroUsize::MIN, told: &told };
        let surveyed_at = |times: &[i64]| {
            let stamp = |captured_ns: &i64| ScanStamp { captured_ns: *captured_ns, odom: Pose2::default() };
            let drive = Drive { scans: times.iter().map(stamp).collect(), frames: Vec::new() };
            let path = vec![Pose2::default(); times.len()];
            let slam = SlamMap { path, keys: Vec::new(), loops: Vec::new(), refused: 0, walls: Vec::new() };
            surveyed(&drive, slam, None, (&params, effort)).unwrap_err()
        };
        assert_eq!(surveyed_at(&[]), SurveyError::Scans(0, 0));
        assert_eq!(surveyed_at(&[5, 9, 8]), SurveyError::Times(2));
        assert_eq!(surveyed_at(&[0, 0]), SurveyError::Times(1));
        assert_eq!(surveyed_at(&[5, 9]), SurveyError::NoFrame);
    }

    #[test]
    fn a_map_begins_where_it_is_told_to() {
        let laser = SlamMap {
            path: vec![Pose2::default(), Pose2::new(1.0, 0.0, 0.0)],
            keys: Vec::new(),
            loops: Vec::new(),
            refused: 0,
            walls: vec![LaserSegment::by_hand(&[0.0, 1.0, 2.0, 1.0]).unwrap()],
        };
        let made = beginning_at(laser, &Pose2::new(5.0, 1.0, std::f64::consts::FRAC_PI_2));
        assert!((made.path[1].position() - Vector2::new(5.0, 2.0)).norm() < 1e-9, "{:?}", made.path);
        assert!((made.walls[0].a - Point2::new(4.0, 1.0)).norm() < 1e-9, "{:?}", made.walls[0]);
        assert!((made.walls[0].b - Point2::new(4.0, 3.0)).norm() < 1e-9, "{:?}", made.walls[0]);
    }
}
