//! How each robot moves: odometry, scans and fixes by landmarks in, its fused pose on the map out. For pages, odometry
//! alone is laid on the map at the robot's first known pose. A new epoch of a robot starts afresh; so does another map, unless it is
//! known how the two lie to each other.
//! Capture times order one robot's own readings; they are never compared with this machine's clock.

mod corrections;
mod messages;
mod robot;
mod run;
mod scans;

pub use corrections::{Correction, Corrections, MAX_CORRECTIONS};
pub use messages::{MAX_ODOMETRY_BYTES, MAX_SCAN_BYTES, MessageCounts};
pub use robot::{MAX_SUPPORTERS, RESTS_ON_M};
pub(crate) use run::Recording;
pub use run::{MAX_RECORDINGS, MAX_RUN_FIXES, MAX_RUN_ODOMETRY, Recorded, RunError};
pub use scans::{ScanJob, Scans};

use super::{live::LiveHub, mapping::Mappings, snapshot::Snapshots};
use map::{
    changes::{Change, Judged, Standing},
    fuse::{FixOutcome, FusedPose},
    laser_fix::{LaserFixParams, laser_fix},
    localise::Fix,
    pose2::{Pose2, Pose2Covariance},
};
use protos::{Code, Name, Rejection, convert::geometry::pose2_covariance_wire, prost::bytes::Bytes, v1};
use robot::Robot;
use std::{
    collections::{BTreeMap, BTreeSet},
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};
use vision::recognise::LandmarkId;

/// Robots whose motion is followed; the number of registered robots bounds it first.
pub const MAX_ROBOTS: usize = 10_000;
/// The laser's word in counters.
const LASER: &str = "laser";

#[derive(Debug, Default)]
struct State {
    /// Each with its own lock: replaying one robot's last seconds holds up no other.
    robots: BTreeMap<Name, Arc<Mutex<Robot>>>,
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
    scans: Scans,
    mappings: Mappings,
    /// Robots whose run is recorded; taken before their own locks.
    recorded: Mutex<BTreeSet<Name>>,
}

impl Motion {
    /// Nothing known of any robot yet.
    pub fn new(snapshots: Arc<Snapshots>, live: Arc<LiveHub>) -> Self {
        Self {
            snapshots,
            live,
            state: Mutex::default(),
            scans: Scans::default(),
            mappings: Mappings::default(),
            recorded: Mutex::default(),
        }
    }

    /// Odometry of a robot; gives its new pose once it has been on the map. A refusal is counted.
    pub fn odometry(&self, robot: &Name, message: Bytes) -> Option<v1::RobotPose> {
        let checked = messages::odometry(&self.snapshots, robot, message);
        let mut state = self.lock();
        let taken = checked.and_then(|(map, odometry)| {
            let followed = state.robot(robot)?;
            own(&followed).odometry.advance(odometry.epoch, odometry.seq)?;
            Ok((map, odometry, followed))
        });
        let (map, odometry, followed) = state.odometry.count("odometry", robot, taken)?;
        drop(state);
        let mut followed = own(&followed);
        if !followed.belong(odometry.epoch, &map, &self.snapshots) {
            return None;
        }
        followed.moved(odometry.captured_ns, odometry.odom_from_robot);
        let on_map = followed.on_map(&odometry.odom_from_robot);
        let (fused, modalities) = (followed.fuser.pose(), followed.modalities());
        drop(followed);
        if let Some(on_map) = on_map {
            self.live.odometry(robot, &map, on_map);
        }
        Some(self.tell(robot, &map, odometry.epoch, &fused?, modalities))
    }

    /// A laser scan: checked, counted, and put where [`Motion::laser`] takes it from; that of a robot that makes a map, where
    /// it is mapped.
    pub fn scan(&self, robot: &Name, message: Bytes) {
        let checked = messages::scan(&self.snapshots, robot, message);
        let mut state = self.lock();
        let taken = checked.and_then(|(map, scan)| {
            let followed = state.robot(robot)?;
            own(&followed).scans.advance(scan.epoch, scan.seq)?;
            Ok((map, scan, followed))
        });
        let Some((map, checked, followed)) = state.scans.count("scan", robot, taken) else { return };
        drop(state);
        let (epoch, captured_ns) = (checked.epoch, checked.captured_ns);
        let job =
            ScanJob { map, epoch, captured_ns, odom_from_robot: checked.odom_from_robot, scan: checked.scan };
        let Some(job) = self.mappings.offer(robot, job) else { return };
        if self.scans.offer(robot, job) {
            own(&followed).log.count(LASER, "superseded");
        }
    }

    /// The scans that wait for the laser's thread.
    pub fn scans(&self) -> &Scans {
        &self.scans
    }

    /// Maps that are being made.
    pub fn mappings(&self) -> &Mappings {
        &self.mappings
    }

    /// Lays a scan on the walls of its map, near the pose that is known without it, and corrects that pose by it; gives the
    /// new pose if it did. A scan never gives a first pose. Takes about 100 microseconds: for the laser's own thread.
    pub fn laser(&self, robot: &Name, job: &ScanJob) -> Option<v1::RobotPose> {
        let map = self.snapshots.get(&job.map)?;
        let followed = self.lock().robot(robot).ok()?;
        let prior = {
            let mut followed = own(&followed);
            if !followed.belong(job.epoch, &job.map, &self.snapshots) {
                return None;
            }
            followed.moved_to(job.captured_ns, job.odom_from_robot);
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
        let mut followed = own(&followed);
        if !followed.belong(job.epoch, &job.map, &self.snapshots) {
            return None;
        }
        let found =
            found.inspect_err(|error| tracing::error!(%error, "a prior of ours is out of range")).ok()?;
        let fix = match found {
            Ok(found) => found.fix(),
            Err(refusal) => {
                followed.log.count(LASER, corrections::refusal(refusal));
                return None;
            }
        };
        let (outcome, fused) = followed.fix(job.captured_ns, &fix, Vec::new())?;
        let modalities = followed.modalities();
        drop(followed);
        let applied = matches!(outcome, FixOutcome::Applied { .. });
        applied.then(|| self.tell(robot, &job.map, job.epoch, &fused, modalities))
    }

    /// What is known of a robot's pose at a frame without the frame itself: for choosing between two solutions, and for
    /// judging landmarks.
    pub fn grounds(&self, robot: &Name, at: Moment<'_>) -> Option<Grounds> {
        let followed = self.lock().robot(robot).ok()?;
        let mut followed = own(&followed);
        if !followed.belong(at.epoch, at.map, &self.snapshots) {
            return None;
        }
        if let Some(odometry) = at.odometry {
            followed.moved(at.captured_ns, odometry);
        }
        let pose = followed.fuser.pose_at(at.captured_ns)?;
        Some(Grounds { pose, supporters: followed.supporters.clone() })
    }

    /// The last fused pose of a robot on a map.
    pub fn pose(&self, robot: &Name, map: &str) -> Option<Pose2Covariance> {
        let followed = self.lock().robots.get(robot)?.clone();
        let followed = own(&followed);
        followed.fuser.pose().filter(|_| followed.map == map).map(|fused| fused.pose)
    }

    /// Every fix of a robot and what became of it; nothing for one that has not been heard of since the start.
    pub fn corrections(&self, robot: &Name) -> Corrections {
        let Some(followed) = self.lock().robots.get(robot).cloned() else { return Corrections::default() };
        let followed = own(&followed);
        followed.log.read(followed.modalities())
    }

    /// Begins to record a run of a robot on a map.
    pub fn record(&self, robot: &Name, map: &str) -> Result<Recorded, RunError> {
        let mut recorded = self.recorded.lock().unwrap_or_else(PoisonError::into_inner);
        if recorded.contains(robot) {
            return Err(RunError::Going);
        }
        if recorded.len() >= MAX_RECORDINGS {
            return Err(RunError::TooMany);
        }
        let followed = self.lock().robot(robot).map_err(|_full| RunError::TooMany)?;
        let mut followed = own(&followed);
        let run = followed.run.insert(Box::new(Recording::new(map)));
        let told = run.told(robot.as_str());
        recorded.insert(robot.clone());
        Ok(told)
    }

    /// The run of a robot as it is recorded.
    pub fn recorded(&self, robot: &Name) -> Option<Recorded> {
        let followed = self.lock().robots.get(robot)?.clone();
        let followed = own(&followed);
        Some(followed.run.as_ref()?.told(robot.as_str()))
    }

    /// Ends the recording and gives it.
    pub(crate) fn take_recording(&self, robot: &Name) -> Option<Box<Recording>> {
        let mut recorded = self.recorded.lock().unwrap_or_else(PoisonError::into_inner);
        recorded.remove(robot);
        let followed = self.lock().robots.get(robot)?.clone();
        own(&followed).run.take()
    }

    /// Takes a recording back that could not be learnt from after all, unless another has begun.
    pub(crate) fn keep_recording(&self, robot: &Name, recording: Box<Recording>) {
        let mut recorded = self.recorded.lock().unwrap_or_else(PoisonError::into_inner);
        if recorded.len() >= MAX_RECORDINGS || !recorded.insert(robot.clone()) {
            return;
        }
        if let Ok(followed) = self.lock().robot(robot) {
            own(&followed).run = Some(recording);
        }
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
        let Ok(followed) = self.lock().robot(robot) else { return Vec::new() };
        let mut followed = own(&followed);
        if !followed.belong(at.epoch, at.map, &self.snapshots) {
            return Vec::new();
        }
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
        let map = self.snapshots.get(at.map);
        let name = |id: &LandmarkId| map.as_ref().and_then(|m| Some(m.landmarks.get(id)?.name.clone()));
        let landmarks = fix.landmarks.iter().filter_map(name).collect();
        let followed = self.lock().robot(robot).ok()?;
        let mut followed = own(&followed);
        if !followed.belong(at.epoch, at.map, &self.snapshots) {
            return None;
        }
        if let Some(odometry) = at.odometry {
            followed.moved(at.captured_ns, odometry);
        }
        let (outcome, fused) = followed.fix(at.captured_ns, fix, landmarks)?;
        tracing::debug!(%robot, ?outcome, "fix");
        if let Some(odometry) = at.odometry {
            followed.on_map(&odometry);
        }
        let modalities =
            if followed.newest.is_some() { followed.modalities() } else { vec!["landmarks".to_owned()] };
        drop(followed);
        Some(self.tell(robot, at.map, at.epoch, &fused, modalities))
    }

    /// A robot that searched was found, by landmarks that each may be several: its pose to publish. None if its pose is known
    /// by now.
    pub fn found(
        &self,
        robot: &Name,
        at: Moment<'_>,
        pose: &Pose2Covariance,
        landmarks: &[LandmarkId],
    ) -> Option<v1::RobotPose> {
        let odometry = at.odometry?;
        let map = self.snapshots.get(at.map);
        let name = |id: &LandmarkId| map.as_ref().and_then(|m| Some(m.landmarks.get(id)?.name.clone()));
        let landmarks = landmarks.iter().filter_map(name).collect();
        let followed = self.lock().robot(robot).ok()?;
        let mut followed = own(&followed);
        if !followed.belong(at.epoch, at.map, &self.snapshots) {
            return None;
        }
        let fused = followed.found(at.captured_ns, &odometry, pose, landmarks)?;
        let modalities = followed.modalities();
        drop(followed);
        Some(self.tell(robot, at.map, at.epoch, &fused, modalities))
    }

    fn tell(
        &self,
        robot: &Name,
        map: &str,
        epoch: u64,
        fused: &FusedPose,
        modalities: Vec<String>,
    ) -> v1::RobotPose {
        self.live.fused(robot, map, &fused.pose, fused.corrections);
        v1::RobotPose {
            epoch,
            captured_ns: fused.at_ns,
            map: map.to_owned(),
            map_from_robot: Some(pose2_covariance_wire(&fused.pose)),
            modalities,
            corrections: fused.corrections,
            laser_corrections: fused.laser_corrections,
        }
    }

    /// What came in: odometry and scans.
    pub fn counts(&self) -> (MessageCounts, MessageCounts) {
        let state = self.lock();
        (state.odometry.clone(), state.scans.clone())
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    fn robot(&mut self, robot: &Name) -> Result<Arc<Mutex<Robot>>, Rejection> {
        if self.robots.len() >= MAX_ROBOTS && !self.robots.contains_key(robot) {
            return Err(Rejection::new(Code::TooMany, "robot", format!("more than {MAX_ROBOTS} robots")));
        }
        Ok(self.robots.entry(robot.clone()).or_default().clone())
    }
}

fn own(robot: &Mutex<Robot>) -> MutexGuard<'_, Robot> {
    robot.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests;
