//! How each robot moves: odometry, scans and fixes by landmarks in, its fused pose on the map out. For pages, odometry
//! alone is laid on the map at the robot's first known pose. A new epoch of a robot, or another map, starts afresh.
//! Capture times order one robot's own readings; they are never compared with this machine's clock.

use super::{live::LiveHub, slots::Order, snapshot::Snapshots};
use map::{
    changes::{Change, ChangeParams, Judged, Standing, Watch},
    fuse::{FixOutcome, FuseParams, FusedPose, Fuser, OdometryOutcome},
    localise::Fix,
    pose2::{Pose2, Pose2Covariance},
};
use protos::{
    Code, Name, Rejection,
    convert::{CheckedOdometry, CheckedScan, geometry::pose2_covariance_wire},
    prost::{Message, bytes::Bytes},
    v1,
};
use std::{
    collections::BTreeMap,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};
use vision::recognise::LandmarkId;

/// Largest odometry message, in bytes: it has nine numbers.
pub const MAX_ODOMETRY_BYTES: usize = 1024;
/// Largest scan, in bytes: [`map::laser::MAX_BEAMS`] ranges and their head.
pub const MAX_SCAN_BYTES: usize = map::laser::MAX_BEAMS * 5 + 1024;
/// Landmarks that a pose is said to rest on: the latest.
pub const MAX_SUPPORTERS: usize = 16;
/// Robots whose motion is followed; the number of registered robots bounds it first.
pub const MAX_ROBOTS: usize = 10_000;

/// What came in, of one kind.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct MessageCounts {
    /// Taken.
    pub accepted: u64,
    /// Refused, by code.
    pub rejected: BTreeMap<Code, u64>,
}

#[derive(Debug)]
struct Robot {
    odometry: Order,
    scans: Order,
    /// What the rest belongs to.
    epoch: u64,
    map: String,
    fuser: Fuser,
    /// Lays odometry alone on the map, for pages.
    map_from_odom: Option<Pose2>,
    /// Any odometry in this epoch.
    moves: bool,
    /// The landmarks that the pose rests on.
    supporters: Vec<LandmarkId>,
    /// What it has found out about landmarks...
    watch: Watch,
    /// ...and what of that was not passed on yet.
    found: Vec<Change>,
}

#[derive(Debug, Default)]
struct State {
    robots: BTreeMap<Name, Robot>,
    odometry: MessageCounts,
    scans: MessageCounts,
}

/// Which frame of a robot.
#[derive(Debug, Clone, Copy)]
pub struct Moment<'a> {
    /// The map it is in.
    pub map: &'a str,
    /// Echo of the frame.
    pub epoch: u64,
    /// Echo of the frame.
    pub captured_ns: i64,
    /// Odometry at capture, where the frame said.
    pub odometry: Option<Pose2>,
}

/// What is known of a robot's pose without its frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Grounds {
    /// `map_from_robot`.
    pub pose: Pose2Covariance,
    /// The landmarks that it rests on.
    pub supporters: Vec<LandmarkId>,
}

/// The motion of all robots.
#[derive(Debug)]
pub struct Motion {
    snapshots: Arc<Snapshots>,
    live: Arc<LiveHub>,
    state: Mutex<State>,
}

impl Motion {
    /// Nothing known of any robot yet.
    pub fn new(snapshots: Arc<Snapshots>, live: Arc<LiveHub>) -> Self {
        Self { snapshots, live, state: Mutex::default() }
    }

    /// Odometry of a robot; gives its new pose once it has been on the map. A refusal is counted.
    pub fn odometry(&self, robot: &Name, message: Bytes) -> Option<v1::RobotPose> {
        let checked = self.checked(robot, message, MAX_ODOMETRY_BYTES).and_then(|(map, message)| {
            let wire = v1::Odometry::decode(message).map_err(|e| undecodable("Odometry", &e))?;
            Ok((map, CheckedOdometry::try_from(wire)?))
        });
        let mut state = self.lock();
        let taken = checked.and_then(|(map, odometry)| {
            state.robot(robot)?.odometry.advance(odometry.epoch, odometry.seq)?;
            Ok((map, odometry))
        });
        let (map, odometry) = state.odometry.count("odometry", robot, taken)?;
        let followed = state.robots.get_mut(robot)?;
        followed.belong(odometry.epoch, &map);
        followed.moved(odometry.captured_ns, odometry.odom_from_robot);
        let on_map = followed.on_map(&odometry.odom_from_robot);
        let fused = followed.fuser.pose();
        drop(state);
        if let Some(on_map) = on_map {
            self.live.odometry(robot, &map, on_map);
        }
        Some(self.tell(robot, &map, odometry.epoch, &fused?))
    }

    /// A laser scan: checked and counted. Walls come from the map; scans do not yet move anything.
    pub fn scan(&self, robot: &Name, message: Bytes) {
        let checked = self.checked(robot, message, MAX_SCAN_BYTES).and_then(|(_, message)| {
            let wire = v1::Scan::decode(message).map_err(|e| undecodable("Scan", &e))?;
            CheckedScan::try_from(wire)
        });
        let mut state = self.lock();
        let taken = checked.and_then(|scan| {
            state.robot(robot)?.scans.advance(scan.epoch, scan.seq)?;
            Ok(scan)
        });
        state.scans.count("scan", robot, taken);
    }

    /// What is known of a robot's pose at a frame without the frame itself: for choosing between two solutions, and for
    /// judging landmarks.
    pub fn grounds(&self, robot: &Name, at: Moment<'_>) -> Option<Grounds> {
        let mut state = self.lock();
        let followed = state.robot(robot).ok()?;
        followed.belong(at.epoch, at.map);
        if let Some(odometry) = at.odometry {
            followed.moved(at.captured_ns, odometry);
        }
        let pose = followed.fuser.pose_at(at.captured_ns)?;
        Some(Grounds { pose, supporters: followed.supporters.clone() })
    }

    /// The last fused pose of a robot on a map.
    pub fn pose(&self, robot: &Name, map: &str) -> Option<Pose2Covariance> {
        let state = self.lock();
        let followed = state.robots.get(robot).filter(|r| r.map == map)?;
        followed.fuser.pose().map(|fused| fused.pose)
    }

    /// A frame's landmarks were judged by these grounds: what should change in the map by that.
    pub fn judged(
        &self,
        robot: &Name,
        at: Moment<'_>,
        grounds: &Grounds,
        judged: &[Judged],
        missed: &[LandmarkId],
    ) -> Vec<Change> {
        let map = self.snapshots.get(at.map);
        let standing = |id| map.as_ref().and_then(|m| Some(m.landmarks.get(&id)?.standing));
        let mut state = self.lock();
        let Ok(followed) = state.robot(robot) else { return Vec::new() };
        followed.belong(at.epoch, at.map);
        let mut changes = std::mem::take(&mut followed.found);
        if changes.is_empty() {
            let from = grounds.pose.pose.position().into();
            let now = |id| standing(id).unwrap_or(Standing::Sound);
            changes = followed.watch.frame(from, judged, missed, now);
        }
        changes
    }

    /// A robot was fixed by landmarks: its pose to publish. Without any odometry that is the fix itself.
    pub fn fixed(&self, robot: &Name, at: Moment<'_>, fix: &Fix) -> Option<v1::RobotPose> {
        let mut state = self.lock();
        let followed = state.robot(robot).ok()?;
        followed.belong(at.epoch, at.map);
        if let Some(odometry) = at.odometry {
            followed.moved(at.captured_ns, odometry);
        }
        match followed.fuser.fix(at.captured_ns, fix) {
            Ok(outcome) => {
                tracing::debug!(%robot, ?outcome, "fix");
                followed.rests_on(&outcome, &fix.landmarks);
            }
            Err(error) => tracing::error!(%robot, %error, "a fix of ours is out of range"),
        }
        let alone = FusedPose { at_ns: at.captured_ns, pose: fix.pose, corrections: 1, contradictions: 0 };
        let fused = if followed.moves { followed.fuser.pose()? } else { alone };
        if let (Some(odometry), None) = (at.odometry, followed.map_from_odom) {
            followed.map_from_odom = Some(fused.pose.pose.compose(&odometry.inverse()));
        }
        let moves = followed.moves;
        drop(state);
        let mut pose = self.tell(robot, at.map, at.epoch, &fused);
        if !moves {
            pose.modalities = vec!["landmarks".to_owned()];
        }
        Some(pose)
    }

    fn tell(&self, robot: &Name, map: &str, epoch: u64, fused: &FusedPose) -> v1::RobotPose {
        self.live.fused(robot, map, &fused.pose, fused.corrections);
        v1::RobotPose {
            epoch,
            captured_ns: fused.at_ns,
            map: map.to_owned(),
            map_from_robot: Some(pose2_covariance_wire(&fused.pose)),
            modalities: vec!["odometry".to_owned(), "landmarks".to_owned()],
            corrections: fused.corrections,
        }
    }

    /// What came in: odometry and scans.
    pub fn counts(&self) -> (MessageCounts, MessageCounts) {
        let state = self.lock();
        (state.odometry.clone(), state.scans.clone())
    }

    /// The robot's map and its message, if it may send one of this size.
    fn checked(&self, robot: &Name, message: Bytes, limit: usize) -> Result<(String, Bytes), Rejection> {
        let map = self.snapshots.robot_map(robot.as_str());
        let map = map.ok_or_else(|| Rejection::new(Code::UnknownRobot, "robot", "not registered"))?;
        if message.len() > limit {
            let detail = format!("{} bytes are more than {limit}", message.len());
            return Err(Rejection::new(Code::TooLarge, "message", detail));
        }
        Ok((map, message))
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Robot {
    fn new() -> Self {
        Self {
            odometry: Order::default(),
            scans: Order::default(),
            epoch: 0,
            map: String::new(),
            fuser: Fuser::new(FuseParams::default()),
            map_from_odom: None,
            moves: false,
            supporters: Vec::new(),
            watch: Watch::new(ChangeParams::default()),
            found: Vec::new(),
        }
    }

    /// Starts afresh when the robot's software did, or when it is on another map.
    fn belong(&mut self, epoch: u64, map: &str) {
        if self.epoch != epoch || self.map != map {
            (self.epoch, self.map) = (epoch, map.to_owned());
            self.fuser = Fuser::new(FuseParams::default());
            (self.map_from_odom, self.moves) = (None, false);
            self.lost();
            self.found.clear();
        }
    }

    /// The pose has proved wrong, or is unknown: nothing rests on it any more.
    fn lost(&mut self) {
        self.supporters.clear();
        let cleared = self.watch.clear();
        self.found.extend(cleared);
    }

    /// Keeps the landmarks that the pose rests on, the latest first to stay.
    fn rests_on(&mut self, outcome: &FixOutcome, landmarks: &[LandmarkId]) {
        match outcome {
            FixOutcome::Started | FixOutcome::Reset => self.lost(),
            FixOutcome::Applied { .. } => {}
            _ => return,
        }
        self.supporters.retain(|id| !landmarks.contains(id));
        self.supporters.extend(landmarks);
        let gone = self.supporters.len().saturating_sub(MAX_SUPPORTERS);
        self.supporters.drain(..gone);
    }

    fn moved(&mut self, captured_ns: i64, odom_from_robot: Pose2) {
        self.moves = true;
        match self.fuser.odometry(captured_ns, odom_from_robot) {
            // Another odometry frame: the old one means nothing on the map any more.
            Ok(OdometryOutcome::Jumped) => {
                self.map_from_odom = None;
                self.lost();
            }
            Ok(OdometryOutcome::Moved | OdometryOutcome::TooOld) => {}
            Err(error) => tracing::error!(%error, "checked odometry was refused"),
        }
    }

    /// Odometry alone on the map; laid there by the first fused pose.
    fn on_map(&mut self, odom_from_robot: &Pose2) -> Option<Pose2> {
        if self.map_from_odom.is_none() {
            let fused = self.fuser.pose()?;
            self.map_from_odom = Some(fused.pose.pose.compose(&odom_from_robot.inverse()));
        }
        Some(self.map_from_odom?.compose(odom_from_robot))
    }
}

impl State {
    fn robot(&mut self, robot: &Name) -> Result<&mut Robot, Rejection> {
        if self.robots.len() >= MAX_ROBOTS && !self.robots.contains_key(robot) {
            return Err(Rejection::new(Code::TooMany, "robot", format!("more than {MAX_ROBOTS} robots")));
        }
        Ok(self.robots.entry(robot.clone()).or_insert_with(Robot::new))
    }
}

impl MessageCounts {
    fn count<T>(&mut self, kind: &str, robot: &Name, taken: Result<T, Rejection>) -> Option<T> {
        match taken {
            Ok(message) => {
                self.accepted += 1;
                Some(message)
            }
            Err(rejection) => {
                tracing::debug!(%robot, kind, %rejection, "refused");
                *self.rejected.entry(rejection.code).or_default() += 1;
                None
            }
        }
    }
}

fn undecodable(kind: &str, error: &protos::prost::DecodeError) -> Rejection {
    Rejection::new(Code::BadMessage, "message", format!("no {kind} message: {error}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use map::{localise::DecidedBy, pose2::Pose2Covariance};
    use nalgebra::Matrix3;

    fn motion() -> (Motion, Name) {
        let snapshots = Arc::new(Snapshots::default());
        snapshots.set_robot("r1", Some("hall"));
        (Motion::new(snapshots, Arc::default()), Name::new("r1").unwrap())
    }

    fn odometry(seq: u64, x_m: f64) -> Bytes {
        let odom_from_robot = Some(v1::Pose2 { x_m, ..v1::Pose2::default() });
        v1::Odometry { epoch: 1, seq, captured_ns: seq as i64 * 1_000_000_000, odom_from_robot }
            .encode_to_vec()
            .into()
    }

    fn fix(x_m: f64) -> Fix {
        Fix {
            pose: Pose2Covariance { pose: Pose2::new(x_m, 1.0, 0.0), covariance: Matrix3::identity() * 1e-4 },
            noise: Matrix3::identity() * 1e-4,
            nuisances: Vec::new(),
            landmarks: Vec::new(),
            decided_by: DecidedBy::Single,
            chi2: 1.0,
            dof: 5,
        }
    }

    #[test]
    fn odometry_is_checked_and_counted() {
        let (motion, r1) = motion();
        motion.odometry(&r1, odometry(1, 0.0));
        motion.odometry(&r1, odometry(1, 0.0));
        motion.odometry(&r1, odometry(2, f64::NAN));
        motion.odometry(&r1, Bytes::from_static(b"\xff"));
        motion.odometry(&r1, vec![0; MAX_ODOMETRY_BYTES + 1].into());
        motion.odometry(&Name::new("nobody").unwrap(), odometry(1, 0.0));
        let (odometry, scans) = motion.counts();
        let each = [Code::BadMessage, Code::NotFinite, Code::TooLarge, Code::UnknownRobot, Code::NotNewer];
        assert_eq!((odometry.accepted, scans.accepted), (1, 0));
        assert_eq!(odometry.rejected, BTreeMap::from(each.map(|code| (code, 1))));
    }

    #[test]
    fn scans_are_checked_and_counted() {
        let (motion, r1) = motion();
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
        motion.scan(&r1, scan.encode_to_vec().into());
        motion.scan(&r1, v1::Scan { max_range_m: -1.0, ..scan }.encode_to_vec().into());
        let (_, scans) = motion.counts();
        assert_eq!((scans.accepted, scans.rejected), (1, BTreeMap::from([(Code::OutOfRange, 1)])));
    }

    fn at(captured_ns: i64, x_m: f64) -> Moment<'static> {
        Moment { map: "hall", epoch: 1, captured_ns, odometry: Some(Pose2::new(x_m, 0.0, 0.0)) }
    }

    #[test]
    fn a_fix_puts_odometry_on_the_map() {
        let (motion, r1) = motion();
        assert!(motion.odometry(&r1, odometry(1, 3.0)).is_none(), "no pose before the first fix");
        assert!(motion.live.tracks(&r1).is_none());
        let pose = motion.fixed(&r1, at(1_000_000_000, 3.0), &fix(10.0)).unwrap();
        assert_eq!((pose.corrections, pose.map.as_str(), pose.epoch), (1, "hall", 1));
        let pose = motion.odometry(&r1, odometry(2, 4.0)).unwrap().map_from_robot.unwrap();
        assert!((pose.pose.unwrap().x_m - 11.0).abs() < 1e-9, "{pose:?}");
        assert!(pose.covariance[0] > 1e-4, "driving makes it less sure");
        let tracks = motion.live.tracks(&r1).unwrap();
        assert!((tracks.odometry[0].x_m - 11.0).abs() < 1e-9);
        assert_eq!((tracks.odometry.len(), tracks.pose.len()), (1, 2));
    }

    #[test]
    fn a_prior_follows_from_odometry_alone() {
        let (motion, r1) = motion();
        assert!(motion.grounds(&r1, at(1_000_000_000, 3.0)).is_none());
        motion.fixed(&r1, at(1_000_000_000, 3.0), &fix(10.0)).unwrap();
        let prior = motion.grounds(&r1, at(1_500_000_000, 3.5)).unwrap().pose;
        assert!((prior.pose.x_m - 10.5).abs() < 1e-9);
        let anew = Moment { epoch: 2, ..at(1_600_000_000, 0.0) };
        assert!(motion.grounds(&r1, anew).is_none(), "a new epoch has its own odometry");
    }

    #[test]
    fn another_map_starts_afresh() {
        let (motion, r1) = motion();
        motion.fixed(&r1, at(1_000_000_000, 3.0), &fix(10.0)).unwrap();
        let there = Moment { map: "cellar", ..at(2_000_000_000, 3.0) };
        assert!(motion.grounds(&r1, there).is_none());
    }

    #[test]
    fn without_odometry_the_fix_is_the_pose() {
        let (motion, r1) = motion();
        let still = Moment { odometry: None, ..at(1_000_000_000, 0.0) };
        let pose = motion.fixed(&r1, still, &fix(10.0)).unwrap();
        assert_eq!(pose.modalities, ["landmarks"]);
        assert!((pose.map_from_robot.unwrap().pose.unwrap().x_m - 10.0).abs() < 1e-12);
    }
}
