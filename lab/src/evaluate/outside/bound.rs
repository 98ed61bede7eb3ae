//! What corners can tell at most of a camera's position. In: the true camera and the landmarks as
//! they hang. Out: the covariance of the position by their corners alone (Cramer and Rao), and
//! errors drawn from it.

use super::world::{CameraTruth, LandmarkTruth};
use nalgebra::{Matrix3, Matrix3x6, Matrix6, Vector3};
use vision::{
    pose::reprojection::{corner_points, cross, project},
    random::Random,
};

/// Standard deviation of a coordinate of a corner, px: the best that edges of noisy pictures give
/// (method 13.5, `BORDER_SIGMA_PX`).
pub(super) const CORNER_SIGMA_PX: f64 = 0.3;
/// Errors drawn for each picture.
const DRAWS: usize = 20;

/// Covariance of the position (map frame, m^2), of independent corners with [`CORNER_SIGMA_PX`];
/// `None` where they do not determine it.
pub(super) fn position_bound<'a>(
    landmarks: impl Iterator<Item = &'a LandmarkTruth>,
    camera: &CameraTruth,
) -> Option<Matrix3<f64>> {
    let mut information = Matrix6::zeros();
    for landmark in landmarks {
        for corner in corner_points(&landmark.size) {
            let at = landmark.world_from_landmark * nalgebra::Point3::from(corner);
            let projected = project(&camera.camera_from_world, &at.coords, &camera.intrinsics)?;
            information += projected.by_pose.transpose() * projected.by_pose;
        }
    }
    let covariance = information.cholesky()?.inverse() * CORNER_SIGMA_PX.powi(2);
    // The position is -R^T t of `camera_from_world`: by the rotation vector R^T [t]x, by the
    // translation -R^T.
    let turn = camera.camera_from_world.rotation.inverse().to_rotation_matrix().into_inner();
    let mut by_pose = Matrix3x6::zeros();
    by_pose
        .fixed_columns_mut::<3>(0)
        .copy_from(&(turn * cross(&camera.camera_from_world.translation.vector)));
    by_pose.fixed_columns_mut::<3>(3).copy_from(&-turn);
    Some(by_pose * covariance * by_pose.transpose())
}

/// Lengths of errors with each of the covariances, metres; the same for the same covariances.
pub(super) fn drawn_m(covariances: impl Iterator<Item = Matrix3<f64>>) -> Vec<f64> {
    let mut random = Random::new(1);
    let mut lengths = Vec::new();
    for factor in covariances.filter_map(Matrix3::cholesky) {
        for _ in 0..DRAWS {
            let draw = Vector3::from_fn(|_, _| random.normal());
            lengths.push((factor.l() * draw).norm());
        }
    }
    lengths
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Isometry3, Translation3, UnitQuaternion};
    use vision::{
        frame::{Distortion, Intrinsics},
        geometry::Corners,
        pose::{LandmarkSize, landmark_pose},
    };

    /// A poster of 0.6 x 0.84 m on the wall x = 0, and a camera `distance_m` before it, `aside_m`
    /// to the right.
    fn scene(distance_m: f64, aside_m: f64) -> (LandmarkTruth, CameraTruth) {
        let size = LandmarkSize { width_m: 0.6, height_m: 0.84 };
        let landmark = LandmarkTruth { world_from_landmark: Isometry3::identity(), size };
        let eye = nalgebra::Point3::new(distance_m, aside_m, 0.1);
        let look = Isometry3::look_at_rh(&eye, &nalgebra::Point3::origin(), &nalgebra::Vector3::z());
        // OpenGL's camera looks along -z with y up.
        let flip = UnitQuaternion::from_axis_angle(&nalgebra::Vector3::x_axis(), std::f64::consts::PI);
        let camera_from_world = Isometry3::from_parts(Translation3::identity(), flip) * look;
        let intrinsics = Intrinsics::new(700.0, 700.0, 320.0, 240.0, Distortion::None).unwrap();
        (landmark, CameraTruth { camera_from_world, intrinsics })
    }

    #[test]
    fn the_bound_is_the_error_of_poses_by_corners_with_that_noise() {
        let (landmark, camera) = scene(3.0, 2.0);
        let bound = position_bound([landmark].iter(), &camera).unwrap();
        let truth = camera.camera_from_world.inverse().translation.vector;
        let mut random = Random::new(7);
        let (mut squares, count) = (0.0, 400);
        for _ in 0..count {
            let corners = corner_points(&landmark.size).map(|at| {
                let px = project(&camera.camera_from_world, &at, &camera.intrinsics).unwrap().px;
                [px.x + CORNER_SIGMA_PX * random.normal(), px.y + CORNER_SIGMA_PX * random.normal()]
            });
            let covariance = [nalgebra::Matrix2::identity() * CORNER_SIGMA_PX.powi(2); 4];
            let corners = Corners::try_from(corners).unwrap();
            let pose = landmark_pose(&corners, &covariance, landmark.size, &camera.intrinsics).unwrap();
            let position = pose.best.camera_from_landmark.inverse().translation.vector;
            squares += (position - truth).norm_squared();
        }
        let (measured, bound) = ((squares / f64::from(count)).sqrt(), bound.trace().sqrt());
        assert!((measured / bound - 1.0).abs() < 0.1, "{measured} {bound}");
    }

    #[test]
    fn two_landmarks_tell_more_than_one_and_none_tells_nothing() {
        let (first, camera) = scene(4.0, 0.5);
        let aside = Translation3::new(0.0, 1.5, 0.0) * first.world_from_landmark;
        let second = LandmarkTruth { world_from_landmark: aside, ..first };
        let sigma = |all: &[LandmarkTruth]| position_bound(all.iter(), &camera).map(|c| c.trace().sqrt());
        let (one, two) = (sigma(&[first]).unwrap(), sigma(&[first, second]).unwrap());
        assert!(two < 0.5 * one, "{one} {two}");
        assert_eq!(sigma(&[]), None);
    }

    #[test]
    fn drawn_errors_have_the_covariance() {
        let covariance = Matrix3::from_diagonal(&Vector3::new(0.04, 0.01, 0.0001));
        let drawn = drawn_m((0..500).map(|_| covariance));
        assert_eq!(drawn.len(), 500 * DRAWS);
        let mean = drawn.iter().map(|d| d * d).sum::<f64>() / drawn.len() as f64;
        assert!((mean / covariance.trace() - 1.0).abs() < 0.05, "{mean}");
    }
}
