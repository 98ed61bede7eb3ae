//! One robot on the move: its clock, its fused pose, what that rests on, what it has found out about landmarks. A new epoch
//! starts afresh; which epoch speaks for the robot is decided in `engine/epochs.rs`.

mod trust;
pub(super) use trust::StatedPose;

use super::{
    corrections::{Correction, Log, modality, moved, outcome},
    run::RunRecording,
    timebase::{AHEAD_TOLERANCE, Stamp, Stream, TimeBase},
};
use crate::{slots::SequenceTracker, snapshot::Snapshots};
use map::{
    fuse::{FixOutcome, FixRole, FuseParams, FusedPose, Fuser, OdometryOutcome},
    guided::{Schedule, ScheduleParams},
    landmark_health::{HealthChange, HealthMonitor, HealthParams},
    localise::Fix,
    modality_stats::ModalityMap,
    pose2::{Pose2, Pose2Covariance},
};
use protos::{Name, Rejection};
use std::{
    sync::Arc,
    time::{Duration, Instant},
};
use vision::model::LandmarkId;

/// Landmarks that a pose is said to rest on: the latest.
pub const MAX_SUPPORTERS: usize = 16;
/// The word of landmarks that were named by the pose, in counters and among what a pose rests on.
const GUIDED: &str = "guided";
/// After so many metres without a fix of a modality the pose no longer rests on it, but on odometry.
pub const RESTS_ON_M: f64 = 10.0;

#[derive(Debug)]
pub(super) struct RobotState {
    pub(super) odometry: SequenceTracker,
    pub(super) scans: SequenceTracker,
    /// What the rest belongs to.
    epoch: u64,
    pub(super) map: String,
    /// Of this epoch.
    clock: TimeBase,
    pub(super) fuser: Fuser,
    /// Lays odometry alone on the map, for pages.
    map_from_odom: Option<Pose2>,
    /// The newest odometry of this epoch, and its time.
    pub(super) newest: Option<(i64, Pose2)>,
    /// The last odometry message: capture time and reading.
    last_message: Option<(i64, Pose2)>,
    /// When odometry was taken last, by the server's clock.
    moved_at: Option<Instant>,
    /// Way driven by odometry in this epoch.
    way_m: f64,
    /// Where on it landmarks, those named by the pose, and the laser last agreed with the pose.
    by_landmarks_m: Option<f64>,
    by_guided_m: Option<f64>,
    by_laser_m: Option<f64>,
    /// It began with the last hypothesis that was left, and no landmark has confirmed it yet.
    by_hypotheses: bool,
    /// The landmarks that the pose rests on.
    pub(super) supporters: Vec<LandmarkId>,
    /// What it has found out about landmarks...
    pub(super) watch: HealthMonitor,
    /// ...and what of that was not passed on yet.
    pub(super) found: Vec<HealthChange>,
    pub(super) log: Log,
    /// The run that is being recorded.
    pub(super) run: Option<Box<RunRecording>>,
    /// What its fusion goes by.
    areas: Arc<ModalityMap>,
    /// When landmarks may be named by the pose, and how far it is trusted.
    pub(super) schedule: Schedule,
    /// Its cameras, by their numbers in the schedule.
    cameras: Vec<Name>,
    /// Odometry at the last frame.
    at_last_frame: Option<Pose2>,
}

impl Default for RobotState {
    fn default() -> Self {
        Self {
            odometry: SequenceTracker::default(),
            scans: SequenceTracker::default(),
            epoch: 0,
            map: String::new(),
            clock: TimeBase::default(),
            fuser: Fuser::new(FuseParams::default()),
            map_from_odom: None,
            newest: None,
            last_message: None,
            moved_at: None,
            way_m: 0.0,
            by_landmarks_m: None,
            by_guided_m: None,
            by_laser_m: None,
            by_hypotheses: false,
            supporters: Vec::new(),
            watch: HealthMonitor::new(HealthParams::default()),
            found: Vec::new(),
            log: Log::default(),
            run: None,
            areas: Arc::default(),
            schedule: schedule(),
            cameras: Vec::new(),
            at_last_frame: None,
        }
    }
}

fn schedule() -> Schedule {
    Schedule::new(ScheduleParams::default(), FuseParams::default())
}

impl RobotState {
    /// Starts afresh when the robot's software did, or when it is on another map; its pose goes with it where it is known
    /// how the two maps lie to each other.
    pub(super) fn belong(&mut self, epoch: u64, map: &str, maps: &Snapshots) {
        if self.epoch == epoch && self.map == map {
            self.trust(maps);
            return;
        }
        if self.epoch != epoch {
            self.clock = TimeBase::default();
        }
        if let Some(run) = &mut self.run {
            if run.map != map {
                run.end("the robot went to another map");
            } else if self.epoch != epoch && !run.odometry.is_empty() {
                run.end("the robot's software was started again");
            }
        }
        let there = if self.epoch == epoch { self.pose_on(map, maps) } else { None };
        let newest = self.newest;
        (self.epoch, self.map) = (epoch, map.to_owned());
        self.fuser = Fuser::new(FuseParams::default());
        self.areas = Arc::default();
        self.trust(maps);
        (self.map_from_odom, self.newest, self.last_message, self.way_m) = (None, None, None, 0.0);
        let moved_at = self.moved_at.take();
        self.unknown();
        self.found.clear();
        if let (Some(pose), Some((at_ns, odometry)), Some(moved_at)) = (there, newest, moved_at) {
            self.moved(at_ns, odometry, moved_at);
            self.begin(at_ns, &pose, ("map_change", "carried_over"), Vec::new());
        }
    }

    /// Judges the capture time of the next message of a stream, with the odometry in it. Where it shows that the robot's
    /// clock was set, the fusion goes on at the new time.
    pub(super) fn stamp(
        &mut self,
        stream: &Stream,
        captured_ns: i64,
        odometry: Option<Pose2>,
        received: Instant,
    ) -> Result<(), Rejection> {
        match self.clock.judge(stream, captured_ns, received)? {
            Stamp::Good => {}
            Stamp::GoodAfterStray(before_ns) => {
                if *stream == Stream::Odometry {
                    self.fuser.retract(before_ns);
                    if let Some((at_ns, _)) = self.newest.as_mut().filter(|(at_ns, _)| *at_ns == before_ns) {
                        *at_ns = captured_ns.saturating_sub(1);
                    }
                }
            }
            Stamp::ClockSet => {
                tracing::info!(epoch = self.epoch, captured_ns, "the robot's clock was set");
                self.clock_set(captured_ns, odometry, received);
            }
        }
        if let (Stream::Odometry, Some(odometry)) = (stream, odometry) {
            self.last_message = Some((captured_ns, odometry));
        }
        Ok(())
    }

    fn clock_set(&mut self, captured_ns: i64, odometry: Option<Pose2>, received: Instant) {
        self.last_message = None;
        if let Some(run) = &mut self.run {
            run.end("the robot's clock was set");
        }
        let Some(odometry) = odometry else { return };
        let elapsed_s = self.elapsed_s(received);
        match self.fuser.set_clock(captured_ns, odometry, elapsed_s) {
            Ok(OdometryOutcome::Jumped) => self.jumped(captured_ns, odometry),
            Ok(OdometryOutcome::Moved | OdometryOutcome::TooOld) => self.advanced(captured_ns, odometry),
            Err(error) => tracing::error!(%error, "checked odometry was refused"),
        }
        self.moved_at = Some(received);
    }

    /// Since odometry was taken last, s.
    fn elapsed_s(&self, now: Instant) -> f64 {
        self.moved_at.map_or(0.0, |at| now.saturating_duration_since(at).as_secs_f64())
    }

    /// How long ago something was captured.
    pub(super) fn age(&self, captured_ns: i64, now: Instant) -> Duration {
        // Without any message of which the time of receipt is known there is no clock to compare with.
        self.clock.age(captured_ns, now).unwrap_or_default()
    }

    /// What the robot's clock shows.
    pub(super) fn clock_ns(&self, now: Instant) -> Option<i64> {
        self.clock.robot_ns(now)
    }

    /// The fused pose by the newest odometry. That is the last message, even where a scan or frame is stamped a little
    /// later: its stamp may be wrong by what is tolerated.
    pub(super) fn pose(&self) -> Option<FusedPose> {
        let fused = self.fuser.pose()?;
        if let Some((at_ns, odometry)) = &self.last_message {
            let later_ns = fused.at_ns.saturating_sub(*at_ns);
            if later_ns > 0 && later_ns as u128 <= AHEAD_TOLERANCE.as_nanos() {
                return self.fuser.pose_by(*at_ns, odometry);
            }
        }
        Some(fused)
    }

    /// Goes by what runs have shown of its map by now.
    fn trust(&mut self, maps: &Snapshots) {
        let Some(map) = maps.get(&self.map) else { return };
        if !Arc::ptr_eq(&map.modalities, &self.areas) {
            self.areas = map.modalities.clone();
            self.fuser.set_modality_map(self.areas.clone());
        }
    }

    /// The pose of this moment in the frame of another map.
    fn pose_on(&self, map: &str, maps: &Snapshots) -> Option<Pose2Covariance> {
        let here = self.fuser.pose()?.pose;
        Some(maps.relation(&self.map, map)?.compose(&here))
    }

    /// Starts the filter from a pose of this moment, and logs it; false if it is out of range.
    fn begin(
        &mut self,
        captured_ns: i64,
        pose: &Pose2Covariance,
        (modality, outcome): (&'static str, &'static str),
        landmarks: Vec<String>,
    ) -> bool {
        if let Err(error) = self.fuser.start(pose) {
            tracing::error!(%error, modality, "a pose to start from is out of range");
            return false;
        }
        let (epoch, map) = (self.epoch, self.map.clone());
        self.log.keep(Correction {
            epoch,
            captured_ns,
            map,
            modality,
            landmarks,
            outcome,
            chi2: None,
            along_m: None,
            across_m: None,
            turn_rad: None,
        });
        true
    }

    /// Takes an odometry reading, at a time of the server's clock.
    pub(super) fn moved(&mut self, captured_ns: i64, odom_from_robot: Pose2, now: Instant) {
        let elapsed_s = self.elapsed_s(now);
        match self.fuser.apply_odometry_after(captured_ns, odom_from_robot, elapsed_s) {
            Ok(OdometryOutcome::Jumped) => {
                self.jumped(captured_ns, odom_from_robot);
                self.moved_at = Some(now);
            }
            Ok(OdometryOutcome::Moved | OdometryOutcome::TooOld) => {
                if let Some(run) = &mut self.run {
                    run.moved(captured_ns, odom_from_robot);
                }
                if self.newest.is_none_or(|(at_ns, _)| at_ns < captured_ns) {
                    self.advanced(captured_ns, odom_from_robot);
                    self.moved_at = Some(now);
                }
            }
            Err(error) => tracing::error!(%error, "checked odometry was refused"),
        }
    }

    /// Another odometry frame: the old one means nothing on the map any more.
    fn jumped(&mut self, captured_ns: i64, odom_from_robot: Pose2) {
        self.map_from_odom = None;
        self.newest = Some((captured_ns, odom_from_robot));
        self.unknown();
        if let Some(run) = &mut self.run {
            run.end("odometry jumped");
        }
    }

    /// This odometry is the newest.
    fn advanced(&mut self, captured_ns: i64, odom_from_robot: Pose2) {
        let before = self.newest.replace((captured_ns, odom_from_robot));
        self.way_m += before.map_or(0.0, |(_, o)| o.between(&odom_from_robot).position().norm());
    }

    /// Takes the odometry of a scan or frame, unless newer odometry tells as much.
    pub(super) fn moved_to(&mut self, captured_ns: i64, odom_from_robot: Pose2, now: Instant) {
        if self.newest.is_none_or(|(at_ns, _)| at_ns < captured_ns) {
            self.moved(captured_ns, odom_from_robot, now);
        }
    }

    /// Takes a fix, logs it, and gives the pose after it: without any odometry that is the fix itself.
    pub(super) fn fix(
        &mut self,
        captured_ns: i64,
        (fix, role): (&Fix, FixRole),
        landmarks: Vec<String>,
    ) -> Option<(FixOutcome, FusedPose)> {
        let before = self.fuser.pose().map(|fused| fused.pose.pose);
        let judged = match self.fuser.apply_fix_as(captured_ns, fix, role) {
            Ok(judged) => judged,
            Err(error) => {
                tracing::error!(%error, "a fix of ours is out of range");
                return None;
            }
        };
        self.rests_on(judged, fix, role);
        let after = self.fuser.pose();
        let kind = if role == FixRole::Guided { GUIDED } else { modality(fix.modality) };
        let (outcome, chi2) = outcome(judged);
        if matches!(judged, FixOutcome::Repeated | FixOutcome::NoPose) {
            self.log.count(kind, outcome);
        } else {
            // A fix by the pose shows nothing of how well landmarks do without it.
            if let Some(run) = self.run.as_mut().filter(|_| role != FixRole::Guided) {
                run.fix(captured_ns, fix);
            }
            let step = moved(before.as_ref(), after.as_ref().map(|fused| &fused.pose.pose));
            self.log.keep(Correction {
                epoch: self.epoch,
                captured_ns,
                map: self.map.clone(),
                modality: kind,
                landmarks,
                outcome,
                chi2,
                along_m: step.map(|s| s.x_m),
                across_m: step.map(|s| s.y_m),
                turn_rad: step.map(|s| s.theta_rad),
            });
        }
        let alone = FusedPose {
            at_ns: captured_ns,
            pose: fix.pose,
            corrections: 1,
            laser_corrections: 0,
            contradictions: 0,
        };
        let fused = if self.newest.is_some() { after? } else { alone };
        Some((judged, fused))
    }

    /// Starts from a pose at a frame, if there is none.
    pub(super) fn found(
        &mut self,
        captured_ns: i64,
        odometry: &Pose2,
        pose: &Pose2Covariance,
        (landmarks, names): (&[LandmarkId], Vec<String>),
        now: Instant,
    ) -> Option<FusedPose> {
        if self.fuser.pose().is_some() {
            return None;
        }
        self.moved(captured_ns, *odometry, now);
        // The fuser starts at the newest odometry, the frame is some way behind it.
        let motion = odometry.between(&self.newest?.1);
        let covariance = FuseParams::default().motion_noise(&motion);
        let there = pose.compose(&Pose2Covariance { pose: motion, covariance });
        self.lost();
        if !self.begin(captured_ns, &there, ("relocalisation", "started"), names) {
            return None;
        }
        self.schedule.relocalised(landmarks);
        self.by_hypotheses = true;
        self.fuser.pose()
    }

    /// Odometry alone on the map; laid there by the first fused pose.
    pub(super) fn on_map(&mut self, odom_from_robot: &Pose2) -> Option<Pose2> {
        if self.map_from_odom.is_none() {
            let fused = self.fuser.pose()?;
            self.map_from_odom = Some(fused.pose.pose.compose(&odom_from_robot.inverse()));
        }
        Some(self.map_from_odom?.compose(odom_from_robot))
    }
}
