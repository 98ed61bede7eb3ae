//! How each robot moves: odometry, scans and fixes by landmarks in, its fused pose on the map out. For pages, odometry
//! alone is laid on the map at the robot's first known pose. A new epoch of a robot starts afresh; so does another map, unless it is
//! known how the two lie to each other.
//! Capture times order one robot's own readings. They are never compared with this machine's wall clock, only with the time
//! that passes between messages (`timebase.rs`): a stray stamp is refused, and a pose says how old it is.

mod corrections;
mod frames;
mod lent;
mod messages;
mod robot;
mod run;
mod scans;
mod timebase;

pub use crate::limits::MAX_SCAN_BYTES;
pub use crate::scan_job::ScanJob;
pub use corrections::{Correction, Corrections, MAX_CORRECTIONS};
pub use frames::{FrameFixes, FrameStamp, PriorPose};
pub use messages::{MAX_ODOMETRY_BYTES, MessageCounts};
pub use robot::{MAX_SUPPORTERS, RESTS_ON_M};
pub use run::RunRecording;
pub use run::{MAX_RECORDINGS, MAX_RUN_FIXES, MAX_RUN_ODOMETRY, RecordingError, RecordingStatus};
pub use scans::Scans;
pub use timebase::{
    AHEAD_TOLERANCE, BEHIND_TOLERANCE, CLOCK_SET_AFTER, CLOCK_SET_COUNT, CLOCK_SET_SPREAD, LEADER_SILENT,
    MAX_LEADS, MAX_STREAMS,
};

use super::{
    epochs::Epochs, limits::MAX_ROBOTS, live::LiveHub, mapping::MappingSessions, snapshot::Snapshots,
};
use map::{
    fuse::{FixOutcome, FixRole, FusedPose},
    laser_fix::{LaserFixParams, laser_fix},
    pose2::Pose2Covariance,
};
use protos::{
    Code, Name, Rejection,
    convert::{CheckedOdometry, geometry::pose2_covariance_wire},
    prost::bytes::Bytes,
    v1,
};
use robot::{RobotState, StatedPose};
use std::{
    collections::{BTreeMap, BTreeSet},
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::{Duration, Instant},
};
use timebase::Stream;

/// A fused pose is published, and used, only while the odometry or fix that supports it was captured no longer ago.
/// Robots that send odometry once a second are within it.
pub const MAX_POSE_AGE: Duration = Duration::from_secs(2);
/// The laser's word in counters.
const LASER: &str = "laser";

#[derive(Debug, Default)]
struct State {
    /// Each with its own lock: replaying one robot's last seconds holds up no other.
    robots: BTreeMap<Name, Arc<Mutex<RobotState>>>,
    odometry: MessageCounts,
    scans: MessageCounts,
    /// Capture times of frames.
    stamps: MessageCounts,
}

/// The fused pose of a robot as it is known at some moment.
#[derive(Debug, Clone, PartialEq)]
pub struct Known {
    /// The map it is in.
    pub map: String,
    /// The pose.
    pub fused: FusedPose,
    /// Since the capture of the newest odometry that supports it; at most [`MAX_POSE_AGE`].
    pub age: Duration,
}

/// The motion of all robots.
#[derive(Debug)]
pub struct MotionTracker {
    snapshots: Arc<Snapshots>,
    live: Arc<LiveHub>,
    epochs: Epochs,
    state: Mutex<State>,
    scans: Scans,
    mappings: MappingSessions,
    /// Robots whose run is recorded; taken before their own locks.
    recorded: Mutex<BTreeSet<Name>>,
}

impl MotionTracker {
    /// Nothing known of any robot yet.
    pub fn new(snapshots: Arc<Snapshots>, live: Arc<LiveHub>) -> Self {
        Self {
            snapshots,
            live,
            epochs: Epochs::default(),
            state: Mutex::default(),
            scans: Scans::default(),
            mappings: MappingSessions::default(),
            recorded: Mutex::default(),
        }
    }

    /// Which start of each robot's software speaks for it.
    pub fn epochs(&self) -> &Epochs {
        &self.epochs
    }

    /// Odometry of a robot, with the time of receipt; gives its new pose once it has been on the map. A refusal is counted.
    pub fn odometry(&self, robot: &Name, message: Bytes, received: Instant) -> Option<v1::RobotPose> {
        let taken = self.checked_odometry(robot, message, received);
        let (map, odometry, followed) = self.lock().odometry.count("odometry", robot, taken)?;
        let mut followed = own(&followed);
        followed.moved(odometry.captured_ns, odometry.odom_from_robot, received);
        let on_map = followed.on_map(&odometry.odom_from_robot);
        let told = followed.pose().map(|fused| followed.told(fused, received));
        drop(followed);
        if let Some(on_map) = on_map {
            self.live.odometry(robot, &map, on_map);
        }
        self.tell(robot, &map, odometry.epoch, told?)
    }

    fn checked_odometry(
        &self,
        robot: &Name,
        message: Bytes,
        received: Instant,
    ) -> Result<(String, CheckedOdometry, Arc<Mutex<RobotState>>), Rejection> {
        let (map, odometry) = messages::odometry(&self.snapshots, robot, message)?;
        self.epochs.admit(robot, odometry.epoch, received)?;
        let shared = self.lock().robot(robot)?;
        let mut followed = own(&shared);
        followed.odometry.advance(odometry.epoch, odometry.seq)?;
        followed.belong(odometry.epoch, &map, &self.snapshots);
        let moved = Some(odometry.odom_from_robot);
        followed.stamp(&Stream::Odometry, odometry.captured_ns, moved, received)?;
        drop(followed);
        Ok((map, odometry, shared))
    }

    /// A laser scan, with the time of receipt: checked, counted, and put where [`MotionTracker::laser`] takes it from; that of a
    /// robot that makes a map, where it is mapped.
    pub fn scan(&self, robot: &Name, message: Bytes, received: Instant) {
        let taken = self.checked_scan(robot, message, received);
        let Some(Some(job)) = self.lock().scans.count("scan", robot, taken) else { return };
        if self.scans.offer(robot, job)
            && let Ok(followed) = self.lock().robot(robot)
        {
            own(&followed).log.count(LASER, "superseded");
        }
    }

    /// The scan to lay on the walls; none if it is mapped.
    fn checked_scan(
        &self,
        robot: &Name,
        message: Bytes,
        received: Instant,
    ) -> Result<Option<ScanJob>, Rejection> {
        let (map, checked) = messages::scan(&self.snapshots, robot, message)?;
        self.epochs.admit(robot, checked.epoch, received)?;
        let shared = self.lock().robot(robot)?;
        own(&shared).scans.advance(checked.epoch, checked.seq)?;
        let (epoch, captured_ns) = (checked.epoch, checked.captured_ns);
        let job =
            ScanJob { map, epoch, captured_ns, odom_from_robot: checked.odom_from_robot, scan: checked.scan };
        // Mapping goes by the order of scans and does not use their times.
        let Some(job) = self.mappings.offer(robot, job) else { return Ok(None) };
        let mut followed = own(&shared);
        followed.belong(epoch, &job.map, &self.snapshots);
        followed.stamp(&Stream::Scan, captured_ns, Some(job.odom_from_robot), received)?;
        Ok(Some(job))
    }

    /// The scans that wait for the laser's thread.
    pub fn scans(&self) -> &Scans {
        &self.scans
    }

    /// Maps that are being made.
    pub fn mappings(&self) -> &MappingSessions {
        &self.mappings
    }

    /// Lays a scan on the walls of its map, near the pose that is known without it, and corrects that pose by it; gives the
    /// new pose if it did. A scan never gives a first pose. Takes about 100 microseconds: for the laser's own thread.
    pub fn laser(&self, robot: &Name, job: &ScanJob, now: Instant) -> Option<v1::RobotPose> {
        let map = self.snapshots.get(&job.map)?;
        let followed = self.followed(robot, &job.map, job.epoch)?;
        let prior = {
            let mut followed = own(&followed);
            followed.belong(job.epoch, &job.map, &self.snapshots);
            followed.moved_to(job.captured_ns, job.odom_from_robot, now);
            if map.wall_index.is_empty() {
                followed.log.count(LASER, "no_walls");
                return None;
            }
            let prior = followed.fuser.pose_at(job.captured_ns);
            if prior.is_none() {
                followed.log.count(LASER, "no_pose");
            }
            prior?
        };
        let found = laser_fix(&map.wall_index, &job.scan, &prior, &LaserFixParams::default());
        let followed = self.followed(robot, &job.map, job.epoch)?;
        let mut followed = own(&followed);
        followed.belong(job.epoch, &job.map, &self.snapshots);
        let found =
            found.inspect_err(|error| tracing::error!(%error, "a prior of ours is out of range")).ok()?;
        let fix = match found {
            Ok(found) => found.fix(),
            Err(refusal) => {
                followed.log.count(LASER, corrections::refusal(refusal));
                return None;
            }
        };
        let (outcome, fused) = followed.fix(job.captured_ns, (&fix, FixRole::Independent), Vec::new())?;
        let told = followed.told(fused, now);
        drop(followed);
        if !matches!(outcome, FixOutcome::Applied { .. }) {
            return None;
        }
        self.tell(robot, &job.map, job.epoch, told)
    }

    /// The fused pose of a robot on a map, unless it is older than [`MAX_POSE_AGE`].
    pub fn pose(&self, robot: &Name, map: &str, now: Instant) -> Option<Pose2Covariance> {
        self.known(robot, now).filter(|known| known.map == map).map(|known| known.fused.pose)
    }

    /// The fused pose of a robot and its age, unless it is older than [`MAX_POSE_AGE`].
    pub fn known(&self, robot: &Name, now: Instant) -> Option<Known> {
        let followed = self.lock().robots.get(robot)?.clone();
        let followed = own(&followed);
        let fused = followed.pose()?;
        let age = followed.age(fused.at_ns, now);
        (age <= MAX_POSE_AGE).then(|| Known { map: followed.map.clone(), fused, age })
    }

    /// Every fix of a robot and what became of it; nothing for one that has not been heard of since the start.
    pub fn corrections(&self, robot: &Name) -> Corrections {
        let Some(followed) = self.lock().robots.get(robot).cloned() else { return Corrections::default() };
        let followed = own(&followed);
        followed.log.read(followed.modalities())
    }

    /// Begins to record a run of a robot on a map.
    pub fn record(&self, robot: &Name, map: &str) -> Result<RecordingStatus, RecordingError> {
        let mut recorded = self.recorded.lock().unwrap_or_else(PoisonError::into_inner);
        if recorded.contains(robot) {
            return Err(RecordingError::Going);
        }
        if recorded.len() >= MAX_RECORDINGS {
            return Err(RecordingError::TooMany);
        }
        let followed = self.lock().robot(robot).map_err(|_full| RecordingError::TooMany)?;
        let mut followed = own(&followed);
        let run = followed.run.insert(Box::new(RunRecording::new(map)));
        let told = run.told(robot.as_str());
        recorded.insert(robot.clone());
        Ok(told)
    }

    /// The run of a robot as it is recorded.
    pub fn recorded(&self, robot: &Name) -> Option<RecordingStatus> {
        let followed = self.lock().robots.get(robot)?.clone();
        let followed = own(&followed);
        Some(followed.run.as_ref()?.told(robot.as_str()))
    }

    /// Ends the recording and gives it.
    pub fn take_recording(&self, robot: &Name) -> Option<Box<RunRecording>> {
        let mut recorded = self.recorded.lock().unwrap_or_else(PoisonError::into_inner);
        recorded.remove(robot);
        let followed = self.lock().robots.get(robot)?.clone();
        own(&followed).run.take()
    }

    /// The state of a robot that stands on this map, for its live epoch; `None` for any other. What a frame shows of a map
    /// that its robot does not stand on says nothing about the robot's pose, and must not restart its fusion; no more must
    /// what was still in work when another epoch began.
    fn followed(&self, robot: &Name, map: &str, epoch: u64) -> Option<Arc<Mutex<RobotState>>> {
        let stands_on = self.snapshots.robot_map(robot.as_str())?;
        if stands_on != map || self.epochs.current(robot).is_some_and(|current| current != epoch) {
            return None;
        }
        self.lock().robot(robot).ok()
    }

    /// The pose to publish, unless it is too old.
    fn tell(&self, robot: &Name, map: &str, epoch: u64, told: StatedPose) -> Option<v1::RobotPose> {
        let StatedPose { fused, age, modalities, trust } = told;
        if age > MAX_POSE_AGE {
            tracing::debug!(%robot, ?age, "a pose is too old to be published");
            return None;
        }
        let age_ms = age.as_secs_f64() * 1e3;
        self.live.fused(robot, map, &fused.pose, (fused.corrections, age_ms), trust);
        Some(v1::RobotPose {
            epoch,
            captured_ns: fused.at_ns,
            map: map.to_owned(),
            map_from_robot: Some(pose2_covariance_wire(&fused.pose)),
            modalities,
            corrections: fused.corrections,
            laser_corrections: fused.laser_corrections,
            age_ms,
            trust: trust.into(),
        })
    }

    /// What came in: odometry and scans.
    pub fn counts(&self) -> (MessageCounts, MessageCounts) {
        let state = self.lock();
        (state.odometry.clone(), state.scans.clone())
    }

    /// What became of the capture times of frames.
    pub fn frame_stamps(&self) -> MessageCounts {
        self.lock().stamps.clone()
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    fn robot(&mut self, robot: &Name) -> Result<Arc<Mutex<RobotState>>, Rejection> {
        if self.robots.len() >= MAX_ROBOTS && !self.robots.contains_key(robot) {
            return Err(Rejection::new(Code::TooMany, "robot", format!("more than {MAX_ROBOTS} robots")));
        }
        Ok(self.robots.entry(robot.clone()).or_default().clone())
    }
}

fn own(robot: &Mutex<RobotState>) -> MutexGuard<'_, RobotState> {
    robot.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests;
