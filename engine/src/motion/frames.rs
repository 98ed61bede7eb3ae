//! Frames of a robot: what is known of its pose without one, and what one does to that pose.
//!
//! For each frame on the robot's own map, in this order: [`MotionTracker::frame_stamp`], [`MotionTracker::grounds`], recognition,
//! [`MotionTracker::looked`], and [`MotionTracker::found`] and [`MotionTracker::judged`] where there is something to say. How a fix goes to the
//! fusion is for [`map::guided::Schedule`] to decide: landmarks that were named by the pose correct it and do nothing else.

use super::{MotionTracker, own, robot::RobotState, timebase::Stream};
use map::{
    fuse::{FixRole, FusedPose},
    guided::{Decision, FramePlan, FrameReport},
    landmark_health::{HealthChange, LandmarkHealth, PlaceCheck},
    localise::{AmbiguityResolvedBy, Fix, FixResult},
    pose2::{Pose2, Pose2Covariance},
};
use protos::{CheckedFrame, Name, v1};
use std::time::Instant;
use vision::model::LandmarkId;

/// Which frame of a robot.
#[derive(Debug, Clone, Copy)]
pub struct FrameStamp<'a> {
    /// The map it is in.
    pub map: &'a str,
    /// Echo of the frame.
    pub epoch: u64,
    /// Echo of the frame.
    pub captured_ns: i64,
    /// Odometry at capture, where the frame said.
    pub odometry: Option<Pose2>,
    /// When it is looked at, by the server's clock.
    pub now: Instant,
}

/// What is known of a robot's pose without its frame.
#[derive(Debug, Clone, PartialEq)]
pub struct PriorPose {
    /// `map_from_robot`.
    pub pose: Pose2Covariance,
    /// The landmarks that it rests on.
    pub supporters: Vec<LandmarkId>,
    /// Whether landmarks may be named by it.
    pub plan: FramePlan,
}

/// What a frame says of its robot's pose.
#[derive(Debug, Clone, Copy, Default)]
pub struct FrameFixes<'a> {
    /// The pose without the frame: that of [`PriorPose`].
    pub prior: Option<&'a Pose2Covariance>,
    /// By landmarks that were named without a pose, and without a pose of ours to choose among several solutions.
    pub independent: Option<&'a FixResult>,
    /// By the same landmarks, chosen among several solutions where need be.
    pub chosen: Option<&'a Fix>,
    /// By landmarks that were named by the pose.
    pub guided: Option<&'a Fix>,
    /// Landmarks that should be in the frame and are not.
    pub missed: &'a [LandmarkId],
    /// The frame was not searched for all landmarks of the map.
    pub only_expected: bool,
}

impl<'a> FrameFixes<'a> {
    /// What goes to the fusion of the landmarks that were named without the pose, and as what.
    fn by_decision(&'a self, decision: &'a Decision, guided_corrects: bool) -> Option<(&'a Fix, FixRole)> {
        match decision {
            Decision::Replace(fix) => Some((fix, FixRole::Replacing)),
            Decision::Use | Decision::Doubt { .. } => match self.independent? {
                FixResult::Fixed(fix) => Some((fix, FixRole::Independent)),
                FixResult::Ambiguous(_) | FixResult::Refused(_) => None,
            },
            // A solution that the pose chose agrees with the pose in any case: it may correct it, and is no support.
            Decision::Keep => self
                .chosen
                .filter(|fix| guided_corrects && fix.decided_by == AmbiguityResolvedBy::Prior)
                .map(|fix| (fix, FixRole::Guided)),
        }
    }
}

impl MotionTracker {
    /// Judges the capture time of a frame on its robot's own map. Where it is refused, the frame may be answered, but says
    /// nothing about the robot's pose; what the robot's clock showed at receipt is given instead. Counted.
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
        let Some(shared) = self.followed(robot, map, frame.epoch) else { return Ok(()) };
        let mut followed = own(&shared);
        followed.belong(frame.epoch, map, &self.snapshots);
        let judged = followed.stamp(&stream, frame.captured_ns, frame.odometry, received);
        let instead_ns = followed.clock_ns(received).unwrap_or(frame.captured_ns);
        drop(followed);
        self.lock().stamps.count("frame", robot, judged).ok_or(instead_ns)
    }

    /// What is known of a robot's pose at a frame without the frame itself: for choosing between two solutions, for naming
    /// landmarks that look alike, and for judging landmarks.
    pub fn grounds(&self, robot: &Name, camera: &Name, at: FrameStamp<'_>) -> Option<PriorPose> {
        let followed = self.followed(robot, at.map, at.epoch)?;
        let mut followed = own(&followed);
        self.caught_up(&mut followed, at);
        let pose = followed.fuser.pose_at(at.captured_ns)?;
        let plan = followed.plan(camera, &pose);
        Some(PriorPose { pose, supporters: followed.supporters.clone(), plan })
    }

    /// A frame was looked at: what it says of the pose goes to the fusion. Gives the pose to publish if it said something;
    /// without any odometry that is its fix itself.
    pub fn looked(
        &self,
        robot: &Name,
        camera: &Name,
        at: FrameStamp<'_>,
        says: &FrameFixes<'_>,
    ) -> Option<v1::RobotPose> {
        let followed = self.followed(robot, at.map, at.epoch)?;
        let mut followed = own(&followed);
        self.caught_up(&mut followed, at);
        let motion = followed.since_last_frame(at.odometry);
        let camera = followed.camera_number(camera);
        let decision = followed.schedule.finish(&FrameReport {
            camera,
            motion,
            prior: says.prior,
            searched: !says.only_expected,
            global: says.independent,
            missed: says.missed,
        });
        let guided_corrects = followed.schedule.guided_corrects();
        let guided = says.guided.filter(|_| guided_corrects).map(|fix| (fix, FixRole::Guided));
        let mut fused: Option<FusedPose> = None;
        for (fix, role) in [says.by_decision(&decision, guided_corrects), guided].into_iter().flatten() {
            let landmarks = self.names(at.map, &fix.landmarks);
            let (outcome, after) = followed.fix(at.captured_ns, (fix, role), landmarks)?;
            tracing::debug!(%robot, ?role, ?outcome, "fix");
            fused = Some(after);
        }
        if let Some(odometry) = at.odometry {
            followed.on_map(&odometry);
        }
        let told = followed.told(fused?, at.now);
        drop(followed);
        self.tell(robot, at.map, at.epoch, told)
    }

    /// A robot that searched was found, by landmarks that each may be several: its pose to publish. None if its pose is known
    /// by now.
    pub fn found(
        &self,
        robot: &Name,
        at: FrameStamp<'_>,
        pose: &Pose2Covariance,
        landmarks: &[LandmarkId],
    ) -> Option<v1::RobotPose> {
        let odometry = at.odometry?;
        let names = self.names(at.map, landmarks);
        let followed = self.followed(robot, at.map, at.epoch)?;
        let mut followed = own(&followed);
        followed.belong(at.epoch, at.map, &self.snapshots);
        let fused = followed.found(at.captured_ns, &odometry, pose, (landmarks, names), at.now)?;
        let told = followed.told(fused, at.now);
        drop(followed);
        self.tell(robot, at.map, at.epoch, told)
    }

    /// A frame's landmarks were judged by these grounds: what should change in the map by that.
    pub fn judged(
        &self,
        robot: &Name,
        at: FrameStamp<'_>,
        grounds: &PriorPose,
        judged: &[PlaceCheck],
        missed: &[LandmarkId],
    ) -> Vec<HealthChange> {
        let map = self.snapshots.get(at.map);
        let standing = |id| map.as_ref().and_then(|m| Some(m.landmarks.get(&id)?.standing));
        let Some(followed) = self.followed(robot, at.map, at.epoch) else { return Vec::new() };
        let mut followed = own(&followed);
        followed.belong(at.epoch, at.map, &self.snapshots);
        let mut changes = std::mem::take(&mut followed.found);
        if changes.is_empty() {
            let from = grounds.pose.pose.position().into();
            let now = |id| standing(id).unwrap_or(LandmarkHealth::Sound);
            changes = followed.watch.frame(from, judged, missed, now);
        }
        changes
    }

    /// Brings a robot's state to the frame: its epoch, its map, its odometry.
    fn caught_up(&self, followed: &mut RobotState, at: FrameStamp<'_>) {
        followed.belong(at.epoch, at.map, &self.snapshots);
        if let Some(odometry) = at.odometry {
            followed.moved(at.captured_ns, odometry, at.now);
        }
    }

    /// Names of landmarks, as far as the map has them.
    fn names(&self, map: &str, landmarks: &[LandmarkId]) -> Vec<String> {
        let Some(map) = self.snapshots.get(map) else { return Vec::new() };
        landmarks.iter().filter_map(|id| Some(map.landmarks.get(id)?.name.clone())).collect()
    }
}
