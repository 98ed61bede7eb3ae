//! Derivatives of points by robot pose, landmark place and extrinsics.

use nalgebra::{Matrix3, Matrix3x6, SMatrix, Vector3};
use vision::pose::LandmarkSize;

/// Camera coordinates of a map point by (x, y, theta) of the robot; `from_robot` = point - robot,
/// map axes.
pub(crate) fn point_by_pose(camera_from_map: &Matrix3<f64>, from_robot: &Vector3<f64>) -> Matrix3<f64> {
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

/// Camera coordinates of a robot point by the mounting's (rotation, translation); `from_camera` =
/// point - camera, robot axes.
pub(crate) fn point_by_mounting(
    camera_from_robot: &Matrix3<f64>,
    from_camera: &Vector3<f64>,
) -> SMatrix<f64, 3, 6> {
    let mut j = SMatrix::<f64, 3, 6>::zeros();
    j.fixed_columns_mut::<3>(0).copy_from(&(camera_from_robot * from_camera.cross_matrix()));
    j.fixed_columns_mut::<3>(3).copy_from(&-camera_from_robot);
    j
}
