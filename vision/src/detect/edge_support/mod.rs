//! How well edges support a proposed side of a quad.

pub(crate) mod fixed_point;
pub mod gradients;
pub mod side_fit;
pub mod side_support;
pub mod coarse_support;
