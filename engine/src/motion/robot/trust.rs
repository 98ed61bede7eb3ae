//! What a robot's pose rests on, and how far it is trusted.

use super::{GUIDED, MAX_SUPPORTING_LANDMARKS, RESTS_ON_M, RobotState, schedule};
use map::{
    fuse::{FixOutcome, FixRole, FusedPose},
    guided::{FramePlan, MAX_CAMERAS, Trust},
    localise::{Fix, FixSource},
    pose2::{Pose2, Pose2Covariance},
};
use protos::{Name, v1::PoseTrust};
use std::time::{Duration, Instant};

/// A pose as it is published.
#[derive(Debug)]
pub(in crate::motion) struct StatedPose {
    pub(in crate::motion) fused: FusedPose,
    /// Time since its capture.
    pub(in crate::motion) age: Duration,
    /// What it rests on.
    pub(in crate::motion) modalities: Vec<String>,
    pub(in crate::motion) trust: PoseTrust,
}

impl RobotState {
    /// The pose was wrong or is unknown: forgets its support, and withdraws the health changes that
    /// rest on it.
    pub(super) fn invalidate_pose(&mut self) {
        (self.landmarks_at_m, self.guided_at_m, self.laser_at_m) = (None, None, None);
        self.given_by = None;
        self.supporting_landmarks.clear();
        let cleared = self.health_monitor.clear();
        self.pending_changes.extend(cleared);
    }

    /// The same, and odometry so far is invalid: restarts the schedule.
    pub(super) fn invalidate_odometry(&mut self) {
        self.invalidate_pose();
        (self.schedule, self.at_last_frame) = (schedule(), None);
    }

    /// The plan for a camera's next frame near this pose.
    pub(in crate::motion) fn plan(&mut self, camera: &Name, pose: &Pose2Covariance) -> FramePlan {
        let camera = self.camera_number(camera);
        self.schedule.plan(camera, Some(pose))
    }

    /// The camera's number in the schedule; `u32::MAX` for cameras beyond the bound.
    pub(in crate::motion) fn camera_number(&mut self, camera: &Name) -> u32 {
        if let Some(number) = self.cameras.iter().position(|known| known == camera) {
            return number as u32;
        }
        if self.cameras.len() >= MAX_CAMERAS {
            return u32::MAX;
        }
        self.cameras.push(camera.clone());
        self.cameras.len() as u32 - 1
    }

    /// Motion by odometry since the frame before, for a frame with this odometry or, without, the
    /// newest.
    pub(in crate::motion) fn since_last_frame(&mut self, odometry: Option<Pose2>) -> Pose2 {
        let Some(now) = odometry.or(self.newest.map(|(_, newest)| newest)) else { return Pose2::default() };
        let before = self.at_last_frame.replace(now).unwrap_or(now);
        before.between(&now)
    }

    /// The pose as it is published now.
    pub(in crate::motion) fn state_pose(&self, fused: FusedPose, now: Instant) -> StatedPose {
        let trust = match self.schedule.trust() {
            // `NoPose`: the pose was carried over from another map, and no frame has checked it
            // yet.
            Trust::NoPose | Trust::Unsupported => PoseTrust::Unsupported,
            Trust::Supported => PoseTrust::Supported,
            Trust::Stale => PoseTrust::Stale,
            Trust::Contradicted => PoseTrust::Contradicted,
        };
        // Without any odometry the pose is the fix itself.
        let modalities = if self.newest.is_some() { self.modalities() } else { vec!["landmarks".to_owned()] };
        StatedPose { fused, age: self.age(fused.at_ns, now), modalities, trust }
    }

    /// Records that the pose rests on this fix; of landmarks the latest.
    pub(super) fn record_support(&mut self, outcome: FixOutcome, fix: &Fix, role: FixRole) {
        match outcome {
            FixOutcome::Started => self.invalidate_pose(),
            FixOutcome::Reset => {
                self.invalidate_pose();
                self.schedule.relocalised(&fix.landmarks);
            }
            FixOutcome::Applied { .. } | FixOutcome::ExcludedByMode { .. } | FixOutcome::Repeated => {}
            _ => return,
        }
        match fix.modality {
            FixSource::Laser => self.laser_at_m = Some(self.distance_m),
            // A landmark that the pose named cannot support the pose: it never becomes a supporting
            // landmark.
            FixSource::Landmarks if role == FixRole::Guided => self.guided_at_m = Some(self.distance_m),
            FixSource::Landmarks => {
                self.landmarks_at_m = Some(self.distance_m);
                self.given_by = None;
                self.supporting_landmarks.retain(|id| !fix.landmarks.contains(id));
                self.supporting_landmarks.extend(&fix.landmarks);
                let excess = self.supporting_landmarks.len().saturating_sub(MAX_SUPPORTING_LANDMARKS);
                self.supporting_landmarks.drain(..excess);
            }
        }
    }

    /// What the pose rests on now; nothing without a pose.
    pub(in crate::motion) fn modalities(&self) -> Vec<String> {
        let is_recent = |at_m: Option<f64>| at_m.is_some_and(|at_m| self.distance_m - at_m <= RESTS_ON_M);
        let (has_odometry, has_pose) = (self.newest.is_some(), self.fuser.pose().is_some());
        let all = [
            ("odometry", has_odometry && has_pose),
            ("landmarks", is_recent(self.landmarks_at_m)),
            (GUIDED, is_recent(self.guided_at_m)),
            ("laser", is_recent(self.laser_at_m)),
        ];
        let given_by = self.given_by.into_iter();
        let resting = all.into_iter().filter(|(_, rests)| *rests).map(|(word, _)| word);
        resting.chain(given_by).map(str::to_owned).collect()
    }
}
