//! One pose from odometry and fixes by landmarks and scans, in the order of capture, late ones included (method 15).
//!
//! In: odometry and fixes with their capture times. Out: the fused pose with covariance, or none before the first fix
//! and after odometry has jumped. Scans only correct; a pose begins with landmarks. Errors that last (a landmark's place,
//! the mounting, the walls) are part of the state: a hundred fixes on one landmark do not make its place better known
//! than the map says. So are a wrong scale of odometry and a
//! steady turn: the robot learns its own between landmarks.

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
