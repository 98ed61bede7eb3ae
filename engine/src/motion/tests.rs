//! Odometry, scans and fixes of one robot, without any transport.

use super::*;
use crate::{observers::live::LiveHub, snapshot::MapSnapshot};
use map::{
    guided::FramePlan,
    laser_fix::WallIndex,
    localise::{AmbiguityResolvedBy, Fix, FixResult, FixSource},
    map_links::MapLink,
    pose2::{Pose2, Pose2Covariance},
};
use nalgebra::Matrix3;
use protos::prost::Message;
use sim::{
    building::{Building, WallSegment},
    laser::LaserParams,
};
use std::sync::LazyLock;
use vision::model::LandmarkId;

mod by_hand;
mod guided;
mod recordings;
mod simulated_time;
mod stamps;

/// A time of the server's clock.
fn time(seconds: f64) -> Instant {
    static START: LazyLock<Instant> = LazyLock::new(Instant::now);
    *START + Duration::from_secs_f64(seconds)
}

impl MotionTracker {
    /// Odometry that is received as it is captured: number 1 at 1 s.
    fn odometry_of(&self, robot: &Name, message: Bytes) -> Option<v1::RobotPose> {
        let seq = v1::Odometry::decode(message.clone()).map_or(0, |o| o.seq);
        self.odometry(robot, message, time(seq as f64))
    }

    /// The same of a scan.
    fn scan_of(&self, robot: &Name, message: Bytes) {
        let seq = v1::Scan::decode(message.clone()).map_or(0, |s| s.seq);
        self.scan(robot, message, time(seq as f64));
    }
}

fn motion() -> (MotionTracker, Name) {
    let (motion, r1, _) = watched();
    (motion, r1)
}

/// The same with what pages are told.
fn watched() -> (MotionTracker, Name, Arc<LiveHub>) {
    let (snapshots, live) = (Arc::new(Snapshots::default()), Arc::new(LiveHub::default()));
    snapshots.set_robot("r1", Some("hall"));
    (MotionTracker::new(snapshots, live.clone()), Name::new("r1").unwrap(), live)
}

fn odometry(seq: u64, x_m: f64) -> Bytes {
    let odom_from_robot = Some(v1::Pose2 { x_m, ..v1::Pose2::default() });
    v1::Odometry {
        epoch: 1,
        seq,
        captured_ns: seq as i64 * 1_000_000_000,
        odom_from_robot,
        ..v1::Odometry::default()
    }
    .encode_to_vec()
    .into()
}

fn fix(x_m: f64) -> Fix {
    Fix {
        modality: FixSource::Landmarks,
        pose: Pose2Covariance { pose: Pose2::new(x_m, 1.0, 0.0), covariance: Matrix3::identity() * 1e-4 },
        noise: Matrix3::identity() * 1e-4,
        nuisances: Vec::new(),
        landmarks: Vec::new(),
        decided_by: AmbiguityResolvedBy::Single,
        chi2: 1.0,
        dof: 5,
    }
}

#[test]
fn odometry_is_checked_and_counted() {
    let (motion, r1) = motion();
    motion.odometry_of(&r1, odometry(1, 0.0));
    motion.odometry_of(&r1, odometry(1, 0.0));
    motion.odometry_of(&r1, odometry(2, f64::NAN));
    motion.odometry_of(&r1, Bytes::from_static(b"\xff"));
    motion.odometry_of(&r1, vec![0; MAX_ODOMETRY_BYTES + 1].into());
    motion.odometry_of(&Name::new("nobody").unwrap(), odometry(1, 0.0));
    let (odometry, scans) = motion.counts();
    let each = [Code::BadMessage, Code::NotFinite, Code::TooLarge, Code::UnknownRobot, Code::NotNewer];
    assert_eq!((odometry.accepted, scans.accepted), (1, 0));
    assert_eq!(odometry.rejected, BTreeMap::from(each.map(|code| (code, 1))));
}

#[test]
fn scans_are_checked_and_counted() {
    let (motion, r1, live) = watched();
    let scan = v1::Scan {
        epoch: 1,
        seq: 1,
        odom_from_robot: Some(v1::Pose2::default()),
        robot_from_laser: Some(v1::Pose2::default()),
        bearing_step_rad: 1e-4,
        max_range_m: 30.0,
        ranges_m: vec![1.0; map::laser::MAX_BEAMS],
        ..v1::Scan::default()
    };
    motion.scan_of(&r1, scan.encode_to_vec().into());
    motion.scan_of(&r1, v1::Scan { max_range_m: -1.0, ..scan }.encode_to_vec().into());
    let (_, scans) = motion.counts();
    assert_eq!((scans.accepted, scans.rejected), (1, BTreeMap::from([(Code::OutOfRange, 1)])));
    // What is not answered is told by the robot's page.
    let told = live.activity(&r1, time(2.0)).unwrap().inputs;
    let scans = told.iter().find(|told| told.input == Input::Scan).unwrap();
    assert_eq!((scans.used, scans.refused, scans.reasons[0].code.as_str()), (1, 1, "out_of_range"));
}

fn front() -> Name {
    Name::new("front").unwrap()
}

impl MotionTracker {
    /// A frame whose landmarks, named without the pose, give this fix.
    fn apply_fix(&self, robot: &Name, at: FrameStamp<'_>, fix: &Fix) -> Option<v1::RobotPose> {
        let prior = self.prior_pose(robot, &front(), at).map(|prior| prior.pose);
        let independent = FixResult::Fixed(Box::new(fix.clone()));
        let (independent, chosen) = (Some(&independent), Some(fix));
        let fixes = FrameFixes { prior: prior.as_ref(), independent, chosen, ..FrameFixes::default() };
        self.apply_frame(robot, &front(), at, &fixes)
    }
}

fn at(captured_ns: i64, x_m: f64) -> FrameStamp<'static> {
    let now = time(captured_ns as f64 * 1e-9);
    FrameStamp { map: "hall", epoch: 1, captured_ns, odometry: Some(Pose2::new(x_m, 0.0, 0.0)), now }
}

#[test]
fn a_fix_puts_odometry_on_the_map() {
    let (motion, r1, live) = watched();
    assert!(motion.odometry_of(&r1, odometry(1, 3.0)).is_none(), "no pose before the first fix");
    assert!(live.trajectories(&r1).is_none());
    let pose = motion.apply_fix(&r1, at(1_000_000_000, 3.0), &fix(10.0)).unwrap();
    assert_eq!((pose.corrections, pose.map.as_str(), pose.epoch), (1, "hall", 1));
    let pose = motion.odometry_of(&r1, odometry(2, 4.0)).unwrap().map_from_robot.unwrap();
    assert!((pose.pose.unwrap().x_m - 11.0).abs() < 1e-9, "{pose:?}");
    assert!(pose.covariance[0] > 1e-4, "driving increases the covariance");
    let trajectories = live.trajectories(&r1).unwrap();
    assert!((trajectories.odometry[0].x_m - 11.0).abs() < 1e-9);
    assert_eq!((trajectories.odometry.len(), trajectories.pose.len()), (1, 2));
}

#[test]
fn a_prior_follows_from_odometry_alone() {
    let (motion, r1) = motion();
    assert!(motion.prior_pose(&r1, &front(), at(1_000_000_000, 3.0)).is_none());
    motion.apply_fix(&r1, at(1_000_000_000, 3.0), &fix(10.0)).unwrap();
    let prior = motion.prior_pose(&r1, &front(), at(1_500_000_000, 3.5)).unwrap().pose;
    assert!((prior.pose.x_m - 10.5).abs() < 1e-9);
    let anew = FrameStamp { epoch: 2, ..at(1_600_000_000, 0.0) };
    assert!(motion.prior_pose(&r1, &front(), anew).is_none(), "a new epoch has its own odometry");
}

#[test]
fn another_map_resets_the_pose() {
    let (motion, r1) = motion();
    motion.apply_fix(&r1, at(1_000_000_000, 3.0), &fix(10.0)).unwrap();
    motion.snapshots.set_robot("r1", Some("cellar"));
    let there = FrameStamp { map: "cellar", ..at(2_000_000_000, 3.0) };
    assert!(motion.prior_pose(&r1, &front(), there).is_none());
    assert!(motion.pose(&r1, "hall", time(2.0)).is_none(), "the old pose is gone");
}

/// Such a frame must not reset the fusion to the map that it names.
#[test]
fn a_frame_against_another_map_leaves_the_fusion_alone() {
    let (motion, r1) = motion();
    motion.snapshots.publish(Arc::new(MapSnapshot::empty("cellar", 1)));
    motion.apply_fix(&r1, at(1_000_000_000, 3.0), &fix(10.0)).unwrap();
    let there = FrameStamp { map: "cellar", ..at(1_500_000_000, 3.0) };
    let plan = FramePlan { guided: true, global: None };
    let prior = PriorPose { pose: fix(0.0).pose, supporting_landmarks: Vec::new(), plan };
    assert!(motion.prior_pose(&r1, &front(), there).is_none());
    assert!(motion.apply_fix(&r1, there, &fix(0.0)).is_none());
    assert!(motion.start_from_hypothesis(&r1, there, &fix(0.0).pose, &[]).is_none());
    assert!(motion.update_landmark_health(&r1, there, &prior, &[], &[]).is_empty());
    let pose = motion.odometry_of(&r1, odometry(2, 4.0)).unwrap();
    assert_eq!((pose.map.as_str(), pose.corrections), ("hall", 1));
    assert!((pose.map_from_robot.unwrap().pose.unwrap().x_m - 11.0).abs() < 1e-9);
}

#[test]
fn a_pose_is_carried_over_to_a_linked_map() {
    let (motion, r1) = motion();
    // The floor above: its origin at (4, 3) of the hall, turned by a quarter.
    let hall_from_floor = Pose2Covariance {
        pose: Pose2::new(4.0, 3.0, std::f64::consts::FRAC_PI_2),
        covariance: Matrix3::identity() * 1e-2,
    };
    let link = MapLink { parent: "hall".to_owned(), parent_from_map: hall_from_floor, level_m: 3.5 };
    motion.snapshots.set_links([("floor".to_owned(), link)].into());
    let on = |map: &'static str| {
        motion.snapshots.set_robot("r1", Some(map));
        motion.prior_pose(&r1, &front(), FrameStamp { map, ..at(2_000_000_000, 5.0) })
    };
    motion.apply_fix(&r1, at(1_000_000_000, 3.0), &fix(10.0)).unwrap();
    motion.odometry_of(&r1, odometry(2, 5.0));
    // (12, 1) in the hall, looking along x.
    let there = on("floor").unwrap().pose;
    assert!((there.pose.x_m + 2.0).abs() < 1e-9 && (there.pose.y_m + 8.0).abs() < 1e-9, "{there:?}");
    assert!((there.pose.theta_rad + std::f64::consts::FRAC_PI_2).abs() < 1e-9);
    // Its covariance includes the link's: 10 cm, and 0.1 rad at 8 m.
    assert!(there.covariance[(0, 0)] > 0.5 && there.covariance[(0, 0)] < 1.0, "{}", there.covariance);
    let log = motion.corrections(&r1);
    assert_eq!(log.modalities, ["odometry"]);
    let published = motion.odometry_of(&r1, odometry(3, 5.1)).unwrap();
    assert_eq!((published.map.as_str(), published.trust()), ("floor", v1::PoseTrust::Unsupported));
    assert_eq!(log.corrections.last().map(|c| (c.modality, c.outcome)), Some(("map_change", "carried_over")));
    assert!(on("attic").is_none(), "it has no link");
    assert!(on("hall").is_none(), "and the pose is lost with it");
}

#[test]
fn without_odometry_the_fix_is_the_pose() {
    let (motion, r1) = motion();
    let still = FrameStamp { odometry: None, ..at(1_000_000_000, 0.0) };
    let pose = motion.apply_fix(&r1, still, &fix(10.0)).unwrap();
    assert_eq!(pose.modalities, ["landmarks"]);
    assert!((pose.map_from_robot.unwrap().pose.unwrap().x_m - 10.0).abs() < 1e-12);
}

/// The rendered corridor with its walls as the map `hall`, without any landmark.
fn walled() -> (MotionTracker, Name, Building) {
    let building = Building::corridor(7);
    let wall = |w: &WallSegment| {
        map::segments::LaserSegment::by_hand(&[w.a_m.x, w.a_m.y, w.b_m.x, w.b_m.y]).unwrap()
    };
    let walls: Vec<_> = building.walls().iter().map(wall).collect();
    let wall_index = Arc::new(WallIndex::new(&walls));
    let (motion, r1) = motion();
    motion.snapshots.publish(Arc::new(MapSnapshot {
        walls: Arc::new(walls),
        wall_index,
        ..MapSnapshot::empty("hall", 1)
    }));
    (motion, r1, building)
}

/// The scan of a robot at a pose; odometry is 5 m behind.
fn scan_at(building: &Building, seq: u64, at: &Pose2) -> Bytes {
    let scan = sim::laser::scan(building, at, &LaserParams::default(), seq);
    let mount = scan.robot_from_laser();
    v1::Scan {
        epoch: 1,
        seq,
        captured_ns: seq as i64 * 1_000_000_000,
        odom_from_robot: Some(v1::Pose2 { x_m: at.x_m - 5.0, y_m: at.y_m, theta_rad: at.theta_rad }),
        robot_from_laser: Some(v1::Pose2 { x_m: mount.x_m, y_m: mount.y_m, theta_rad: mount.theta_rad }),
        first_bearing_rad: scan.bearing_rad(0),
        bearing_step_rad: scan.bearing_step_rad(),
        max_range_m: scan.max_range_m(),
        ranges_m: scan.ranges_m().to_vec(),
        ..v1::Scan::default()
    }
    .encode_to_vec()
    .into()
}

fn matched(motion: &MotionTracker) -> Option<v1::RobotPose> {
    let (robot, job) = motion.scans().take().unwrap();
    motion.fix_by_scan(&robot, &job, time(job.captured_ns as f64 * 1e-9))
}

#[test]
fn scans_correct_a_pose_and_never_start_one() {
    let (motion, r1, building) = walled();
    motion.scan_of(&r1, scan_at(&building, 1, &Pose2::new(12.0, 0.1, 0.0)));
    assert!(matched(&motion).is_none());
    assert_eq!(motion.corrections(&r1).totals["laser"], [("no_pose", 1)].into());
    assert!(motion.corrections(&r1).modalities.is_empty());
    // Landmarks give a pose 8 cm too far to the left, with a large covariance.
    let pose = Pose2Covariance { pose: Pose2::new(12.0, 0.18, 0.0), covariance: Matrix3::identity() * 0.01 };
    let weak = Fix { pose, noise: pose.covariance, ..fix(0.0) };
    let first = FrameStamp { captured_ns: 1_000_000_000, odometry: None, ..at(0, 0.0) };
    let started = motion.apply_fix(&r1, first, &weak).unwrap();
    assert_eq!(started.modalities, ["odometry", "landmarks"]);
    motion.scan_of(&r1, scan_at(&building, 2, &Pose2::new(12.1, 0.1, 0.0)));
    motion.scan_of(&r1, scan_at(&building, 3, &Pose2::new(12.2, 0.1, 0.0)));
    let pose = matched(&motion).unwrap();
    assert_eq!((pose.laser_corrections, pose.corrections), (1, 1));
    assert_eq!(pose.modalities, ["odometry", "landmarks", "laser"]);
    let at = pose.map_from_robot.unwrap();
    let y_m = at.pose.unwrap().y_m;
    assert!((y_m - 0.1).abs() < 0.03 && at.covariance[4].sqrt() < 0.03, "{at:?}");
    // From the same place, another scan gives nothing new.
    motion.scan_of(&r1, scan_at(&building, 4, &Pose2::new(12.2, 0.1, 0.0)));
    assert!(matched(&motion).is_none());
    let log = motion.corrections(&r1);
    let ends = [("applied", 1), ("no_pose", 1), ("repeated", 1), ("superseded", 1)];
    assert_eq!(log.totals["laser"], ends.into());
    let words: Vec<_> = log.corrections.iter().map(|c| (c.modality, c.outcome)).collect();
    assert_eq!(words, [("landmarks", "started"), ("laser", "applied")]);
    let across_m = log.corrections[1].across_m.unwrap();
    assert!((across_m + 0.08).abs() < 0.03 && log.corrections[1].chi2.is_some(), "{log:?}");
}

#[test]
fn after_ten_metres_a_pose_rests_on_odometry_alone() {
    let (motion, r1, _) = walled();
    motion.odometry_of(&r1, odometry(1, 0.0));
    motion.apply_fix(&r1, FrameStamp { odometry: None, ..at(1_000_000_000, 0.0) }, &fix(3.0)).unwrap();
    let after = |seq, x_m| motion.odometry_of(&r1, odometry(seq, x_m)).unwrap().modalities;
    assert_eq!(after(2, 5.0), ["odometry", "landmarks"]);
    assert_eq!(after(3, RESTS_ON_M), ["odometry", "landmarks"]);
    assert_eq!(after(4, RESTS_ON_M + 0.01), ["odometry"]);
}

#[test]
fn scans_without_a_fix_are_counted_with_the_reason() {
    let (motion, r1, building) = walled();
    motion.apply_fix(&r1, at(1_000_000_000, 7.0), &fix(12.0)).unwrap();
    let counted = || motion.corrections(&r1).totals["laser"].clone();
    // A scan of another place.
    motion.scan_of(&r1, scan_at(&building, 2, &Pose2::new(1.0, 1.0, 2.0)));
    assert!(matched(&motion).is_none());
    assert_eq!(counted().values().sum::<u64>(), 1, "{:?}", counted());
    assert!(!counted().contains_key("applied"));
    motion.snapshots.publish(Arc::new(MapSnapshot::empty("hall", 2)));
    motion.scan_of(&r1, scan_at(&building, 3, &Pose2::new(12.0, 1.0, 0.0)));
    assert!(matched(&motion).is_none());
    assert_eq!(counted()["no_walls"], 1);
}

#[test]
fn an_epoch_that_is_over_changes_nothing() {
    let (motion, r1) = motion();
    motion.epochs().admit(&r1, 1, time(1.0)).unwrap();
    motion.apply_fix(&r1, at(1_000_000_000, 3.0), &fix(10.0)).unwrap();
    motion.epochs().token(&r1, (1, true), time(1.1), |_| true);
    motion.epochs().token(&r1, (1, false), time(1.2), |_| true);
    motion.epochs().admit(&r1, 2, time(1.3)).unwrap();
    let anew = FrameStamp { epoch: 2, ..at(2_000_000_000, 0.0) };
    motion.apply_fix(&r1, anew, &fix(20.0)).unwrap();
    // A frame of the first epoch that was still in work.
    assert!(motion.apply_fix(&r1, at(3_000_000_000, 4.0), &fix(11.0)).is_none());
    assert!((motion.pose(&r1, "hall", time(2.0)).unwrap().pose.x_m - 20.0).abs() < 1e-9);
}

/// One message of another epoch must not reset the fusion, nor get the robot's own messages
/// refused.
#[test]
fn a_forged_message_leaves_the_robot_alone() {
    let (motion, r1) = motion();
    motion.odometry_of(&r1, odometry(1, 3.0));
    motion.apply_fix(&r1, at(1_000_000_000, 3.0), &fix(10.0)).unwrap();
    let forged = v1::Odometry {
        epoch: 2,
        seq: 1,
        captured_ns: 1_500_000_000,
        odom_from_robot: Some(v1::Pose2::default()),
        ..v1::Odometry::default()
    };
    assert!(motion.odometry(&r1, forged.encode_to_vec().into(), time(1.5)).is_none());
    let pose = motion.odometry_of(&r1, odometry(2, 4.0)).unwrap();
    assert!((pose.map_from_robot.unwrap().pose.unwrap().x_m - 11.0).abs() < 1e-9);
    assert_eq!(motion.counts().0.rejected, [(Code::EpochConflict, 1)].into());
    assert_eq!(motion.epochs().status(&r1, time(2.0)).conflict.unwrap().epoch, 2);
}
