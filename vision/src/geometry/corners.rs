//! Four image corners in a fixed order: checked, sorted, rotated.

use nalgebra::{Point2, Vector2};
use serde::{Deserialize, Serialize};

/// Why four points are not the corners of a quad.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum CornersError {
    /// A coordinate is NaN or infinite.
    #[error("a corner is not finite")]
    NotFinite,
    /// The polygon is concave, crossing, flat, or runs counter-clockwise on screen.
    #[error("corners are not a strictly convex polygon, clockwise on screen")]
    NotConvex,
}

/// Four corners in pixels: top-left, top-right, bottom-right, bottom-left seen from the front,
/// hence clockwise on screen (u right, v down). Strictly convex. All corners in Waymark have this
/// order.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "[[f64; 2]; 4]", into = "[[f64; 2]; 4]")]
pub struct Corners([Point2<f64>; 4]);

impl Corners {
    /// Smallest area of a triangle of three successive corners, in px^2: below it they count as
    /// collinear.
    const MIN_TRIANGLE_PX2: f64 = 1e-6;

    /// Checks order, convexity and finiteness.
    pub fn new(corners_px: [Point2<f64>; 4]) -> Result<Self, CornersError> {
        if corners_px.iter().any(|c| !c.x.is_finite() || !c.y.is_finite()) {
            return Err(CornersError::NotFinite);
        }
        let convex = (0..4).all(|i| {
            let (a, b, c) = (corners_px[i], corners_px[(i + 1) % 4], corners_px[(i + 2) % 4]);
            0.5 * (b - a).perp(&(c - b)) > Self::MIN_TRIANGLE_PX2
        });
        if convex { Ok(Self(corners_px)) } else { Err(CornersError::NotConvex) }
    }

    /// Sorts four points clockwise on screen, starting at the corner that makes the quad most
    /// upright (image gravity is +v). Method 4, rule A10.
    pub fn from_unordered(mut points_px: [Point2<f64>; 4]) -> Result<Self, CornersError> {
        if points_px.iter().any(|c| !c.x.is_finite() || !c.y.is_finite()) {
            return Err(CornersError::NotFinite);
        }
        let centre = points_px.iter().fold(Point2::origin(), |m: Point2<f64>, p| m + p.coords * 0.25);
        let angle = |p: &Point2<f64>| (p.y - centre.y).atan2(p.x - centre.x);
        points_px.sort_by(|a, b| angle(a).total_cmp(&angle(b)));
        let sorted = Self::new(points_px)?;
        Ok(sorted.rotated(sorted.top_left(&Vector2::y())))
    }

    /// Which corner, 0 to 3, makes the quad most upright when it is named top-left, where gravity
    /// points to `down` in the image (any length). The first of equal ones.
    pub fn top_left(&self, down: &Vector2<f64>) -> usize {
        let lean = |shift: &usize| self.rotated(*shift).lean_rad(down);
        (0..4).min_by(|a, b| lean(a).total_cmp(&lean(b))).unwrap_or(0)
    }

    /// The corners TL, TR, BR, BL.
    pub fn points(&self) -> &[Point2<f64>; 4] {
        &self.0
    }

    /// The same quad with corner `shift` (0 to 3) named top-left.
    #[must_use]
    pub fn rotated(&self, shift: usize) -> Self {
        Self(std::array::from_fn(|i| self.0[(i + shift) % 4]))
    }

    /// Mean angle between the sides TL-BL and TR-BR and the direction `down` of gravity in the
    /// image (any length): 0 when upright, pi upside down.
    pub fn lean_rad(&self, down: &Vector2<f64>) -> f64 {
        let [tl, tr, br, bl] = self.0;
        let angle = |side: Vector2<f64>| side.perp(down).abs().atan2(side.dot(down));
        f64::midpoint(angle(bl - tl), angle(br - tr))
    }

    /// Area in px^2.
    pub fn area_px2(&self) -> f64 {
        let [a, b, c, d] = self.0;
        0.5 * (c - a).perp(&(d - b))
    }

    /// Distance to `other`'s of the corner that is furthest from it.
    pub fn furthest_px(&self, other: &Self) -> f64 {
        self.0.iter().zip(&other.0).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max)
    }

    /// Length of the shortest side.
    pub fn min_side_px(&self) -> f64 {
        (0..4).map(|i| (self.0[(i + 1) % 4] - self.0[i]).norm()).fold(f64::INFINITY, f64::min)
    }
}

impl TryFrom<[[f64; 2]; 4]> for Corners {
    type Error = CornersError;
    fn try_from(c: [[f64; 2]; 4]) -> Result<Self, CornersError> {
        Self::new(c.map(|[x, y]| Point2::new(x, y)))
    }
}

impl From<Corners> for [[f64; 2]; 4] {
    fn from(c: Corners) -> Self {
        c.0.map(|p| [p.x, p.y])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square() -> [[f64; 2]; 4] {
        [[0.0, 0.0], [10.0, 0.0], [10.0, 8.0], [0.0, 8.0]]
    }

    #[test]
    fn invalid_corners_are_refused() {
        assert!(Corners::try_from(square()).is_ok());
        let mut counter_clockwise = square();
        counter_clockwise.reverse();
        assert_eq!(Corners::try_from(counter_clockwise), Err(CornersError::NotConvex));
        let mut nan = square();
        nan[2][1] = f64::NAN;
        assert_eq!(Corners::try_from(nan), Err(CornersError::NotFinite));
        let crossed = [[0.0, 0.0], [10.0, 8.0], [10.0, 0.0], [0.0, 8.0]];
        assert_eq!(Corners::try_from(crossed), Err(CornersError::NotConvex));
        let collinear = [[0.0, 0.0], [5.0, 0.0], [10.0, 0.0], [0.0, 8.0]];
        assert_eq!(Corners::try_from(collinear), Err(CornersError::NotConvex));
    }

    #[test]
    fn unordered_points_become_upright() {
        let expected = Corners::try_from(square()).unwrap();
        for order in [[0, 1, 2, 3], [2, 0, 3, 1], [3, 2, 1, 0]] {
            let points = order.map(|i| Point2::from(square()[i]));
            assert_eq!(Corners::from_unordered(points).unwrap(), expected);
        }
        assert!((expected.area_px2() - 80.0).abs() < 1e-12);
        assert!((expected.min_side_px() - 8.0).abs() < 1e-12);
    }

    #[test]
    fn four_rotations_give_the_same_corners() {
        let corners = Corners::try_from(square()).unwrap();
        assert_eq!(corners.rotated(1).rotated(3), corners);
        assert!(corners.rotated(2).lean_rad(&Vector2::y()) > 3.0);
    }

    #[test]
    fn the_top_left_corner_goes_by_the_direction_of_gravity() {
        let corners = Corners::try_from(square()).unwrap();
        let downs = [[0.0, 1.0], [-1.0, 0.0], [0.0, -1.0], [1.0, 0.0]];
        for (shift, [x, y]) in downs.into_iter().enumerate() {
            for (lean, factor) in [(0.0, 1.0), (0.6, 0.01), (-0.6, 30.0)] {
                let down = nalgebra::Rotation2::new(lean) * Vector2::new(x, y) * factor;
                assert_eq!(corners.top_left(&down), shift, "{down}");
                assert!((corners.rotated(shift).lean_rad(&down) - f64::abs(lean)).abs() < 1e-12);
            }
        }
    }
}
