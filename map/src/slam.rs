//! The laser map from scans and odometry: every scan is matched with those before it, places met again close loops, and
//! all key poses are fitted to everything at once (method 17; 17.6's global optimisation).
//!
//! In: scans with odometry, in order. Out: the path, the walls with their covariance, the loops. The first pose is the
//! origin of the map. What does not fit is left out and counted: a false loop folds a building over.
//!
//! Departs from method 17.6, an EKF over robot and lines: key poses and scans are kept instead of lines, so that a line
//! wrongly associated once does no harm for ever, curved walls help too, and loops cost no more than they must.

pub mod cloud;
pub(crate) mod surface_index;
mod information;
pub mod icp;
pub mod correlative;
pub mod graph;
mod keyframe;
mod params;
mod scan_matcher;
mod loop_closure;
mod refine;
mod map_builder;

pub use loop_closure::{LoopClosure, LoopParams};
pub use map_builder::{MAX_KEYS, MAX_SCANS, Slam, SlamError, SlamMap};
pub use params::{RefineParams, SlamParams};

#[cfg(test)]
pub(crate) mod world;
#[cfg(test)]
mod tests;
