//! What a robot's pose rests on, how far it is trusted, and how it is told.

use super::{GUIDED, MAX_SUPPORTERS, RESTS_ON_M, RobotState, schedule};
use map::{
    fuse::{FixOutcome, FixRole, FusedPose},
    guided::{FramePlan, MAX_CAMERAS, Trust},
    localise::{Fix, FixSource},
    pose2::{Pose2, Pose2Covariance},
};
use protos::{Name, v1::PoseTrust};
use std::time::{Duration, Instant};

/// A pose as it is told.
#[derive(Debug)]
pub(in crate::motion) struct StatedPose {
    pub(in crate::motion) fused: FusedPose,
    /// Since it was captured.
    pub(in crate::motion) age: Duration,
    /// What it rests on.
    pub(in crate::motion) modalities: Vec<String>,
    pub(in crate::motion) trust: PoseTrust,
}

impl RobotState {
    /// The pose has proved wrong, or is unknown: nothing rests on it any more.
    pub(super) fn lost(&mut self) {
        (self.by_landmarks_m, self.by_guided_m, self.by_laser_m) = (None, None, None);
        self.by_hypotheses = false;
        self.supporters.clear();
        let cleared = self.watch.clear();
        self.found.extend(cleared);
    }

    /// The same, and odometry so far means nothing any more.
    pub(super) fn unknown(&mut self) {
        self.lost();
        (self.schedule, self.at_last_frame) = (schedule(), None);
    }

    /// What to do with a camera's next frame, taken near this pose.
    pub(in crate::motion) fn plan(&mut self, camera: &Name, pose: &Pose2Covariance) -> FramePlan {
        let camera = self.camera_number(camera);
        self.schedule.plan(camera, Some(pose))
    }

    /// The camera's number in the schedule; of too many cameras one that it does not count.
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

    /// Motion by odometry since the frame before, for a frame with this odometry or, without, the newest.
    pub(in crate::motion) fn since_last_frame(&mut self, odometry: Option<Pose2>) -> Pose2 {
        let Some(now) = odometry.or(self.newest.map(|(_, newest)| newest)) else { return Pose2::default() };
        let before = self.at_last_frame.replace(now).unwrap_or(now);
        before.between(&now)
    }

    /// A pose as it is told at this moment.
    pub(in crate::motion) fn told(&self, fused: FusedPose, now: Instant) -> StatedPose {
        let trust = match self.schedule.trust() {
            // A pose that came along from another map, which no frame has been compared with yet.
            Trust::NoPose | Trust::Unsupported => PoseTrust::Unsupported,
            Trust::Supported => PoseTrust::Supported,
            Trust::Stale => PoseTrust::Stale,
            Trust::Contradicted => PoseTrust::Contradicted,
        };
        // Without any odometry the pose is the fix itself.
        let modalities = if self.newest.is_some() { self.modalities() } else { vec!["landmarks".to_owned()] };
        StatedPose { fused, age: self.age(fused.at_ns, now), modalities, trust }
    }

    /// Keeps what the pose rests on; of landmarks the latest.
    pub(super) fn rests_on(&mut self, outcome: FixOutcome, fix: &Fix, role: FixRole) {
        match outcome {
            FixOutcome::Started => self.lost(),
            FixOutcome::Reset => {
                self.lost();
                self.schedule.relocalised(&fix.landmarks);
            }
            FixOutcome::Applied { .. } | FixOutcome::ExcludedByMode { .. } | FixOutcome::Repeated => {}
            _ => return,
        }
        match fix.modality {
            FixSource::Laser => self.by_laser_m = Some(self.way_m),
            // The pose does not rest on what was named by it, in the sense that it could be judged by it.
            FixSource::Landmarks if role == FixRole::Guided => self.by_guided_m = Some(self.way_m),
            FixSource::Landmarks => {
                self.by_landmarks_m = Some(self.way_m);
                self.by_hypotheses = false;
                self.supporters.retain(|id| !fix.landmarks.contains(id));
                self.supporters.extend(&fix.landmarks);
                let gone = self.supporters.len().saturating_sub(MAX_SUPPORTERS);
                self.supporters.drain(..gone);
            }
        }
    }

    /// What the pose rests on now; nothing without a pose.
    pub(in crate::motion) fn modalities(&self) -> Vec<String> {
        let near = |at_m: Option<f64>| at_m.is_some_and(|at_m| self.way_m - at_m <= RESTS_ON_M);
        let moves = self.newest.is_some();
        let posed = self.fuser.pose().is_some();
        let all = [
            ("odometry", moves && posed),
            ("landmarks", near(self.by_landmarks_m)),
            (GUIDED, near(self.by_guided_m)),
            ("laser", near(self.by_laser_m)),
            ("relocalisation", self.by_hypotheses),
        ];
        all.into_iter().filter(|(_, rests)| *rests).map(|(word, _)| word.to_owned()).collect()
    }
}
