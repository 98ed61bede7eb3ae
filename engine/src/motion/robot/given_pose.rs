//! Poses that a robot is given as a whole: by the last hypothesis of its relocalisation, or by a
//! person.

use super::RobotState;
use map::{
    fuse::{FuseParams, FusedPose},
    pose2::{Pose2, Pose2Covariance},
};
use std::time::Instant;
use vision::model::LandmarkId;

/// Word of a person's poses, among the corrections and among what a pose rests on.
const BY_HAND: &str = "by_hand";
/// Word of the last hypothesis.
const RELOCALISATION: &str = "relocalisation";

impl RobotState {
    /// Starts the filter from the pose of a hypothesis at a frame, if there is no pose yet.
    pub(in crate::motion) fn start_from_hypothesis(
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
        self.apply_odometry(captured_ns, *odometry, now);
        // The fuser starts at the newest odometry; the frame is older.
        let motion = odometry.between(&self.newest?.1);
        let covariance = FuseParams::default().motion_noise(&motion);
        let at_newest = pose.compose(&Pose2Covariance { pose: motion, covariance });
        self.invalidate_pose();
        if !self.start_filter(captured_ns, &at_newest, (RELOCALISATION, "started"), names) {
            return None;
        }
        self.schedule.relocalised(landmarks);
        self.given_by = Some(RELOCALISATION);
        self.fuser.pose()
    }

    /// Puts the robot where a person says it is, at its newest odometry. Nothing that supported an
    /// earlier pose supports this one.
    pub(in crate::motion) fn start_by_hand(&mut self, pose: &Pose2Covariance) -> Option<FusedPose> {
        let (at_ns, _) = self.newest?;
        let before = self.fuser.pose().map(|fused| fused.pose.pose);
        self.invalidate_odometry();
        let outcome = if before.is_some() { "reset" } else { "started" };
        if !self.start_filter(at_ns, pose, (BY_HAND, outcome), Vec::new()) {
            return None;
        }
        self.log.moved(BY_HAND, before.map(|before| before.between(&pose.pose)));
        self.given_by = Some(BY_HAND);
        self.by_hand_ns = Some(at_ns);
        self.fuser.pose()
    }

    /// Whether a frame was taken before a person said where the robot is: it was judged by the pose
    /// before.
    pub(in crate::motion) fn is_before_by_hand(&self, captured_ns: i64) -> bool {
        self.by_hand_ns.is_some_and(|at_ns| captured_ns < at_ns)
    }
}
