//! A quad in, its rectified square picture out (method 4).

/// A landmark's appearance, rectified to a square of `size` x `size` grey levels, upright as the corners say.
#[derive(Debug, Clone, PartialEq)]
pub struct Icon {
    /// Side in icon pixels.
    pub size: usize,
    /// Row-major grey levels in [0, 255]; row 0 is the top.
    pub pixels: Vec<f32>,
    /// Mean number of source pixels along an icon pixel's side; below 1 the icon is magnified.
    pub source_scale: f64,
}

/// Parameters of this stage.
#[derive(Debug, Clone, PartialEq, Default, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct IconParams {}
