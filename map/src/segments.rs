//! A laser segment: a piece of wall as the laser measures it, with the covariance of its supporting
//! line and its two ends.

use crate::{
    check::{self, MAX_COORDINATE_M, OutOfRange},
    pose2::{Pose2, Pose2Covariance, wrap_rad},
};
use nalgebra::{Matrix2, Matrix2x3, Point2, Vector2};
use std::f64::consts::PI;

/// Shortest length of a segment, metres.
pub const MIN_SEGMENT_M: f64 = 0.01;
/// Standard deviation of each end of a wall given by hand, across it, metres.
const BY_HAND_SIGMA_M: f64 = 0.01;

/// A straight piece of wall. `a` to `b` runs so that the free side, from which it was measured, is
/// on the left: the two faces of a wall are two segments. The ends lie on the line
/// `cos(alpha) x + sin(alpha) y = rho`, rho >= 0.
#[derive(Debug, Clone, PartialEq)]
pub struct LaserSegment {
    /// First end, metres, map or robot frame.
    pub a: Point2<f64>,
    /// Second end, metres, in the same frame.
    pub b: Point2<f64>,
    /// Direction of the line's normal, in (-pi, pi].
    pub alpha_rad: f64,
    /// Distance of the line from the origin, not negative.
    pub rho_m: f64,
    /// Covariance of (alpha, rho): rad^2, rad m, m^2.
    pub covariance: Matrix2<f64>,
    /// Number of scans that measured it.
    pub hits: u32,
}

impl LaserSegment {
    /// From its ends and the covariance of its line. Ends within [`MAX_COORDINATE_M`], at least
    /// [`MIN_SEGMENT_M`] apart.
    pub fn from_ends(a: Point2<f64>, b: Point2<f64>, covariance: Matrix2<f64>) -> Result<Self, OutOfRange> {
        for (field, value) in [("a.x_m", a.x), ("a.y_m", a.y), ("b.x_m", b.x), ("b.y_m", b.y)] {
            check::within(field, value, -MAX_COORDINATE_M, MAX_COORDINATE_M)?;
        }
        let length = (b - a).norm();
        check::within("length_m", length, MIN_SEGMENT_M, 4.0 * MAX_COORDINATE_M)?;
        check::covariance("covariance", &covariance)?;
        let d = (b - a) / length;
        let normal = Vector2::new(-d.y, d.x);
        let rho = normal.dot(&Point2::from((a.coords + b.coords) * 0.5).coords);
        let (normal, rho_m) = if rho < 0.0 { (-normal, -rho) } else { (normal, rho) };
        Ok(Self { a, b, alpha_rad: normal.y.atan2(normal.x), rho_m, covariance, hits: 1 })
    }

    /// From its ends and the covariance of its direction and its offset to the free side, about its
    /// middle: rad^2, rad m, m^2. That form does not depend on the map's origin. Bounds as those of
    /// [`Self::from_ends`].
    pub fn about_middle(
        a: Point2<f64>,
        b: Point2<f64>,
        covariance: &Matrix2<f64>,
    ) -> Result<Self, OutOfRange> {
        check::covariance("covariance", covariance)?;
        let plain = Self::from_ends(a, b, Matrix2::zeros())?;
        let (sign, along_m) = plain.line_by_middle();
        // Inverse of that of `covariance_about_middle`.
        let j = Matrix2::new(1.0, 0.0, sign * along_m, sign);
        let covariance = j * covariance * j.transpose();
        let covariance = 0.5 * (covariance + covariance.transpose());
        check::covariance("covariance", &covariance)?;
        Ok(Self { covariance, ..plain })
    }

    /// Covariance of its direction and its offset to the free side, about its middle: rad^2, rad m,
    /// m^2.
    pub fn covariance_about_middle(&self) -> Matrix2<f64> {
        let (sign, along_m) = self.line_by_middle();
        let j = Matrix2::new(1.0, 0.0, -along_m, sign);
        let covariance = j * self.covariance * j.transpose();
        0.5 * (covariance + covariance.transpose())
    }

    /// Whether rho grows to the free side (1, or -1), and how far the middle lies along the wall
    /// from the foot of the origin, metres.
    fn line_by_middle(&self) -> (f64, f64) {
        let n = self.facing();
        let is_same = n.dot(&Vector2::new(self.alpha_rad.cos(), self.alpha_rad.sin())) >= 0.0;
        let middle = nalgebra::center(&self.a, &self.b);
        (if is_same { 1.0 } else { -1.0 }, Vector2::new(-n.y, n.x).dot(&middle.coords))
    }

    /// From ends `[ax, ay, bx, by]` (metres) measured by hand, each known to 1 cm across the wall,
    /// independently.
    pub fn by_hand(&[ax, ay, bx, by]: &[f64; 4]) -> Result<Self, OutOfRange> {
        let (a, b) = (Point2::new(ax, ay), Point2::new(bx, by));
        let length = (b - a).norm().max(MIN_SEGMENT_M);
        let variance = BY_HAND_SIGMA_M * BY_HAND_SIGMA_M;
        // Offset of the middle: half the sum of those of the ends; direction: their difference by
        // the length. The two are uncorrelated about the middle, and about no other point.
        let covariance = Matrix2::new(2.0 * variance / (length * length), 0.0, 0.0, 0.5 * variance);
        Self::about_middle(a, b, &covariance)
    }

    /// From a line and two points that are projected on it, `a` to `b` with the free side on the
    /// left.
    pub(crate) fn on_line(
        (alpha_rad, rho_m): (f64, f64),
        (a, b): (Point2<f64>, Point2<f64>),
        covariance: Matrix2<f64>,
        hits: u32,
    ) -> Self {
        let n = Vector2::new(alpha_rad.cos(), alpha_rad.sin());
        let foot = |p: Point2<f64>| p - n * (n.dot(&p.coords) - rho_m);
        // The line's sign is a convention, not a change of side: (alpha, rho) and (alpha +
        // pi, -rho) are one line, and so are their covariances but for the sign of the off-diagonal
        // term's rho.
        let (alpha_rad, rho_m, covariance) = if rho_m < 0.0 {
            let flip = Matrix2::new(1.0, 0.0, 0.0, -1.0);
            (wrap_rad(alpha_rad + PI), -rho_m, flip * covariance * flip)
        } else {
            (wrap_rad(alpha_rad), rho_m, covariance)
        };
        Self { a: foot(a), b: foot(b), alpha_rad, rho_m, covariance, hits }
    }

    /// Distance between the ends, metres.
    pub fn length_m(&self) -> f64 {
        (self.b - self.a).norm()
    }

    /// Unit vector from `a` to `b`.
    pub fn direction(&self) -> Vector2<f64> {
        (self.b - self.a) / self.length_m()
    }

    /// Unit normal on the free side.
    pub fn facing(&self) -> Vector2<f64> {
        let d = self.direction();
        Vector2::new(-d.y, d.x)
    }

    /// The segment in the frame a, given `a_from_b` with its covariance and the segment in b
    /// (errors independent).
    #[must_use]
    pub fn transformed(&self, a_from_b: &Pose2Covariance) -> Self {
        let Pose2 { x_m, y_m, theta_rad } = a_from_b.pose;
        let alpha = self.alpha_rad + theta_rad;
        let (s, c) = alpha.sin_cos();
        let rho = self.rho_m + x_m * c + y_m * s;
        // Inverse of method 17.4: d(alpha, rho) by (x, y, theta) and by the line in b.
        let turn = y_m * c - x_m * s;
        let by_pose = Matrix2x3::new(0.0, 0.0, 1.0, c, s, turn);
        let by_line = Matrix2::new(1.0, 0.0, turn, 1.0);
        let covariance = by_pose * a_from_b.covariance * by_pose.transpose()
            + by_line * self.covariance * by_line.transpose();
        let ends = (a_from_b.pose.apply(&self.a), a_from_b.pose.apply(&self.b));
        Self::on_line((alpha, rho), ends, covariance, self.hits)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, Vector3};
    use rand::{RngExt as _, SeedableRng as _};
    use rand_chacha::ChaCha8Rng;

    fn wall() -> LaserSegment {
        let covariance = Matrix2::new(1e-4, 3e-5, 3e-5, 2e-4);
        LaserSegment::from_ends(Point2::new(3.0, -1.0), Point2::new(3.2, 1.0), covariance).unwrap()
    }

    #[test]
    fn the_free_side_is_on_the_left() {
        let w = wall();
        assert!(w.facing().dot(&-w.a.coords) > 0.0, "faces the origin");
        let back = LaserSegment::from_ends(w.b, w.a, w.covariance).unwrap();
        assert!((back.facing() + w.facing()).norm() < 1e-12);
        assert!((back.alpha_rad - w.alpha_rad).abs() < 1e-12, "same line");
        assert!((back.rho_m - w.rho_m).abs() < 1e-12);
    }

    /// Variance of a point of the wall's line across it, by (alpha, rho) alone, m^2. `along` runs
    /// from 0 at `a` to 1 at `b`.
    fn variance_across(wall: &LaserSegment, along: f64) -> f64 {
        let p = wall.a + (wall.b - wall.a) * along;
        let (s, c) = wall.alpha_rad.sin_cos();
        // Offset of the point from the line: cos(alpha) x + sin(alpha) y - rho.
        let j = Vector2::new(c * p.y - s * p.x, -1.0);
        (j.transpose() * wall.covariance * j)[0]
    }

    /// What two independent ends give: a quarter of the sum in the middle, all of one at its end.
    fn by_ends(along: f64) -> f64 {
        let sigma = BY_HAND_SIGMA_M;
        sigma * sigma * ((1.0 - along).powi(2) + along.powi(2))
    }

    #[test]
    fn points_of_a_wall_by_hand_are_as_well_known_wherever_the_origin_is() {
        let mut random = ChaCha8Rng::seed_from_u64(5);
        for _ in 0..2000 {
            let mut draw = |low: f64, high: f64| random.random_range(low..high);
            let (x, y, length, turn) = (draw(-1e4, 1e4), draw(-1e4, 1e4), draw(0.2, 50.0), draw(-PI, PI));
            let (along, pose) =
                (draw(-0.5, 1.5), Pose2::new(draw(-1e4, 1e4), draw(-1e4, 1e4), draw(-PI, PI)));
            let (s, c) = turn.sin_cos();
            let wall = LaserSegment::by_hand(&[x, y, x + length * c, y + length * s]).unwrap();
            let moved = wall.transformed(&Pose2Covariance { pose, covariance: Matrix3::zeros() });
            let again = LaserSegment::by_hand(&[moved.a.x, moved.a.y, moved.b.x, moved.b.y]).unwrap();
            for (wall, what) in [(&wall, "given"), (&moved, "moved"), (&again, "given where it was moved to")]
            {
                let (variance, expected) = (variance_across(wall, along), by_ends(along));
                assert!((variance - expected).abs() < 1e-3 * expected, "{what}: {variance}, not {expected}");
                let offset = wall.covariance_about_middle()[(1, 1)];
                assert!((offset - by_ends(0.5)).abs() < 1e-3 * by_ends(0.5), "{what}: {offset}");
            }
        }
    }

    #[test]
    fn ends_drawn_anew_give_the_covariance_of_a_wall_by_hand() {
        // Oracle: both ends moved by what a tape measure is wrong, far from the origin.
        let (a, b) = (Point2::new(300.0, 299.0), Point2::new(302.0, 300.0));
        let wall = LaserSegment::by_hand(&[a.x, a.y, b.x, b.y]).unwrap();
        let mut sum = Matrix2::zeros();
        let step = BY_HAND_SIGMA_M * 1e-3;
        for (da, db) in [(step, 0.0), (0.0, step)] {
            let (n, zero) = (wall.facing(), Matrix2::zeros());
            let off =
                |sign: f64| LaserSegment::from_ends(a + n * da * sign, b + n * db * sign, zero).unwrap();
            let (up, down) = (off(1.0), off(-1.0));
            let d = Vector2::new(wrap_rad(up.alpha_rad - down.alpha_rad), up.rho_m - down.rho_m) / 2e-3;
            sum += d * d.transpose();
        }
        for k in 0..4 {
            let (i, j) = (k / 2, k % 2);
            let weight = (sum[(i, i)] * sum[(j, j)]).sqrt();
            assert!(
                (sum[(i, j)] - wall.covariance[(i, j)]).abs() < 1e-6 * weight,
                "{sum} {}",
                wall.covariance
            );
        }
        assert!(
            sum[(0, 1)].abs() > 0.99 * (sum[(0, 0)] * sum[(1, 1)]).sqrt(),
            "direction and distance go together far from the origin"
        );
    }

    #[test]
    fn ends_lie_on_the_line_in_every_frame() {
        for pose in [Pose2::new(0.3, 0.2, 1.0), Pose2::new(-9.0, 4.0, -2.5), Pose2::new(-2.9, -0.1, 0.0)] {
            let moved = wall().transformed(&Pose2Covariance { pose, covariance: Matrix3::zeros() });
            assert!(moved.rho_m >= 0.0);
            for (p, original) in [(moved.a, wall().a), (moved.b, wall().b)] {
                let n = Vector2::new(moved.alpha_rad.cos(), moved.alpha_rad.sin());
                assert!((n.dot(&p.coords) - moved.rho_m).abs() < 1e-12);
                assert!((p - pose.apply(&original)).norm() < 1e-12);
            }
            assert!((moved.length_m() - wall().length_m()).abs() < 1e-12);
        }
    }

    #[test]
    fn covariance_follows_finite_differences() {
        // Oracle: the transform itself, differenced by (x, y, theta, alpha, rho).
        for pose in [Pose2::new(0.3, 0.2, 1.0), Pose2::new(-9.0, 4.0, 0.3)] {
            let line = |d: &[f64; 5]| {
                let w = wall();
                let moved =
                    LaserSegment::on_line((w.alpha_rad + d[3], w.rho_m + d[4]), (w.a, w.b), w.covariance, 1);
                let p = pose.plus(&Vector3::new(d[0], d[1], d[2]));
                let s = moved.transformed(&Pose2Covariance { pose: p, covariance: Matrix3::zeros() });
                Vector2::new(s.alpha_rad, s.rho_m)
            };
            let mut expected = Matrix2::zeros();
            let pose_covariance = Matrix3::from_diagonal(&Vector3::new(1e-4, 2e-4, 3e-5));
            let mut j = nalgebra::Matrix2x5::zeros();
            for k in 0..5 {
                let (mut up, mut down) = ([0.0; 5], [0.0; 5]);
                (up[k], down[k]) = (1e-6, -1e-6);
                j.set_column(k, &((line(&up) - line(&down)) / 2e-6));
            }
            let (jp, jl) = (j.fixed_columns::<3>(0), j.fixed_columns::<2>(3));
            expected += jp * pose_covariance * jp.transpose() + jl * wall().covariance * jl.transpose();
            let got = wall().transformed(&Pose2Covariance { pose, covariance: pose_covariance }).covariance;
            assert!((got - expected).norm() < 1e-8, "{got} {expected}");
        }
    }

    #[test]
    fn the_covariance_about_the_middle_is_that_of_the_wall_in_every_frame() {
        // Oracle: a wall drawn by its covariance about the middle, and the line that goes through
        // it.
        let about = Matrix2::new(4e-6, -1.2e-5, -1.2e-5, 1e-4);
        for (a, b) in [([40.0, -1.0], [43.0, 1.0]), ([43.0, 1.0], [40.0, -1.0]), ([-2.0, 0.0], [4.0, 0.0])] {
            let wall = LaserSegment::about_middle(Point2::from(a), Point2::from(b), &about).unwrap();
            assert!((wall.covariance_about_middle() - about).norm() < 1e-12, "{wall:?}");
            let (middle, n) = (nalgebra::center(&wall.a, &wall.b), wall.facing());
            let line = |turn: f64, offset: f64| {
                let turned = nalgebra::Rotation2::new(turn);
                let end = |p: &Point2<f64>| middle + turned * (p - middle + n * offset);
                let s = LaserSegment::from_ends(end(&wall.a), end(&wall.b), Matrix2::zeros()).unwrap();
                // Near the origin the sign of the normal is a convention.
                let same = (s.alpha_rad - wall.alpha_rad).cos() > 0.0;
                let (alpha, rho) = if same { (s.alpha_rad, s.rho_m) } else { (s.alpha_rad + PI, -s.rho_m) };
                Vector2::new(wrap_rad(alpha), rho)
            };
            let by = |up: Vector2<f64>, down: Vector2<f64>| {
                Vector2::new(wrap_rad(up.x - down.x), up.y - down.y) / 2e-6
            };
            let j = Matrix2::from_columns(&[
                by(line(1e-6, 0.0), line(-1e-6, 0.0)),
                by(line(0.0, 1e-6), line(0.0, -1e-6)),
            ]);
            let expected = j * about * j.transpose();
            assert!(
                (wall.covariance - expected).norm() < 1e-7 * (1.0 + expected.norm()),
                "{wall:?} {expected}"
            );
            let pose = Pose2::new(-300.0, 70.0, 2.0);
            let moved = wall.transformed(&Pose2Covariance { pose, covariance: Matrix3::zeros() });
            assert!((moved.covariance_about_middle() - about).norm() < 1e-10, "{moved:?}");
        }
        let (a, b) = (Point2::origin(), Point2::new(1.0, 0.0));
        let bad = Matrix2::new(1e-4, 1.0, 1.0, 1e-4);
        assert_eq!(LaserSegment::about_middle(a, b, &bad).unwrap_err().field, "covariance");
    }

    #[test]
    fn points_and_infinite_lines_are_refused() {
        let o = Point2::origin();
        let at = |x| LaserSegment::from_ends(o, Point2::new(x, 0.0), Matrix2::identity());
        assert!(at(MIN_SEGMENT_M).is_ok());
        assert_eq!(at(0.009).unwrap_err().field, "length_m");
        assert_eq!(at(f64::INFINITY).unwrap_err().field, "b.x_m");
        assert!(LaserSegment::from_ends(o, Point2::new(1.0, 0.0), -Matrix2::identity()).is_err());
    }
}
