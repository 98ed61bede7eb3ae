//! Parameters of a calibration.

use serde::{Deserialize, Serialize};

/// Most radial coefficients that can be fitted.
pub const MAX_RADIAL: usize = 2;

/// What is known of the camera's height over the plane's origin, which stays the same when a robot
/// drives on a floor (C3).
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum CameraHeight {
    /// Nothing, or it changes.
    #[default]
    Free,
    /// It is the same in all views, and known.
    Known {
        /// Camera above the plane's origin.
        height_m: f64,
        /// Standard deviation.
        sigma_m: f64,
    },
    /// It is the same in all views, and is found with the camera.
    Constant {
        /// Standard deviation of its variation, metres.
        sigma_m: f64,
    },
}

/// Parameters of the calibration.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CalibrateParams {
    /// Height of a pixel's focal length over its width, `fy / fx`; 1 for nearly every sensor.
    pub pixel_aspect: f64,
    /// Fit `fy / fx` as well, starting at `pixel_aspect`.
    pub free_pixel_aspect: bool,
    /// The ratio of the plane's sides is known. If not, it is fitted; the linear solution then
    /// ignores heights (C3).
    pub known_aspect: bool,
    /// The camera does not roll (C2): standard deviation of the roll, radians. Zero: no prior.
    pub roll_sigma_rad: f64,
    /// The camera's height (C3).
    pub height: CameraHeight,
    /// Fit the reprojection of all views (Zhang); without it the result is the linear solution,
    /// which has no covariance.
    pub refine: bool,
    /// Radial coefficients (k1, k2) that are fitted, 0 to [`MAX_RADIAL`].
    pub radial: usize,
    /// Standard deviation of the principal point from the image's centre, as a share of its width.
    /// Zero: no prior. It matters where the views hardly determine the principal point.
    pub centre_sigma: f64,
    /// Fewest different orientations (method 16.4).
    pub min_orientations: usize,
    /// Two orientations differ when the plane's normals do by more than this, radians.
    pub orientation_step_rad: f64,
    /// Largest root mean square residual, pixels: beyond it the views are not of one plane of this
    /// shape.
    pub max_rms_px: f64,
}

impl Default for CalibrateParams {
    fn default() -> Self {
        Self {
            pixel_aspect: 1.0,
            free_pixel_aspect: false,
            known_aspect: true,
            roll_sigma_rad: 0.0,
            height: CameraHeight::Free,
            refine: true,
            radial: 0,
            centre_sigma: 0.0,
            min_orientations: 3,
            orientation_step_rad: 15.0_f64.to_radians(),
            max_rms_px: 5.0,
        }
    }
}
