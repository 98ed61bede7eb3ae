//! Poses on the floor, alone and with covariance: composition, inverse, propagation of the
//! covariance.

use crate::check::{self, MAX_COORDINATE_M, OutOfRange};
use nalgebra::{Isometry3, Matrix3, Point2, Translation3, UnitQuaternion, Vector2, Vector3};
use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, TAU};

/// The equivalent angle in (-pi, pi]. NaN stays NaN.
pub fn wrap_rad(angle_rad: f64) -> f64 {
    let a = angle_rad.rem_euclid(TAU);
    if a > PI { a - TAU } else { a }
}

/// Pose on the floor: `a_from_b` as position of b's origin in a (metres) and heading of b's x axis
/// (radians).
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pose2 {
    /// Position along x, metres.
    pub x_m: f64,
    /// Position along y, metres.
    pub y_m: f64,
    /// Heading, radians, counter-clockwise from x, in (-pi, pi].
    pub theta_rad: f64,
}

impl Pose2 {
    /// Wraps the heading. Checks nothing: see [`Pose2::check`].
    pub fn new(x_m: f64, y_m: f64, theta_rad: f64) -> Self {
        Self { x_m, y_m, theta_rad: wrap_rad(theta_rad) }
    }

    /// Finite, and within [`MAX_COORDINATE_M`] of the origin.
    pub fn check(&self) -> Result<(), OutOfRange> {
        check::within("x_m", self.x_m, -MAX_COORDINATE_M, MAX_COORDINATE_M)?;
        check::within("y_m", self.y_m, -MAX_COORDINATE_M, MAX_COORDINATE_M)?;
        check::within("theta_rad", self.theta_rad, -1e3, 1e3)
    }

    /// `a_from_c` of `self` = `a_from_b` and `b_from_c`.
    #[must_use]
    pub fn compose(&self, b_from_c: &Self) -> Self {
        let p = self.apply(&Point2::new(b_from_c.x_m, b_from_c.y_m));
        Self::new(p.x, p.y, self.theta_rad + b_from_c.theta_rad)
    }

    /// `b_from_a` of `a_from_b`.
    #[must_use]
    pub fn inverse(&self) -> Self {
        let (s, c) = self.theta_rad.sin_cos();
        Self::new(-c * self.x_m - s * self.y_m, s * self.x_m - c * self.y_m, -self.theta_rad)
    }

    /// `b_from_c` of `self` = `a_from_b` and `a_from_c`: the motion from `self` to the other.
    #[must_use]
    pub fn between(&self, a_from_c: &Self) -> Self {
        self.inverse().compose(a_from_c)
    }

    /// A point of b in a.
    pub fn apply(&self, p_b: &Point2<f64>) -> Point2<f64> {
        let (s, c) = self.theta_rad.sin_cos();
        Point2::new(self.x_m + c * p_b.x - s * p_b.y, self.y_m + s * p_b.x + c * p_b.y)
    }

    /// Position, metres.
    pub fn position(&self) -> Vector2<f64> {
        Vector2::new(self.x_m, self.y_m)
    }

    /// `self` minus `other`, heading wrapped: the error vector (x, y, theta) in the frame a.
    pub fn minus(&self, other: &Self) -> Vector3<f64> {
        Vector3::new(self.x_m - other.x_m, self.y_m - other.y_m, wrap_rad(self.theta_rad - other.theta_rad))
    }

    /// Adds an error vector (x, y, theta).
    #[must_use]
    pub fn plus(&self, d: &Vector3<f64>) -> Self {
        Self::new(self.x_m + d.x, self.y_m + d.y, self.theta_rad + d.z)
    }

    /// The same transform in space: no roll, no pitch, height 0.
    pub fn to_isometry3(&self) -> Isometry3<f64> {
        Isometry3::from_parts(
            Translation3::new(self.x_m, self.y_m, 0.0),
            UnitQuaternion::from_axis_angle(&Vector3::z_axis(), self.theta_rad),
        )
    }

    /// Derivatives of `self.compose(b_from_c)` by (x, y, theta) of `self` and of `b_from_c`.
    pub fn compose_jacobians(&self, b_from_c: &Self) -> (Matrix3<f64>, Matrix3<f64>) {
        let (s, c) = self.theta_rad.sin_cos();
        let (x, y) = (b_from_c.x_m, b_from_c.y_m);
        let by_self = Matrix3::new(1.0, 0.0, -s * x - c * y, 0.0, 1.0, c * x - s * y, 0.0, 0.0, 1.0);
        let by_other = Matrix3::new(c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0);
        (by_self, by_other)
    }
}

/// A pose and the covariance of its (x, y, theta), in the frame a of `a_from_b` (m^2, m rad,
/// rad^2).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose2Covariance {
    /// Mean pose.
    pub pose: Pose2,
    /// Symmetric, positive semidefinite. The off-diagonal terms carry information (method 13.6).
    pub covariance: Matrix3<f64>,
}

impl Pose2Covariance {
    /// Checks the pose and the covariance.
    pub fn new(pose: Pose2, covariance: Matrix3<f64>) -> Result<Self, OutOfRange> {
        let made = Self { pose: Pose2::new(pose.x_m, pose.y_m, pose.theta_rad), covariance };
        pose.check()?;
        made.check()?;
        Ok(made)
    }

    /// Pose in range; covariance finite, symmetric, positive semidefinite.
    pub fn check(&self) -> Result<(), OutOfRange> {
        self.pose.check()?;
        check::covariance("covariance", &self.covariance)
    }

    /// Composes with another uncertain pose whose error is independent.
    #[must_use]
    pub fn compose(&self, b_from_c: &Self) -> Self {
        let (ja, jb) = self.pose.compose_jacobians(&b_from_c.pose);
        Self {
            pose: self.pose.compose(&b_from_c.pose),
            covariance: ja * self.covariance * ja.transpose() + jb * b_from_c.covariance * jb.transpose(),
        }
    }

    /// The inverse pose with its covariance, in the frame b.
    #[must_use]
    pub fn inverse(&self) -> Self {
        let inverse = self.pose.inverse();
        let (s, c) = self.pose.theta_rad.sin_cos();
        let j = Matrix3::new(-c, -s, inverse.y_m, s, -c, -inverse.x_m, 0.0, 0.0, -1.0);
        Self { pose: inverse, covariance: j * self.covariance * j.transpose() }
    }

    /// Squared Mahalanobis distance of `other` under the sum of both covariances; `None` when that
    /// is singular.
    pub fn distance2(&self, other: &Self) -> Option<f64> {
        let d = self.pose.minus(&other.pose);
        let s = (self.covariance + other.covariance).cholesky()?;
        Some(d.dot(&s.solve(&d)))
    }
}

/// The motion that lays points best on the same points of another frame: `there_from_here` by least
/// squares; the identity for none.
pub fn laid_on(here: &[Point2<f64>], there: &[Point2<f64>]) -> Pose2 {
    let mean = |points: &[Point2<f64>]| {
        points.iter().map(|p| p.coords).sum::<Vector2<f64>>() / points.len().max(1) as f64
    };
    let (from, to) = (mean(here), mean(there));
    let (mut dot, mut perp) = (0.0, 0.0);
    for (a, b) in here.iter().zip(there) {
        let (a, b) = (a.coords - from, b.coords - to);
        (dot, perp) = (dot + a.dot(&b), perp + a.perp(&b));
    }
    let turn = Pose2::new(0.0, 0.0, perp.atan2(dot));
    let shift = to - turn.apply(&from.into()).coords;
    Pose2::new(shift.x, shift.y, turn.theta_rad)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn poses() -> [Pose2; 3] {
        [Pose2::new(1.0, -2.0, 0.7), Pose2::new(-0.4, 3.0, 3.0), Pose2::new(5.0, 0.1, -2.2)]
    }

    #[test]
    fn wraps_into_the_half_open_circle() {
        assert!((wrap_rad(3.0 * PI) - PI).abs() < 1e-12);
        assert!((wrap_rad(-PI) - PI).abs() < 1e-12);
        assert!((wrap_rad(TAU + 0.25) - 0.25).abs() < 1e-12);
        assert!(wrap_rad(f64::NAN).is_nan());
        assert!((wrap_rad(-1e-18)).abs() < 1e-12);
    }

    #[test]
    fn agrees_with_matrices_in_space() {
        // Oracle: nalgebra's isometries.
        let [a, b, _] = poses();
        let (ours, theirs) = (a.compose(&b).to_isometry3(), a.to_isometry3() * b.to_isometry3());
        assert!((ours.to_homogeneous() - theirs.to_homogeneous()).norm() < 1e-12);
        let inverse = a.inverse().to_isometry3().to_homogeneous();
        assert!((inverse - a.to_isometry3().inverse().to_homogeneous()).norm() < 1e-12);
    }

    #[test]
    fn group_laws_hold() {
        let [a, b, c] = poses();
        let d = a.compose(&b).compose(&c).minus(&a.compose(&b.compose(&c)));
        assert!(d.norm() < 1e-12);
        assert!(a.compose(&a.between(&b)).minus(&b).norm() < 1e-12);
    }

    #[test]
    fn jacobians_are_the_finite_differences() {
        let [a, b, _] = poses();
        let (ja, jb) = a.compose_jacobians(&b);
        let inverse_covariance =
            Pose2Covariance { pose: a, covariance: Matrix3::identity() }.inverse().covariance;
        let mut ji = Matrix3::zeros();
        let h = 1e-6;
        for k in 0..3 {
            let mut d = Vector3::zeros();
            d[k] = h;
            let na = (a.plus(&d).compose(&b).minus(&a.plus(&-d).compose(&b))) / (2.0 * h);
            let nb = (a.compose(&b.plus(&d)).minus(&a.compose(&b.plus(&-d)))) / (2.0 * h);
            assert!((na - ja.column(k)).norm() < 1e-8);
            assert!((nb - jb.column(k)).norm() < 1e-8);
            ji.set_column(k, &((a.plus(&d).inverse().minus(&a.plus(&-d).inverse())) / (2.0 * h)));
        }
        assert!((ji * ji.transpose() - inverse_covariance).norm() < 1e-7);
    }

    #[test]
    fn invalid_poses_are_refused() {
        assert_eq!(Pose2::new(f64::NAN, 0.0, 0.0).check().unwrap_err().field, "x_m");
        assert_eq!(Pose2::new(0.0, MAX_COORDINATE_M * 1.01, 0.0).check().unwrap_err().field, "y_m");
        assert!(Pose2::new(0.0, MAX_COORDINATE_M, 0.0).check().is_ok());
        assert_eq!(Pose2::new(0.0, 0.0, f64::INFINITY).check().unwrap_err().field, "theta_rad");
        let bad = Pose2Covariance::new(Pose2::default(), -Matrix3::identity());
        assert_eq!(bad.unwrap_err().field, "covariance");
    }

    #[test]
    fn distance2_uses_both_covariances() {
        let at = |x| Pose2Covariance { pose: Pose2::new(x, 0.0, 0.0), covariance: Matrix3::identity() * 0.5 };
        assert!((at(0.0).distance2(&at(3.0)).unwrap() - 9.0).abs() < 1e-12);
        let sure = Pose2Covariance { pose: Pose2::default(), covariance: Matrix3::zeros() };
        assert_eq!(sure.distance2(&sure), None);
    }

    #[test]
    fn a_moved_map_is_laid_back() {
        let there = [[0.0, 0.0], [4.0, 1.0], [3.0, -2.0]].map(Point2::from);
        let truth = Pose2::new(2.0, -1.0, 2.5);
        let here = there.map(|p| truth.inverse().apply(&p));
        assert!(laid_on(&here, &there).minus(&truth).norm() < 1e-12);
        // A point that is off by 3 draws the others by a third of it.
        let mut off = there;
        off[0].y += 3.0;
        let to_mean = laid_on(&there, &off).apply(&Point2::new(7.0 / 3.0, -1.0 / 3.0));
        assert!((to_mean - Point2::new(7.0 / 3.0, 2.0 / 3.0)).norm() < 1e-12);
        assert_eq!(laid_on(&[], &[]), Pose2::default());
    }
}
