//! Second moment of a pose around a minimum, by quadrature over the direction of the landmark's
//! normal.
//!
//! Near the front view the corners hardly determine the direction, and chi2 is far from quadratic
//! in it: the covariance at the minimum is several times too small (measured: mean NEES 10 to 15
//! instead of 6 at 6 m). Here the normal goes over a grid, roll and position are refitted at each
//! point. Skipped where the direction is well determined.

use crate::pose::{refine::Problem, reprojection::perturbed};
use nalgebra::{Isometry3, Matrix2, Matrix4, Matrix6, SMatrix, Vector3, Vector6};

/// Standard deviation of the normal below which the linear covariance is good enough.
const LINEAR_RAD: f64 = 0.012;
/// Step of the grid, in standard deviations.
const STEP_SIGMA: f64 = 0.8;
/// Rise of chi2 at which the grid ends in a direction.
const RISE_CHI2: f64 = 25.0;
/// Most steps in each direction.
const MAX_STEPS: usize = 24;
/// Farthest from the minimum, radians in each direction.
const REACH_RAD: f64 = 1.5;
/// Refits of roll and position at each point.
const REFITS: usize = 2;

/// The grid being summed.
struct Sum<'a> {
    problem: &'a Problem<'a>,
    minimum: Isometry3<f64>,
    rival: Option<Vector3<f64>>,
    lowest: f64,
    scale: f64,
    weight: f64,
    moment: Matrix6<f64>,
}

/// Second moment about the minimum `at` of covariance `linear`; `rival` is the other solution of an
/// ambiguous pair: the grid excludes its side. `scale` divides chi2.
pub(crate) fn second_moment(
    problem: &Problem<'_>,
    at: &Isometry3<f64>,
    linear: &Matrix6<f64>,
    rival: Option<&Isometry3<f64>>,
    scale: f64,
) -> Option<Matrix6<f64>> {
    // In-plane axes of the landmark: turning about them moves the normal.
    let axes = SMatrix::<f64, 3, 2>::from_columns(&[at.rotation * Vector3::y(), at.rotation * Vector3::z()]);
    let turn = linear.fixed_view::<3, 3>(0, 0);
    let marginal: Matrix2<f64> = axes.transpose() * turn * axes;
    let eigen = marginal.symmetric_eigen();
    let sigma = eigen.eigenvalues.map(|v| v.max(0.0).sqrt());
    if sigma.max().total_cmp(&LINEAR_RAD).is_lt() {
        return None;
    }
    let step = |k: usize| {
        let length = (STEP_SIGMA * sigma[k]).min(REACH_RAD / MAX_STEPS as f64);
        axes * eigen.eigenvectors.column(k) * length
    };
    let weak = usize::from(sigma[1] > sigma[0]);
    let (along, across): (Vector3<f64>, Vector3<f64>) = (step(weak), step(1 - weak));
    let mut sum = Sum {
        problem,
        minimum: *at,
        rival: rival.map(|r| r.rotation * Vector3::x()),
        lowest: problem.chi2(at),
        scale,
        weight: 0.0,
        moment: Matrix6::zeros(),
    };
    sum.ribs(at, &across);
    for along in [along, -along] {
        let mut pose = *at;
        for _ in 0..MAX_STEPS {
            let Some(next) = sum.refit(&pose, &along) else { break };
            pose = next;
            sum.ribs(&pose, &across);
            if (problem.chi2(&pose) - sum.lowest) / scale > RISE_CHI2 {
                break;
            }
        }
    }
    let moment = sum.moment / sum.weight;
    let good = moment.iter().all(|v| v.is_finite()) && moment.cholesky().is_some();
    good.then(|| 0.5 * (moment + moment.transpose()))
}

impl Sum<'_> {
    /// A point of the spine and its neighbours across.
    fn ribs(&mut self, spine: &Isometry3<f64>, across: &Vector3<f64>) {
        self.add(spine);
        for across in [*across, -across] {
            let mut pose = *spine;
            for _ in 0..MAX_STEPS {
                let Some(next) = self.refit(&pose, &across) else { break };
                pose = next;
                self.add(&pose);
                if (self.problem.chi2(&pose) - self.lowest) / self.scale > RISE_CHI2 {
                    break;
                }
            }
        }
    }

    /// The pose turned by `turn`, with roll about the normal and position refitted, the normal
    /// fixed.
    fn refit(&self, from: &Isometry3<f64>, turn: &Vector3<f64>) -> Option<Isometry3<f64>> {
        let mut pose = perturbed(from, turn, &Vector3::zeros());
        for _ in 0..REFITS {
            let (h, g) = self.problem.normal_equations(&pose)?;
            let free = free(&pose);
            let h: Matrix4<f64> = free.transpose() * h * free;
            let step: Vector6<f64> = free * h.cholesky()?.solve(&(free.transpose() * g));
            pose = perturbed(&pose, &step.fixed_rows::<3>(0).into(), &step.fixed_rows::<3>(3).into());
        }
        Some(pose)
    }

    fn add(&mut self, pose: &Isometry3<f64>) {
        let normal = pose.rotation * Vector3::x();
        let own = (self.minimum.rotation * Vector3::x()).dot(&normal);
        if self.rival.is_some_and(|r| r.dot(&normal) > own) {
            return;
        }
        let Some((h, _)) = self.problem.normal_equations(pose) else { return };
        let free = free(pose);
        let h: Matrix4<f64> = free.transpose() * h * free;
        let Some(conditional) = h.cholesky().map(|c| c.inverse() * self.scale) else { return };
        let rise = (self.problem.chi2(pose) - self.lowest) / self.scale;
        let weight = (-0.5 * rise).exp() * conditional.determinant().max(0.0).sqrt();
        if !weight.is_finite() {
            return;
        }
        let turn = (pose.rotation * self.minimum.rotation.inverse()).scaled_axis();
        let shift = pose.translation.vector - self.minimum.translation.vector;
        let d = Vector6::new(turn.x, turn.y, turn.z, shift.x, shift.y, shift.z);
        self.weight += weight;
        self.moment += (d * d.transpose() + free * conditional * free.transpose()) * weight;
    }
}

/// Directions that preserve the normal: roll about it, and the position.
fn free(pose: &Isometry3<f64>) -> SMatrix<f64, 6, 4> {
    let mut m = SMatrix::<f64, 6, 4>::zeros();
    m.fixed_view_mut::<3, 1>(0, 0).copy_from(&(pose.rotation * Vector3::x()));
    m.fixed_view_mut::<3, 3>(3, 1).fill_with_identity();
    m
}
