//! Corners of a landmark of known size in, its pose in the camera frame out (method 13).

pub mod measurement;
pub mod reprojection;
pub mod linear;
pub(crate) mod refine;
pub(crate) mod spread;
pub mod landmark_pose;

pub use landmark_pose::{AMBIGUOUS_CHI2, AMBIGUOUS_RATIO, LandmarkPose, landmark_pose};
pub use linear::linear_pose;
pub use measurement::{
    LandmarkSize, MAX_CORNER_PX, MAX_CORNER_SIGMA_PX, MIN_CORNER_SIGMA_PX, PoseError, PoseMeasurement,
    UndistortedCorners, straightened,
};
pub use refine::PoseSolution;
