//! Pictures of a flat, textured object in, the camera out (method 16.6).

pub(crate) mod adjustment;
pub(crate) mod common_object;
pub(crate) mod denoise;
pub mod from_pictures;
pub(crate) mod robust_fit;
pub(crate) mod search_windows;
pub(crate) mod side_lines;
pub(crate) mod tracks;
pub(crate) mod window_tracking;

pub use from_pictures::{MAX_PICTURES, PictureCalibration, calibrate_pictures};

#[cfg(test)]
mod tests;
