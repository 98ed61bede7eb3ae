//! Corners, homographies, lines and polygons in the image plane.

pub mod corners;
pub mod corner_covariance;
pub mod homography;
pub mod line;
pub mod polygon;
pub(crate) mod interpolate;

pub use corner_covariance::CornerCovariance;
pub use corners::{Corners, CornersError};
