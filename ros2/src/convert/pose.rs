//! Poses and transforms as isometries, checked, and back.

use super::rotation::{RotationError, quaternion, rotation};
use crate::messages::{Pose, Quaternion, Transform, Vector3};
use nalgebra::{Isometry3, Translation3};

/// Why a pose cannot be used.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum PoseError {
    /// The position has a number that is NaN or infinite.
    #[error("a position that is not finite")]
    Position,
    /// The orientation.
    #[error(transparent)]
    Rotation(#[from] RotationError),
}

/// `a_from_b` of the pose of b in a.
pub fn isometry_of_pose(pose: &Pose) -> Result<Isometry3<f64>, PoseError> {
    isometry(&pose.position, &pose.orientation)
}

/// `parent_from_child` of a transform.
pub fn isometry_of_transform(transform: &Transform) -> Result<Isometry3<f64>, PoseError> {
    isometry(&transform.translation, &transform.rotation)
}

/// The pose of b in a, of `a_from_b`.
pub fn pose_of(a_from_b: &Isometry3<f64>) -> Pose {
    Pose { position: position_of(a_from_b), orientation: quaternion(&a_from_b.rotation) }
}

/// The transform with parent a and child b, of `a_from_b`.
pub fn transform_of(a_from_b: &Isometry3<f64>) -> Transform {
    Transform { translation: position_of(a_from_b), rotation: quaternion(&a_from_b.rotation) }
}

fn isometry(position: &Vector3, orientation: &Quaternion) -> Result<Isometry3<f64>, PoseError> {
    let Vector3 { x, y, z } = *position;
    if ![x, y, z].iter().all(|c| c.is_finite()) {
        return Err(PoseError::Position);
    }
    Ok(Isometry3::from_parts(Translation3::new(x, y, z), rotation(orientation)?))
}

fn position_of(isometry: &Isometry3<f64>) -> Vector3 {
    let t = isometry.translation.vector;
    Vector3 { x: t.x, y: t.y, z: t.z }
}
