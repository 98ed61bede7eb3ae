//! The corners of all sightings as a function of the robot's pose on the floor, and the descent to the nearest minimum
//! (method 13.6 [M] (b)). Lasting errors (places, mounting) enter the weights, so nothing is trusted beyond its word.

use super::{NuisanceKey, Sighting};
use crate::{mounting::Mounting, pose2::Pose2};
use nalgebra::{DMatrix, DVector, Isometry3, Matrix3, Matrix3x6, Matrix6, Point2, SMatrix, Vector3};
use vision::localise::{
    pose::LandmarkSize,
    reproject::{corner_points, project},
};

/// Most steps of one descent.
pub(super) const MAX_STEPS: usize = 40;
/// A step below this (metres and radians) ends it.
const STEP_TOLERANCE: f64 = 1e-10;

/// Residuals and derivatives at one pose; two rows a corner, eight a sighting.
pub(super) struct Linear {
    /// Seen minus predicted, pixels.
    pub residual: DVector<f64>,
    /// By (x, y, theta).
    pub by_pose: DMatrix<f64>,
    /// By each nuisance, in the order of [`Planar::nuisances`]: 6 columns each.
    pub by_nuisance: DMatrix<f64>,
}

/// The least-squares problem of one frame.
pub(super) struct Planar<'a> {
    sightings: &'a [Sighting<'a>],
    mounting: &'a Mounting,
    camera_from_robot: Isometry3<f64>,
}

impl<'a> Planar<'a> {
    pub(super) fn new(sightings: &'a [Sighting<'a>], mounting: &'a Mounting) -> Self {
        Self { sightings, mounting, camera_from_robot: mounting.robot_from_camera.inverse() }
    }

    /// Degrees of freedom of the residual.
    pub(super) fn dof(&self) -> usize {
        8 * self.sightings.len() - 3
    }

    /// Whether the camera stands before every landmark's wall, not behind it.
    pub(super) fn sees_fronts(&self, pose: &Pose2) -> bool {
        let camera = pose.to_isometry3() * self.mounting.robot_from_camera.translation.vector;
        let position = camera + pose.to_isometry3().translation.vector;
        self.sightings.iter().all(|s| {
            let place = s.place.map_from_landmark();
            (place.rotation * Vector3::x()).dot(&(position - place.translation.vector)) > 0.0
        })
    }

    /// The point the robot is turned about: the landmarks' centre on the floor.
    pub(super) fn pivot(&self) -> Point2<f64> {
        super::posterior::centre(self.sightings.iter().map(|s| s.place))
    }

    /// Keys and covariances of the lasting errors: each landmark, then the mounting.
    pub(super) fn nuisances(&self) -> Vec<(NuisanceKey, Matrix6<f64>)> {
        let places = self.sightings.iter().map(|s| (NuisanceKey::Landmark(s.landmark), s.place.covariance));
        places.chain([(NuisanceKey::Mounting, self.mounting.covariance)]).collect()
    }

    /// `camera_from_landmark` of sighting `i` for a robot pose.
    pub(super) fn camera_from_landmark(&self, i: usize, pose: &Pose2) -> Isometry3<f64> {
        self.camera_from_robot * pose.to_isometry3().inverse() * self.sightings[i].place.map_from_landmark()
    }

    /// The robot pose on the floor behind a `camera_from_landmark` of sighting `i`, and the pose in space.
    pub(super) fn robot_from_sighting(
        &self,
        i: usize,
        camera_from_landmark: &Isometry3<f64>,
    ) -> (Pose2, Isometry3<f64>) {
        let map_from_robot = self.sightings[i].place.map_from_landmark()
            * camera_from_landmark.inverse()
            * self.mounting.robot_from_camera.inverse();
        let r = map_from_robot.rotation.to_rotation_matrix();
        let t = map_from_robot.translation.vector;
        (Pose2::new(t.x, t.y, r[(1, 0)].atan2(r[(0, 0)])), map_from_robot)
    }

    /// Residuals and derivatives; `None` when a corner is behind the camera.
    pub(super) fn linearise(&self, pose: &Pose2) -> Option<Linear> {
        let n = self.sightings.len();
        let mut made = Linear {
            residual: DVector::zeros(8 * n),
            by_pose: DMatrix::zeros(8 * n, 3),
            by_nuisance: DMatrix::zeros(8 * n, 6 * (n + 1)),
        };
        let map_from_robot = pose.to_isometry3();
        let camera_from_map = self.camera_from_robot * map_from_robot.inverse();
        let turn = camera_from_map.rotation.to_rotation_matrix().into_inner();
        let robot_turn = self.camera_from_robot.rotation.to_rotation_matrix().into_inner();
        for (i, sighting) in self.sightings.iter().enumerate() {
            let map_from_landmark = sighting.place.map_from_landmark();
            let camera_from_landmark = camera_from_map * map_from_landmark;
            let measured = &sighting.seen.measured;
            for (c, point) in corner_points(&sighting.place.size).iter().enumerate() {
                let seen = project(&camera_from_landmark, point, &measured.camera)?;
                let row = 8 * i + 2 * c;
                let error = measured.corners_px.points()[c] - seen.px;
                made.residual.fixed_rows_mut::<2>(row).copy_from(&error);
                let arm = map_from_landmark.rotation * point;
                let in_map = arm + map_from_landmark.translation.vector;
                let from_robot = in_map - map_from_robot.translation.vector;
                let by_pose = seen.by_point * point_by_pose(&turn, &from_robot);
                made.by_pose.view_mut((row, 0), (2, 3)).copy_from(&by_pose);
                let sides = map_from_landmark.rotation.to_rotation_matrix().into_inner();
                let by_place =
                    seen.by_point * turn * point_by_place(&arm, &sides, point, &sighting.place.size);
                made.by_nuisance.view_mut((row, 6 * i), (2, 6)).copy_from(&by_place);
                let from_camera = map_from_robot.inverse_transform_vector(&from_robot)
                    - self.mounting.robot_from_camera.translation.vector;
                let by_mounting = seen.by_point * point_by_mounting(&robot_turn, &from_camera);
                made.by_nuisance.view_mut((row, 6 * n), (2, 6)).copy_from(&by_mounting);
            }
        }
        Some(made)
    }

    /// Inverse covariance of the residual: corners plus lasting errors.
    pub(super) fn weight(&self, at: &Linear) -> Option<DMatrix<f64>> {
        let n = self.sightings.len();
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
        let n = self.sightings.len();
        let mut s = DMatrix::zeros(8 * n, 8 * n);
        for (i, sighting) in self.sightings.iter().enumerate() {
            for (c, covariance) in sighting.seen.measured.covariance_px2.iter().enumerate() {
                s.view_mut((8 * i + 2 * c, 8 * i + 2 * c), (2, 2)).copy_from(covariance);
            }
        }
        s
    }

    /// Weighted squared residual; infinite where a corner is not in front of the camera.
    pub(super) fn chi2(&self, pose: &Pose2, weight: &DMatrix<f64>) -> f64 {
        let Some(at) = self.linearise(pose) else { return f64::INFINITY };
        let chi2 = at.residual.dot(&(weight * &at.residual));
        if chi2.is_nan() { f64::INFINITY } else { chi2 }
    }

    /// Levenberg-Marquardt over (x, y, theta), or over (x, y) alone.
    pub(super) fn descend(
        &self,
        start: Pose2,
        weight: &DMatrix<f64>,
        turn: bool,
        steps: usize,
    ) -> Option<Pose2> {
        let (mut pose, mut damping) = (start, 1e-6);
        let mut cost = self.chi2(&pose, weight);
        if !cost.is_finite() {
            return None;
        }
        for _ in 0..steps {
            let at = self.linearise(&pose)?;
            let jw = at.by_pose.transpose() * weight;
            let (h, g) = (&jw * &at.by_pose, &jw * &at.residual);
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
            let next = pose.plus(&step);
            let next_cost = self.chi2(&next, weight);
            if next_cost <= cost {
                (pose, cost, damping) = (next, next_cost, (damping * 0.1).max(1e-12));
            } else {
                damping *= 10.0;
            }
            if step.norm() < STEP_TOLERANCE || damping > 1e9 {
                break;
            }
        }
        Some(pose)
    }
}

/// Camera coordinates of a map point by (x, y, theta) of the robot; `from_robot` = point - robot, map axes.
pub(super) fn point_by_pose(camera_from_map: &Matrix3<f64>, from_robot: &Vector3<f64>) -> Matrix3<f64> {
    let turn = Vector3::z().cross(from_robot);
    -camera_from_map * Matrix3::from_columns(&[Vector3::x(), Vector3::y(), turn])
}

/// Map coordinates of a landmark's corner by (x, y, theta, z, width, height).
pub(super) fn point_by_place(
    arm: &Vector3<f64>,
    map_from_landmark: &Matrix3<f64>,
    point: &Vector3<f64>,
    size: &LandmarkSize,
) -> Matrix3x6<f64> {
    let wider = map_from_landmark * Vector3::new(0.0, point.y / size.width_m, 0.0);
    let higher = map_from_landmark * Vector3::new(0.0, 0.0, point.z / size.height_m);
    let turn = Vector3::z().cross(arm);
    Matrix3x6::from_columns(&[Vector3::x(), Vector3::y(), turn, Vector3::z(), wider, higher])
}

/// Camera coordinates of a robot point by the mounting's (rotation, translation); `from_camera` = point - camera,
/// robot axes.
pub(super) fn point_by_mounting(
    camera_from_robot: &Matrix3<f64>,
    from_camera: &Vector3<f64>,
) -> SMatrix<f64, 3, 6> {
    let mut j = SMatrix::<f64, 3, 6>::zeros();
    j.fixed_columns_mut::<3>(0).copy_from(&(camera_from_robot * from_camera.cross_matrix()));
    j.fixed_columns_mut::<3>(3).copy_from(&-camera_from_robot);
    j
}
