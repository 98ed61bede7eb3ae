//! Views of a flat object of known shape: points of its plane and their pixels.

use crate::{
    geometry::corners::Corners,
    pose::{measurement::LandmarkSize, reprojection::corner_points},
};
use nalgebra::{Matrix2, Point2};

/// Most views of one calibration.
pub const MAX_VIEWS: usize = 512;

/// Most points of a view.
pub const MAX_POINTS: usize = 4096;

/// Fewest views.
pub const MIN_VIEWS: usize = 2;

/// One view of the flat object.
#[derive(Debug, Clone, PartialEq)]
pub struct PlanarView {
    /// Points in the plane: y (the viewer's right) and z (up), metres.
    pub plane_m: Vec<Point2<f64>>,
    /// Their image points, pixels.
    pub seen_px: Vec<Point2<f64>>,
    /// Covariance of each.
    pub covariance_px2: Vec<Matrix2<f64>>,
}

impl PlanarView {
    /// The four corners of a quad, in the landmark's own order.
    pub fn of_quad(corners: &Corners, covariance_px2: &[Matrix2<f64>; 4], size: LandmarkSize) -> Self {
        Self {
            plane_m: corner_points(&size).map(|p| Point2::new(p.y, p.z)).to_vec(),
            seen_px: corners.points().to_vec(),
            covariance_px2: covariance_px2.to_vec(),
        }
    }

    /// Points with the same standard deviation per coordinate.
    pub fn of_points(plane_m: Vec<Point2<f64>>, seen_px: Vec<Point2<f64>>, sigma_px: f64) -> Self {
        let covariance_px2 = vec![Matrix2::identity() * sigma_px * sigma_px; seen_px.len()];
        Self { plane_m, seen_px, covariance_px2 }
    }
}
