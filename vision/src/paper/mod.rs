//! The method of the paper where the product departs from it: off, unless parameters or a map's
//! distance ask for it. Sets of three sides are on: points name what is seen in them.
//!
//! Product code imports it at a few places only, which a test lists (`tests/end_to_end/tidy.rs`).

pub mod tiling;
pub mod relaxation;
pub mod three_sided;
pub(crate) mod detector;
pub(crate) mod deciding_distance;
pub mod entropy;
pub(crate) mod preset;
