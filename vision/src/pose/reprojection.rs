//! Pixels of a landmark's corners for a pose, with the derivatives by the pose and by the
//! landmark's size. A pinhole is assumed: corners are undistorted before they come here.

use crate::{frame::Intrinsics, pose::measurement::LandmarkSize};
use nalgebra::{Isometry3, Matrix2x3, Matrix3, Point2, SMatrix, Vector3};

/// Corners nearer to the camera plane than this are not projected, metres.
pub const MIN_DEPTH_M: f64 = 1e-6;

/// A projected point with its derivatives.
#[derive(Debug, Clone, PartialEq)]
pub struct Projected {
    /// Its pixel.
    pub px: Point2<f64>,
    /// Derivative by the point in camera coordinates.
    pub by_point: Matrix2x3<f64>,
    /// Derivative by the left perturbation (rotation, translation) of `camera_from_landmark`.
    pub by_pose: SMatrix<f64, 2, 6>,
}

/// Corners TL, TR, BR, BL in landmark coordinates (method 0.2), metres.
pub fn corner_points(size: &LandmarkSize) -> [Vector3<f64>; 4] {
    let (y, z) = (0.5 * size.width_m, 0.5 * size.height_m);
    [(-y, z), (y, z), (y, -z), (-y, -z)].map(|(y, z)| Vector3::new(0.0, y, z))
}

/// Pixel of `point` (landmark coordinates); `None` when it is not in front of the camera.
pub fn pixel(
    camera_from_landmark: &Isometry3<f64>,
    point: &Vector3<f64>,
    camera: &Intrinsics,
) -> Option<Point2<f64>> {
    let p = camera_from_landmark.rotation * point + camera_from_landmark.translation.vector;
    (p.z > MIN_DEPTH_M).then(|| {
        Point2::new(camera.fx_px * p.x / p.z + camera.cx_px, camera.fy_px * p.y / p.z + camera.cy_px)
    })
}

/// As [`pixel`], with the derivatives.
pub fn project(
    camera_from_landmark: &Isometry3<f64>,
    point: &Vector3<f64>,
    camera: &Intrinsics,
) -> Option<Projected> {
    let px = pixel(camera_from_landmark, point, camera)?;
    let arm = camera_from_landmark.rotation * point;
    let p = arm + camera_from_landmark.translation.vector;
    let (fx, fy, inverse) = (camera.fx_px, camera.fy_px, 1.0 / p.z);
    let by_point = Matrix2x3::new(
        fx * inverse,
        0.0,
        -fx * p.x * inverse * inverse,
        0.0,
        fy * inverse,
        -fy * p.y * inverse * inverse,
    );
    let mut by_pose = SMatrix::<f64, 2, 6>::zeros();
    by_pose.fixed_columns_mut::<3>(0).copy_from(&(by_point * -cross(&arm)));
    by_pose.fixed_columns_mut::<3>(3).copy_from(&by_point);
    Some(Projected { px, by_point, by_pose })
}

/// The matrix of `v x`.
pub fn cross(v: &Vector3<f64>) -> Matrix3<f64> {
    v.cross_matrix()
}

/// `Exp(rotation) R, T + translation` of a pose: the project's left perturbation (method 0.2).
pub fn perturbed(
    pose: &Isometry3<f64>,
    rotation_rad: &Vector3<f64>,
    translation_m: &Vector3<f64>,
) -> Isometry3<f64> {
    let rotation = nalgebra::UnitQuaternion::from_scaled_axis(*rotation_rad) * pose.rotation;
    Isometry3::from_parts((pose.translation.vector + translation_m).into(), rotation)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Distortion;
    use nalgebra::{UnitQuaternion, Vector6};

    fn camera() -> Intrinsics {
        Intrinsics::new(700.0, 690.0, 320.0, 240.0, Distortion::None).unwrap()
    }

    #[test]
    fn derivatives_are_the_finite_differences() {
        let rotation = UnitQuaternion::from_euler_angles(0.4, -1.1, 0.2);
        let pose = Isometry3::from_parts(Vector3::new(0.3, -0.2, 3.0).into(), rotation);
        for point in corner_points(&LandmarkSize { width_m: 0.6, height_m: 0.84 }) {
            let projected = project(&pose, &point, &camera()).unwrap();
            for k in 0..6 {
                let mut d = Vector6::zeros();
                d[k] = 1e-6;
                let at = |d: Vector6<f64>| {
                    let moved = perturbed(&pose, &d.fixed_rows::<3>(0).into(), &d.fixed_rows::<3>(3).into());
                    pixel(&moved, &point, &camera()).unwrap()
                };
                let numeric = (at(d) - at(-d)) / 2e-6;
                assert!((numeric - projected.by_pose.column(k)).norm() < 1e-5, "{k}");
            }
        }
    }

    #[test]
    fn agrees_with_the_camera_model() {
        let pose = Isometry3::translation(0.1, 0.2, 2.0);
        let point = Vector3::new(0.0, 0.3, -0.4);
        let expected = camera().project(&(pose * nalgebra::Point3::from(point)).coords);
        assert!((pixel(&pose, &point, &camera()).unwrap() - expected).norm() < 1e-12);
    }

    #[test]
    fn points_behind_the_camera_are_not_projected() {
        let at = |z| pixel(&Isometry3::translation(0.0, 0.0, z), &Vector3::zeros(), &camera());
        assert!(at(2e-6).is_some());
        assert!(at(MIN_DEPTH_M).is_none());
        assert!(at(-1.0).is_none());
        assert!(at(f64::NAN).is_none());
    }
}
