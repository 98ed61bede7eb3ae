//! Predicted corners of one landmark for an upright robot, with their derivatives.

use crate::{
    extrinsics::CameraExtrinsics,
    localise::derivatives::{point_by_mounting, point_by_place, point_by_pose},
    place::LandmarkPlace,
    pose2::Pose2,
};
use nalgebra::SMatrix;
use vision::{
    frame::Intrinsics,
    pose::reprojection::{corner_points, project},
};

/// Derivatives of the eight corner coordinates.
pub(crate) struct Predicted {
    /// By (x, y, theta) of the robot.
    pub pose: SMatrix<f64, 8, 3>,
    /// By (x, y, theta, z, width, height) of the landmark.
    pub place: SMatrix<f64, 8, 6>,
    /// By (rotation, translation) of the extrinsics.
    pub mounting: SMatrix<f64, 8, 6>,
}

/// At a pose; `None` when a corner is behind the camera.
pub(crate) fn corners(
    pose: &Pose2,
    place: &LandmarkPlace,
    mounting: &CameraExtrinsics,
    camera: &Intrinsics,
) -> Option<Predicted> {
    let map_from_robot = pose.to_isometry3();
    let camera_from_robot = mounting.robot_from_camera.inverse();
    let camera_from_map = camera_from_robot * map_from_robot.inverse();
    let map_from_landmark = place.map_from_landmark();
    let camera_from_landmark = camera_from_map * map_from_landmark;
    let turn = camera_from_map.rotation.to_rotation_matrix().into_inner();
    let robot_turn = camera_from_robot.rotation.to_rotation_matrix().into_inner();
    let sides = map_from_landmark.rotation.to_rotation_matrix().into_inner();
    let mut made = Predicted { pose: SMatrix::zeros(), place: SMatrix::zeros(), mounting: SMatrix::zeros() };
    for (c, point) in corner_points(&place.size).iter().enumerate() {
        let projected = project(&camera_from_landmark, point, camera)?;
        let arm = map_from_landmark.rotation * point;
        let from_robot = arm + map_from_landmark.translation.vector - map_from_robot.translation.vector;
        let by_pose = projected.by_point * point_by_pose(&turn, &from_robot);
        made.pose.fixed_rows_mut::<2>(2 * c).copy_from(&by_pose);
        let by_place = projected.by_point * turn * point_by_place(&arm, &sides, point, &place.size);
        made.place.fixed_rows_mut::<2>(2 * c).copy_from(&by_place);
        let from_camera = map_from_robot.inverse_transform_vector(&from_robot)
            - mounting.robot_from_camera.translation.vector;
        let by_mounting = projected.by_point * point_by_mounting(&robot_turn, &from_camera);
        made.mounting.fixed_rows_mut::<2>(2 * c).copy_from(&by_mounting);
    }
    Some(made)
}
