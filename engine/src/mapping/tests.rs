//! Mappings without any transport.

use super::*;
use map::{
    laser::Scan,
    slam::{Slam, SlamParams},
};
use sim::{building::Building, drive::DriveParams, laser::LaserParams, odometry::OdometryParams};
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
    mappings.begin(&name("hall"), &name("r1"), origin).unwrap();
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
    let (finishing, walls) = mappings.finish("hall").unwrap();
    assert_eq!(finishing.stage, MappingStage::Finishing);
    let walls = walls.await.unwrap().unwrap();
    let expected: Vec<_> = slam.finish().unwrap().walls;
    assert_eq!(walls.len(), expected.len());
    for (got, wall) in walls.iter().zip(&expected) {
        let off = (got.a - origin.apply(&wall.a)).norm() + (got.b - origin.apply(&wall.b)).norm();
        assert!(off < 1e-11, "{off}");
        let (was, is) = (wall.covariance_about_middle(), got.covariance_about_middle());
        assert!(was[(1, 1)] > 0.0 && (was - is).norm() < 1e-9 * (1.0 + was.norm()), "{was} {is}");
    }
    mappings.hold("hall", Ok(walls.clone()));
    let held = mappings.progress("hall").unwrap();
    assert_eq!((held.stage, held.segments), (MappingStage::Found, Some(walls.len())));
    assert_eq!(mappings.held("hall").as_ref(), Some(&walls));
    assert_eq!(mappings.begin(&name("hall"), &name("r1"), origin), Err(MappingError::AlreadyMapping));
    let (_, again) = mappings.finish("hall").unwrap();
    assert_eq!(again.await.unwrap().unwrap(), walls);
    assert_eq!(mappings.held("hall"), None);
    mappings.stored("hall", Ok(walls.len()));
    assert_eq!(mappings.progress("hall").unwrap().stage, MappingStage::Done);
    assert_eq!(mappings.finish("hall").unwrap_err(), MappingError::None);
    mappings.begin(&name("hall"), &name("r1"), origin).unwrap();
    // Late word of the one before.
    mappings.hold("hall", Err("the mapping was given up".into()));
    assert_eq!(mappings.progress("hall").unwrap().stage, MappingStage::Mapping);
}

#[test]
fn mappings_are_bounded_and_one_robot_makes_one_map() {
    let mappings = MappingSessions::default();
    let begin = |map: usize, robot: &str| {
        mappings.begin(&name(&format!("m{map}")), &name(robot), Pose2::default()).map(|p| p.stage)
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
        mappings.begin(&name(&map), &name("r1"), Pose2::default()).unwrap();
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
    mappings.begin(&name("hall"), &name("r1"), Pose2::default()).unwrap();
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
    mappings.begin(&name("hall"), &name("r1"), origin).unwrap();
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
    let walls = mappings.finish("hall").unwrap().1.await.unwrap().unwrap();
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
    mappings.begin(&name("hall"), &name("r1"), Pose2::default()).unwrap();
    let seen = scan(&building, &Pose2::new(3.0, 0.0, 0.0), 1);
    mappings.offer(&name("r1"), job("hall", 1, Pose2::default(), seen));
    wait(|| mappings.progress("hall").unwrap().scans == 1);
    assert!(mappings.progress("hall").unwrap().journal_error.is_some(), "and the mapping continues");
    let folder = dir.path().join("mapping");
    let mappings = MappingSessions::default();
    mappings.resume_in(folder.clone(), |_, _| true);
    mappings.begin(&name("hall"), &name("r1"), Pose2::default()).unwrap();
    mappings.begin(&name("house"), &name("r2"), Pose2::default()).unwrap();
    let files = || std::fs::read_dir(&folder).unwrap().count();
    assert!(files() == 2 && mappings.cancel("hall") && files() == 1);
    let again = MappingSessions::default();
    again.resume_in(folder.clone(), |_, robot| robot.as_str() != "r2");
    assert!(again.progress("house").is_none() && files() == 0, "its robot is on another map");
}
