//! Edge map in, straight segments out (method 1.2 to 1.4).

pub mod gap_closing;
pub mod chains;
pub(crate) mod polyline;
pub mod collinear_merge;
pub mod edge_segments;
