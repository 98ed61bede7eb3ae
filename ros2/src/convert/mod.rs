//! Conventions of ROS in plain numbers. In: messages. Out: metres, radians, nanoseconds and pixels
//! in the coordinate frames of docs/TERMS.md, or a typed error; and back.
//!
//! Sources: REP-103 (units, axes, covariances over x, y, z and rotations about fixed axes), REP-105
//! (`map`, `odom`, `base_link`), REP-104 (`CameraInfo`), `ros2/geometry2` (tf2),
//! `ros-navigation/navigation2`; files are named where they matter. `a_from_b` takes coordinates of
//! b to those of a; ROS calls it the transform with parent a and child b.

mod rotation;
mod pose;
mod planar;
mod covariance;
mod transform_tree;
mod optical;
mod map_from_odom;
mod initial_pose;
mod laser;
mod camera;
mod image;

pub use camera::{CameraError, CameraModel, LensModel};
pub use covariance::{
    CovarianceError, MAX_INITIAL_VARIANCE, UNKNOWN_VARIANCE, clip_for_initial_pose, ros_of_planar,
};
pub use image::{Compression, ImageError, ImageRows, PixelLayout};
pub use initial_pose::{InitialPoseError, initial_pose};
pub use laser::{LaserError, LaserMounting, MAX_LASER_TILT_RAD, MAX_SCAN_S, PlanarScan};
pub use map_from_odom::{map_from_odom, transform_stamped};
pub use optical::body_from_optical;
pub use planar::PlanarPose;
pub use pose::{PoseError, isometry_of_pose, isometry_of_transform, pose_of, transform_of};
pub use rotation::{MAX_NORM2_ERROR, RotationError, quaternion, rotation};
pub use transform_tree::{LookupError, MAX_FRAME_NAME_BYTES, MAX_FRAMES, TransformError, TransformTree};
