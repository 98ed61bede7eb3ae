//! The least-squares problem of one photograph: corners of several landmarks as a function of the
//! camera's pose in space (method 13.8), and the descent to the nearest minimum. Nuisance
//! parameters (places and sizes of the landmarks, intrinsics) enter the weights.

use crate::{
    gate::{Z_95, chi2_quantile},
    localise::{derivatives::point_by_place, fix::LandmarkObservation},
    place::SurveyId,
};
use nalgebra::{DMatrix, DVector, Isometry3, Matrix3, Matrix6, SMatrix, Vector3, Vector6};
use std::collections::BTreeMap;
use vision::{
    frame::Intrinsics,
    pose::reprojection::{corner_points, perturbed, project},
};

/// Most steps of one descent, accepted or not.
const MAX_STEPS: usize = 40;
/// A step below this (radians and metres) ends it.
const STEP_TOLERANCE: f64 = 1e-10;
/// The weight depends a little on the pose: it is computed so many times.
const WEIGHTINGS: usize = 2;

/// The least-squares problem of one photograph.
pub(super) struct Spatial<'a> {
    observations: &'a [LandmarkObservation<'a>],
    /// Standard deviations of the camera's intrinsics, if they are stated; all observations are by
    /// one camera.
    camera: Option<Vector3<f64>>,
    /// Corners of each landmark, map frame.
    corners_m: Vec<[Vector3<f64>; 4]>,
}

#[derive(Debug, Clone)]
pub(super) struct SpatialFit {
    pub(super) camera_from_map: Isometry3<f64>,
    /// Covariance of the left perturbation (rotation vector, translation), camera frame; scaled by
    /// chi2 over its 95 % quantile where that exceeds 1.
    pub(super) covariance: Matrix6<f64>,
    pub(super) chi2: f64,
    /// Squared residual of each observation by itself, in standard deviations.
    pub(super) each: Vec<f64>,
}

/// Measured minus predicted, px, and its derivative by the pose; eight rows for each observation.
struct Linearisation {
    residual: DVector<f64>,
    by_pose: DMatrix<f64>,
}

impl<'a> Spatial<'a> {
    pub(super) fn new(observations: &'a [LandmarkObservation<'a>]) -> Self {
        let corners = |s: &LandmarkObservation<'_>| {
            let at = s.place.map_from_landmark();
            corner_points(&s.place.size).map(|p| at.rotation * p + at.translation.vector)
        };
        let stated = observations.first().map(|s| &s.seen.measured.camera).filter(|c| c.sigmas.is_some());
        let camera = stated.map(Intrinsics::error_sigmas);
        Self { observations, camera, corners_m: observations.iter().map(corners).collect() }
    }

    /// Degrees of freedom of the residual.
    pub(super) fn dof(&self) -> usize {
        8 * self.observations.len() - 6
    }

    /// The nearest minimum; `None` where a corner is behind the camera or the pose is not
    /// determined.
    pub(super) fn descend(&self, start: Isometry3<f64>) -> Option<SpatialFit> {
        let mut pose = start;
        for _ in 0..WEIGHTINGS {
            let weight = self.residual_covariance(&pose)?.cholesky()?.inverse();
            pose = self.descend_with(pose, &weight)?;
        }
        let covariance = self.residual_covariance(&pose)?;
        let each = (0..self.observations.len()).map(|i| (8 * i, covariance.view((8 * i, 8 * i), (8, 8))));
        let at = self.linearise(&pose)?;
        let each = each.map(|(row, own)| {
            let r = at.residual.rows(row, 8).into_owned();
            own.into_owned().cholesky().map_or(f64::INFINITY, |own| r.dot(&own.solve(&r)))
        });
        let each = each.collect();
        let weight = covariance.cholesky()?.inverse();
        let chi2 = at.residual.dot(&(&weight * &at.residual));
        let normal = at.by_pose.transpose() * &weight * &at.by_pose;
        let normal = Matrix6::from_iterator(normal.iter().copied());
        let scale = (chi2 / chi2_quantile(self.dof(), Z_95)).max(1.0);
        Some(SpatialFit {
            camera_from_map: pose,
            covariance: normal.cholesky()?.inverse() * scale,
            chi2,
            each,
        })
    }

    /// Levenberg-Marquardt with a fixed weight.
    fn descend_with(&self, start: Isometry3<f64>, weight: &DMatrix<f64>) -> Option<Isometry3<f64>> {
        let cost = |at: &Linearisation| at.residual.dot(&(weight * &at.residual));
        let (mut pose, mut here, mut damping) = (start, self.linearise(&start)?, 1e-6);
        for _ in 0..MAX_STEPS {
            let jw = here.by_pose.transpose() * weight;
            let (h, g) = (&jw * &here.by_pose, &jw * &here.residual);
            let mut h = Matrix6::from_iterator(h.iter().copied());
            for k in 0..6 {
                h[(k, k)] *= 1.0 + damping;
            }
            let step: Vector6<f64> = h.cholesky()?.solve(&Vector6::from_iterator(g.iter().copied()));
            let (turn, shift) = (step.fixed_rows::<3>(0).into_owned(), step.fixed_rows::<3>(3).into_owned());
            let next = perturbed(&pose, &turn, &shift);
            match self.linearise(&next).filter(|there| cost(there) <= cost(&here)) {
                Some(there) => (pose, here, damping) = (next, there, (damping * 0.1).max(1e-12)),
                None => damping *= 10.0,
            }
            if step.norm() < STEP_TOLERANCE || damping > 1e9 {
                break;
            }
        }
        cost(&here).is_finite().then_some(pose)
    }

    fn linearise(&self, camera_from_map: &Isometry3<f64>) -> Option<Linearisation> {
        let rows = 8 * self.observations.len();
        let mut made = Linearisation { residual: DVector::zeros(rows), by_pose: DMatrix::zeros(rows, 6) };
        for (i, (observation, corners)) in self.observations.iter().zip(&self.corners_m).enumerate() {
            let measured = &observation.seen.measured;
            for (c, (point, px)) in corners.iter().zip(measured.corners_px.points()).enumerate() {
                let predicted = project(camera_from_map, point, &measured.camera)?;
                made.residual.fixed_rows_mut::<2>(8 * i + 2 * c).copy_from(&(px - predicted.px));
                made.by_pose.view_mut((8 * i + 2 * c, 0), (2, 6)).copy_from(&predicted.by_pose);
            }
        }
        Some(made)
    }

    /// Covariance of the residual at a pose: corners plus nuisance parameters.
    fn residual_covariance(&self, camera_from_map: &Isometry3<f64>) -> Option<DMatrix<f64>> {
        let n = self.observations.len();
        let turn = camera_from_map.rotation.to_rotation_matrix().into_inner();
        let mut sum = DMatrix::zeros(8 * n, 8 * n);
        let mut by_camera = DMatrix::zeros(8 * n, 3);
        let mut by_survey: BTreeMap<SurveyId, DMatrix<f64>> = BTreeMap::new();
        for (i, observation) in self.observations.iter().enumerate() {
            let (measured, place) = (&observation.seen.measured, observation.place);
            let at = place.map_from_landmark();
            let sides = at.rotation.to_rotation_matrix().into_inner();
            let mut by_place = SMatrix::<f64, 8, 6>::zeros();
            for (c, point) in corner_points(&place.size).iter().enumerate() {
                let projected = project(camera_from_map, &self.corners_m[i][c], &measured.camera)?;
                let arm = at.rotation * point;
                let own = projected.by_point * turn * point_by_place(&arm, &sides, point, &place.size);
                by_place.fixed_rows_mut::<2>(2 * c).copy_from(&own);
                by_camera.view_mut((8 * i + 2 * c, 0), (2, 3)).copy_from(&measured.by_camera[c]);
            }
            let own =
                by_place * place.own_covariance() * by_place.transpose() + measured.covariance_px2.matrix();
            let mut block = sum.view_mut((8 * i, 8 * i), (8, 8));
            block += own;
            if let Some(shared) = place.shared {
                let of_survey = by_survey.entry(shared.survey).or_insert_with(|| DMatrix::zeros(8 * n, 6));
                of_survey.view_mut((8 * i, 0), (8, 6)).copy_from(&(by_place * shared.by));
            }
        }
        for by_shared in by_survey.values() {
            sum += by_shared * by_shared.transpose();
        }
        if let Some(sigmas) = self.camera {
            let variances = Matrix3::from_diagonal(&sigmas.component_mul(&sigmas));
            sum += &by_camera * variances * by_camera.transpose();
        }
        Some(sum)
    }
}
