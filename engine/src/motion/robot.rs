//! The state of one robot: its clock, its fused pose and what that rests on, the health monitor of
//! its landmarks. A new epoch resets the state; `epochs.rs` decides which epoch is live.

mod given_pose;
mod trust;
pub(super) use trust::StatedPose;

use super::{
    corrections::{Correction, CorrectionLog, modality_word, outcome_word, pose_change},
    run_recording::RunRecording,
    timebase::{AHEAD_TOLERANCE, Stamp, Stream, TimeBase},
};
use crate::{epochs::SequenceTracker, snapshot::Snapshots};
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

/// Supporting landmarks of a pose: the latest.
pub const MAX_SUPPORTING_LANDMARKS: usize = 16;
/// Word of guided fixes, in counters and among what a pose rests on.
const GUIDED: &str = "guided";
/// After this many metres without a fix of a modality, the pose no longer rests on that modality.
pub const RESTS_ON_M: f64 = 10.0;

#[derive(Debug)]
pub(super) struct RobotState {
    pub(super) odometry: SequenceTracker,
    pub(super) scans: SequenceTracker,
    /// Epoch and map that the rest of the state belongs to.
    epoch: u64,
    pub(super) map: String,
    /// The robot's clock in this epoch.
    clock: TimeBase,
    pub(super) fuser: Fuser,
    /// Puts odometry alone on the map, for pages.
    map_from_odom: Option<Pose2>,
    /// The newest odometry of this epoch, and its capture time.
    pub(super) newest: Option<(i64, Pose2)>,
    /// The last odometry message: capture time and reading.
    last_message: Option<(i64, Pose2)>,
    /// When odometry was last applied, by the server's clock.
    moved_at: Option<Instant>,
    /// Distance driven by odometry in this epoch, m.
    distance_m: f64,
    /// `distance_m` at which a global fix, a guided fix and a laser fix last agreed with the pose.
    landmarks_at_m: Option<f64>,
    guided_at_m: Option<f64>,
    laser_at_m: Option<f64>,
    /// Who gave the pose as a whole, while no global fix has confirmed it yet.
    given_by: Option<&'static str>,
    /// Capture time of the odometry at which a person last gave the pose, ns.
    by_hand_ns: Option<i64>,
    /// The landmarks that the pose rests on.
    pub(super) supporting_landmarks: Vec<LandmarkId>,
    /// Health of the landmarks by this robot's frames...
    pub(super) health_monitor: HealthMonitor,
    /// ...and the changes that were not passed on yet.
    pub(super) pending_changes: Vec<HealthChange>,
    pub(super) log: CorrectionLog,
    /// The recording, while there is one.
    pub(super) recording: Option<Box<RunRecording>>,
    /// The modality statistics that the fusion uses.
    modality_map: Arc<ModalityMap>,
    /// Decides which frames are guided, and how far the pose is trusted.
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
            distance_m: 0.0,
            landmarks_at_m: None,
            guided_at_m: None,
            laser_at_m: None,
            given_by: None,
            by_hand_ns: None,
            supporting_landmarks: Vec::new(),
            health_monitor: HealthMonitor::new(HealthParams::default()),
            pending_changes: Vec::new(),
            log: CorrectionLog::default(),
            recording: None,
            modality_map: Arc::default(),
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
    /// Resets the filter on a new epoch or map; converts the pose if the maps are linked.
    pub(super) fn switch_epoch_or_map(&mut self, epoch: u64, map: &str, maps: &Snapshots) {
        if self.epoch == epoch && self.map == map {
            self.refresh_modality_map(maps);
            return;
        }
        if self.epoch != epoch {
            self.clock = TimeBase::default();
        }
        if let Some(recording) = &mut self.recording {
            if recording.map != map {
                recording.end("the robot went to another map");
            } else if self.epoch != epoch && !recording.odometry.is_empty() {
                recording.end("the robot's software was started again");
            }
        }
        let converted = if self.epoch == epoch { self.pose_on(map, maps) } else { None };
        let newest = self.newest;
        (self.epoch, self.map) = (epoch, map.to_owned());
        self.fuser = Fuser::new(FuseParams::default());
        self.modality_map = Arc::default();
        self.refresh_modality_map(maps);
        (self.map_from_odom, self.newest, self.last_message, self.distance_m) = (None, None, None, 0.0);
        let moved_at = self.moved_at.take();
        self.invalidate_odometry();
        self.pending_changes.clear();
        self.by_hand_ns = None;
        if let (Some(pose), Some((at_ns, odometry)), Some(moved_at)) = (converted, newest, moved_at) {
            self.apply_odometry(at_ns, odometry, moved_at);
            self.start_filter(at_ns, &pose, ("map_change", "carried_over"), Vec::new());
        }
    }

    /// Checks the capture time of the next message of a stream, with the odometry in it. If the
    /// robot's clock was set, the fusion goes on at the new time. Errors: the stamp is stray.
    pub(super) fn check_stamp(
        &mut self,
        stream: &Stream,
        captured_ns: i64,
        odometry: Option<Pose2>,
        received: Instant,
    ) -> Result<(), Rejection> {
        match self.clock.check(stream, captured_ns, received)? {
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
                tracing::info!(epoch = self.epoch, captured_ns, "robot_clock_set");
                self.clock_set(captured_ns, odometry, received);
            }
        }
        if let (Stream::Odometry, Some(odometry)) = (stream, odometry) {
            self.last_message = Some((captured_ns, odometry));
        }
        Ok(())
    }

    fn clock_set(&mut self, captured_ns: i64, odometry: Option<Pose2>, received: Instant) {
        (self.last_message, self.by_hand_ns) = (None, None);
        if let Some(recording) = &mut self.recording {
            recording.end("the robot's clock was set");
        }
        let Some(odometry) = odometry else { return };
        let elapsed_s = self.elapsed_s(received);
        match self.fuser.set_clock(captured_ns, odometry, elapsed_s) {
            Ok(OdometryOutcome::Jumped) => self.odometry_jumped(captured_ns, odometry),
            Ok(OdometryOutcome::Moved | OdometryOutcome::TooOld) => self.advance(captured_ns, odometry),
            Err(error) => tracing::error!(%error, "checked_odometry_refused"),
        }
        self.moved_at = Some(received);
    }

    /// Time since odometry was last applied, s; by the clock of a simulation that runs faster.
    fn elapsed_s(&self, now: Instant) -> f64 {
        let elapsed_s = self.moved_at.map_or(0.0, |at| now.saturating_duration_since(at).as_secs_f64());
        elapsed_s * self.clock.rate().max(1.0)
    }

    /// Time since a capture by the robot's clock.
    pub(super) fn age(&self, captured_ns: i64, now: Instant) -> Duration {
        // Before the first message there is no clock to compare with.
        self.clock.age(captured_ns, now).unwrap_or_default()
    }

    /// What the robot's clock shows, ns.
    pub(super) fn clock_ns(&self, now: Instant) -> Option<i64> {
        self.clock.robot_ns(now)
    }

    /// The fused pose by the newest odometry. That is the last message, even if a scan or frame is
    /// stamped a little later: such a stamp may be wrong within the tolerance.
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

    /// Takes the map's present modality statistics.
    fn refresh_modality_map(&mut self, maps: &Snapshots) {
        let Some(map) = maps.get(&self.map) else { return };
        if !Arc::ptr_eq(&map.modalities, &self.modality_map) {
            self.modality_map = map.modalities.clone();
            self.fuser.set_modality_map(self.modality_map.clone());
        }
    }

    /// The present pose in the frame of another map, if the two are linked.
    fn pose_on(&self, map: &str, maps: &Snapshots) -> Option<Pose2Covariance> {
        let here = self.fuser.pose()?.pose;
        Some(maps.relation(&self.map, map)?.compose(&here))
    }

    /// Starts the filter from a pose at the newest odometry, and logs it. False if the pose is out
    /// of range.
    fn start_filter(
        &mut self,
        captured_ns: i64,
        pose: &Pose2Covariance,
        (modality, outcome): (&'static str, &'static str),
        landmarks: Vec<String>,
    ) -> bool {
        if let Err(error) = self.fuser.start(pose) {
            tracing::error!(%error, modality, "start_pose_out_of_range");
            return false;
        }
        let (epoch, map) = (self.epoch, self.map.clone());
        self.log.add(Correction {
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

    /// Applies an odometry reading (odom frame). `now` is by the server's clock.
    pub(super) fn apply_odometry(&mut self, captured_ns: i64, odom_from_robot: Pose2, now: Instant) {
        let elapsed_s = self.elapsed_s(now);
        match self.fuser.apply_odometry_after(captured_ns, odom_from_robot, elapsed_s) {
            Ok(OdometryOutcome::Jumped) => {
                self.odometry_jumped(captured_ns, odom_from_robot);
                self.moved_at = Some(now);
            }
            Ok(OdometryOutcome::Moved | OdometryOutcome::TooOld) => {
                if let Some(recording) = &mut self.recording {
                    recording.add_odometry(captured_ns, odom_from_robot);
                }
                if self.newest.is_none_or(|(at_ns, _)| at_ns < captured_ns) {
                    self.advance(captured_ns, odom_from_robot);
                    self.moved_at = Some(now);
                }
            }
            Err(error) => tracing::error!(%error, "checked_odometry_refused"),
        }
    }

    /// The odom frame has changed: poses by the old one are invalid.
    fn odometry_jumped(&mut self, captured_ns: i64, odom_from_robot: Pose2) {
        self.map_from_odom = None;
        self.newest = Some((captured_ns, odom_from_robot));
        self.invalidate_odometry();
        if let Some(recording) = &mut self.recording {
            recording.end("odometry jumped");
        }
    }

    /// Makes this odometry the newest.
    fn advance(&mut self, captured_ns: i64, odom_from_robot: Pose2) {
        let before = self.newest.replace((captured_ns, odom_from_robot));
        self.distance_m += before.map_or(0.0, |(_, o)| o.between(&odom_from_robot).position().norm());
    }

    /// Applies the odometry of a scan or frame, unless newer odometry is there.
    pub(super) fn apply_odometry_if_newer(&mut self, captured_ns: i64, odom_from_robot: Pose2, now: Instant) {
        if self.newest.is_none_or(|(at_ns, _)| at_ns < captured_ns) {
            self.apply_odometry(captured_ns, odom_from_robot, now);
        }
    }

    /// Applies a fix, logs it, and gives the pose after it; without any odometry that is the fix
    /// itself.
    pub(super) fn apply_fix(
        &mut self,
        captured_ns: i64,
        (fix, role): (&Fix, FixRole),
        landmarks: Vec<String>,
    ) -> Option<(FixOutcome, FusedPose)> {
        let before = self.fuser.pose().map(|fused| fused.pose.pose);
        let result = match self.fuser.apply_fix_as(captured_ns, fix, role) {
            Ok(result) => result,
            Err(error) => {
                tracing::error!(%error, "fix_out_of_range");
                return None;
            }
        };
        self.record_support(result, fix, role);
        let after = self.fuser.pose();
        let kind = if role == FixRole::Guided { GUIDED } else { modality_word(fix.modality) };
        let (outcome, chi2) = outcome_word(result);
        if matches!(result, FixOutcome::Repeated | FixOutcome::NoPose) {
            self.log.count(kind, outcome);
        } else {
            // A guided fix shows nothing of how well landmarks do without a pose.
            if let Some(recording) = self.recording.as_mut().filter(|_| role != FixRole::Guided) {
                recording.add_fix(captured_ns, fix);
            }
            let step = pose_change(before.as_ref(), after.as_ref().map(|fused| &fused.pose.pose));
            self.log.add(Correction {
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
        Some((result, fused))
    }

    /// Odometry alone on the map; the first fused pose puts it there.
    pub(super) fn odometry_on_map(&mut self, odom_from_robot: &Pose2) -> Option<Pose2> {
        if self.map_from_odom.is_none() {
            let fused = self.fuser.pose()?;
            self.map_from_odom = Some(fused.pose.pose.compose(&odom_from_robot.inverse()));
        }
        Some(self.map_from_odom?.compose(odom_from_robot))
    }
}
