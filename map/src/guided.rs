//! Guided recognition, the metric side: predicts landmarks in an image from a known pose, assigns
//! observations to them, and decides when the whole map must be searched as well.
//!
//! Three stages, one file each:
//!
//! 1. [`expect()`]: prior pose, camera and landmarks -> [`Expectations`]: predicted corners with
//!    their covariance, what of each landmark is in view, and a search gate for every corner.
//! 2. [`associate()`]: expectations and observations -> [`Assignment`]: joint compatibility under
//!    one common error of pose, extrinsics and intrinsics. Unique, ambiguous, or none, for each
//!    observation.
//! 3. [`Schedule`]: frame reports -> when to search globally, how far the pose is trusted, when a
//!    pose is replaced.
//!
//! A guided observation corrects a pose. It never starts, supports or replaces one: see
//! [`crate::fuse::FixRole`].

mod associate;
mod error;
mod expect;
mod joint;
mod projection;
mod schedule;
mod sight_line;

pub use associate::{
    Assignment, AssociateParams, Association, Candidate, MAX_CANDIDATES, MAX_NODES, MAX_OBSERVATIONS,
    NotAssociated, Observation, associate,
};
pub use error::GuidedError;
pub use expect::{
    CameraView, ExpectParams, Expectations, Expected, InView, KnownLandmark, MAX_EXPECTED, SearchGate, expect,
};
pub use schedule::{
    Decision, FramePlan, FrameReport, GlobalReason, GuidedReport, MAX_CAMERAS, MAX_SUPPORT, Schedule,
    ScheduleParams, Trust,
};

#[cfg(test)]
mod tests;
