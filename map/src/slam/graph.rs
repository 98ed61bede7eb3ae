//! The pose graph: relative poses with information between keyframes, and the poses that fit them
//! best (sparse nonlinear least squares). In: poses and constraints. Out: poses, chi2 of every
//! constraint, covariances.

use super::normal_equations::{BlockMatrix, BlockPattern, NotPositiveDefinite};
use crate::pose2::{Pose2, wrap_rad};
use nalgebra::{Matrix3, Vector3};

/// Most poses in a graph.
pub const MAX_POSES: usize = 50_000;
/// Most edges in a graph.
pub const MAX_EDGES: usize = 1_000_000;
/// Most iterations of an optimisation.
const MAX_ITERATIONS: usize = 50;

/// A measured relative pose between two poses.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PoseConstraint {
    /// Index of the pose whose frame the measurement is in.
    pub from: usize,
    /// Index of the other pose.
    pub to: usize,
    /// The measured relative pose, `from` to `to`.
    pub measured: Pose2,
    /// Inverse covariance over (x, y, theta) in the frame of `from`; may be singular.
    pub information: Matrix3<f64>,
    /// For a constraint that may be wrong: its weight falls off beyond this chi2 (dynamic
    /// covariance scaling, Agarwal et al. 2013).
    pub doubt_chi2: Option<f64>,
}

/// Why a graph cannot be optimised.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum GraphError {
    /// There are too many poses or constraints.
    #[error("{0} poses and {1} edges: at most {MAX_POSES} and {MAX_EDGES}")]
    TooLarge(usize, usize),
    /// A constraint names a missing pose, or has a number that is not finite.
    #[error("constraint {0} names a missing pose, or has a number that is not finite")]
    Constraint(usize),
    /// The constraints do not determine every pose.
    #[error("the constraints do not determine every pose")]
    Loose,
}

/// Error of a constraint (x, y, theta).
pub(crate) fn error(edge: &PoseConstraint, from: &Pose2, to: &Pose2) -> Vector3<f64> {
    let h = from.between(to);
    Vector3::new(
        h.x_m - edge.measured.x_m,
        h.y_m - edge.measured.y_m,
        wrap_rad(h.theta_rad - edge.measured.theta_rad),
    )
}

/// Derivatives of [`error`] by both poses.
pub(crate) fn jacobians(from: &Pose2, to: &Pose2) -> (Matrix3<f64>, Matrix3<f64>) {
    let (s, c) = from.theta_rad.sin_cos();
    let d = to.position() - from.position();
    let by_from = Matrix3::new(-c, -s, -s * d.x + c * d.y, s, -c, -c * d.x - s * d.y, 0.0, 0.0, -1.0);
    let by_to = Matrix3::new(c, s, 0.0, -s, c, 0.0, 0.0, 0.0, 1.0);
    (by_from, by_to)
}

/// chi2 of a constraint at these poses, without scaling.
pub fn chi2(edge: &PoseConstraint, poses: &[Pose2]) -> f64 {
    let e = error(edge, &poses[edge.from], &poses[edge.to]);
    e.dot(&(edge.information * e))
}

/// Weight of a constraint with this chi2: 1, or less if it may be wrong.
pub fn weight(edge: &PoseConstraint, chi2: f64) -> f64 {
    edge.doubt_chi2.map_or(1.0, |phi| scaled_weight(phi, chi2))
}

/// Weight of dynamic covariance scaling beyond `phi`: 1 below it.
pub(crate) fn scaled_weight(phi: f64, chi2: f64) -> f64 {
    (2.0 * phi / (phi + chi2)).min(1.0).powi(2)
}

/// The cost that belongs to [`scaled_weight`]: its integral over chi2.
pub(crate) fn scaled_cost(phi: f64, chi2: f64) -> f64 {
    if chi2 > phi { phi + 4.0 * phi * phi * (1.0 / (2.0 * phi) - 1.0 / (phi + chi2)) } else { chi2 }
}

/// Robust cost: chi2, bounded for constraints that may be wrong.
fn cost(edges: &[PoseConstraint], poses: &[Pose2]) -> f64 {
    let one = |e: &PoseConstraint| {
        let c = chi2(e, poses);
        e.doubt_chi2.map_or(c, |phi| scaled_cost(phi, c))
    };
    edges.iter().map(one).sum()
}

fn check(poses: &[Pose2], edges: &[PoseConstraint]) -> Result<(), GraphError> {
    if poses.len() > MAX_POSES || edges.len() > MAX_EDGES {
        return Err(GraphError::TooLarge(poses.len(), edges.len()));
    }
    let good = |e: &PoseConstraint| {
        e.from < poses.len()
            && e.to < poses.len()
            && e.from != e.to
            && e.measured.check().is_ok()
            && e.information.iter().all(|v| v.is_finite())
    };
    edges.iter().position(|e| !good(e)).map_or(Ok(()), |i| Err(GraphError::Constraint(i)))
}

impl From<NotPositiveDefinite> for GraphError {
    fn from(_: NotPositiveDefinite) -> Self {
        Self::Loose
    }
}

/// Which blocks the constraints fill; the first pose is fixed and has no row.
fn pattern(poses: &[Pose2], edges: &[PoseConstraint]) -> BlockPattern {
    let pairs = edges.iter().filter_map(|e| Some((e.from.checked_sub(1)?, e.to.checked_sub(1)?)));
    BlockPattern::new(&vec![3; poses.len() - 1], pairs)
}

/// The normal equations at these poses: matrix and gradient.
fn normal<'a>(
    pattern: &'a BlockPattern,
    poses: &[Pose2],
    edges: &[PoseConstraint],
    damping: f64,
) -> (BlockMatrix<'a>, Vec<f64>) {
    let mut gradient = vec![0.0; 3 * (poses.len() - 1)];
    let mut matrix = pattern.zeros();
    for edge in edges {
        let (a, b) = (&poses[edge.from], &poses[edge.to]);
        let e = error(edge, a, b);
        let information = edge.information * weight(edge, e.dot(&(edge.information * e)));
        let (ja, jb) = jacobians(a, b);
        let ends = [(edge.from.checked_sub(1), ja), (edge.to.checked_sub(1), jb)];
        for (row, j) in &ends {
            let Some(row) = *row else { continue };
            let g = j.transpose() * information * e;
            for r in 0..3 {
                gradient[3 * row + r] += g[r];
            }
            matrix.add(row, row, &(j.transpose() * information * j));
        }
        if let [(Some(from), ja), (Some(to), jb)] = &ends {
            matrix.add(*to, *from, &(jb.transpose() * information * ja));
        }
    }
    matrix.change_diagonal(|d| d * (1.0 + damping) + 1e-12);
    (matrix, gradient)
}

/// Optimises all poses but the first (Levenberg-Marquardt). Gives the final cost.
pub fn optimise(poses: &mut [Pose2], edges: &[PoseConstraint]) -> Result<f64, GraphError> {
    check(poses, edges)?;
    if poses.len() < 2 {
        return Ok(0.0);
    }
    let mut now = cost(edges, poses);
    let mut damping = 1e-6;
    let pattern = pattern(poses, edges);
    for _ in 0..MAX_ITERATIONS {
        let (matrix, gradient) = normal(&pattern, poses, edges, damping);
        let downhill: Vec<f64> = gradient.iter().map(|g| -g).collect();
        let step = matrix.factor()?.solve(&downhill);
        if step.iter().any(|v| !v.is_finite()) {
            return Err(GraphError::Loose);
        }
        let moved: Vec<Pose2> = poses
            .iter()
            .enumerate()
            .map(|(i, p)| match i.checked_sub(1) {
                Some(k) => p.plus(&Vector3::new(step[3 * k], step[3 * k + 1], step[3 * k + 2])),
                None => *p,
            })
            .collect();
        let then = cost(edges, &moved);
        if then > now {
            damping = (damping * 10.0).max(1e-6);
            if damping > 1e3 {
                break;
            }
            continue;
        }
        let gain = now - then;
        poses.copy_from_slice(&moved);
        now = then;
        damping *= 0.1;
        if gain <= 1e-6 * (1.0 + now) {
            break;
        }
    }
    Ok(now)
}

/// Covariance over (x, y, theta) of the poses `at`, in the map frame, the first pose fixed.
pub fn covariances(
    poses: &[Pose2],
    edges: &[PoseConstraint],
    at: &[usize],
) -> Result<Vec<Matrix3<f64>>, GraphError> {
    check(poses, edges)?;
    if poses.len() < 2 {
        return Ok(vec![Matrix3::zeros(); at.len()]);
    }
    let pattern = pattern(poses, edges);
    let factor = normal(&pattern, poses, edges, 0.0).0.factor()?;
    let one = |&i: &usize| match i.checked_sub(1).filter(|k| *k < poses.len() - 1) {
        Some(k) => {
            let made = factor.inverse_of(&[k]).fixed_view::<3, 3>(0, 0).into_owned();
            0.5 * (made + made.transpose())
        }
        None => Matrix3::zeros(),
    };
    Ok(at.iter().map(one).collect())
}

#[cfg(test)]
mod tests;
