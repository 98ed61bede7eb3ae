//! From grey image to quads, one stage a file (method 1 to 3).

mod deriche;
mod thinning;
mod bridging;
mod joining;
mod polyline;
#[cfg(test)]
mod rendering;
pub mod edges;
pub mod chains;
pub mod segments;
pub mod similarity;
pub mod relaxation;
pub mod quads;
