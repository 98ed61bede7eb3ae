//! The part of the image in which one corner is searched.

use nalgebra::{Matrix2, Point2, Vector2};

/// The search gate of one corner: an ellipse in the image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SearchGate {
    /// Predicted corner, px.
    pub center_px: Point2<f64>,
    /// Covariance of a measured corner about it, px^2: prediction plus
    /// [`super::ExpectParams::corner_sigma_px`].
    pub covariance_px2: Matrix2<f64>,
    /// Squared Mahalanobis distance of the border.
    pub chi2: f64,
}

impl SearchGate {
    /// Whether a measured corner is inside.
    pub fn contains(&self, corner_px: &Point2<f64>) -> bool {
        let d = corner_px - self.center_px;
        self.covariance_px2.cholesky().is_some_and(|c| d.dot(&c.solve(&d)) <= self.chi2)
    }

    /// Half width and half height of the ellipse's bounding box, px.
    pub fn half_extent_px(&self) -> Vector2<f64> {
        self.covariance_px2.diagonal().map(|v| (self.chi2 * v).sqrt())
    }
}
