//! When the whole map must be searched although a pose is known, how far that pose is trusted, and
//! when a global observation replaces it. A state machine over frames: no clock, no images.
//!
//! For each frame: [`Schedule::plan`] before recognition, [`GuidedReport::global_reason`] after
//! guided recognition of the same frame, [`Schedule::finish`] at the end. What `finish` decides
//! says how the frame's global fix goes to the fuser, [`Schedule::guided_corrects`] whether its
//! guided fix does.
//!
//! Only fixes from landmarks that were recognised in the whole map, without the pose, support a
//! pose. Guided observations support nothing: in a row of identical doors they fit a pose that is
//! wrong by one door as well as the right one. So they correct only a pose that has had support;
//! otherwise they would make a wrong pose more certain.
//!
//! A pose with no support yet is replaced after [`ScheduleParams::unsupported_reset_fixes`]
//! contradicting fixes that agree with one another. A pose that
//! [`ScheduleParams::established_landmarks`] different landmarks support needs
//! [`ScheduleParams::reset_fixes`] and two witnesses: two contradicting landmarks, or one and an
//! expected landmark that is missing. One landmark that was moved must not move robots.

mod params;
mod report;
mod agreement;

pub use params::ScheduleParams;
pub use report::{Decision, FramePlan, FrameReport, GlobalReason, GuidedReport, Trust};

use crate::{
    fuse::FuseParams,
    guided::schedule::agreement::{PoseAgreement, agreement, is_uncertain},
    localise::{Fix, FixResult},
    pose2::{Pose2, Pose2Covariance},
};
use std::collections::BTreeMap;
use vision::model::LandmarkId;

/// Most landmarks remembered as support of a pose, or as contradicting it; the oldest go first.
pub const MAX_SUPPORT: usize = 16;
/// Most cameras of a robot whose searches are counted.
pub const MAX_CAMERAS: usize = 16;

/// Global fixes that contradict the pose and agree with one another.
#[derive(Debug, Clone)]
struct Contradiction {
    /// The latest, carried along by odometry; `None` where it has several solutions.
    pose: Option<Pose2Covariance>,
    count: u32,
    landmarks: Vec<LandmarkId>,
    missed: Vec<LandmarkId>,
}

/// One robot's schedule on one map. A new one when the map or the odometry frame changes.
#[derive(Debug, Clone, Default)]
pub struct Schedule {
    params: ScheduleParams,
    noise: FuseParams,
    has_pose: bool,
    /// A global fix has agreed with this pose.
    was_supported: bool,
    /// The last frame replaced the pose.
    was_replaced: bool,
    /// Frames of each camera since the last that was searched globally.
    searches: BTreeMap<u32, u32>,
    frames_since_support: u32,
    metres_since_support: f64,
    /// Landmarks that agreed with the pose, with the metres driven since, the latest last.
    support: Vec<(LandmarkId, f64)>,
    contradiction: Option<Contradiction>,
}

impl Schedule {
    /// A schedule without knowledge. `noise` is the noise model of odometry between frames.
    pub fn new(params: ScheduleParams, noise: FuseParams) -> Self {
        Self { params, noise, ..Self::default() }
    }

    /// How far the pose is trusted after the last frame.
    pub fn trust(&self) -> Trust {
        if !self.has_pose {
            Trust::NoPose
        } else if self.contradiction.is_some() {
            Trust::Contradicted
        } else if !self.was_supported {
            Trust::Unsupported
        } else if self.is_stale() {
            Trust::Stale
        } else {
            Trust::Supported
        }
    }

    /// Whether the guided fix of the last frame may go to the fuser (as `FixRole::Guided`): the
    /// pose has had support and the frame does not contradict it.
    pub fn guided_corrects(&self) -> bool {
        self.was_supported && self.contradiction.is_none() && !self.was_replaced
    }

    /// The pose was found by relocalisation from several observations of these landmarks: that is
    /// support.
    pub fn relocalised(&mut self, landmarks: &[LandmarkId]) {
        self.forget();
        self.has_pose = true;
        self.supported(landmarks);
    }

    /// What to do with the next frame of a camera, taken near `prior`. Cameras are numbered by the
    /// caller; of more than [`MAX_CAMERAS`] the others are searched every time.
    pub fn plan(&self, camera: u32, prior: Option<&Pose2Covariance>) -> FramePlan {
        let p = &self.params;
        let Some(prior) = prior else {
            return FramePlan { guided: false, global: Some(GlobalReason::NoPose) };
        };
        if self.contradiction.is_some() {
            return FramePlan { guided: false, global: Some(GlobalReason::Contradicted) };
        }
        let interval =
            if self.support.is_empty() { p.unsupported_interval_frames } else { p.interval_frames };
        let global = if is_uncertain(prior, p) {
            Some(GlobalReason::Uncertain)
        } else if self.is_stale() {
            Some(GlobalReason::Stale)
        } else if self.frames_since_search(camera).saturating_add(1) >= interval {
            Some(GlobalReason::Interval)
        } else {
            None
        };
        FramePlan { guided: true, global }
    }

    /// Ends a frame.
    pub fn finish(&mut self, frame: &FrameReport<'_>) -> Decision {
        self.carry(&frame.motion);
        self.count_search(frame.camera, frame.searched);
        self.was_replaced = false;
        let Some(prior) = frame.prior else {
            return self.without_pose(frame);
        };
        self.has_pose = true;
        let Some(global) = frame.global else { return Decision::Keep };
        match agreement(global, prior, &self.params) {
            PoseAgreement::Agrees(fix) => {
                self.supported(&fix.landmarks);
                Decision::Use
            }
            PoseAgreement::Silent => Decision::Keep,
            PoseAgreement::Contradicts(fixes) => self.contradicted(fixes, frame.missed),
        }
    }

    /// Number of landmarks remembered, in all lists.
    #[cfg(test)]
    pub(super) fn remembered(&self) -> usize {
        self.support.len() + self.contradiction.as_ref().map_or(0, |c| c.landmarks.len() + c.missed.len())
    }

    /// A global fix starts a pose.
    fn without_pose(&mut self, frame: &FrameReport<'_>) -> Decision {
        self.forget();
        self.has_pose = false;
        match frame.global {
            Some(FixResult::Fixed(fix)) => {
                self.has_pose = true;
                self.supported(&fix.landmarks);
                Decision::Use
            }
            Some(FixResult::Ambiguous(_) | FixResult::Refused(_)) | None => Decision::Keep,
        }
    }

    fn frames_since_search(&self, camera: u32) -> u32 {
        let unknown = if self.searches.len() < MAX_CAMERAS { 0 } else { u32::MAX };
        self.searches.get(&camera).copied().unwrap_or(unknown)
    }

    fn count_search(&mut self, camera: u32, searched: bool) {
        if self.searches.len() >= MAX_CAMERAS && !self.searches.contains_key(&camera) {
            return;
        }
        let since = self.searches.entry(camera).or_insert(0);
        *since = if searched { 0 } else { since.saturating_add(1) };
    }

    fn is_stale(&self) -> bool {
        let p = &self.params;
        self.frames_since_support >= p.max_guided_frames || self.metres_since_support >= p.max_guided_m
    }

    fn forget(&mut self) {
        self.support.clear();
        (self.contradiction, self.was_supported) = (None, false);
        (self.frames_since_support, self.metres_since_support) = (0, 0.0);
    }

    /// Ages everything by a motion.
    fn carry(&mut self, motion: &Pose2) {
        let metres = motion.position().norm();
        self.frames_since_support = self.frames_since_support.saturating_add(1);
        self.metres_since_support += metres;
        for (_, since) in &mut self.support {
            *since += metres;
        }
        self.support.retain(|(_, since)| *since <= self.params.support_m);
        let noise = self.noise.motion_noise(motion);
        if let Some(pose) = self.contradiction.as_mut().and_then(|c| c.pose.as_mut()) {
            *pose = pose.compose(&Pose2Covariance { pose: *motion, covariance: noise });
        }
    }

    fn supported(&mut self, landmarks: &[LandmarkId]) {
        (self.contradiction, self.was_supported) = (None, true);
        (self.frames_since_support, self.metres_since_support) = (0, 0.0);
        self.support.retain(|(landmark, _)| !landmarks.contains(landmark));
        self.support.extend(landmarks.iter().map(|landmark| (*landmark, 0.0)));
        let gone = self.support.len().saturating_sub(MAX_SUPPORT);
        self.support.drain(..gone);
    }

    /// Counts contradicting fixes that agree; enough of them replace the pose.
    fn contradicted(&mut self, fixes: &[Fix], missed: &[LandmarkId]) -> Decision {
        let single = if let [fix] = fixes { Some(fix) } else { None };
        let agrees = |c: &Contradiction| {
            // A fix with several solutions agrees by any of them, but counts for none.
            c.pose.as_ref().is_none_or(|pose| {
                fixes.iter().any(|f| pose.distance2(&f.pose).is_some_and(|d| d <= self.params.support_chi2))
            })
        };
        let mut contradiction = self.contradiction.take().filter(agrees).unwrap_or(Contradiction {
            pose: None,
            count: 0,
            landmarks: Vec::new(),
            missed: Vec::new(),
        });
        if let Some(fix) = single {
            contradiction.pose = Some(fix.pose);
            contradiction.count = contradiction.count.saturating_add(1);
            remember(&mut contradiction.landmarks, &fix.landmarks);
            remember(&mut contradiction.missed, missed);
        }
        let Contradiction { count, landmarks, missed, .. } = &contradiction;
        let p = &self.params;
        let missing = missed.iter().any(|id| !landmarks.contains(id));
        let witnesses = landmarks.len() + usize::from(missing);
        // Stale support does not count.
        let support = if self.is_stale() { 0 } else { self.support.len() };
        let needed = if support >= p.established_landmarks { 2 } else { 1 };
        let fixes_needed = if support == 0 { p.unsupported_reset_fixes } else { p.reset_fixes };
        let in_a_row = *count;
        if let Some(fix) = single
            && in_a_row >= fixes_needed
            && witnesses >= needed
        {
            self.forget();
            self.supported(&fix.landmarks);
            self.was_replaced = true;
            return Decision::Replace(Box::new(fix.clone()));
        }
        self.contradiction = Some(contradiction);
        Decision::Doubt { in_a_row }
    }
}

fn remember(known: &mut Vec<LandmarkId>, more: &[LandmarkId]) {
    for id in more {
        if known.len() < MAX_SUPPORT && !known.contains(id) {
            known.push(*id);
        }
    }
}
