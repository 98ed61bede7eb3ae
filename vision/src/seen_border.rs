//! The border of a landmark in an image: corners, covariances, and how they were found.

use crate::{detect::quad::BORDER_SIGMA_PX, geometry::corners::Corners, params::Params};
use nalgebra::Matrix2;

/// Standard deviation of an aligned corner, in icon pixels: twice the tolerance of the alignment's
/// test.
pub(crate) const ALIGNED_SIGMA_ICON_PX: f64 = 0.5;

/// The taught border of a landmark in an image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SeenBorder {
    /// Its corners, the landmark's top-left first.
    pub corners_px: Corners,
    /// Their covariances, px^2.
    pub covariance_px2: [Matrix2<f64>; 4],
    /// How the corners were found.
    pub found_by: FoundBy,
}

/// 99 % of chi2 with 2 degrees of freedom.
const CHI2_2_99: f64 = 9.21;

impl SeenBorder {
    /// Whether both are the same border within their covariances.
    pub fn agrees_with(&self, other: &Self) -> bool {
        let corners = self.corners_px.points().iter().zip(other.corners_px.points());
        let covariances = self.covariance_px2.iter().zip(&other.covariance_px2);
        corners.zip(covariances).all(|((a, b), (c, d))| {
            let off = a - b;
            (c + d).cholesky().is_some_and(|sum| off.dot(&sum.solve(&off)) <= CHI2_2_99)
        })
    }
}

/// How the corners of a landmark were found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FoundBy {
    /// A detected border.
    Edges,
    /// Alignment with the learnt icon.
    Alignment,
    /// The homography of matched points.
    Points,
}

/// Covariances of corners aligned with the learnt icon without a detected border.
pub(crate) fn aligned_covariance_px2(corners_px: &Corners, icon_size: usize) -> [Matrix2<f64>; 4] {
    let sigma_px = ALIGNED_SIGMA_ICON_PX * corners_px.area_px2().sqrt() / icon_size as f64;
    [Matrix2::identity() * (sigma_px.powi(2) + BORDER_SIGMA_PX.powi(2)); 4]
}

/// Corners that differ by less, in icon pixels, belong to one border.
const SAME_BORDER_ICON_PX: f64 = 1.5;

/// Whether aligned corners are those of the detected border; its edges then give the more accurate
/// corners.
pub(crate) fn is_same_border(detected_px: &Corners, aligned_px: &Corners, p: &Params) -> bool {
    let icon_px = detected_px.area_px2().sqrt() / p.icon.size as f64;
    detected_px.furthest_px(aligned_px) < SAME_BORDER_ICON_PX * icon_px
}
