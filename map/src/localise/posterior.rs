//! Mean and covariance of the robot's pose around a minimum, by quadrature over the heading.
//!
//! From the front, a plane determines its direction poorly, and chi2 is not quadratic in it. The
//! covariance at the minimum is then several times too small (mean NEES 10 instead of 3 at 6 m, by
//! the Monte Carlo test of this module). The robot is turned around the landmarks in steps, its
//! position refitted at each; the weighted samples give the first two moments.
//!
//! Departs from method 13.6, which takes the covariance to first order.

use crate::{
    localise::planar::{Descended, Planar},
    pose2::Pose2,
};
use nalgebra::{DMatrix, Matrix2, Matrix3, Point2, Vector3};

/// Half-width of the first grid, in standard deviations of the minimum.
const REACH_SIGMA: f64 = 6.0;
/// Points on each side of the minimum in the first grid.
const HALF_POINTS: usize = 12;
/// The grid grows until chi2 has risen by this at both ends.
const RISE_CHI2: f64 = 25.0;
/// Most times the grid grows, each time by half.
const MAX_GROWTH: usize = 8;
/// Farthest turn from the minimum.
const MAX_TURN_RAD: f64 = 2.6;
/// Steps of the position's refit at each turn.
const REFIT_STEPS: usize = 3;

/// First two moments of the pose.
pub(super) struct Moments {
    pub mean: Pose2,
    pub covariance: Matrix3<f64>,
}

/// One point of the grid.
struct Sample {
    pose: Pose2,
    chi2: f64,
    /// Covariance of the position, heading held.
    position: Matrix2<f64>,
}

/// Moments of `exp(-chi2 / 2)` around the minimum `at`, no farther than `limit_rad` (signed turns)
/// on each side: the border to another minimum. `sigma_rad` is the heading's standard deviation by
/// linearisation.
pub(super) fn moments(
    problem: &Planar<'_>,
    at: &Pose2,
    weight: &DMatrix<f64>,
    sigma_rad: f64,
    limit_rad: (f64, f64),
) -> Option<Moments> {
    let pivot = problem.pivot();
    let step = (REACH_SIGMA * sigma_rad / HALF_POINTS as f64).clamp(1e-9, MAX_TURN_RAD / HALF_POINTS as f64);
    // No step: the residuals at the minimum itself.
    let centre = sample(problem.descend(*at, weight, false, 0)?, weight)?;
    let lowest = centre.chi2;
    let mut samples = vec![centre];
    for direction in [-1.0, 1.0] {
        let limit = if direction < 0.0 { -limit_rad.0 } else { limit_rad.1 }.min(MAX_TURN_RAD);
        let mut pose = *at;
        let most = HALF_POINTS * (MAX_GROWTH + 1);
        for i in 1..=most {
            let turn = i as f64 * step;
            if turn > limit {
                break;
            }
            let start = turned(&pose, &pivot, direction * step);
            let refitted = problem.descend(start, weight, false, REFIT_STEPS);
            let Some(made) = refitted.and_then(|r| sample(r, weight)) else { break };
            pose = made.pose;
            let far = made.chi2 - lowest > RISE_CHI2;
            samples.push(made);
            if i >= HALF_POINTS && far {
                break;
            }
        }
    }
    integrate(&samples, at, lowest)
}

/// The robot turned about a point of the floor, whose bearing and distance from the robot stay.
pub(super) fn turned(pose: &Pose2, pivot: &Point2<f64>, by_rad: f64) -> Pose2 {
    let (s, c) = by_rad.sin_cos();
    let d = Point2::new(pose.x_m, pose.y_m) - pivot;
    Pose2::new(pivot.x + c * d.x - s * d.y, pivot.y + s * d.x + c * d.y, pose.theta_rad + by_rad)
}

fn sample(Descended { pose, linearisation, chi2 }: Descended, weight: &DMatrix<f64>) -> Option<Sample> {
    let j = linearisation.by_pose.columns(0, 2);
    let h = j.transpose() * weight * j;
    let position = Matrix2::new(h[(0, 0)], h[(0, 1)], h[(1, 0)], h[(1, 1)]).cholesky()?.inverse();
    Some(Sample { pose, chi2, position })
}

fn integrate(samples: &[Sample], at: &Pose2, lowest: f64) -> Option<Moments> {
    let weight_of = |s: &Sample| (-0.5 * (s.chi2 - lowest)).exp() * s.position.determinant().max(0.0).sqrt();
    let total: f64 = samples.iter().map(weight_of).sum();
    let mut mean = Vector3::zeros();
    for s in samples {
        mean += s.pose.minus(at) * (weight_of(s) / total);
    }
    let mut covariance = Matrix3::zeros();
    for s in samples {
        let d = s.pose.minus(at) - mean;
        let mut spread = d * d.transpose();
        let mut block = spread.fixed_view_mut::<2, 2>(0, 0);
        block += s.position;
        covariance += spread * (weight_of(s) / total);
    }
    let finite = mean.iter().chain(covariance.iter()).all(|v| v.is_finite());
    finite.then(|| Moments { mean: at.plus(&mean), covariance })
}
