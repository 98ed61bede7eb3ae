//! The linear pose of a plane from its homography, Eq. (2), and the mirror image of a pose (method
//! 13.1, 13.2, 13.4).

use crate::{
    geometry::homography::Homography,
    pose::{measurement::PoseMeasurement, reprojection::corner_points},
};
use nalgebra::{Isometry3, Matrix3, Point2, Rotation3, UnitQuaternion};

/// Eq. (2): `[r2 r3 T] = lambda K^-1 H`, then the nearest rotation (method 13.1, 13.2).
pub fn linear_pose(measured: &PoseMeasurement) -> Option<Isometry3<f64>> {
    let c = &measured.camera;
    let ray = |p: &Point2<f64>| Point2::new((p.x - c.cx_px) / c.fx_px, (p.y - c.cy_px) / c.fy_px);
    let plane = corner_points(&measured.size).map(|p| Point2::new(p.y, p.z));
    let rays = measured.corners_px.points().each_ref().map(ray);
    pose_of_columns(Homography::from_points(&plane, &rays).ok()?.matrix())
}

/// The pose of `B = K^-1 H`, with H mapping the plane's (y, z, 1), positive over its points.
pub(crate) fn pose_of_columns(b: &Matrix3<f64>) -> Option<Isometry3<f64>> {
    let (b1, b2, b3) = (b.column(0), b.column(1), b.column(2));
    let scale = (b1.norm() * b2.norm()).sqrt();
    let lambda = if b3.z < 0.0 { -1.0 } else { 1.0 } / scale;
    let (r2, r3, t) = (b1 * lambda, b2 * lambda, b3 * lambda);
    let raw = Matrix3::from_columns(&[r2.cross(&r3), r2, r3]);
    if !raw.iter().chain(t.iter()).all(|v| v.is_finite()) {
        return None;
    }
    let rotation = nearest_rotation(&raw)?;
    Some(Isometry3::from_parts(t.into(), UnitQuaternion::from_rotation_matrix(&rotation)))
}

/// `U diag(1, 1, det(U V^T)) V^T`: nearest in the Frobenius norm.
fn nearest_rotation(raw: &Matrix3<f64>) -> Option<Rotation3<f64>> {
    let svd = raw.try_svd(true, true, f64::EPSILON, 100)?;
    let (u, v_t) = (svd.u?, svd.v_t?);
    let mut signs = Matrix3::identity();
    signs[(2, 2)] = (u * v_t).determinant().signum();
    Some(Rotation3::from_matrix_unchecked(u * signs * v_t))
}

/// The camera is on the front side: `r1 . T < 0`.
pub(crate) fn faces_camera(pose: &Isometry3<f64>) -> bool {
    (pose.rotation * nalgebra::Vector3::x()).dot(&pose.translation.vector) < 0.0
}

/// The pose with its normal mirrored about the line of sight (method 13.4).
pub(crate) fn mirrored(pose: &Isometry3<f64>) -> Isometry3<f64> {
    let v = pose.translation.vector.normalize();
    let mirror = Matrix3::identity() - 2.0 * v * v.transpose();
    let flip = Matrix3::from_diagonal(&nalgebra::Vector3::new(-1.0, 1.0, 1.0));
    let rotation =
        Rotation3::from_matrix_unchecked(mirror * pose.rotation.to_rotation_matrix().matrix() * flip);
    Isometry3::from_parts(pose.translation, UnitQuaternion::from_rotation_matrix(&rotation))
}
