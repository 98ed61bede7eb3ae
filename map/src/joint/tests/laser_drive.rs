//! Drives through a corridor with posters: the program makes the laser maps, gives lines to walls,
//! and the joint map corrects the odometry, the camera and the places.

use crate::{
    fuse::FuseParams,
    joint::{
        CameraState, CameraStated, Datum, FrameSeen, JointError, JointLaserMap, JointParams, LaserDrive,
        LaserDrives, MappedObject, ObjectSeen, QuadView,
    },
    pose2::Pose2,
    segments::LaserSegment,
    slam::{
        MapKey, Slam, SlamMap, SlamParams,
        world::{Walls, rectangle, scan},
    },
};
use nalgebra::{
    Isometry3, Matrix2, Point2, Point3, Rotation3, SVector, Translation3, UnitQuaternion, Vector2, Vector3,
};
use vision::{pose::LandmarkSize, random::Random};

const SIZE: LandmarkSize = LandmarkSize { width_m: 0.6, height_m: 0.8 };
const STEP_NS: i64 = 100_000_000;

struct Poster {
    centre: Vector3<f64>,
    facing_rad: f64,
}

fn corridor() -> Walls {
    let mut walls = rectangle([0.0, -1.2, 24.0, 1.2]);
    for x in [4.0, 9.0, 15.5, 20.0] {
        walls.extend(rectangle([x, 0.9, x + 0.5, 1.2]));
    }
    walls
}

/// Posters left and right.
fn posters() -> Vec<Poster> {
    let side = |i: i32| if i % 2 == 0 { 1.0 } else { -1.0 };
    let poster = |i: i32| Poster {
        centre: Vector3::new(2.5 + 3.0 * f64::from(i), 1.2 * side(i), 1.5),
        facing_rad: -0.5 * std::f64::consts::PI * side(i),
    };
    (0..7).map(poster).collect()
}

/// There, a turn on the spot, and back.
fn path() -> Vec<Pose2> {
    let there = (0..=220).map(|i| Pose2::new(1.0 + 0.1 * f64::from(i), 0.0, 0.0));
    let turn = (1..=16).map(|i| Pose2::new(23.0, 0.0, std::f64::consts::PI * f64::from(i) / 16.0));
    let back = (1..=220).map(|i| Pose2::new(23.0 - 0.1 * f64::from(i), 0.0, std::f64::consts::PI));
    there.chain(turn).chain(back).collect()
}

/// From the far end here, a turn on the spot, and back.
fn path_from_the_far_end() -> Vec<Pose2> {
    let far = Pose2::new(24.0, 0.0, std::f64::consts::PI);
    path().iter().map(|pose| far.compose(pose)).collect()
}

fn camera() -> CameraState {
    // Looks forwards: camera z is robot x, camera x is robot -y.
    let looks = Rotation3::from_matrix_unchecked(nalgebra::Matrix3::new(
        0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0,
    ));
    CameraState {
        robot_from_camera: Isometry3::from_parts(
            Translation3::new(0.1, 0.0, 1.2),
            UnitQuaternion::from_rotation_matrix(&looks),
        ),
        focal_px: 600.0,
        aspect: 1.0,
        centre_px: Point2::new(480.0, 360.0),
        k1: 0.0,
    }
}

/// Corners of a poster that is in full view and near.
fn seen(robot: &Pose2, poster: &Poster, camera: &CameraState) -> Option<[Point2<f64>; 4]> {
    let map_from_camera = robot.to_isometry3() * camera.robot_from_camera;
    let away = poster.centre.xy() - robot.position();
    let facing = Vector2::new(poster.facing_rad.cos(), poster.facing_rad.sin());
    (away.norm() < 5.0 && -away.dot(&facing) / away.norm() > 0.25).then_some(())?;
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), poster.facing_rad);
    let (w, h) = (0.5 * SIZE.width_m, 0.5 * SIZE.height_m);
    // TL, TR, BR, BL as seen from before it.
    let corners = [[-w, h], [w, h], [w, -h], [-w, -h]].map(|[y, z]| {
        let at = poster.centre + turn * Vector3::new(0.0, y, z);
        let local = map_from_camera.inverse() * Point3::from(at);
        let a = local.xy() / local.z;
        let px = camera.centre_px + a.coords * camera.focal_px;
        let inside = local.z > 0.2 && (5.0..955.0).contains(&px.x) && (5.0..715.0).contains(&px.y);
        inside.then_some(px)
    });
    let [a, b, c, d] = corners;
    Some([a?, b?, c?, d?])
}

struct Driven {
    start: Pose2,
    map: SlamMap,
    scans_ns: Vec<i64>,
    frames: Vec<FrameSeen>,
    objects: Vec<ObjectSeen>,
}

impl Driven {
    fn drive(&self) -> LaserDrive<'_> {
        let Self { map, scans_ns, frames, objects, .. } = self;
        LaserDrive { map, scans_ns, frames, objects }
    }
}

fn driven(real: &CameraState, seed: u64) -> Driven {
    driven_along(&path(), real, seed)
}

/// A drive with an odometry that measures 2 % too little, seen by this camera.
fn driven_along(path: &[Pose2], real: &CameraState, seed: u64) -> Driven {
    let (walls, mut random) = (corridor(), Random::new(seed));
    let mut odom = vec![Pose2::default()];
    for pair in path.windows(2) {
        let m = pair[0].between(&pair[1]);
        let d = m.position().norm();
        let step = Pose2::new(
            m.x_m * 0.98 + 0.01 * d.sqrt() * random.normal(),
            0.005 * d.sqrt() * random.normal(),
            m.theta_rad
                + 0.004 * d.sqrt() * random.normal()
                + 0.01 * m.theta_rad.abs().sqrt() * random.normal(),
        );
        odom.push(odom[odom.len() - 1].compose(&step));
    }
    let mut slam = Slam::new(SlamParams::default());
    let mut objects = vec![ObjectSeen::default(); posters().len()];
    let mut frames = Vec::new();
    for (i, (at, odom)) in path.iter().zip(&odom).enumerate() {
        slam.add(odom, &scan(&walls, at, 0.01, 12.0, &mut random)).unwrap();
        if i % 3 != 1 {
            continue;
        }
        let keyframe = frames.len();
        frames.push(FrameSeen { captured_ns: i as i64 * STEP_NS, odom: *odom });
        for (object, poster) in objects.iter_mut().zip(posters()) {
            let Some(corners) = seen(at, &poster, real) else { continue };
            let noise = |p: Point2<f64>| p + Vector2::new(random.normal(), random.normal()) * 0.5;
            object.views.push(QuadView {
                keyframe,
                mounting_from_camera: Isometry3::identity(),
                corners_px: corners.map(noise),
                covariance_px2: [Matrix2::identity() * 0.25; 4],
            });
        }
    }
    let map = slam.finish().unwrap();
    for (object, poster) in objects.iter_mut().zip(posters()) {
        // In the frame of the laser map, which begins at the first pose.
        let at = path[0].inverse().apply(&Point2::from(poster.centre.xy()));
        let off = |wall: &LaserSegment| {
            let from = at - wall.a;
            let along = wall.direction().dot(&from);
            let is_there = (-0.5..wall.length_m() + 0.5).contains(&along);
            if is_there { wall.facing().dot(&from).abs() } else { f64::INFINITY }
        };
        let near = (0..map.walls.len()).min_by(|a, b| off(&map.walls[*a]).total_cmp(&off(&map.walls[*b])));
        let along = |i: &usize| map.walls[*i].direction().dot(&(at - map.walls[*i].a));
        object.on_wall = near.filter(|i| off(&map.walls[*i]) < 0.5).map(|i| (i, along(&i)));
    }
    let scans_ns = (0..path.len() as i64).map(|i| i * STEP_NS).collect();
    Driven { start: path[0], map, scans_ns, frames, objects }
}

fn solved(driven: &Driven, stated: &CameraState) -> JointLaserMap {
    solved_together(&[driven], &[], stated).unwrap()
}

fn solved_together(
    all: &[&Driven],
    same: &[[usize; 2]],
    stated: &CameraState,
) -> Result<JointLaserMap, JointError> {
    let half_degree = 0.5_f64.to_radians();
    let sigmas =
        SVector::from([half_degree, half_degree, half_degree, 0.01, 0.01, 0.01, 3.0, 1e-3, 1e-3, 1e-6]);
    let camera = CameraStated { camera: *stated, sigmas: Some(sigmas) };
    let params = JointParams { border_sigma_px: 0.0, ..JointParams::default() };
    let drives: Vec<LaserDrive<'_>> = all.iter().map(|driven| driven.drive()).collect();
    LaserDrives { drives: &drives, same }.joint_map(
        camera,
        (&params, &FuseParams::default()),
        Datum::FirstPose,
    )
}

#[test]
fn one_drive_places_posters_and_corrects_camera_and_odometry() {
    let stated = camera();
    let turn = UnitQuaternion::from_euler_angles(0.004, -0.006, 0.008);
    let real = CameraState {
        robot_from_camera: Isometry3::from_parts(
            stated.robot_from_camera.translation,
            turn * stated.robot_from_camera.rotation,
        ),
        ..stated
    };
    let driven = driven(&real, 1);
    let made = solved(&driven, &stated);
    let start = path()[0];
    let mut chi2 = 0.0;
    for (object, poster) in made.objects.iter().zip(posters()) {
        let MappedObject { place, agreement } = object.as_ref().unwrap();
        let truth = start.inverse().apply(&Point2::from(poster.centre.xy()));
        let off = Point2::new(place.x_m, place.y_m) - truth;
        let covariance = place.covariance.fixed_view::<2, 2>(0, 0).into_owned();
        chi2 += off.dot(&covariance.cholesky().unwrap().solve(&off));
        assert!(off.norm() < 0.04 && covariance.trace().sqrt() < 0.08, "{off} {covariance}");
        assert!((place.size.width_m / SIZE.width_m - 1.0).abs() < 0.015, "{:?}", place.size);
        assert!((place.size.height_m / SIZE.height_m - 1.0).abs() < 0.015, "{:?}", place.size);
        assert!(*agreement > 0.9);
    }
    // 99.9 % of chi2 with 14 degrees of freedom.
    assert!(chi2 < 36.1, "{chi2}");
    let turn_rad = |camera: &CameraState| camera.minus(&real).fixed_rows::<3>(0).norm();
    assert!(turn_rad(&stated) > 0.01 && turn_rad(&made.camera) < 0.001, "{:?}", made.camera);
    assert!((made.odometry[0].scale - (1.0 / 0.98 - 1.0)).abs() < 0.006, "{:?}", made.odometry);
    // The far wall, which odometry and scans alone put nearer.
    let far_m = |walls: &[LaserSegment]| {
        let ends = walls.iter().filter(|wall| wall.facing().x < -0.9 && wall.length_m() > 1.0);
        ends.map(|wall| wall.a.x).fold(f64::NEG_INFINITY, f64::max)
    };
    let off_m = |walls: &[LaserSegment]| (far_m(walls) - 23.0).abs();
    let walls: Vec<LaserSegment> = made.walls.iter().map(|wall| wall.segment.clone()).collect();
    assert!(off_m(&walls) < 0.05, "{} {}", far_m(&walls), far_m(&driven.map.walls));
    assert!(off_m(&walls) < 0.5 * off_m(&driven.map.walls), "{}", far_m(&driven.map.walls));
}

#[test]
fn frames_and_scans_of_one_time_are_one_keyframe_and_strays_are_refused() {
    let mut driven = driven(&camera(), 2);
    let (keys, frames) = (driven.map.keys.len(), driven.frames.len());
    let key_ns = |key: &MapKey| driven.scans_ns[key.scan];
    let both =
        driven.map.keys.iter().filter(|key| driven.frames.iter().any(|f| f.captured_ns == key_ns(key)));
    let both = both.count();
    assert!(both > 0);
    let stated = CameraStated { camera: camera(), sigmas: None };
    let made = driven.drive().survey(stated, &FuseParams::default()).unwrap();
    assert_eq!(made.keyframes.len(), keys + frames - both);
    assert!(made.pieces.iter().all(|p| p.along_m[1] - p.along_m[0] < 7.001));
    driven.objects[0].views[0].keyframe = frames;
    let refused = driven.drive().survey(stated, &FuseParams::default()).unwrap_err();
    assert_eq!(refused.to_string(), format!("frame of laser map {frames} is out of range"));
    driven.scans_ns.truncate(3);
    let refused = driven.drive().survey(stated, &FuseParams::default()).unwrap_err();
    assert!(refused.to_string().starts_with("scan of laser map"), "{refused}");
}

#[test]
fn lines_of_cupboards_do_not_pull_the_walls_behind_them() {
    let mut driven = driven(&camera(), 1);
    // A third of the keyframes sees something 12 cm before the left wall.
    for key in driven.map.keys.iter_mut().step_by(3) {
        for line in &mut key.lines {
            let [a, b] = [line.a, line.b].map(|end| end + line.facing() * 0.12);
            let is_left = key.pose.pose.theta_rad.cos() * line.facing().y < -0.9;
            if is_left {
                *line = LaserSegment::about_middle(a, b, &line.covariance_about_middle()).unwrap();
            }
        }
    }
    let made = solved(&driven, &camera());
    let start = path()[0];
    for (object, poster) in made.objects.iter().zip(posters()) {
        let MappedObject { place, .. } = object.as_ref().unwrap();
        let truth = start.inverse().apply(&Point2::from(poster.centre.xy()));
        let off = Point2::new(place.x_m, place.y_m) - truth;
        assert!(off.norm() < 0.04, "{off}");
    }
}

#[test]
fn drives_from_both_ends_make_one_map() {
    let [first, second] = [driven(&camera(), 1), driven_along(&path_from_the_far_end(), &camera(), 5)];
    let count = posters().len();
    // The second drive names poster 4 as poster 0, and poster 0 not at all.
    let mut same: Vec<[usize; 2]> = (1..count).map(|i| [i, count + i]).collect();
    same[3] = [0, count + 4];
    let made = solved_together(&[&first, &second], &same, &camera()).unwrap();
    let right: Vec<[usize; 2]> = same.iter().copied().filter(|[a, b]| a + count == *b).collect();
    assert_eq!(made.same, right, "the wrong identity is dropped, the others stay");
    assert_eq!(made.frames.len(), first.frames.len() + second.frames.len());
    assert_eq!(made.path.len(), 2 * path().len());
    for (number, object) in made.objects.iter().enumerate() {
        let MappedObject { place, .. } = object.as_ref().unwrap();
        let poster = &posters()[number % count];
        let truth = first.start.inverse().apply(&Point2::from(poster.centre.xy()));
        let off = Point2::new(place.x_m, place.y_m) - truth;
        assert!(off.norm() < 0.05, "{number}: {off}");
    }
    // The walls of the second are those of the first: as long in all as from one drive.
    let length_m = |map: &JointLaserMap| map.walls.iter().map(|wall| wall.segment.length_m()).sum::<f64>();
    let alone = solved(&first, &camera());
    let (both_m, one_m) = (length_m(&made), length_m(&alone));
    assert!(both_m > 0.95 * one_m && both_m < 1.1 * one_m, "{both_m} {one_m}");
    // The last pose of the second drive, at the far end.
    let last = first.start.compose(&made.path[made.path.len() - 1]);
    let truth = path_from_the_far_end()[path().len() - 1];
    assert!((last.position() - truth.position()).norm() < 0.06, "{last:?} {truth:?}");
    let sigma = |map: &JointLaserMap, object: usize| {
        let place = map.objects[object].as_ref().unwrap().place;
        (place.covariance[(0, 0)] + place.covariance[(1, 1)]).sqrt()
    };
    assert!(sigma(&made, 6) < sigma(&alone, 6), "{} {}", sigma(&made, 6), sigma(&alone, 6));
}

#[test]
fn a_drive_that_shares_too_little_is_refused() {
    let [first, second] = [driven(&camera(), 1), driven_along(&path_from_the_far_end(), &camera(), 5)];
    let count = posters().len();
    for (same, common) in [(&[][..], 0), (&[[2, count + 2]][..], 1)] {
        let refused = solved_together(&[&first, &second], same, &camera()).unwrap_err();
        assert_eq!(refused, JointError::Apart { drive: 2, common });
    }
}
