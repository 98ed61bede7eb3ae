//! `/maps/{map}/visibility-settings`: the camera that looks for a map's landmarks, and what counts
//! as seen.

use serde::{Deserialize, Serialize};

/// A camera, and what counts as seen by it. Every number may be absent.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema, utoipa::IntoParams))]
#[serde(default, deny_unknown_fields)]
#[cfg_attr(feature = "openapi", into_params(parameter_in = Query))]
pub struct VisibilitySettingsBody {
    /// Focal length, pixels: 10 to 20 000; usually 512.
    pub focal_px: Option<f64>,
    /// Width of the image, pixels: 16 to 20 000; usually 640.
    pub width_px: Option<f64>,
    /// Height of the image, pixels: 16 to 20 000; usually 480.
    pub height_px: Option<f64>,
    /// Height of the camera above the floor: 0 to 10 m; usually 1.2.
    pub camera_height_m: Option<f64>,
    /// Lowest tilt of the camera, up positive, within 1.55; usually -0.35. The same as the highest
    /// for one that is fixed.
    pub tilt_low_rad: Option<f64>,
    /// Highest tilt; usually 0.35. Signs under ceilings are seen only by cameras that look up.
    pub tilt_high_rad: Option<f64>,
    /// Rightmost pan, left positive, from -pi; usually -1.7.
    pub pan_low_rad: Option<f64>,
    /// Leftmost pan, to pi; usually 1.7.
    pub pan_high_rad: Option<f64>,
    /// Most oblique view against a landmark's normal: 0.01 to 1.48; usually 1.309, 75 degrees.
    pub max_incidence_rad: Option<f64>,
    /// Shortest side of a landmark in the image, pixels: 1 to 20 000; usually 75.
    pub min_side_px: Option<f64>,
    /// Largest share of the image that a landmark may take: 0.01 to 1; usually 0.9.
    pub max_fill: Option<f64>,
    /// How far before its wall a landmark is taken to hang, so that its own wall does not hide it:
    /// 0.001 to 0.5 m; usually 0.05.
    pub standoff_m: Option<f64>,
}
