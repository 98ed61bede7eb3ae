//! From landmarks of known place, seen by a camera of known mounting, to the robot's pose on the floor (method 13.6).
//!
//! In: sightings, the mounting, perhaps a prior. Out: one pose with its covariance, or that several are left, or why
//! there is none. The robot stands upright on the floor, so three numbers are fitted to all corners of all landmarks at
//! once (method 13.6, variant b). It never picks a solution that image, wall and prior leave undecided.

mod params;
mod fix;
mod derivatives;
pub(crate) mod predict;
mod planar;
mod posterior;
mod solve;
mod robot_pose;
pub mod intrinsics_monitor;

pub use fix::{
    AmbiguityResolvedBy, Fix, FixRefusal, FixResult, FixSource, LandmarkObservation, Nuisance, NuisanceKey,
};
pub use params::LocaliseParams;
pub use robot_pose::{MAX_SIGHTINGS, robot_pose};

#[cfg(test)]
mod tests;
