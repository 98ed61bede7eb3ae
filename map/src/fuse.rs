//! Fusion of odometry and fixes into one pose, in the order of capture, late events included
//! (method 15).
//!
//! In: odometry and fixes with their capture times. Out: the fused pose with covariance; none
//! before the first fix and after a jump of odometry. Scans only correct; landmarks start a pose.
//! Nuisance parameters (places, extrinsics, walls) are part of the state: a hundred fixes on one
//! landmark do not make its place more certain than the map says. Systematic odometry errors
//! (scale, drift) are part of the state too and are estimated between landmarks.

mod params;
mod outcome;
mod rules;
mod error_correction;
mod belief;
mod filter;
mod replay;
mod fuser;

pub use belief::{MAX_NUISANCES, SystematicOdometryError};
pub use filter::MAX_SOURCES;
pub use fuser::{Fuser, MAX_EVENTS};
pub use outcome::{FixOutcome, FixRole, FusedPose, OdometryOutcome};
pub use params::FuseParams;

#[cfg(test)]
mod tests;
