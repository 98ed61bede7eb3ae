//! From grey image to quads, one stage a file (method 1 to 3).

pub mod edges;
pub mod chains;
pub mod segments;
pub mod similarity;
pub mod relaxation;
pub mod quads;
