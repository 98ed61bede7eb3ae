//! SLAM: the laser map from scans and odometry. Every scan is matched to those before it, loop
//! closures join revisited places, and all keyframes are fitted together (method 17; 17.6's global
//! optimisation).
//!
//! In: scans with odometry, in order. Out: the trajectory, the walls with covariance, the loop
//! closures. The first pose is the origin of the map. Uncertain loop closures are refused and
//! counted, since a false one folds the map.
//!
//! Departs from method 17.6, an EKF over robot and lines: it stores keyframes and scans instead of
//! lines. A wrong association of a line can then be corrected, curved walls contribute, and the
//! cost of loops stays bounded.

pub mod cloud;
pub(crate) mod surface_index;
mod information;
pub(crate) mod normal_equations;
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
pub use map_builder::{MAX_KEYS, MAX_SCANS, MapKey, Slam, SlamError, SlamMap};
pub use params::{RefineParams, SlamParams};

#[cfg(test)]
pub(crate) mod world;
#[cfg(test)]
mod tests;
