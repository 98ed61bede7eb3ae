//! All solutions of one frame, and which of them remain (method 13.4, 13.6).

use crate::{
    extrinsics::CameraExtrinsics,
    gate::{Z_95, chi2_quantile},
    localise::{
        fix::{AmbiguityResolvedBy, Fix, FixRefusal, FixResult, FixSource, LandmarkObservation, Nuisance},
        params::LocaliseParams,
        planar::{MAX_STEPS, Planar},
        posterior::{Moments, moments, turned},
    },
    pose2::{Pose2, Pose2Covariance, wrap_rad},
};
use nalgebra::{DMatrix, Isometry3, Matrix3, Matrix3x6, Rotation3, UnitQuaternion, Vector3};

/// Two minima nearer than this (metres and radians) are one; a descent that comes so near to one
/// stops.
const SAME_POSE: f64 = 1e-3;
/// Points on the way from one minimum to another.
const PATH_POINTS: usize = 24;

/// A minimum of the weighted squared residual over (x, y, theta).
pub(super) struct Minimum {
    pub(super) pose: Pose2,
    weight: DMatrix<f64>,
    pub(super) chi2: f64,
    /// Turns, negative and positive, at which the basin of another minimum begins.
    limit_rad: (f64, f64),
}

pub(super) fn solve(
    observations: &[LandmarkObservation<'_>],
    mounting: &CameraExtrinsics,
    prior: Option<&Pose2Covariance>,
    p: &LocaliseParams,
) -> FixResult {
    let problem = Planar::new(observations, mounting);
    let mut found = minima(&problem, observations);
    let Some(best) = found.first() else { return FixResult::Refused(FixRefusal::Degenerate) };
    let limit = p.max_reduced_chi2 * problem.dof() as f64;
    if best.chi2 > limit {
        let chi2 = best.chi2;
        return FixResult::Refused(match observations.len() {
            1 => FixRefusal::ReprojectionError { chi2, limit },
            _ => FixRefusal::Disagree { chi2, limit },
        });
    }
    let scale = (best.chi2 / chi2_quantile(problem.dof(), Z_95)).max(1.0);
    let several = found.len() > 1;
    let lowest = best.chi2;
    found.retain(|m| m.chi2 - lowest < p.ambiguous_chi2 * scale);
    merge(&problem, &mut found, p.merge_chi2 * scale);
    let decided_by = if several { AmbiguityResolvedBy::Image } else { AmbiguityResolvedBy::Single };
    let mut fixes: Vec<Fix> =
        found.iter().filter_map(|m| fix(&problem, observations, m, scale, decided_by)).collect();
    match (prior, fixes.len()) {
        (_, 0) => FixResult::Refused(FixRefusal::Degenerate),
        (None, 1) => FixResult::Fixed(Box::new(fixes.swap_remove(0))),
        (None, _) => FixResult::Ambiguous(fixes),
        (Some(prior), _) => by_prior(fixes, prior, scale, p),
    }
}

/// Every minimum reachable from the solutions of each observation and their mirror images, by
/// rising chi2. Minima behind a landmark's wall are left out.
pub(super) fn minima(problem: &Planar<'_>, observations: &[LandmarkObservation<'_>]) -> Vec<Minimum> {
    let mut found: Vec<Minimum> = Vec::new();
    for (i, observation) in observations.iter().enumerate() {
        let solutions = [Some(&observation.seen.best), observation.seen.second.as_ref()];
        for solution in solutions.into_iter().flatten() {
            let (start, _) = problem.robot_from_observation(i, &solution.camera_from_landmark);
            add(problem, &mut found, start);
        }
    }
    // Mirror images of each minimum, one landmark at a time.
    let seeds: Vec<Pose2> = found.iter().map(|m| m.pose).collect();
    for pose in seeds {
        for i in 0..observations.len() {
            let other = mirrored(&problem.camera_from_landmark(i, &pose));
            let (start, _) = problem.robot_from_observation(i, &other);
            add(problem, &mut found, start);
        }
    }
    found.sort_by(|a, b| a.chi2.total_cmp(&b.chi2));
    found
}

fn add(problem: &Planar<'_>, found: &mut Vec<Minimum>, start: Pose2) {
    let weight_at = |pose: &Pose2| problem.linearise(pose).and_then(|at| problem.weight(&at));
    let mut pose = start;
    // The weight depends a little on the pose: refresh it once.
    for _ in 0..2 {
        let Some(weight) = weight_at(&pose) else { return };
        let Some(next) = problem.descend(pose, &weight, true, MAX_STEPS) else { return };
        pose = next.pose;
        if found.iter().any(|m| m.pose.minus(&pose).norm() < SAME_POSE) {
            return;
        }
    }
    let Some(weight) = weight_at(&pose) else { return };
    let Some(linearisation) = problem.pose_linearisation(&pose) else { return };
    let chi2 = linearisation.chi2(&weight);
    if chi2.is_finite() && problem.is_in_front(&pose) {
        found.push(Minimum { pose, weight, chi2, limit_rad: (f64::NEG_INFINITY, f64::INFINITY) });
    }
}

/// The pose with its normal mirrored about the line of sight (method 13.4).
fn mirrored(camera_from_landmark: &Isometry3<f64>) -> Isometry3<f64> {
    let v = camera_from_landmark.translation.vector.normalize();
    let mirror = Matrix3::identity() - 2.0 * v * v.transpose();
    let flip = Matrix3::from_diagonal(&Vector3::new(-1.0, 1.0, 1.0));
    let turn = mirror * camera_from_landmark.rotation.to_rotation_matrix().matrix() * flip;
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(turn));
    Isometry3::from_parts(camera_from_landmark.translation, rotation)
}

/// Drops minima that a low barrier separates from a better one; sets the borders between the
/// others.
fn merge(problem: &Planar<'_>, found: &mut Vec<Minimum>, barrier: f64) {
    let mut distinct: Vec<Minimum> = Vec::new();
    for mut minimum in found.drain(..) {
        let mut alone = true;
        for other in &mut distinct {
            let (top_rad, rise) = pass(problem, other, &minimum);
            if rise < barrier {
                alone = false;
                break;
            }
            let back_rad = top_rad - wrap_rad(minimum.pose.theta_rad - other.pose.theta_rad);
            narrow(&mut other.limit_rad, top_rad);
            narrow(&mut minimum.limit_rad, back_rad);
        }
        if alone {
            distinct.push(minimum);
        }
    }
    *found = distinct;
}

fn narrow(limit_rad: &mut (f64, f64), border_rad: f64) {
    if border_rad < 0.0 {
        limit_rad.0 = limit_rad.0.max(border_rad);
    } else {
        limit_rad.1 = limit_rad.1.min(border_rad);
    }
}

/// The highest point on the path from `from` to the worse minimum `to`: its turn, and its rise
/// above `to`.
fn pass(problem: &Planar<'_>, from: &Minimum, to: &Minimum) -> (f64, f64) {
    let whole = wrap_rad(to.pose.theta_rad - from.pose.theta_rad);
    let step = whole / PATH_POINTS as f64;
    let pivot = problem.pivot();
    let (mut pose, mut top) = (from.pose, (0.0, f64::NEG_INFINITY));
    for i in 1..PATH_POINTS {
        let start = turned(&pose, &pivot, step);
        let Some(next) = problem.descend(start, &from.weight, false, 3) else {
            return (step * i as f64, f64::INFINITY);
        };
        let rise = next.chi2 - to.chi2;
        if rise > top.1 {
            top = (step * i as f64, rise);
        }
        pose = next.pose;
    }
    top
}

/// Chooses among the remaining solutions by the prior, or refuses all of them.
fn by_prior(mut fixes: Vec<Fix>, prior: &Pose2Covariance, scale: f64, p: &LocaliseParams) -> FixResult {
    let distances: Vec<f64> =
        fixes.iter().map(|f| f.pose.distance2(prior).unwrap_or(f64::INFINITY)).collect();
    let nearest = (0..fixes.len()).min_by(|&a, &b| distances[a].total_cmp(&distances[b])).unwrap_or(0);
    if distances[nearest] > p.prior_gate {
        let (nearest, distance2) = (fixes[nearest].pose, distances[nearest]);
        return FixResult::Refused(FixRefusal::Prior { nearest, distance2, limit: p.prior_gate });
    }
    if fixes.len() == 1 {
        return FixResult::Fixed(Box::new(fixes.swap_remove(0)));
    }
    let score = |i: usize| fixes[i].chi2 / scale + distances[i];
    let chosen = (0..fixes.len())
        .filter(|&i| distances[i] <= p.prior_gate)
        .min_by(|&a, &b| score(a).total_cmp(&score(b)))
        .unwrap_or(0);
    let clear = (0..fixes.len()).all(|i| i == chosen || score(i) - score(chosen) >= p.ambiguous_chi2);
    if !clear {
        return FixResult::Ambiguous(fixes);
    }
    let mut fix = fixes.swap_remove(chosen);
    fix.decided_by = AmbiguityResolvedBy::Prior;
    FixResult::Fixed(Box::new(fix))
}

/// Moments around one minimum, split into independent noise and shared nuisance parameters.
fn fix(
    problem: &Planar<'_>,
    observations: &[LandmarkObservation<'_>],
    minimum: &Minimum,
    scale: f64,
    decided_by: AmbiguityResolvedBy,
) -> Option<Fix> {
    let weight = &minimum.weight / scale;
    let sigma_rad = local_covariance(problem, &minimum.pose, &weight)?[(2, 2)].sqrt();
    let Moments { mean, covariance } =
        moments(problem, &minimum.pose, &weight, sigma_rad, minimum.limit_rad)?;
    let at = problem.linearise(&mean)?;
    let local = local_covariance(problem, &mean, &weight)?;
    let jw = at.by_pose.transpose() * &weight;
    let gain = DMatrix::from_iterator(3, 3, local.iter().copied()) * jw;
    let corners = &gain * problem.corner_covariance() * gain.transpose() * scale;
    let mut noise = Matrix3::from_iterator(corners.iter().copied());
    noise += positive_part(&(covariance - local));
    let mut total = noise;
    let mut nuisances = Vec::new();
    for (k, (key, covariance)) in problem.nuisances().into_iter().enumerate() {
        let j = &gain * at.by_nuisance.columns(6 * k, 6);
        let jacobian = Matrix3x6::from_iterator(j.iter().copied());
        let part = jacobian * covariance * jacobian.transpose();
        total += part * scale;
        // The inflation of a bad fit is not an error of the place.
        noise += part * (scale - 1.0);
        nuisances.push(Nuisance { key, jacobian, covariance });
    }
    let total = 0.5 * (total + total.transpose());
    let pose = Pose2Covariance::new(mean, total).ok()?;
    let landmarks = observations.iter().map(|s| s.landmark).collect();
    Some(Fix {
        modality: FixSource::Landmarks,
        pose,
        noise,
        nuisances,
        landmarks,
        decided_by,
        chi2: minimum.chi2,
        dof: problem.dof(),
    })
}

/// `(J^T W J)^-1` over (x, y, theta).
fn local_covariance(problem: &Planar<'_>, pose: &Pose2, weight: &DMatrix<f64>) -> Option<Matrix3<f64>> {
    let at = problem.pose_linearisation(pose)?;
    let h = at.by_pose.transpose() * weight * &at.by_pose;
    Some(Matrix3::from_iterator(h.iter().copied()).cholesky()?.inverse())
}

/// The nearest positive semidefinite matrix.
fn positive_part(m: &Matrix3<f64>) -> Matrix3<f64> {
    let eigen = (0.5 * (m + m.transpose())).symmetric_eigen();
    let distinct = Matrix3::from_diagonal(&eigen.eigenvalues.map(|v| v.max(0.0)));
    eigen.eigenvectors * distinct * eigen.eigenvectors.transpose()
}
