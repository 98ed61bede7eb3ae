//! The motion of each robot. In: odometry, scans and fixes by landmarks. Out: its fused pose on the
//! map. For pages, odometry alone is put on the map at the robot's first known pose. A new epoch of
//! a robot resets its state; so does another map, unless the two maps are linked.
//!
//! Capture times order one robot's own readings. They are never compared with this machine's wall
//! clock, only with the time that passes between messages (`timebase.rs`). A stray stamp is
//! refused, and a pose says how old it is.

mod corrections;
mod frames;
mod exclusive_recording;
mod messages;
mod robot;
mod run_recording;
mod scans;
mod timebase;

pub use crate::limits::MAX_SCAN_BYTES;
pub use crate::scan_job::ScanJob;
pub use corrections::{Correction, Corrections, MAX_CORRECTIONS};
pub use frames::{FrameFixes, FrameStamp, PriorPose};
pub use messages::{MAX_ODOMETRY_BYTES, MessageCounts};
pub use robot::{MAX_SUPPORTING_LANDMARKS, RESTS_ON_M};
pub use run_recording::{
    MAX_RECORDINGS, MAX_RUN_FIXES, MAX_RUN_ODOMETRY, RecordingError, RecordingStatus, RunRecording,
};
pub use scans::Scans;
pub use timebase::{
    AHEAD_TOLERANCE, BEHIND_TOLERANCE, CLOCK_SET_AFTER, CLOCK_SET_COUNT, CLOCK_SET_SPREAD, LEADER_SILENT,
    MAX_LEADS, MAX_STREAMS,
};

use crate::{
    epochs::Epochs,
    inputs::Input,
    limits::MAX_ROBOTS,
    mapping::MappingSessions,
    quotas::{Kind, Quotas},
    snapshot::Snapshots,
};
use map::{
    fuse::{FixOutcome, FixRole, FusedPose},
    laser_fix::laser_fix,
    pose2::{Pose2, Pose2Covariance},
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
    fmt::Debug,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::{Duration, Instant},
};
use timebase::Stream;

/// A fused pose is published, and used, only while the odometry or fix that supports it was
/// captured no longer ago. Robots that send odometry once a second are within it.
pub const MAX_POSE_AGE: Duration = Duration::from_secs(2);
/// Word of the laser in counters.
const LASER: &str = "laser";

#[derive(Debug, Default)]
struct State {
    /// Each with its own lock: replaying the last seconds of one robot holds up no other robot.
    robots: BTreeMap<Name, Arc<Mutex<RobotState>>>,
    odometry: MessageCounts,
    scans: MessageCounts,
    /// Capture times of frames.
    stamps: MessageCounts,
}

/// The fused pose of a robot at one time.
#[derive(Debug, Clone, PartialEq)]
pub struct KnownPose {
    /// The map it is in.
    pub map: String,
    /// The pose (map frame) and what corrected it.
    pub fused: FusedPose,
    /// Time since the capture of the newest odometry that supports it; at most [`MAX_POSE_AGE`].
    pub age: Duration,
}

/// Watches what robots send and where they are. Never waits.
pub trait MotionObserver: Debug + Send + Sync {
    /// A message was used, or refused. Used frames are counted with their answers.
    fn message(&self, robot: &Name, input: Input, refused: Option<&Rejection>, received: Instant);
    /// Odometry put on the map.
    fn odometry(&self, robot: &Name, map: &str, map_from_robot: Pose2);
    /// A fused pose, with the corrections so far, its age (ms), and how far it is trusted.
    fn pose(&self, robot: &Name, map: &str, pose: &Pose2Covariance, counts: (u64, f64), trust: v1::PoseTrust);
}

/// The motion of all robots.
#[derive(Debug)]
pub struct MotionTracker {
    snapshots: Arc<Snapshots>,
    observer: Arc<dyn MotionObserver>,
    epochs: Epochs,
    quotas: Quotas,
    state: Mutex<State>,
    scans: Scans,
    mappings: MappingSessions,
    /// Robots with a recording. Locked before the robots' own states.
    recording_robots: Mutex<BTreeSet<Name>>,
}

impl MotionTracker {
    /// No robot has moved yet.
    pub fn new(snapshots: Arc<Snapshots>, observer: Arc<dyn MotionObserver>) -> Self {
        Self {
            snapshots,
            observer,
            epochs: Epochs::default(),
            quotas: Quotas::default(),
            state: Mutex::default(),
            scans: Scans::default(),
            mappings: MappingSessions::default(),
            recording_robots: Mutex::default(),
        }
    }

    /// The same with bounds of what a robot may send.
    #[must_use]
    pub fn with_quotas(self, quotas: Quotas) -> Self {
        Self { quotas, ..self }
    }

    /// What each robot may send.
    pub fn quotas(&self) -> &Quotas {
        &self.quotas
    }

    /// The live epoch of each robot.
    pub fn epochs(&self) -> &Epochs {
        &self.epochs
    }

    /// Takes odometry of a robot, with the time of receipt. Gives the pose to publish once the
    /// robot has one. A refusal is counted.
    pub fn odometry(&self, robot: &Name, message: Bytes, received: Instant) -> Option<v1::RobotPose> {
        let taken = self.checked_odometry(robot, message, received);
        self.observer.message(robot, Input::Odometry, taken.as_ref().err(), received);
        let (map, odometry, state) = self.lock().odometry.count(taken)?;
        let mut state = lock_robot(&state);
        state.apply_odometry(odometry.captured_ns, odometry.odom_from_robot, received);
        let on_map = state.odometry_on_map(&odometry.odom_from_robot);
        let stated = state.pose().map(|fused| state.state_pose(fused, received));
        drop(state);
        if let Some(on_map) = on_map {
            self.observer.odometry(robot, &map, on_map);
        }
        self.announce(robot, &map, odometry.epoch, stated?)
    }

    fn checked_odometry(
        &self,
        robot: &Name,
        message: Bytes,
        received: Instant,
    ) -> Result<(String, CheckedOdometry, Arc<Mutex<RobotState>>), Rejection> {
        self.check_quota(robot, Kind::Odometry, &message, received)?;
        let (map, odometry) = messages::odometry(&self.snapshots, robot, message)?;
        self.epochs.admit(robot, odometry.epoch, received)?;
        let shared = self.lock().robot(robot)?;
        let mut state = lock_robot(&shared);
        state.odometry.advance(odometry.epoch, odometry.seq)?;
        state.switch_epoch_or_map(odometry.epoch, &map, &self.snapshots);
        let reading = Some(odometry.odom_from_robot);
        state.check_stamp(&Stream::Odometry, odometry.captured_ns, reading, received)?;
        drop(state);
        Ok((map, odometry, shared))
    }

    /// Takes a laser scan, with the time of receipt: checks it, counts it, and queues it for
    /// [`MotionTracker::fix_by_scan`], or for the mapping if the robot makes a map.
    pub fn scan(&self, robot: &Name, message: Bytes, received: Instant) {
        let taken = self.checked_scan(robot, message, received);
        self.observer.message(robot, Input::Scan, taken.as_ref().err(), received);
        let Some(Some(job)) = self.lock().scans.count(taken) else { return };
        if self.scans.offer(robot, job)
            && let Ok(state) = self.lock().robot(robot)
        {
            lock_robot(&state).log.count(LASER, "superseded");
        }
    }

    /// The scan to be matched with the walls; `None` if it went to a mapping.
    fn checked_scan(
        &self,
        robot: &Name,
        message: Bytes,
        received: Instant,
    ) -> Result<Option<ScanJob>, Rejection> {
        self.check_quota(robot, Kind::Scan, &message, received)?;
        let (map, checked) = messages::scan(&self.snapshots, robot, message)?;
        self.epochs.admit(robot, checked.epoch, received)?;
        let shared = self.lock().robot(robot)?;
        lock_robot(&shared).scans.advance(checked.epoch, checked.seq)?;
        let (epoch, captured_ns) = (checked.epoch, checked.captured_ns);
        let job =
            ScanJob { map, epoch, captured_ns, odom_from_robot: checked.odom_from_robot, scan: checked.scan };
        // Mapping uses the order of scans, not their times.
        let Some(job) = self.mappings.offer(robot, job) else { return Ok(None) };
        let mut state = lock_robot(&shared);
        state.switch_epoch_or_map(epoch, &job.map, &self.snapshots);
        state.check_stamp(&Stream::Scan, captured_ns, Some(job.odom_from_robot), received)?;
        Ok(Some(job))
    }

    /// Counts a message of a registered robot.
    fn check_quota(&self, robot: &Name, kind: Kind, message: &Bytes, now: Instant) -> Result<(), Rejection> {
        let is_known = self.snapshots.robot_map(robot.as_str()).is_some();
        if is_known { self.quotas.take(robot, kind, message.len(), now) } else { Ok(()) }
    }

    /// The scans that wait for the laser thread.
    pub fn scans(&self) -> &Scans {
        &self.scans
    }

    /// The mappings.
    pub fn mappings(&self) -> &MappingSessions {
        &self.mappings
    }

    /// Matches a scan with the walls of its map, near the prior pose without it, and corrects that
    /// pose. Gives the pose to publish if it was corrected. A scan never gives a first pose. Takes
    /// about 100 microseconds: for the laser thread.
    pub fn fix_by_scan(&self, robot: &Name, job: &ScanJob, now: Instant) -> Option<v1::RobotPose> {
        let map = self.snapshots.get(&job.map)?;
        let state = self.robot_state(robot, &job.map, job.epoch)?;
        let prior = {
            let mut state = lock_robot(&state);
            state.switch_epoch_or_map(job.epoch, &job.map, &self.snapshots);
            state.apply_odometry_if_newer(job.captured_ns, job.odom_from_robot, now);
            if map.wall_index.is_empty() {
                state.log.count(LASER, "no_walls");
                return None;
            }
            let prior = state.fuser.pose_at(job.captured_ns);
            if prior.is_none() {
                state.log.count(LASER, "no_pose");
            }
            prior?
        };
        let matched = laser_fix(&map.wall_index, &job.scan, &prior, &map.poses.laser_fix);
        let state = self.robot_state(robot, &job.map, job.epoch)?;
        let mut state = lock_robot(&state);
        state.switch_epoch_or_map(job.epoch, &job.map, &self.snapshots);
        let matched = matched.inspect_err(|error| tracing::error!(%error, "prior_pose_out_of_range")).ok()?;
        let fix = match matched {
            Ok(matched) => matched.fix(),
            Err(refusal) => {
                state.log.count(LASER, corrections::refusal_word(refusal));
                return None;
            }
        };
        let (outcome, fused) = state.apply_fix(job.captured_ns, (&fix, FixRole::Independent), Vec::new())?;
        let stated = state.state_pose(fused, now);
        drop(state);
        if !matches!(outcome, FixOutcome::Applied { .. }) {
            return None;
        }
        self.announce(robot, &job.map, job.epoch, stated)
    }

    /// The fused pose of a robot on a map (map frame), unless it is older than [`MAX_POSE_AGE`].
    pub fn pose(&self, robot: &Name, map: &str, now: Instant) -> Option<Pose2Covariance> {
        self.known_pose(robot, now).filter(|known| known.map == map).map(|known| known.fused.pose)
    }

    /// The fused pose of a robot and its age, unless it is older than [`MAX_POSE_AGE`].
    pub fn known_pose(&self, robot: &Name, now: Instant) -> Option<KnownPose> {
        let state = self.lock().robots.get(robot)?.clone();
        let state = lock_robot(&state);
        let fused = state.pose()?;
        let age = state.age(fused.at_ns, now);
        (age <= MAX_POSE_AGE).then(|| KnownPose { map: state.map.clone(), fused, age })
    }

    /// The correction log of a robot; empty for a robot that has sent nothing since the start.
    pub fn corrections(&self, robot: &Name) -> Corrections {
        let Some(state) = self.lock().robots.get(robot).cloned() else { return Corrections::default() };
        let state = lock_robot(&state);
        state.log.read(state.modalities())
    }

    /// Starts a recording of a robot on a map.
    pub fn start_recording(&self, robot: &Name, map: &str) -> Result<RecordingStatus, RecordingError> {
        let mut recording = self.recording_robots.lock().unwrap_or_else(PoisonError::into_inner);
        if recording.contains(robot) {
            return Err(RecordingError::AlreadyRecording);
        }
        if recording.len() >= MAX_RECORDINGS {
            return Err(RecordingError::TooMany);
        }
        let state = self.lock().robot(robot).map_err(|_full| RecordingError::TooMany)?;
        let mut state = lock_robot(&state);
        let recorded = state.recording.insert(Box::new(RunRecording::new(map)));
        let status = recorded.status(robot.as_str());
        recording.insert(robot.clone());
        Ok(status)
    }

    /// Status of a robot's recording.
    pub fn recording(&self, robot: &Name) -> Option<RecordingStatus> {
        let state = self.lock().robots.get(robot)?.clone();
        let state = lock_robot(&state);
        Some(state.recording.as_ref()?.status(robot.as_str()))
    }

    /// Ends a robot's recording and gives it.
    pub fn take_recording(&self, robot: &Name) -> Option<Box<RunRecording>> {
        let mut recording = self.recording_robots.lock().unwrap_or_else(PoisonError::into_inner);
        recording.remove(robot);
        let state = self.lock().robots.get(robot)?.clone();
        lock_robot(&state).recording.take()
    }

    /// The state of a robot that is on this map, for its live epoch; `None` for any other. A frame
    /// against another map says nothing about the robot's pose and must not reset its fusion.
    /// Neither must a frame that was in work when another epoch began.
    fn robot_state(&self, robot: &Name, map: &str, epoch: u64) -> Option<Arc<Mutex<RobotState>>> {
        let stands_on = self.snapshots.robot_map(robot.as_str())?;
        if stands_on != map || self.epochs.current(robot).is_some_and(|current| current != epoch) {
            return None;
        }
        self.lock().robot(robot).ok()
    }

    /// Sends a pose to the pages and gives it as the message to publish, unless it is too old.
    fn announce(&self, robot: &Name, map: &str, epoch: u64, stated: StatedPose) -> Option<v1::RobotPose> {
        let StatedPose { fused, age, modalities, trust } = stated;
        if age > MAX_POSE_AGE {
            tracing::debug!(%robot, ?age, "pose_too_old_to_publish");
            return None;
        }
        let age_ms = age.as_secs_f64() * 1e3;
        self.observer.pose(robot, map, &fused.pose, (fused.corrections, age_ms), trust);
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
            ..v1::RobotPose::default()
        })
    }

    /// Counts of odometry messages and of scans.
    pub fn counts(&self) -> (MessageCounts, MessageCounts) {
        let state = self.lock();
        (state.odometry.clone(), state.scans.clone())
    }

    /// Counts of accepted and refused capture times of frames.
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

fn lock_robot(robot: &Mutex<RobotState>) -> MutexGuard<'_, RobotState> {
    robot.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests;
