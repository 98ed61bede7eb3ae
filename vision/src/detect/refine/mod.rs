//! Quad proposals in, quads with sub-pixel corners out (method 3.6).

pub mod corners;
pub mod rating;
pub mod refit;
pub(crate) mod full_size;
