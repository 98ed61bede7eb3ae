//! Mappings without any transport.

use super::*;
use map::{
    extrinsics::CameraExtrinsics,
    laser::Scan,
    slam::{Slam, SlamParams},
};
use protos::convert::frame::{EncodedImage, Encoding, Pixels};
use sim::{
    building::Building,
    drive::DriveParams,
    laser::LaserParams,
    odometry::OdometryParams,
    robot::{Robot, RobotParams},
};
use std::time::{Duration, Instant};

fn name(text: &str) -> Name {
    Name::new(text).unwrap()
}

fn scan(building: &Building, at: &Pose2, seed: u64) -> Scan {
    sim::laser::scan(building, at, &LaserParams::default(), seed)
}

fn job(map: &str, epoch: u64, odom_from_robot: Pose2, scan: Scan) -> ScanJob {
    ScanJob { map: map.into(), epoch, captured_ns: 0, odom_from_robot, scan }
}

fn wait(mut ready: impl FnMut() -> bool) {
    let started = Instant::now();
    while !ready() {
        assert!(started.elapsed() < Duration::from_secs(20));
        std::thread::sleep(Duration::from_millis(2));
    }
}

#[tokio::test]
async fn scans_become_the_walls_that_mapping_them_gives() {
    let building = Arc::new(Building::corridor(7));
    let drive = DriveParams { odometry: OdometryParams::default(), ..DriveParams::default() };
    let steps: Vec<_> = sim::drive::Drive::new(building.clone(), &drive).step_by(3).take(60).collect();
    let (mappings, mut slam) = (MappingSessions::default(), Slam::new(SlamParams::default()));
    let origin = Pose2::new(3.0, 1.0, 0.5);
    mappings.begin(&name("hall"), &name("r1"), (Some(origin), false)).unwrap();
    for (i, step) in steps.iter().enumerate() {
        let seen = scan(&building, &step.map_from_robot, i as u64);
        slam.add(&step.odom_from_robot, &seen).unwrap();
        assert!(mappings.offer(&name("r1"), job("hall", 1, step.odom_from_robot, seen)).is_none());
        wait(|| mappings.progress("hall").unwrap().scans == i as u64 + 1);
    }
    let other = scan(&building, &Pose2::new(3.0, 0.0, 0.0), 1);
    assert!(mappings.offer(&name("r2"), job("hall", 1, Pose2::default(), other.clone())).is_some());
    assert!(mappings.offer(&name("r1"), job("hall", 2, Pose2::default(), other)).is_none());
    let so_far = mappings.progress("hall").unwrap();
    assert_eq!((so_far.stage, so_far.scans, so_far.dropped), (MappingStage::Mapping, 60, 1));
    assert!(so_far.distance_m > 10.0 && so_far.pose.is_some());
    let (finishing, made) = mappings.finish("hall").unwrap();
    assert_eq!(finishing.stage, MappingStage::Finishing);
    let made = made.await.unwrap().unwrap();
    let walls = made.walls.clone();
    assert!(made.survey.is_none());
    let expected: Vec<_> = slam.finish().unwrap().walls;
    assert_eq!(walls.len(), expected.len());
    for (got, wall) in walls.iter().zip(&expected) {
        let off = (got.a - origin.apply(&wall.a)).norm() + (got.b - origin.apply(&wall.b)).norm();
        assert!(off < 1e-11, "{off}");
        let (was, is) = (wall.covariance_about_middle(), got.covariance_about_middle());
        assert!(was[(1, 1)] > 0.0 && (was - is).norm() < 1e-9 * (1.0 + was.norm()), "{was} {is}");
    }
    mappings.hold("hall", Ok(made));
    let held = mappings.progress("hall").unwrap();
    assert_eq!((held.stage, held.segments), (MappingStage::Found, Some(walls.len())));
    assert_eq!(mappings.held("hall").as_ref(), Some(&walls));
    assert_eq!(
        mappings.begin(&name("hall"), &name("r1"), (Some(origin), false)),
        Err(MappingError::AlreadyMapping)
    );
    let (_, again) = mappings.finish("hall").unwrap();
    assert_eq!(again.await.unwrap().unwrap().walls, walls);
    assert_eq!(mappings.held("hall"), None);
    mappings.stored("hall", Ok(walls.len()));
    assert_eq!(mappings.progress("hall").unwrap().stage, MappingStage::Done);
    assert_eq!(mappings.finish("hall").unwrap_err(), MappingError::None);
    mappings.begin(&name("hall"), &name("r1"), (Some(origin), false)).unwrap();
    // Late word of the one before.
    mappings.hold("hall", Err("the mapping was given up".into()));
    assert_eq!(mappings.progress("hall").unwrap().stage, MappingStage::Mapping);
}

#[test]
fn mappings_are_bounded_and_one_robot_makes_one_map() {
    let mappings = MappingSessions::default();
    let begin = |map: usize, robot: &str| {
        mappings.begin(&name(&format!("m{map}")), &name(robot), (None, false)).map(|p| p.stage)
    };
    for i in 0..MAX_MAPPINGS {
        assert_eq!(begin(i, &format!("r{i}")), Ok(MappingStage::Mapping));
    }
    assert_eq!(begin(0, "other"), Err(MappingError::AlreadyMapping));
    assert_eq!(begin(9, "r0"), Err(MappingError::Busy));
    assert_eq!(begin(9, "other"), Err(MappingError::TooMany));
    assert!(mappings.cancel("m0") && !mappings.cancel("m0"));
    assert_eq!((begin(9, "r0"), mappings.progress("m0")), (Ok(MappingStage::Mapping), None));
}

#[test]
fn old_mappings_are_forgotten_at_the_bound() {
    let mappings = MappingSessions::default();
    for i in 0..=MAX_SESSIONS {
        let map = format!("m{i:03}");
        mappings.begin(&name(&map), &name("r1"), (None, false)).unwrap();
        mappings.stored(&map, Err("planted".into()));
    }
    assert_eq!(mappings.progress("m000"), None);
    let oldest = mappings.progress("m001").unwrap();
    assert_eq!((oldest.stage, oldest.reason.as_deref()), (MappingStage::Failed, Some("planted")));
}

#[test]
fn what_the_queue_does_not_hold_is_dropped_and_counted() {
    let mappings = MappingSessions::default();
    let building = Building::corridor(7);
    mappings.begin(&name("hall"), &name("r1"), (None, false)).unwrap();
    let sent = 4 * QUEUE as u64;
    for i in 0..sent {
        let at = Pose2::new(2.0 + 0.02 * i as f64, 0.0, 0.0);
        mappings.offer(&name("r1"), job("hall", 1, at, scan(&building, &at, 1)));
    }
    wait(|| {
        let p = mappings.progress("hall").unwrap();
        p.scans + p.dropped == sent
    });
}

fn steps_of(building: &Arc<Building>) -> Vec<sim::drive::Step> {
    let drive = DriveParams { odometry: OdometryParams::default(), ..DriveParams::default() };
    sim::drive::Drive::new(building.clone(), &drive).step_by(3).take(40).collect()
}

#[tokio::test]
async fn a_mapping_resumes_after_a_restart_as_if_there_had_been_none() {
    let (building, dir) = (Arc::new(Building::corridor(7)), tempfile::tempdir().unwrap());
    let (mut slam, origin) = (Slam::new(SlamParams::default()), Pose2::new(3.0, 1.0, 0.5));
    let mut mappings = MappingSessions::default();
    mappings.resume_in(dir.path().join("mapping"), |_, _| true);
    mappings.begin(&name("hall"), &name("r1"), (Some(origin), false)).unwrap();
    for (i, step) in steps_of(&building).iter().enumerate() {
        if i == 25 {
            mappings = MappingSessions::default();
            mappings.resume_in(dir.path().join("mapping"), |map, robot| {
                (map.as_str(), robot.as_str()) == ("hall", "r1")
            });
        }
        let seen = scan(&building, &step.map_from_robot, i as u64);
        slam.add(&step.odom_from_robot, &seen).unwrap();
        assert!(mappings.offer(&name("r1"), job("hall", 5, step.odom_from_robot, seen)).is_none());
        wait(|| mappings.progress("hall").unwrap().scans == i as u64 + 1);
    }
    let other = scan(&building, &Pose2::new(3.0, 0.0, 0.0), 1);
    mappings.offer(&name("r1"), job("hall", 6, Pose2::default(), other));
    let so_far = mappings.progress("hall").unwrap();
    assert_eq!(
        (so_far.stage, so_far.dropped, so_far.journal_error),
        (MappingStage::Mapping, 1, None),
        "its epoch is that of the journal"
    );
    let walls = mappings.finish("hall").unwrap().1.await.unwrap().unwrap().walls;
    let expected = slam.finish().unwrap().walls;
    assert_eq!(walls.len(), expected.len());
    for (got, wall) in walls.iter().zip(&expected) {
        let off = (got.a - origin.apply(&wall.a)).norm() + (got.b - origin.apply(&wall.b)).norm();
        assert!(off < 1e-9, "{off}");
    }
    mappings.stored("hall", Ok(walls.len()));
    let again = MappingSessions::default();
    again.resume_in(dir.path().join("mapping"), |_, _| true);
    assert_eq!(again.progress("hall"), None, "a stored mapping does not resume");
}

#[test]
fn a_journal_error_is_reported_and_a_cancelled_journal_is_removed() {
    let (building, dir) = (Building::corridor(7), tempfile::tempdir().unwrap());
    let file = dir.path().join("file");
    std::fs::write(&file, "not a folder").unwrap();
    let mappings = MappingSessions::default();
    mappings.resume_in(file, |_, _| true);
    mappings.begin(&name("hall"), &name("r1"), (None, false)).unwrap();
    let seen = scan(&building, &Pose2::new(3.0, 0.0, 0.0), 1);
    mappings.offer(&name("r1"), job("hall", 1, Pose2::default(), seen));
    wait(|| mappings.progress("hall").unwrap().scans == 1);
    assert!(mappings.progress("hall").unwrap().journal_error.is_some(), "and the mapping continues");
    let folder = dir.path().join("mapping");
    let mappings = MappingSessions::default();
    mappings.resume_in(folder.clone(), |_, _| true);
    mappings.begin(&name("hall"), &name("r1"), (None, false)).unwrap();
    mappings.begin(&name("house"), &name("r2"), (None, false)).unwrap();
    let files = || std::fs::read_dir(&folder).unwrap().count();
    assert!(files() == 2 && mappings.cancel("hall") && files() == 1);
    let again = MappingSessions::default();
    again.resume_in(folder.clone(), |_, robot| robot.as_str() != "r2");
    assert!(again.progress("house").is_none() && files() == 0, "its robot is on another map");
}

/// Offers a frame of the robot's camera.
fn offer_frame(mappings: &MappingSessions, frame: &CheckedFrame) {
    mappings.offer_frame((&name("r1"), &name("front")), "hall", frame);
}

#[test]
fn frames_that_wait_are_bounded_and_what_is_dropped_is_counted() {
    let (mappings, building) = (MappingSessions::default(), Arc::new(Building::corridor(7)));
    mappings.begin(&name("hall"), &name("r1"), (None, true)).unwrap();
    let mut robot = Robot::new(building.clone(), &RobotParams::default());
    let camera = *robot.camera().intrinsics();
    let sent = CheckedFrame { mounting: None, ..frame(&robot.next().unwrap(), &camera) };
    // Scans keep the thread at work while frames come.
    for i in 0..QUEUE / 2 {
        let at = Pose2::new(2.0 + 0.02 * i as f64, 0.0, 0.0);
        mappings.offer(&name("r1"), job("hall", 5, at, scan(&building, &at, 1)));
    }
    let count = 20 * FRAMES_WAITING as u64;
    (0..count).for_each(|_| offer_frame(&mappings, &sent));
    let told = || {
        let progress = mappings.progress("hall").unwrap();
        (progress.frames_refused.map_or(0, |(count, _)| count), progress.frames_dropped)
    };
    wait(|| told().0 + told().1 == count);
    // Without a bound of their own the queue would hold half of them.
    assert!(told().1 >= count - 3 * FRAMES_WAITING as u64, "{:?}", told());
}

/// What a robot sends of its frames.
fn frame(readings: &sim::robot::SensorReadings, camera: &vision::frame::Intrinsics) -> CheckedFrame {
    let image = &readings.frame.image;
    let bytes = crate::picture::png(image.width(), image.height(), image.data()).unwrap();
    CheckedFrame {
        epoch: 5,
        seq: readings.step.index,
        captured_ns: (readings.step.time_s * 1e9) as i64,
        width_px: image.width() as u32,
        height_px: image.height() as u32,
        pixels: Pixels::Image(EncodedImage { encoding: Encoding::Png, bytes: bytes.into() }),
        intrinsics: Some(*camera),
        mounting: Some(CameraExtrinsics::new(readings.step.robot_from_camera).unwrap()),
        odometry: None,
        prior: None,
        deadline_ms: None,
        map: None,
    }
}

#[tokio::test]
async fn frames_of_a_drive_give_landmarks_also_after_a_restart() {
    let (building, dir) = (Arc::new(Building::corridor(7)), tempfile::tempdir().unwrap());
    let journals = || dir.path().join("mapping");
    let drive = DriveParams { rate_hz: 2.0, ..DriveParams::default() };
    let robot = Robot::new(building.clone(), &RobotParams { drive, ..RobotParams::default() });
    let camera = *robot.camera().intrinsics();
    let origin = robot.clone().next().unwrap().step.map_from_robot;
    let mut mappings = MappingSessions::default();
    mappings.resume_in(journals(), |_, _| true);
    mappings.begin(&name("hall"), &name("r1"), (Some(origin), true)).unwrap();
    for (scans, readings) in (1_u64..).zip(robot) {
        if scans == 31 {
            mappings = MappingSessions::default();
            mappings.resume_in(journals(), |_, _| true);
            wait(|| mappings.progress("hall").unwrap().stage == MappingStage::Mapping);
            assert!(mappings.progress("hall").unwrap().frames > Some(10), "frames are in the journal");
        }
        let step = &readings.step;
        let captured_ns = (step.time_s * 1e9) as i64;
        let job = ScanJob { captured_ns, ..job("hall", 5, step.odom_from_robot, readings.scan.clone()) };
        assert!(mappings.offer(&name("r1"), job).is_none());
        let mut sent = frame(&readings, &camera);
        offer_frame(&mappings, &sent);
        (sent.epoch, sent.mounting) = (6, None);
        offer_frame(&mappings, &sent);
        if step.index == 3 {
            sent.epoch = 5;
            offer_frame(&mappings, &sent);
        }
        wait(|| mappings.progress("hall").unwrap().scans == scans);
    }
    let progress = mappings.progress("hall").unwrap();
    assert!(progress.frames.is_some_and(|frames| frames > 40), "{progress:?}");
    let made = mappings.finish("hall").unwrap().1.await.unwrap().unwrap();
    let survey = made.survey.unwrap();
    let found: Vec<_> = survey.building.objects.iter().filter(|object| object.refused.is_none()).collect();
    assert_eq!(mappings.progress("hall").unwrap().landmarks, Some(found.len()));
    let left_out = mappings.progress("hall").unwrap().left_out;
    assert_eq!(left_out.len(), survey.building.objects.len() - found.len());
    assert!(left_out.iter().all(|object| !object.reason.is_empty()), "{left_out:?}");
    assert!(found.len() >= 3 && !made.walls.is_empty(), "{}", found.len());
    for object in found {
        // What hangs there: in the frame of the building, since the origin was told.
        let at = object.place.map_from_landmark().translation.vector;
        let off =
            |truth: &sim::building::LandmarkTruth| (truth.map_from_landmark.translation.vector - at).norm();
        let nearest = building.landmarks().iter().map(off).fold(f64::INFINITY, f64::min);
        assert!(nearest < 0.2, "{nearest} m: {:?}", object.place);
    }
    mappings.proposed("hall", Ok(Some(7)));
    assert_eq!(mappings.progress("hall").unwrap().gathering, Some(7));
    mappings.proposed("hall", Err("the disk is full".into()));
    assert!(mappings.progress("hall").unwrap().reason.unwrap().contains("disk is full"));
}
