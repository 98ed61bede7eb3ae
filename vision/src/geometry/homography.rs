//! Four point pairs in, plane homography out (method 4): `a_from_b` as a 3x3 matrix of Frobenius
//! norm 1 whose denominator is positive over the points it was made from. It does not fit more than
//! four points.

use crate::geometry::corners::Corners;
use nalgebra::{Matrix3, Point2, SMatrix, SVector, Vector3};

/// Why four point pairs have no usable homography.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum HomographyError {
    /// Points not finite, three of them collinear, or too far apart for double precision.
    #[error("the four points are degenerate")]
    Degenerate,
    /// The line at infinity passes between the points.
    #[error("the points lie on both sides of the horizon")]
    Horizon,
}

/// A plane-to-plane map. `Homography` named `a_from_b` takes points of `b` to points of `a`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Homography(Matrix3<f64>);

impl Homography {
    /// Wraps a matrix that is positive (see [`Homography::denominator`]) where it will be used;
    /// scales it to Frobenius norm 1. `None` when it is not finite or zero.
    pub fn from_matrix(matrix: Matrix3<f64>) -> Option<Self> {
        let norm = matrix.norm();
        (norm.is_finite() && norm > 0.0).then(|| Self(matrix / norm))
    }

    /// The map that takes `from[i]` to `to[i]`: direct linear transform on Hartley-normalised
    /// points.
    ///
    /// Departs from method 4: the null vector of the 8x9 system is scaled to a last entry of 1 and
    /// found by an LU with full pivoting instead of an SVD. Normalised points have their centroid
    /// at 0, and a homography between two convex quads cannot send the centroid of one to infinity,
    /// so that entry is never 0; it is 20 times faster.
    pub fn from_points(from: &[Point2<f64>; 4], to: &[Point2<f64>; 4]) -> Result<Self, HomographyError> {
        let (from_normal, from_points) = normalise(from).ok_or(HomographyError::Degenerate)?;
        let (to_normal, to_points) = normalise(to).ok_or(HomographyError::Degenerate)?;
        let mut a = SMatrix::<f64, 8, 8>::zeros();
        let mut b = SVector::<f64, 8>::zeros();
        for i in 0..4 {
            for (j, row) in rows(&from_points[i], &to_points[i]).iter().enumerate() {
                a.set_row(2 * i + j, &row.transpose());
            }
            (b[2 * i], b[2 * i + 1]) = (to_points[i].x, to_points[i].y);
        }
        let h = a.full_piv_lu().solve(&b).ok_or(HomographyError::Degenerate)?;
        let normal = Matrix3::new(h[0], h[1], h[2], h[3], h[4], h[5], h[6], h[7], 1.0);
        let back = to_normal.try_inverse().ok_or(HomographyError::Degenerate)?;
        let map = Self::from_matrix(back * normal * from_normal).ok_or(HomographyError::Degenerate)?;
        let positive = from.iter().filter(|p| map.denominator(p) > 0.0).count();
        match positive {
            4 => Ok(map),
            0 if from.iter().all(|p| map.denominator(p) < 0.0) => Ok(Self(-map.0)),
            _ => Err(HomographyError::Horizon),
        }
    }

    /// The map that takes `from[i]` nearly to `to[i]` for four points or more: least squares of the
    /// algebraic error on normalised points. A start value for refinement; exact for four points.
    pub fn fit(from: &[Point2<f64>], to: &[Point2<f64>]) -> Result<Self, HomographyError> {
        if let (&[a, b, c, d], &[p, q, r, s]) = (from, to) {
            return Self::from_points(&[a, b, c, d], &[p, q, r, s]);
        }
        if from.len() < 4 || from.len() != to.len() {
            return Err(HomographyError::Degenerate);
        }
        let (from_normal, from_points) = normalise_all(from).ok_or(HomographyError::Degenerate)?;
        let (to_normal, to_points) = normalise_all(to).ok_or(HomographyError::Degenerate)?;
        let mut a = SMatrix::<f64, 8, 8>::zeros();
        let mut b = SVector::<f64, 8>::zeros();
        for (p, q) in from_points.iter().zip(&to_points) {
            for (row, w) in rows(p, q).iter().zip([q.x, q.y]) {
                a += row * row.transpose();
                b += row * w;
            }
        }
        let h = a.cholesky().ok_or(HomographyError::Degenerate)?.solve(&b);
        let normal = Matrix3::new(h[0], h[1], h[2], h[3], h[4], h[5], h[6], h[7], 1.0);
        let back = to_normal.try_inverse().ok_or(HomographyError::Degenerate)?;
        let map = Self::from_matrix(back * normal * from_normal).ok_or(HomographyError::Degenerate)?;
        if from.iter().all(|p| map.denominator(p) > 0.0) {
            return Ok(map);
        }
        let behind = from.iter().all(|p| map.denominator(p) < 0.0);
        if behind { Ok(Self(-map.0)) } else { Err(HomographyError::Horizon) }
    }

    /// `image_from_icon` for an icon of `size` x `size` pixels: icon corners (-1/2, -1/2), (size -
    /// 1/2, -1/2) ... go to TL, TR, BR, BL.
    pub fn square_to_quad(size: usize, corners_px: &Corners) -> Result<Self, HomographyError> {
        let (low, high) = (-0.5, size as f64 - 0.5);
        let square =
            [Point2::new(low, low), Point2::new(high, low), Point2::new(high, high), Point2::new(low, high)];
        Self::from_points(&square, corners_px.points())
    }

    /// The matrix, Frobenius norm 1.
    pub fn matrix(&self) -> &Matrix3<f64> {
        &self.0
    }

    /// Third homogeneous coordinate of the image of `p`: positive in front of the horizon.
    pub fn denominator(&self, p: &Point2<f64>) -> f64 {
        self.0[(2, 0)] * p.x + self.0[(2, 1)] * p.y + self.0[(2, 2)]
    }

    /// Image of `p`; not finite on the horizon.
    pub fn apply(&self, p: &Point2<f64>) -> Point2<f64> {
        let q = self.0 * Vector3::new(p.x, p.y, 1.0);
        Point2::new(q.x / q.z, q.y / q.z)
    }

    /// `b_from_a`. Its denominator is positive over the images of points where this one's is.
    pub fn inverse(&self) -> Result<Self, HomographyError> {
        let inverse = self.0.try_inverse().ok_or(HomographyError::Degenerate)?;
        Self::from_matrix(inverse).ok_or(HomographyError::Degenerate)
    }

    /// `a_from_c` of this `a_from_b` and `b_from_c`.
    pub fn compose(&self, b_from_c: &Self) -> Result<Self, HomographyError> {
        Self::from_matrix(self.0 * b_from_c.0).ok_or(HomographyError::Degenerate)
    }
}

/// The two equations of a point pair, for a last entry of 1.
fn rows(p: &Point2<f64>, q: &Point2<f64>) -> [SVector<f64, 8>; 2] {
    let (x, y, u, v) = (p.x, p.y, q.x, q.y);
    [
        SVector::from([x, y, 1.0, 0.0, 0.0, 0.0, -u * x, -u * y]),
        SVector::from([0.0, 0.0, 0.0, x, y, 1.0, -v * x, -v * y]),
    ]
}

/// Hartley's normalisation: centroid to 0, mean distance to sqrt 2.
fn normalise(points: &[Point2<f64>; 4]) -> Option<(Matrix3<f64>, [Point2<f64>; 4])> {
    let (matrix, scaled) = normalise_all(points)?;
    Some((matrix, scaled.try_into().ok()?))
}

fn normalise_all(points: &[Point2<f64>]) -> Option<(Matrix3<f64>, Vec<Point2<f64>>)> {
    let share = 1.0 / points.len() as f64;
    let centre = points.iter().fold(Point2::origin(), |m: Point2<f64>, p| m + p.coords * share);
    let mean = points.iter().map(|p| (p - centre).norm()).sum::<f64>() * share;
    if !(mean.is_finite() && mean > 0.0) {
        return None;
    }
    let s = std::f64::consts::SQRT_2 / mean;
    let matrix = Matrix3::new(s, 0.0, -s * centre.x, 0.0, s, -s * centre.y, 0.0, 0.0, 1.0);
    Some((matrix, points.iter().map(|p| Point2::from((p - centre) * s)).collect()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Heckbert's closed form for the unit square, the oracle.
    fn unit_square_to_quad(c: &[Point2<f64>; 4]) -> Matrix3<f64> {
        let sum = c[0] - c[1] + (c[2] - c[3]);
        let (d1, d2) = (c[1] - c[2], c[3] - c[2]);
        let det = d1.perp(&d2);
        let (g, h) = (sum.perp(&d2) / det, d1.perp(&sum) / det);
        let a = c[1] - c[0] + g * c[1].coords;
        let b = c[3] - c[0] + h * c[3].coords;
        Matrix3::new(a.x, b.x, c[0].x, a.y, b.y, c[0].y, g, h, 1.0)
    }

    fn unit_square() -> [Point2<f64>; 4] {
        [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(Point2::from)
    }

    #[test]
    fn equals_the_closed_form() {
        let quad = [[102.0, 51.0], [420.5, 20.0], [398.0, 333.0], [88.0, 260.0]].map(Point2::from);
        let h = Homography::from_points(&unit_square(), &quad).unwrap();
        let oracle = unit_square_to_quad(&quad);
        assert!((h.matrix() - oracle / oracle.norm()).norm() < 1e-12);
        assert!((h.matrix().norm() - 1.0).abs() < 1e-14);
    }

    #[test]
    fn many_points_of_a_plane_give_its_homography() {
        let truth =
            Homography::from_matrix(Matrix3::new(0.9, 0.1, 30.0, -0.2, 1.1, 12.0, 3e-4, -2e-4, 1.0)).unwrap();
        let grid: Vec<_> =
            (0..30).map(|i| Point2::new(f64::from(i % 6) * 40.0, f64::from(i / 6) * 30.0)).collect();
        let mapped: Vec<_> = grid.iter().map(|p| truth.apply(p)).collect();
        let fitted = Homography::fit(&grid, &mapped).unwrap();
        assert!((fitted.matrix() - truth.matrix()).norm() < 1e-9);
        // Four points: the exact map; fewer or unequal lists: none.
        assert_eq!(Homography::fit(&grid[..3], &mapped[..3]), Err(HomographyError::Degenerate));
        assert_eq!(Homography::fit(&grid[..5], &mapped[..6]), Err(HomographyError::Degenerate));
        assert_eq!(Homography::fit(&grid[..6], &mapped[..6]), Err(HomographyError::Degenerate), "one row");
    }

    #[test]
    fn degenerate_points_are_refused() {
        let flat = [[0.0, 0.0], [1.0, 1.0], [2.0, 2.0], [0.0, 5.0]].map(Point2::from);
        let one = [Point2::new(3.0, 3.0); 4];
        let nan = [[0.0, 0.0], [f64::NAN, 0.0], [1.0, 1.0], [0.0, 1.0]].map(Point2::from);
        for bad in [flat, one, nan] {
            assert!(Homography::from_points(&unit_square(), &bad).is_err());
            assert!(Homography::from_points(&bad, &unit_square()).is_err());
        }
        let concave = [[0.0, 0.0], [10.0, 0.0], [3.0, 3.0], [0.0, 10.0]].map(Point2::from);
        assert_eq!(Homography::from_points(&unit_square(), &concave), Err(HomographyError::Horizon));
    }

    /// Any strictly convex quad: a square with each corner moved by less than 45 % of its half
    /// side.
    fn convex() -> impl Strategy<Value = Corners> {
        (proptest::array::uniform8(-0.22..0.22_f64), 1.0..5e3_f64, -1e4..1e4_f64).prop_filter_map(
            "convex",
            |(d, scale, shift)| {
                let corner = |i: usize, x: f64, y: f64| {
                    [shift + scale * (x + d[2 * i]), -shift + scale * (y + d[2 * i + 1])]
                };
                Corners::try_from([
                    corner(0, 0.0, 0.0),
                    corner(1, 1.0, 0.0),
                    corner(2, 1.0, 1.0),
                    corner(3, 0.0, 1.0),
                ])
                .ok()
            },
        )
    }

    proptest! {
        #[test]
        fn corners_are_mapped_exactly(corners in convex(), size in 20_usize..200) {
            let image_from_icon = Homography::square_to_quad(size, &corners).unwrap();
            let icon_from_image = image_from_icon.inverse().unwrap();
            let (low, high) = (-0.5, size as f64 - 0.5);
            let square = [[low, low], [high, low], [high, high], [low, high]].map(Point2::from);
            for (icon, px) in square.iter().zip(corners.points()) {
                prop_assert!(image_from_icon.denominator(icon) > 0.0);
                prop_assert!(icon_from_image.denominator(px) > 0.0);
                prop_assert!((image_from_icon.apply(icon) - px).norm() < 1e-9 * (1.0 + px.coords.norm()));
                prop_assert!((icon_from_image.apply(px) - icon).norm() < 1e-6);
            }
            let identity = image_from_icon.compose(&icon_from_image).unwrap();
            // Scaled to norm 1 from a product that is small for slanted quads: rounding grows by as
            // much.
            let product = (image_from_icon.matrix() * icon_from_image.matrix()).norm();
            let error = (identity.matrix() * 3.0_f64.sqrt() - Matrix3::identity()).norm();
            prop_assert!(error < 1e-14 / product, "{error} {product}");
        }
    }
}
