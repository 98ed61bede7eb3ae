//! The map of one drive: walls, objects and camera in one estimate. In: the drive. Out: the walls,
//! the objects with their places and views, the camera as it was found, and what each object fails.

use super::{
    drive::{Drive, DriveFrame},
    objects::{Known, ObjectView, SeenObject, objects},
    parallel::Effort,
    sightings::{sightings, straight},
};
use map::{
    extrinsics::CameraExtrinsics,
    fuse::FuseParams,
    joint::{
        CameraState, CameraStated, FrameSeen, JointError, JointLaserMap, JointParams, LaserDrive, MappedWall,
        ObjectSeen, QuadView,
    },
    place::LandmarkPlace,
    pose2::{Pose2, Pose2Covariance},
    segments::LaserSegment,
    slam::SlamMap,
};
use nalgebra::{Isometry3, Matrix3, Matrix6, Point2, SVector, Vector2};
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
/// Gates of an object: mean weight of its views, standard deviation of its centre (metres), angle
/// between its views (radians) or way between them (metres), and number of views.
const MIN_AGREEMENT: f64 = 0.5;
const MAX_SIGMA_M: f64 = 0.25;
const MIN_PARALLAX_RAD: f64 = 0.14;
const MIN_BASELINE_M: f64 = 0.5;
const MIN_VIEWS: usize = 4;

/// An object of a surveyed building.
#[derive(Debug, Clone)]
pub struct SurveyedObject {
    /// Where it hangs.
    pub place: LandmarkPlace,
    /// Its views.
    pub views: Vec<ObjectView>,
    /// Why it is no landmark; none where it is one.
    pub refused: Option<String>,
}

/// What a drive gave.
#[derive(Debug)]
pub struct SurveyedBuilding {
    /// Walls, map frame.
    pub walls: Vec<LaserSegment>,
    /// Walls of the laser map alone, for comparison.
    pub laser_walls: Vec<LaserSegment>,
    /// `map_from_robot` of each frame by the laser map alone.
    pub laser_frames: Vec<Pose2>,
    /// Objects.
    pub objects: Vec<SurveyedObject>,
    /// `map_from_robot` of each frame.
    pub frames: Vec<Pose2Covariance>,
    /// The camera as found, without its lens, and its standard deviations.
    pub camera: (CameraState, SVector<f64, 10>),
    /// The camera as stated.
    pub stated: CameraState,
    /// Scale of odometry as found, minus 1.
    pub odometry_scale: f64,
    /// Loop closures of the laser map.
    pub loops: usize,
    /// Frames that could not be decoded.
    pub undecodable: usize,
}

impl SurveyedBuilding {
    /// The mounting of a frame by the camera as found.
    pub fn mounting(&self, stated: &Isometry3<f64>) -> Isometry3<f64> {
        self.camera.0.robot_from_camera * self.stated.robot_from_camera.inverse() * stated
    }

    /// Intrinsics with the focal length as found; their lens stays.
    pub fn intrinsics(&self, stated: &Intrinsics) -> Intrinsics {
        with_focal(stated, self.camera.0.focal_px)
    }
}

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

/// Surveys a drive whose scans made this laser map; its first pose is `origin`.
pub fn surveyed(
    drive: &Drive,
    slam: SlamMap,
    origin: &Pose2,
    (params, effort): (&Params, Effort<'_>),
) -> Result<SurveyedBuilding, SurveyError> {
    if drive.scans.is_empty() || drive.scans.len() != slam.path.len() {
        return Err(SurveyError::Scans(drive.scans.len(), slam.path.len()));
    }
    if let Some(i) = drive.scans.windows(2).position(|pair| pair[1].captured_ns <= pair[0].captured_ns) {
        return Err(SurveyError::Times(i + 1));
    }
    let slam = &beginning_at(slam, origin);
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
        let map = solved(drive, slam, &found, &camera, &stated)?;
        if round == ROUNDS {
            return Ok(SurveyedBuilding {
                laser_walls: slam.walls.clone(),
                laser_frames,
                loops: slam.loops.len(),
                undecodable,
                ..made(found, map, stated)
            });
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
    drive: &Drive,
    slam: &SlamMap,
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
    Ok(laser.joint_map(camera, &JointParams::default(), &FuseParams::default())?)
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

fn with_focal(camera: &Intrinsics, focal_px: f64) -> Intrinsics {
    Intrinsics { fx_px: focal_px, fy_px: focal_px * camera.fy_px / camera.fx_px, ..*camera }
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

/// Why an object is no landmark by its own views.
fn refusal(place: &LandmarkPlace, agreement: f64, poses: &[Pose2]) -> Option<String> {
    let centre = Vector2::new(place.x_m, place.y_m);
    let ways: Vec<Vector2<f64>> = poses.iter().map(|pose| pose.position() - centre).collect();
    let pairs = || ways.iter().enumerate().flat_map(|(i, a)| ways[i + 1..].iter().map(move |b| (a, b)));
    let parallax = pairs().map(|(a, b)| a.angle(b)).fold(0.0, f64::max);
    let baseline_m = pairs().map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
    let sigma_m = (place.covariance[(0, 0)] + place.covariance[(1, 1)]).sqrt();
    if poses.len() < MIN_VIEWS {
        Some(format!("{} views, {MIN_VIEWS} needed", poses.len()))
    } else if parallax < MIN_PARALLAX_RAD && baseline_m < MIN_BASELINE_M {
        Some(format!("seen from one place only: {:.0} degrees, {baseline_m:.2} m", parallax.to_degrees()))
    } else if agreement < MIN_AGREEMENT {
        Some(format!("its views contradict each other: {:.0} % agree", 100.0 * agreement))
    } else if sigma_m > MAX_SIGMA_M {
        Some(format!("its place is known to {sigma_m:.2} m only"))
    } else {
        None
    }
}

/// Of objects at one place, that with most views stays: the others are its frame or its mat.
fn refuse_twins(objects: &mut [SurveyedObject]) {
    let reach = |place: &LandmarkPlace| 0.5 * place.size.width_m.max(place.size.height_m);
    let at = |place: &LandmarkPlace| place.map_from_landmark().translation.vector;
    for i in 0..objects.len() {
        let rival = (0..objects.len()).find(|&j| {
            let (own, other) = (&objects[i], &objects[j]);
            let apart = (at(&own.place) - at(&other.place)).norm();
            let is_near = apart < reach(&own.place).max(reach(&other.place));
            let is_better =
                (other.views.len(), std::cmp::Reverse(j)) > (own.views.len(), std::cmp::Reverse(i));
            i != j && is_near && is_better && own.refused.is_none() && other.refused.is_none()
        });
        if rival.is_some() {
            objects[i].refused = Some("another one with more views is at its place".to_owned());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{super::drive::ScanStamp, *};
    use map::place::PlaceSigmas;
    use nalgebra::Vector3;
    use vision::{geometry::Corners, pose::LandmarkSize};

    fn place(x_m: f64, width_m: f64) -> LandmarkPlace {
        let size = LandmarkSize { width_m, height_m: 0.8 };
        LandmarkPlace::by_hand(Vector3::new(x_m, 0.0, 1.5), 0.0, size, PlaceSigmas::default()).unwrap()
    }

    fn object(x_m: f64, width_m: f64, views: usize) -> SurveyedObject {
        let corners = [[0.0, 0.0], [9.0, 0.0], [9.0, 9.0], [0.0, 9.0]].map(Point2::from);
        let view = ObjectView {
            frame: 0,
            corners_px: Corners::new(corners).unwrap(),
            covariance_px2: [nalgebra::Matrix2::identity(); 4],
        };
        SurveyedObject { place: place(x_m, width_m), views: vec![view; views], refused: None }
    }

    #[test]
    fn an_object_needs_views_from_several_places_that_agree() {
        let poses = |ways: &[f64]| ways.iter().map(|y| Pose2::new(2.0, *y, 0.0)).collect::<Vec<_>>();
        let there = place(0.0, 0.6);
        let why = |agreement, poses: &[Pose2]| refusal(&there, agreement, poses).unwrap_or_default();
        assert_eq!(why(0.9, &poses(&[-0.5, 0.0, 0.5, 1.0])), "");
        assert_eq!(why(0.9, &poses(&[-0.5, 0.0, 0.5])), "3 views, 4 needed");
        assert!(why(0.9, &poses(&[0.0, 0.01, 0.02, 0.03])).contains("one place only: 1 degrees, 0.03 m"));
        assert!(why(0.4, &poses(&[-0.5, 0.0, 0.5, 1.0])).contains("40 % agree"));
        let mut vague = there;
        vague.covariance[(0, 0)] = 0.09;
        let why = refusal(&vague, 0.9, &poses(&[-0.5, 0.0, 0.5, 1.0])).unwrap();
        assert_eq!(why, "its place is known to 0.30 m only");
    }

    #[test]
    fn a_drive_whose_scans_go_back_in_time_is_refused() {
        let (told, params) = (|_: &'static str, _: usize, _: usize| {}, Params::default());
        let effort = Effort { threads: std::num::NonZeroUsize::MIN, told: &told };
        let surveyed_at = |times: &[i64]| {
            let stamp = |captured_ns: &i64| ScanStamp { captured_ns: *captured_ns, odom: Pose2::default() };
            let drive = Drive { scans: times.iter().map(stamp).collect(), frames: Vec::new() };
            let path = vec![Pose2::default(); times.len()];
            let slam = SlamMap { path, keys: Vec::new(), loops: Vec::new(), refused: 0, walls: Vec::new() };
            surveyed(&drive, slam, &Pose2::default(), (&params, effort)).unwrap_err()
        };
        assert_eq!(surveyed_at(&[]), SurveyError::Scans(0, 0));
        assert_eq!(surveyed_at(&[5, 9, 8]), SurveyError::Times(2));
        assert_eq!(surveyed_at(&[0, 0]), SurveyError::Times(1));
        assert_eq!(surveyed_at(&[5, 9]), SurveyError::NoFrame);
    }

    #[test]
    fn of_a_picture_and_its_frame_the_one_with_most_views_stays() {
        let mut objects = vec![object(0.0, 0.6, 5), object(0.02, 0.7, 9), object(3.0, 0.6, 4)];
        refuse_twins(&mut objects);
        let refused: Vec<bool> = objects.iter().map(|object| object.refused.is_some()).collect();
        assert_eq!(refused, [true, false, false]);
        let mut equal = vec![object(0.0, 0.6, 5), object(0.02, 0.7, 5)];
        refuse_twins(&mut equal);
        assert_eq!(equal.iter().filter(|object| object.refused.is_some()).count(), 1, "one stays");
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
