//! Homographies, lines and polygons in the image plane.

pub mod homography;
pub mod line;
pub mod polygon;
pub(crate) mod interpolate;
