//! How each robot moves: odometry and scans in, its pose on the map out. Odometry is laid on the map at the robot's
//! first fix by landmarks. A new epoch of a robot starts afresh.

use super::{live::LiveHub, slots::Order, snapshot::Snapshots};
use map::{localise::Fix, pose2::Pose2};
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

/// Largest odometry message, in bytes: it has nine numbers.
pub const MAX_ODOMETRY_BYTES: usize = 1024;
/// Largest scan, in bytes: [`map::laser::MAX_BEAMS`] ranges and their head.
pub const MAX_SCAN_BYTES: usize = map::laser::MAX_BEAMS * 5 + 1024;
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

#[derive(Debug, Default)]
struct Robot {
    odometry: Order,
    scans: Order,
    map_from_odom: Option<Pose2>,
    epoch: u64,
    corrections: u64,
}

#[derive(Debug, Default)]
struct State {
    robots: BTreeMap<Name, Robot>,
    odometry: MessageCounts,
    scans: MessageCounts,
}

/// A fix of a robot by landmarks in one frame.
#[derive(Debug, Clone, Copy)]
pub struct FrameFix<'a> {
    /// The map it is in.
    pub map: &'a str,
    /// Echo of the frame.
    pub epoch: u64,
    /// Echo of the frame.
    pub captured_ns: i64,
    /// Odometry at capture, where the frame said.
    pub odometry: Option<Pose2>,
    /// What the landmarks say.
    pub fix: &'a Fix,
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
        let map_from_odom = state.robots.get(robot).and_then(|followed| followed.map_from_odom);
        drop(state);
        if let Some(map_from_odom) = map_from_odom {
            self.live.odometry(robot, &map, map_from_odom.compose(&odometry.odom_from_robot));
        }
        None
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

    /// A robot was seen by landmarks: its pose to publish.
    pub fn fixed(&self, robot: &Name, seen: FrameFix<'_>) -> Option<v1::RobotPose> {
        let mut state = self.lock();
        let followed = state.robot(robot).ok()?;
        if followed.epoch != seen.epoch {
            // The robot's software started anew, and its odometry with it.
            (followed.epoch, followed.corrections, followed.map_from_odom) = (seen.epoch, 0, None);
        }
        followed.corrections += 1;
        let pose = &seen.fix.pose;
        if let (Some(odom_from_robot), None) = (seen.odometry, followed.map_from_odom) {
            followed.map_from_odom = Some(pose.pose.compose(&odom_from_robot.inverse()));
        }
        let corrections = followed.corrections;
        drop(state);
        self.live.fused(robot, seen.map, pose, corrections);
        Some(v1::RobotPose {
            epoch: seen.epoch,
            captured_ns: seen.captured_ns,
            map: seen.map.to_owned(),
            map_from_robot: Some(pose2_covariance_wire(pose)),
            modalities: vec!["landmarks".to_owned()],
            corrections,
        })
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

impl State {
    fn robot(&mut self, robot: &Name) -> Result<&mut Robot, Rejection> {
        if self.robots.len() >= MAX_ROBOTS && !self.robots.contains_key(robot) {
            return Err(Rejection::new(Code::TooMany, "robot", format!("more than {MAX_ROBOTS} robots")));
        }
        Ok(self.robots.entry(robot.clone()).or_default())
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
        v1::Odometry { epoch: 1, seq, captured_ns: 0, odom_from_robot }.encode_to_vec().into()
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

    #[test]
    fn odometry_is_laid_on_the_map_at_the_first_fix() {
        let (motion, r1) = motion();
        motion.odometry(&r1, odometry(1, 3.0));
        assert!(motion.live.tracks(&r1).is_none());
        let (first, second) = (fix(10.0), fix(11.5));
        let at = |odometry, fix| FrameFix { map: "hall", epoch: 1, captured_ns: 0, odometry, fix };
        motion.fixed(&r1, at(Some(Pose2::new(3.0, 0.0, 0.0)), &first)).unwrap();
        motion.odometry(&r1, odometry(2, 4.0));
        // A later fix moves the pose, not the track of odometry alone.
        let pose = motion.fixed(&r1, at(Some(Pose2::new(4.0, 0.0, 0.0)), &second)).unwrap();
        motion.odometry(&r1, odometry(3, 5.0));
        let xs: Vec<_> = motion.live.tracks(&r1).unwrap().odometry.iter().map(|p| p.x_m).collect();
        assert!((xs[0] - 11.0).abs() < 1e-12 && (xs[1] - 12.0).abs() < 1e-12, "{xs:?}");
        assert_eq!((pose.corrections, pose.map.as_str()), (2, "hall"));
    }
}
