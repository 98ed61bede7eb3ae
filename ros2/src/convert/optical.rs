//! The two frames of a camera: body (x forward, y left, z up) and optical (z forward, x right, y
//! down; names end in `_optical_frame`). Images, and Waymark's `camera` frame, are of the optical
//! one (REP-103).

use nalgebra::{Matrix3, Rotation3, UnitQuaternion};

/// Takes coordinates of the optical frame to those of the body frame of the same camera: for a
/// driver that names only the body frame, `robot_from_camera` is
/// `robot_from_body * body_from_optical()`.
pub fn body_from_optical() -> UnitQuaternion<f64> {
    let axes = Matrix3::new(0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0);
    UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    #[test]
    fn axes_are_those_of_rep_103() {
        let body = body_from_optical();
        let axes = [Vector3::x(), Vector3::y(), Vector3::z()].map(|optical| body * optical);
        let expected = [-Vector3::y(), -Vector3::z(), Vector3::x()];
        assert!(axes.iter().zip(expected).all(|(a, b)| (a - b).norm() < 1e-12));
        // Drivers write it as roll -90, yaw -90 degrees: quaternion (-0.5, 0.5, -0.5, 0.5).
        let q = crate::convert::quaternion(&body);
        assert!([q.x + 0.5, q.y - 0.5, q.z + 0.5, q.w - 0.5].iter().all(|d| d.abs() < 1e-12));
    }
}
