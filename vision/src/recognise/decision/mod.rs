//! Verified landmarks in, the verdict out (method 10).

pub mod result;
pub mod measures;
pub mod confidence;
pub(crate) mod confidence_weights;
pub mod matched_border;
pub(crate) mod by_points;
pub mod verdict;
pub(crate) mod by_texture;
pub mod expected;
