//! Chains in, straight segments out (method 1.3, 1.4).

use nalgebra::{Point2, Vector2};

/// A straight piece of edge. Coordinates in pixels; pixel centres at integers.
#[derive(Debug, Clone, PartialEq)]
pub struct EdgeSegment {
    /// One end.
    pub p_px: Point2<f64>,
    /// The other end. Walking from `p_px` to `q_px`, the brighter side lies to the right on screen (u right, v down).
    pub q_px: Point2<f64>,
    /// Distance between the ends.
    pub length_px: f64,
    /// Undirected direction in [0, pi), from +u towards +v.
    pub theta_rad: f64,
    /// Unit normal, pointing to the brighter side. The supporting line is `normal . x = rho_px`.
    pub normal: Vector2<f64>,
    /// Signed distance of the supporting line from the origin along `normal`.
    pub rho_px: f64,
    /// Mean gradient magnitude along the segment, as step height in grey levels.
    pub contrast: f64,
    /// Edge points that support the line.
    pub support: usize,
    /// Index of the chain it came from.
    pub chain: usize,
    /// Variance of the line's direction, rad^2.
    pub theta_variance: f64,
    /// Variance of the line's offset at the segment's mid point, px^2.
    pub offset_variance: f64,
    /// An end lies on the image border, so the true side may be longer.
    pub clipped: bool,
}

/// Parameters of this stage.
#[derive(Debug, Clone, PartialEq, Default, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SegmentParams {}
