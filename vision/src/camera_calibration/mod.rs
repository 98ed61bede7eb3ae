//! Views of a flat object in, the intrinsics of the camera out (method 16).

pub mod params;
pub mod views;
pub(crate) mod linear;
pub(crate) mod camera_model;
pub(crate) mod normal_equations;
pub(crate) mod least_squares;
pub mod calibrate;
pub mod robust;
pub mod pictures;

pub use calibrate::{CalibrateError, CameraCalibration, FOCAL_SIDES, calibrate};
pub use least_squares::ViewFit;
pub use params::{CalibrateParams, CameraHeight, MAX_RADIAL};
pub use pictures::{MAX_PICTURES, PictureCalibration, calibrate_pictures};
pub use robust::{LENS_GAIN, OUTLIER_PX, OUTLIER_SHARE, RobustCalibration, calibrate_choosing};
pub use views::{MAX_POINTS, MAX_VIEWS, MIN_VIEWS, PlanarView};
