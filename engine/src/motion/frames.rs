//! Frames of a robot: its prior pose without a frame, and what a frame does to that pose.
//!
//! The calls for each frame on the robot's own map, in this order: [`MotionTracker::frame_stamp`],
//! [`MotionTracker::prior_pose`], recognition, [`MotionTracker::apply_frame`], and where they apply
//! [`MotionTracker::start_from_hypothesis`] and [`MotionTracker::update_landmark_health`].
//! [`map::guided::Schedule`] decides in which role a fix goes to the fusion: landmarks that the
//! prior pose named correct it and do nothing else.

use super::{MAX_POSE_AGE, MotionTracker, lock_robot, robot::RobotState, timebase::Stream};
use crate::inputs::Input;
use map::{
    fuse::{FixRole, FusedPose},
    guided::{Decision, FramePlan, FrameReport},
    landmark_health::{HealthChange, LandmarkHealth, PlaceCheck},
    localise::{AmbiguityResolvedBy, Fix, FixResult},
    pose2::{Pose2, Pose2Covariance},
};
use protos::{CheckedFrame, Name, v1};
use std::{
    sync::{Arc, Mutex},
    time::Instant,
};
use vision::model::LandmarkId;

/// Identifies a frame of a robot.
#[derive(Debug, Clone, Copy)]
pub struct FrameStamp<'a> {
    /// The map it is in.
    pub map: &'a str,
    /// Echo of the frame.
    pub epoch: u64,
    /// Echo of the frame.
    pub captured_ns: i64,
    /// Odometry at capture (odom frame), if the frame has it.
    pub odometry: Option<Pose2>,
    /// Present time, by the server's clock.
    pub now: Instant,
}

/// A robot's pose without its frame.
#[derive(Debug, Clone, PartialEq)]
pub struct PriorPose {
    /// `map_from_robot` (m and rad, with covariance).
    pub pose: Pose2Covariance,
    /// The landmarks that it rests on.
    pub supporting_landmarks: Vec<LandmarkId>,
    /// Whether landmarks may be named by it.
    pub plan: FramePlan,
}

/// The fixes of one frame.
#[derive(Debug, Clone, Copy, Default)]
pub struct FrameFixes<'a> {
    /// The pose without the frame: that of [`PriorPose`].
    pub prior: Option<&'a Pose2Covariance>,
    /// By landmarks that the picture alone names, without the server's prior to choose among
    /// several solutions.
    pub independent: Option<&'a FixResult>,
    /// By the same landmarks; the prior chooses among several solutions.
    pub chosen: Option<&'a Fix>,
    /// By landmarks that the prior pose names.
    pub guided: Option<&'a Fix>,
    /// Landmarks that were expected in the frame and not observed.
    pub missed: &'a [LandmarkId],
    /// The frame was not searched for all landmarks of the map.
    pub only_expected: bool,
}

impl<'a> FrameFixes<'a> {
    /// The fix by landmarks that the picture alone names, as the fusion gets it, and its role.
    fn by_decision(&'a self, decision: &'a Decision, guided_corrects: bool) -> Option<(&'a Fix, FixRole)> {
        match decision {
            Decision::Replace(fix) => Some((fix, FixRole::Replacing)),
            Decision::Use | Decision::Doubt { .. } => match self.independent? {
                FixResult::Fixed(fix) => Some((fix, FixRole::Independent)),
                FixResult::Ambiguous(_) | FixResult::Refused(_) => None,
            },
            // A solution that the pose chose agrees with the pose in any case: it may correct the
            // pose, and is no support.
            Decision::Keep => self
                .chosen
                .filter(|fix| guided_corrects && fix.decided_by == AmbiguityResolvedBy::Prior)
                .map(|fix| (fix, FixRole::Guided)),
        }
    }
}

impl MotionTracker {
    /// Checks the capture time of a frame on its robot's own map, and counts the result. The error
    /// is the time that the robot's clock showed at receipt, ns: such a frame may be answered, and
    /// must not change the robot's pose.
    pub fn frame_stamp(
        &self,
        (robot, camera): (&Name, &Name),
        map: &str,
        frame: &CheckedFrame,
        received: Instant,
    ) -> Result<(), i64> {
        let stream = match frame.odometry {
            Some(_) => Stream::MovingCamera(camera.clone()),
            None => Stream::Camera(camera.clone()),
        };
        let Some(shared) = self.robot_state(robot, map, frame.epoch) else { return Ok(()) };
        let mut state = lock_robot(&shared);
        state.switch_epoch_or_map(frame.epoch, map, &self.snapshots);
        let checked = state.check_stamp(&stream, frame.captured_ns, frame.odometry, received);
        let instead_ns = state.clock_ns(received).unwrap_or(frame.captured_ns);
        drop(state);
        if let Err(rejection) = &checked {
            self.observer.message(robot, Input::Frame, Some(rejection), received);
        }
        self.lock().stamps.count(checked).ok_or(instead_ns)
    }

    /// The robot's pose at a frame without the frame. It chooses between two solutions, names
    /// look-alikes, and checks landmarks against their places.
    pub fn prior_pose(&self, robot: &Name, camera: &Name, at: FrameStamp<'_>) -> Option<PriorPose> {
        let state = self.robot_state(robot, at.map, at.epoch)?;
        let mut state = lock_robot(&state);
        self.catch_up(&mut state, at);
        let pose = state.fuser.pose_at(at.captured_ns)?;
        let plan = state.plan(camera, &pose);
        Some(PriorPose { pose, supporting_landmarks: state.supporting_landmarks.clone(), plan })
    }

    /// Passes the fixes of a frame to the fusion. Gives the pose to publish if there was a fix;
    /// without any odometry that is the fix itself.
    pub fn apply_frame(
        &self,
        robot: &Name,
        camera: &Name,
        at: FrameStamp<'_>,
        fixes: &FrameFixes<'_>,
    ) -> Option<v1::RobotPose> {
        let state = self.robot_state(robot, at.map, at.epoch)?;
        let mut state = lock_robot(&state);
        self.catch_up(&mut state, at);
        if state.is_before_by_hand(at.captured_ns) {
            return None;
        }
        let motion = state.since_last_frame(at.odometry);
        let camera = state.camera_number(camera);
        let decision = state.schedule.finish(&FrameReport {
            camera,
            motion,
            prior: fixes.prior,
            searched: !fixes.only_expected,
            global: fixes.independent,
            missed: fixes.missed,
        });
        let guided_corrects = state.schedule.guided_corrects();
        let guided = fixes.guided.filter(|_| guided_corrects).map(|fix| (fix, FixRole::Guided));
        let mut fused: Option<FusedPose> = None;
        for (fix, role) in [fixes.by_decision(&decision, guided_corrects), guided].into_iter().flatten() {
            let landmarks = self.names(at.map, &fix.landmarks);
            let (outcome, after) = state.apply_fix(at.captured_ns, (fix, role), landmarks)?;
            tracing::debug!(%robot, ?role, ?outcome, "fix_applied");
            fused = Some(after);
        }
        if let Some(odometry) = at.odometry {
            state.odometry_on_map(&odometry);
        }
        let stated = state.state_pose(fused?, at.now);
        drop(state);
        self.announce(robot, at.map, at.epoch, stated)
    }

    /// Starts the fusion of a relocalised robot from the last hypothesis, and gives its pose to
    /// publish. `None` if the robot has a pose by now.
    pub fn start_from_hypothesis(
        &self,
        robot: &Name,
        at: FrameStamp<'_>,
        pose: &Pose2Covariance,
        landmarks: &[LandmarkId],
    ) -> Option<v1::RobotPose> {
        let odometry = at.odometry?;
        let names = self.names(at.map, landmarks);
        let state = self.robot_state(robot, at.map, at.epoch)?;
        let mut state = lock_robot(&state);
        state.switch_epoch_or_map(at.epoch, at.map, &self.snapshots);
        let fused =
            state.start_from_hypothesis(at.captured_ns, &odometry, pose, (landmarks, names), at.now)?;
        let stated = state.state_pose(fused, at.now);
        drop(state);
        self.announce(robot, at.map, at.epoch, stated)
    }

    /// Whether a robot on this map says how it moves: its newest odometry is not older than
    /// [`MAX_POSE_AGE`].
    pub fn hears_odometry(&self, robot: &Name, map: &str, now: Instant) -> bool {
        self.moving(robot, map, now).is_some()
    }

    /// Puts a robot where a person says it is, and gives its pose to publish. It is unsupported
    /// until a landmark agrees with it. `None` if no odometry of the robot on this map is heard:
    /// nothing would carry the pose on.
    pub fn set_pose_by_hand(
        &self,
        robot: &Name,
        map: &str,
        pose: &Pose2Covariance,
        now: Instant,
    ) -> Option<v1::RobotPose> {
        let (epoch, state) = self.moving(robot, map, now)?;
        let mut state = lock_robot(&state);
        let fused = state.start_by_hand(pose)?;
        let stated = state.state_pose(fused, now);
        drop(state);
        self.announce(robot, map, epoch, stated)
    }

    /// The live epoch and the state of a robot whose odometry is heard.
    fn moving(&self, robot: &Name, map: &str, now: Instant) -> Option<(u64, Arc<Mutex<RobotState>>)> {
        let epoch = self.epochs.current(robot)?;
        let shared = self.robot_state(robot, map, epoch)?;
        let mut state = lock_robot(&shared);
        state.switch_epoch_or_map(epoch, map, &self.snapshots);
        let (at_ns, _) = state.newest?;
        let is_heard = state.age(at_ns, now) <= MAX_POSE_AGE;
        drop(state);
        is_heard.then_some((epoch, shared))
    }

    /// Updates the health of landmarks by a frame's checks against this prior pose. Gives the
    /// changes to be stored.
    pub fn update_landmark_health(
        &self,
        robot: &Name,
        at: FrameStamp<'_>,
        prior: &PriorPose,
        observed: &[PlaceCheck],
        missed: &[LandmarkId],
    ) -> Vec<HealthChange> {
        let map = self.snapshots.get(at.map);
        let health = |id| map.as_ref().and_then(|m| Some(m.landmarks.get(&id)?.health));
        let Some(state) = self.robot_state(robot, at.map, at.epoch) else { return Vec::new() };
        let mut state = lock_robot(&state);
        state.switch_epoch_or_map(at.epoch, at.map, &self.snapshots);
        let mut changes = std::mem::take(&mut state.pending_changes);
        if changes.is_empty() {
            let from = prior.pose.pose.position().into();
            let now = |id| health(id).unwrap_or(LandmarkHealth::Sound);
            changes = state.health_monitor.frame(from, observed, missed, now);
        }
        changes
    }

    /// Brings a robot's state to the frame's epoch, map and odometry.
    fn catch_up(&self, state: &mut RobotState, at: FrameStamp<'_>) {
        state.switch_epoch_or_map(at.epoch, at.map, &self.snapshots);
        if let Some(odometry) = at.odometry {
            state.apply_odometry(at.captured_ns, odometry, at.now);
        }
    }

    /// Names of landmarks that the map has.
    fn names(&self, map: &str, landmarks: &[LandmarkId]) -> Vec<String> {
        let Some(map) = self.snapshots.get(map) else { return Vec::new() };
        landmarks.iter().filter_map(|id| Some(map.landmarks.get(id)?.name.clone())).collect()
    }
}
