//! The straight line through edge points along a side, to a fraction of a pixel (method 3.6). In:
//! points, which `side_support` finds. Out: a line with its variance.

use nalgebra::{Point2, Vector2};

/// Floor of an edge point's standard deviation across the edge (method 1.3).
const MIN_SIGMA_PX: f64 = 0.2;

/// An edge point: distance along the side, offset across it, signed step height.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct EdgePoint {
    pub(crate) along_px: f64,
    pub(crate) offset_px: f64,
    pub(crate) step: f64,
}

/// A line `normal . x = rho_px` with the variance of its offset.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FittedLine {
    /// Unit normal: to the left of the walk from the first to the second point as seen on screen,
    /// hence out of a polygon that is walked clockwise.
    pub normal: Vector2<f64>,
    /// Signed distance from the origin.
    pub rho_px: f64,
    /// Point of the line where the variance of its offset is smallest.
    centre_px: Point2<f64>,
    variance_px2: f64,
    slope_variance: f64,
}

impl FittedLine {
    /// Variance of the line's offset at the foot of `p`, extrapolation included, in px^2.
    pub fn variance_at(&self, p: &Point2<f64>) -> f64 {
        let direction = Vector2::new(-self.normal.y, self.normal.x);
        self.variance_px2 + self.slope_variance * direction.dot(&(p - self.centre_px)).powi(2)
    }
}

/// `offset = offset_at_mean + slope * (along - mean)`.
pub(crate) struct OffsetFit {
    mean_along_px: f64,
    offset_px: f64,
    slope: f64,
    variance_px2: f64,
    slope_variance: f64,
}

/// Least squares with three rounds of trimming: texture near a side throws points far off its line.
pub(crate) fn fit(points: &[EdgePoint], length: f64) -> Option<OffsetFit> {
    const MIN_POINTS: usize = 5;
    let mut inliers: Vec<EdgePoint> = points.to_vec();
    let mut result = None;
    for round in 0..4 {
        if inliers.len() < MIN_POINTS {
            return result;
        }
        let n = inliers.len() as f64;
        let mean = inliers.iter().map(|p| p.along_px).sum::<f64>() / n;
        let offset = inliers.iter().map(|p| p.offset_px).sum::<f64>() / n;
        let spread: f64 = inliers.iter().map(|p| (p.along_px - mean).powi(2)).sum();
        // Coincident points determine no direction.
        if spread < n * (0.05 * length).powi(2) {
            return result;
        }
        let slope =
            inliers.iter().map(|p| (p.along_px - mean) * (p.offset_px - offset)).sum::<f64>() / spread;
        let residual = |p: &EdgePoint| p.offset_px - offset - slope * (p.along_px - mean);
        let sum: f64 = inliers.iter().map(|p| residual(p).powi(2)).sum();
        let sigma = (sum / (n - 2.0)).sqrt().max(MIN_SIGMA_PX);
        result = Some(OffsetFit {
            mean_along_px: mean,
            offset_px: offset,
            slope,
            variance_px2: sigma * sigma / n,
            slope_variance: sigma * sigma / spread,
        });
        let limit = (2.0 * sigma).max(0.5);
        let before = inliers.len();
        if round == 0 {
            // The first line may be pulled by outliers: every point is tested again.
            inliers = points.iter().filter(|p| residual(p).abs() <= limit).copied().collect();
        } else {
            inliers.retain(|p| residual(p).abs() <= limit);
        }
        if round > 0 && inliers.len() == before {
            break;
        }
    }
    result
}

impl OffsetFit {
    pub(crate) fn line(
        &self,
        from: &Point2<f64>,
        direction: &Vector2<f64>,
        normal: &Vector2<f64>,
    ) -> FittedLine {
        let centre_px = from + direction * self.mean_along_px + normal * self.offset_px;
        let turned = (normal - direction * self.slope).normalize();
        FittedLine {
            normal: turned,
            rho_px: turned.dot(&centre_px.coords),
            centre_px,
            variance_px2: self.variance_px2,
            slope_variance: self.slope_variance,
        }
    }
}
