//! Visibility probability for an uncertain pose (method 12.5): the share of draws of the pose from
//! which the landmark is visible. The draws are fixed points of a low-discrepancy sequence, so the
//! result is reproducible.

use super::VisibilityMap;
use crate::pose2::{Pose2, Pose2Covariance, wrap_rad};
use nalgebra::{Matrix3, Point2, SymmetricEigen, Vector2, Vector3};
use std::f64::consts::TAU;

/// Number of draws of a pose.
pub const DRAWS: usize = 64;

/// Draws of an uncertain pose, to be used for many landmarks.
#[derive(Debug, Clone, PartialEq)]
pub struct PoseDraws {
    /// Camera position and robot pose of each draw.
    draws: Vec<(Point2<f64>, Pose2)>,
    mean: Point2<f64>,
    /// Largest distance of a draw from `mean`, metres.
    spread_m: f64,
}

/// The digits of `index` in `base`, mirrored at the point.
fn radical_inverse(mut index: usize, base: usize) -> f64 {
    let (mut value, mut digit) = (0.0, 1.0 / base as f64);
    while index > 0 {
        value += (index % base) as f64 * digit;
        index /= base;
        digit /= base as f64;
    }
    value
}

/// Three standard normal numbers.
fn normals(index: usize) -> Vector3<f64> {
    let u = |base| radical_inverse(index, base);
    let polar = |a: f64, b: f64| ((-2.0 * a.ln()).sqrt(), TAU * b);
    let ((r, angle), (r3, angle3)) = (polar(u(2), u(3)), polar(u(5), u(7)));
    Vector3::new(r * angle.cos(), r * angle.sin(), r3 * angle3.cos())
}

/// Half of the draws of a standard normal vector, transformed to the exact covariance; the others
/// are opposite.
fn standard() -> Vec<Vector3<f64>> {
    let raw: Vec<_> = (1..=DRAWS / 2).map(normals).collect();
    let spread = raw.iter().map(|z| z * z.transpose()).sum::<Matrix3<f64>>() / raw.len() as f64;
    let eigen = SymmetricEigen::new(spread);
    let whiten =
        Matrix3::from_diagonal(&eigen.eigenvalues.map(|v| 1.0 / v.sqrt())) * eigen.eigenvectors.transpose();
    raw.iter().map(|z| eigen.eigenvectors * (whiten * z)).collect()
}

impl PoseDraws {
    /// Draws of a pose; `camera_m` is the camera's position in the robot frame.
    pub fn new(pose: &Pose2Covariance, camera_m: Vector2<f64>) -> Self {
        let eigen = SymmetricEigen::new(pose.covariance);
        let root = eigen.eigenvectors * Matrix3::from_diagonal(&eigen.eigenvalues.map(|v| v.max(0.0).sqrt()));
        let camera = |at: &Pose2| at.apply(&Point2::from(camera_m));
        let errors = standard().into_iter().map(|z| root * z);
        let draws: Vec<_> = errors
            .flat_map(|e| [e, -e])
            .map(|e| {
                let at = pose.pose.plus(&e);
                (camera(&at), at)
            })
            .collect();
        let mean = camera(&pose.pose);
        let spread_m = draws.iter().map(|(c, _)| (c - mean).norm()).fold(0.0, f64::max);
        Self { draws, mean, spread_m }
    }

    /// Camera position at the mean pose.
    pub fn mean(&self) -> Point2<f64> {
        self.mean
    }

    /// Largest distance of a draw from the mean, metres.
    pub fn spread_m(&self) -> f64 {
        self.spread_m
    }

    /// The drawn robot poses.
    pub fn poses(&self) -> impl Iterator<Item = Pose2> {
        self.draws.iter().map(|(_, pose)| *pose)
    }
}

impl VisibilityMap {
    /// Probability that the landmark is visible, the camera panned to it as far as possible.
    pub fn probability(&self, pose: &PoseDraws) -> f64 {
        if (pose.mean - self.frame.origin).norm() > self.reach_m + pose.spread_m {
            return 0.0;
        }
        let inside =
            pose.draws.iter().filter(|(at, pose)| self.contains(at) && self.pans(at, pose.theta_rad));
        inside.count() as f64 / DRAWS as f64
    }

    /// Whether the camera can be panned to the landmark.
    pub(super) fn pans(&self, camera: &Point2<f64>, heading_rad: f64) -> bool {
        let to = self.centre - camera;
        let pan = wrap_rad(to.y.atan2(to.x) - heading_rad);
        (self.pan_rad[0]..=self.pan_rad[1]).contains(&pan)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_draws_have_the_moments_of_the_pose() {
        let root = Matrix3::new(0.3, 0.0, 0.0, -0.1, 0.2, 0.0, 0.02, -0.03, 0.05);
        let covariance = root * root.transpose();
        let pose = Pose2Covariance { pose: Pose2::new(2.0, -1.0, 1.0), covariance };
        let made = PoseDraws::new(&pose, Vector2::zeros());
        let errors: Vec<Vector3<f64>> = made.poses().map(|at| pose.pose.minus(&at)).collect();
        let n = DRAWS as f64;
        let mean = errors.iter().sum::<Vector3<f64>>() / n;
        assert!(mean.norm() < 1e-12, "{mean}");
        let spread = errors.iter().map(|e| e * e.transpose()).sum::<Matrix3<f64>>() / n;
        for (got, expected) in [(0, 0), (1, 1), (2, 2), (0, 1), (1, 2)].map(|k| (spread[k], covariance[k])) {
            assert!((got - expected).abs() < 1e-9, "{spread} {covariance}");
        }
    }
}
