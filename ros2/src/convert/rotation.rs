//! Quaternions from the wire, checked, and back.

use crate::messages::Quaternion;
use nalgebra::UnitQuaternion;

/// Largest difference of the squared norm from 1, that of tf2
/// (`ros2/geometry2 tf2/src/buffer_core.cpp`, `QUATERNION_NORMALIZATION_TOLERANCE`): what a robot's
/// own tf takes is taken here.
pub const MAX_NORM2_ERROR: f64 = 10e-3;

/// Why four numbers are no rotation.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum RotationError {
    /// One of them is NaN or infinite.
    #[error("a quaternion with a number that is not finite")]
    NotFinite,
    /// The squared norm is not 1; 0 for a message that nobody filled in.
    #[error("a quaternion of squared norm {0}, 1 is needed")]
    Norm2(f64),
}

/// The rotation, normalised.
pub fn rotation(q: &Quaternion) -> Result<UnitQuaternion<f64>, RotationError> {
    let raw = nalgebra::Quaternion::new(q.w, q.x, q.y, q.z);
    let norm2 = raw.norm_squared();
    if !norm2.is_finite() {
        return Err(RotationError::NotFinite);
    }
    if (norm2 - 1.0).abs() > MAX_NORM2_ERROR {
        return Err(RotationError::Norm2(norm2));
    }
    Ok(UnitQuaternion::from_quaternion(raw))
}

/// The quaternion of a rotation, of the two the one with `w >= 0`, normalised: Nav2 takes a squared
/// norm within 1e-4 of 1
/// (`ros-navigation/navigation2 nav2_util/include/nav2_util/validate_messages.hpp`).
pub fn quaternion(rotation: &UnitQuaternion<f64>) -> Quaternion {
    let q = rotation.quaternion().normalize();
    let sign = if q.w < 0.0 { -1.0 } else { 1.0 };
    Quaternion { x: sign * q.i, y: sign * q.j, z: sign * q.k, w: sign * q.w }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    #[test]
    fn rotations_come_back_with_a_positive_real_part() {
        let turned = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 4.0);
        let q = quaternion(&turned);
        assert!(q.w >= 0.0);
        assert!(rotation(&q).unwrap().angle_to(&turned) < 1e-12);
    }

    #[test]
    fn what_is_no_rotation_is_refused() {
        let of = |x, w| rotation(&Quaternion { x, y: 0.0, z: 0.0, w });
        assert_eq!(of(0.0, 0.0), Err(RotationError::Norm2(0.0)));
        assert_eq!(of(f64::NAN, 1.0), Err(RotationError::NotFinite));
        assert_eq!(of(f64::INFINITY, 1.0), Err(RotationError::NotFinite));
        assert_eq!(of(1e200, 1.0), Err(RotationError::NotFinite), "the square overflows");
        // A norm of 1.0049 is within tf2's tolerance, one of 1.0051 is not.
        assert!((of(0.0, 1.0049).unwrap().norm() - 1.0).abs() < 1e-15);
        assert!(of(0.0, 1.0051).is_err());
    }
}
