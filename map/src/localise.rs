//! Localisation by landmarks: from landmarks of known place, observed by a camera of known
//! extrinsics, to the robot's pose on the floor (method 13.6).
//!
//! In: observations, extrinsics, an optional prior pose. Out: one pose with its covariance, several
//! that cannot be told apart, or a refusal. The robot stands upright on the floor, so (x, y, theta)
//! is fitted to all corners of all landmarks at once (method 13.6, variant b). A solution is chosen
//! only if image, wall and prior decide.

mod params;
mod fix;
pub(crate) mod derivatives;
pub(crate) mod predict;
mod planar;
mod posterior;
mod spatial;
mod solve;
mod refusal_causes;
mod robot_pose;
mod camera_pose;
mod pose_cautions;
pub mod intrinsics_monitor;

pub use camera_pose::{CameraPose, CameraPoseRefusal, camera_pose};
pub use fix::{
    AmbiguityResolvedBy, Fix, FixRefusal, FixResult, FixSource, LandmarkObservation, Nuisance, NuisanceKey,
};
pub use params::LocaliseParams;
pub use pose_cautions::{PoseCaution, pose_cautions};
pub use refusal_causes::{FixQuantity, RefusalCause, refusal_causes};
pub use robot_pose::{MAX_OBSERVATIONS, robot_pose};

#[cfg(test)]
mod tests;
