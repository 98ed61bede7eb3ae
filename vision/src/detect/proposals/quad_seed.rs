//! A quad proposal: four sides, some of them without a segment, and their corners; tests of
//! plausibility and overlap.

use crate::{detect::segments::edge_segments::EdgeSegment, geometry::polygon};
use nalgebra::Point2;

/// How far outside the image a corner may lie.
pub const CORNER_MARGIN_PX: f64 = 20.0;

/// Four segments proposed as the sides of one quad.
#[derive(Debug, Clone, PartialEq)]
pub struct QuadSeed {
    /// Segments in clockwise order; side i runs from corner i to corner i+1. None for a side that
    /// no segment gave.
    pub sides: [Option<usize>; 4],
    /// Intersections of the supporting lines, clockwise on screen.
    pub corners_px: [Point2<f64>; 4],
    /// Mean similarity of its pairs, 0 to 1.
    pub similarity: f64,
    /// How well the two pairs fit each other (s^2 of method 3.4), 0 to 1.
    pub fit: f64,
}

/// Convex, clockwise, corners inside the image up to a margin, every side at least 15 px.
pub(crate) fn plausible(corners_px: &[Point2<f64>; 4], image_size: (usize, usize)) -> bool {
    const MIN_SIDE_PX: f64 = 15.0;
    let (width, height) = (image_size.0 as f64, image_size.1 as f64);
    let inside = |c: &Point2<f64>| {
        c.x >= -CORNER_MARGIN_PX
            && c.y >= -CORNER_MARGIN_PX
            && c.x <= width - 1.0 + CORNER_MARGIN_PX
            && c.y <= height - 1.0 + CORNER_MARGIN_PX
    };
    corners_px.iter().all(inside)
        && (0..4).all(|i| (corners_px[(i + 1) % 4] - corners_px[i]).norm() >= MIN_SIDE_PX)
        && polygon::signed_area(corners_px) > 0.0
        && polygon::is_convex(corners_px)
}

/// Whether the `IoU` of two quads exceeds `threshold`.
pub(crate) fn overlap_exceeds(a: &[Point2<f64>; 4], b: &[Point2<f64>; 4], threshold: f64) -> bool {
    Extent::new(a).overlaps(&Extent::new(b), threshold)
}

/// A quad with its area and bounding box, a quick test for little overlap.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Extent {
    corners_px: [Point2<f64>; 4],
    area_px2: f64,
    bounds: Bounds,
}

impl Extent {
    pub(crate) fn new(corners_px: &[Point2<f64>; 4]) -> Self {
        Self {
            corners_px: *corners_px,
            area_px2: polygon::area(corners_px),
            bounds: polygon::bounds(corners_px),
        }
    }

    /// Whether the `IoU` exceeds `threshold`.
    pub(crate) fn overlaps(&self, other: &Self, threshold: f64) -> bool {
        if self.area_px2.min(other.area_px2) <= threshold * self.area_px2.max(other.area_px2) {
            return false;
        }
        let boxes = self.bounds.1.inf(&other.bounds.1) - self.bounds.0.sup(&other.bounds.0);
        let sum = self.area_px2 + other.area_px2;
        let exceeds = |common: f64| common > threshold * (sum - common);
        exceeds(boxes.x.max(0.0) * boxes.y.max(0.0))
            && exceeds(polygon::intersection_area(&self.corners_px, &other.corners_px))
    }
}

pub(crate) type Bounds = (Point2<f64>, Point2<f64>);

/// Where the supporting lines of two segments meet; none when they are parallel to within about 1
/// degree.
pub(crate) fn corner_of(a: &EdgeSegment, b: &EdgeSegment) -> Option<Point2<f64>> {
    let determinant = a.normal.perp(&b.normal);
    (determinant.abs() > 0.02).then(|| {
        Point2::new(
            (a.rho_px * b.normal.y - b.rho_px * a.normal.y) / determinant,
            (a.normal.x * b.rho_px - b.normal.x * a.rho_px) / determinant,
        )
    })
}
