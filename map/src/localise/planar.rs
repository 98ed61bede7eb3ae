//! The least-squares problem of one frame: corners of all observations as a function of the robot's
//! floor pose, and the descent to the nearest minimum (method 13.6 [M] (b)). Nuisance parameters
//! (places, extrinsics, intrinsics) enter the weights.

use crate::{
    extrinsics::CameraExtrinsics,
    localise::{
        derivatives::point_by_pose,
        fix::{LandmarkObservation, NuisanceKey},
        predict::corners,
    },
    place::SurveyId,
    pose2::Pose2,
};
use nalgebra::{DMatrix, DVector, Isometry3, Matrix3, Matrix6, Point2, Vector2, Vector3};
use vision::{
    frame::Intrinsics,
    pose::reprojection::{corner_points, project},
};

/// Most steps of one descent.
pub(super) const MAX_STEPS: usize = 40;
/// A step below this (metres and radians) ends it.
const STEP_TOLERANCE: f64 = 1e-10;

/// Residuals and their derivative by the pose; two rows for each corner, eight for each
/// observation.
pub(super) struct PoseLinearisation {
    /// Measured minus predicted, px.
    pub residual: DVector<f64>,
    /// By (x, y, theta).
    pub by_pose: DMatrix<f64>,
}

impl PoseLinearisation {
    /// Weighted squared residual.
    pub(super) fn chi2(&self, weight: &DMatrix<f64>) -> f64 {
        self.residual.dot(&(weight * &self.residual))
    }
}

/// Result of a descent.
pub(super) struct Descended {
    pub pose: Pose2,
    /// Residuals at `pose`.
    pub linearisation: PoseLinearisation,
    pub chi2: f64,
}

/// Residuals and all derivatives at one pose.
pub(super) struct FullLinearisation {
    /// Measured minus predicted, px.
    pub residual: DVector<f64>,
    /// By (x, y, theta).
    pub by_pose: DMatrix<f64>,
    /// By each nuisance parameter, in the order of [`Planar::nuisances`]: 6 columns each.
    pub by_nuisance: DMatrix<f64>,
}

/// The least-squares problem of one frame.
pub(super) struct Planar<'a> {
    observations: &'a [LandmarkObservation<'a>],
    mounting: &'a CameraExtrinsics,
    camera_from_robot: Isometry3<f64>,
    /// Standard deviations of the camera's intrinsics, if they are stated; all observations are by
    /// one camera.
    camera: Option<Vector3<f64>>,
    /// Corners of each landmark, map frame.
    corners_m: Vec<[Vector3<f64>; 4]>,
    /// Surveys whose places share errors, each once.
    surveys: Vec<SurveyId>,
}

impl<'a> Planar<'a> {
    pub(super) fn new(observations: &'a [LandmarkObservation<'a>], mounting: &'a CameraExtrinsics) -> Self {
        let corners = |s: &LandmarkObservation<'_>| {
            let map_from_landmark = s.place.map_from_landmark();
            let in_map =
                |p: Vector3<f64>| map_from_landmark.rotation * p + map_from_landmark.translation.vector;
            corner_points(&s.place.size).map(in_map)
        };
        let camera_from_robot = mounting.robot_from_camera.inverse();
        let stated = observations.first().map(|s| &s.seen.measured.camera).filter(|c| c.sigmas.is_some());
        let camera = stated.map(Intrinsics::error_sigmas);
        let corners_m = observations.iter().map(corners).collect();
        let mut surveys: Vec<SurveyId> =
            observations.iter().filter_map(|s| Some(s.place.shared?.survey)).collect();
        surveys.sort_unstable();
        surveys.dedup();
        Self { observations, mounting, camera_from_robot, camera, corners_m, surveys }
    }

    /// The same problem with exact intrinsics.
    pub(super) fn exact_camera(self) -> Self {
        Self { camera: None, ..self }
    }

    /// Degrees of freedom of the residual.
    pub(super) fn dof(&self) -> usize {
        8 * self.observations.len() - 3
    }

    /// Whether the camera is in front of every landmark's wall.
    pub(super) fn is_in_front(&self, pose: &Pose2) -> bool {
        let camera = pose.to_isometry3() * self.mounting.robot_from_camera.translation.vector;
        let position = camera + pose.to_isometry3().translation.vector;
        self.observations.iter().all(|s| {
            let place = s.place.map_from_landmark();
            (place.rotation * Vector3::x()).dot(&(position - place.translation.vector)) > 0.0
        })
    }

    /// Centre of the landmarks on the floor; the robot is turned about it.
    pub(super) fn pivot(&self) -> Point2<f64> {
        centre(self.observations.iter().map(|s| s.place))
    }

    /// Keys and covariances of the nuisance parameters: each landmark, the extrinsics, the surveys,
    /// then the intrinsics unless exact.
    pub(super) fn nuisances(&self) -> Vec<(NuisanceKey, Matrix6<f64>)> {
        let places =
            self.observations.iter().map(|s| (NuisanceKey::Landmark(s.landmark), s.place.own_covariance()));
        let surveys = self.surveys.iter().map(|survey| (NuisanceKey::Survey(*survey), Matrix6::identity()));
        let camera = self.camera.map(|sigmas| {
            let mut covariance = Matrix6::zeros();
            covariance.fixed_view_mut::<3, 3>(0, 0).set_diagonal(&sigmas.component_mul(&sigmas));
            (NuisanceKey::Camera, covariance)
        });
        let extrinsics = (NuisanceKey::Extrinsics, self.mounting.covariance);
        places.chain([extrinsics]).chain(surveys).chain(camera).collect()
    }

    /// `camera_from_landmark` of observation `i` for a robot pose.
    pub(super) fn camera_from_landmark(&self, i: usize, pose: &Pose2) -> Isometry3<f64> {
        self.camera_from_robot
            * pose.to_isometry3().inverse()
            * self.observations[i].place.map_from_landmark()
    }

    /// Robot pose on the floor for a `camera_from_landmark` of observation `i`, and the pose in
    /// space.
    pub(super) fn robot_from_observation(
        &self,
        i: usize,
        camera_from_landmark: &Isometry3<f64>,
    ) -> (Pose2, Isometry3<f64>) {
        let map_from_robot = self.observations[i].place.map_from_landmark()
            * camera_from_landmark.inverse()
            * self.mounting.robot_from_camera.inverse();
        let r = map_from_robot.rotation.to_rotation_matrix();
        let t = map_from_robot.translation.vector;
        (Pose2::new(t.x, t.y, r[(1, 0)].atan2(r[(0, 0)])), map_from_robot)
    }

    /// Residuals and their derivative by the pose; `None` when a corner is behind the camera.
    pub(super) fn pose_linearisation(&self, pose: &Pose2) -> Option<PoseLinearisation> {
        let rows = 8 * self.observations.len();
        let mut made = PoseLinearisation { residual: DVector::zeros(rows), by_pose: DMatrix::zeros(rows, 3) };
        let map_from_robot = pose.to_isometry3();
        let camera_from_map = self.camera_from_robot * map_from_robot.inverse();
        let turn = camera_from_map.rotation.to_rotation_matrix().into_inner();
        for (i, (observation, corners)) in self.observations.iter().zip(&self.corners_m).enumerate() {
            let measured = &observation.seen.measured;
            for (c, (point, px)) in corners.iter().zip(measured.corners_px.points()).enumerate() {
                let row = 8 * i + 2 * c;
                let predicted = project(&camera_from_map, point, &measured.camera)?;
                made.residual.fixed_rows_mut::<2>(row).copy_from(&(px - predicted.px));
                let from_robot = point - map_from_robot.translation.vector;
                let by_pose = predicted.by_point * point_by_pose(&turn, &from_robot);
                made.by_pose.view_mut((row, 0), (2, 3)).copy_from(&by_pose);
            }
        }
        Some(made)
    }

    /// Residuals and all derivatives; `None` when a corner is behind the camera.
    pub(super) fn linearise(&self, pose: &Pose2) -> Option<FullLinearisation> {
        let n = self.observations.len();
        let PoseLinearisation { residual, by_pose } = self.pose_linearisation(pose)?;
        let of_camera = n + 1 + self.surveys.len();
        let blocks = of_camera + usize::from(self.camera.is_some());
        let mut by_nuisance = DMatrix::zeros(8 * n, 6 * blocks);
        for (i, observation) in self.observations.iter().enumerate() {
            let predicted =
                corners(pose, observation.place, self.mounting, &observation.seen.measured.camera)?;
            by_nuisance.view_mut((8 * i, 6 * i), (8, 6)).copy_from(&predicted.place);
            by_nuisance.view_mut((8 * i, 6 * n), (8, 6)).copy_from(&predicted.mounting);
            if let Some(shared) = observation.place.shared
                && let Ok(survey) = self.surveys.binary_search(&shared.survey)
            {
                let by = predicted.place * shared.by;
                by_nuisance.view_mut((8 * i, 6 * (n + 1 + survey)), (8, 6)).copy_from(&by);
            }
            if self.camera.is_some() {
                for (c, by_camera) in observation.seen.measured.by_camera.iter().enumerate() {
                    // The residual is measured minus predicted, so the derivative of the measured
                    // corner changes its sign.
                    by_nuisance.view_mut((8 * i + 2 * c, 6 * of_camera), (2, 3)).copy_from(&-by_camera);
                }
            }
        }
        Some(FullLinearisation { residual, by_pose, by_nuisance })
    }

    /// Inverse covariance of the residual: corners plus nuisance parameters.
    pub(super) fn weight(&self, at: &FullLinearisation) -> Option<DMatrix<f64>> {
        let n = self.observations.len();
        let mut s = self.corner_covariance();
        for (k, (_, covariance)) in self.nuisances().iter().enumerate() {
            let j = at.by_nuisance.columns(6 * k, 6);
            s += j * covariance * j.transpose();
        }
        debug_assert_eq!(s.nrows(), 8 * n);
        Some(s.cholesky()?.inverse())
    }

    /// Block-diagonal covariance of the corners.
    pub(super) fn corner_covariance(&self) -> DMatrix<f64> {
        let n = self.observations.len();
        let mut s = DMatrix::zeros(8 * n, 8 * n);
        for (i, observation) in self.observations.iter().enumerate() {
            s.view_mut((8 * i, 8 * i), (8, 8)).copy_from(observation.seen.measured.covariance_px2.matrix());
        }
        s
    }

    /// Levenberg-Marquardt over (x, y, theta), or over (x, y) alone.
    pub(super) fn descend(
        &self,
        start: Pose2,
        weight: &DMatrix<f64>,
        turn: bool,
        steps: usize,
    ) -> Option<Descended> {
        let at = |pose: Pose2| {
            let linearisation = self.pose_linearisation(&pose)?;
            let chi2 = linearisation.chi2(weight);
            chi2.is_finite().then_some(Descended { pose, linearisation, chi2 })
        };
        let (mut here, mut damping) = (at(start)?, 1e-6);
        for _ in 0..steps {
            let jw = here.linearisation.by_pose.transpose() * weight;
            let (h, g) = (&jw * &here.linearisation.by_pose, &jw * &here.linearisation.residual);
            let mut h = Matrix3::from_iterator(h.iter().copied());
            let mut g = Vector3::from_iterator(g.iter().copied());
            if !turn {
                // Heading held: its row and column become the identity.
                (h[(0, 2)], h[(2, 0)], h[(1, 2)], h[(2, 1)], h[(2, 2)], g.z) = (0.0, 0.0, 0.0, 0.0, 1.0, 0.0);
            }
            for k in 0..3 {
                h[(k, k)] *= 1.0 + damping;
            }
            let step = h.cholesky()?.solve(&g);
            match at(here.pose.plus(&step)).filter(|next| next.chi2 <= here.chi2) {
                Some(next) => (here, damping) = (next, (damping * 0.1).max(1e-12)),
                None => damping *= 10.0,
            }
            if step.norm() < STEP_TOLERANCE || damping > 1e9 {
                break;
            }
        }
        Some(here)
    }
}

/// Centre of the landmarks on the floor.
pub(super) fn centre<'a>(points: impl Iterator<Item = &'a crate::place::LandmarkPlace>) -> Point2<f64> {
    let (mut sum, mut n) = (Vector2::zeros(), 0.0);
    for p in points {
        sum += Vector2::new(p.x_m, p.y_m);
        n += 1.0;
    }
    Point2::from(sum / f64::max(n, 1.0))
}
