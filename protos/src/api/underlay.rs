//! `/maps/{map}/underlay`: the picture that is shown under a map.

use serde::{Deserialize, Serialize};

/// Where a picture lies in the map.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct UnderlayPlace {
    /// Side of a pixel, 0.0001 to 10.
    pub metres_per_pixel: f64,
    /// Lower left corner of the lower left pixel, x.
    #[serde(default)]
    #[cfg_attr(feature = "openapi", schema(default = 0.0))]
    pub x_m: f64,
    /// Lower left corner of the lower left pixel, y.
    #[serde(default)]
    #[cfg_attr(feature = "openapi", schema(default = 0.0))]
    pub y_m: f64,
    /// Direction of the picture's rows in the map, counter-clockwise from map x.
    #[serde(default)]
    #[cfg_attr(feature = "openapi", schema(default = 0.0))]
    pub theta_rad: f64,
}

/// A picture under a map; `underlay/image` is the picture itself.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Underlay {
    /// Where it lies.
    pub place: UnderlayPlace,
    /// Of the picture, as a viewer shows it.
    pub width_px: u32,
    /// Of the picture, as a viewer shows it.
    pub height_px: u32,
    /// `png` or `jpeg`.
    pub image_kind: String,
    /// ms since the Unix epoch.
    pub created_ms: i64,
}

/// The form of an upload, for the document: it is read part by part.
#[cfg(feature = "openapi")]
#[derive(Debug, utoipa::ToSchema)]
pub struct UnderlayForm {
    /// PNG or JPEG.
    #[schema(value_type = String, format = Binary)]
    pub image: Vec<u8>,
    /// Side of a pixel, 0.0001 to 10.
    pub metres_per_pixel: String,
    /// Lower left corner of the lower left pixel, x; 0 if absent.
    pub x_m: Option<String>,
    /// Lower left corner of the lower left pixel, y; 0 if absent.
    pub y_m: Option<String>,
    /// Direction of the picture's rows in the map, counter-clockwise from map x; 0 if absent.
    pub theta_rad: Option<String>,
}
