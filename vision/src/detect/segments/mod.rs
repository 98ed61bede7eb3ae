//! Edge map in, straight segments out (method 1.2 to 1.4).

pub mod bridging;
pub mod chains;
pub(crate) mod polyline;
pub mod joining;
pub mod edge_segments;
