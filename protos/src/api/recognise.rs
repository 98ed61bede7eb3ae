//! `/maps/{map}/recognise`: one photograph. It is answered with a [`crate::v1::Answer`].

/// The form of a photograph, for the document: it is read part by part.
#[cfg(feature = "openapi")]
#[derive(Debug, utoipa::ToSchema)]
pub struct PhotographForm {
    /// PNG or JPEG.
    #[schema(value_type = String, format = Binary)]
    pub image: Vec<u8>,
    /// JSON: `fx_px`, `fy_px`, `cx_px`, `cy_px` and optionally a lens: `plumb_bob` (5 numbers),
    /// `rational_polynomial` (8) or `equidistant` (4). `width_px` and `height_px` say of which size
    /// of picture they are: one of another scale has them scaled, one of other proportions is
    /// refused. Without them a principal point far off the middle is refused. Without intrinsics
    /// there is recognition but no pose.
    pub intrinsics: Option<String>,
    /// `default` or `paper`: detector and decision for this photograph, in place of the map's.
    pub preset: Option<String>,
}
