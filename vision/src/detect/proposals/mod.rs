//! Segments in, quad proposals out.

pub mod quad_seed;
pub mod facing;
pub mod quad_proposals;
