//! Segments in, the same without those of a patterned floor out (method 1.5).

pub mod tiling_params;
pub(crate) mod floor;
pub(crate) mod period;
pub mod floor_tiling;
