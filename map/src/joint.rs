//! The joint map: keyframes, walls, landmarks, the camera and the errors of odometry in one
//! least-squares problem, with their joint covariance (method 29).
//!
//! In: drives of odometry, lines of scans and tracks of quads. Out: the map, the weights of its
//! closures, and chosen blocks of the covariance. The first keyframe is the frame.

mod variables;
mod factor;
mod factors;
mod problem;
mod linearise;
mod solve;
mod marginals;
mod datum;
mod start;
mod params;
mod survey;
mod build;
mod closures;
mod survey_map;
mod known_map;
mod window;
mod laser_drive;
mod laser_drives;
mod shared_errors;
mod laser_map;

pub use build::SurveyProblem;
pub use datum::Datum;
pub use factor::{Factor, Kernels, Linearised};
pub use factors::{
    camera_prior::CameraPrior,
    hanging::{Level, OnWall, UnderCeiling},
    line::LineFit,
    odometry::{OdometryMotion, OdometryPrior},
    reprojection::LandmarkView,
    same_object::{SAME_PARAMETERS, SameObject},
    summary::Summary,
    wall_prior::{SizePrior, WallPrior},
};
pub use known_map::{KnownMap, refined};
pub use laser_drive::{FrameSeen, LaserDrive, ObjectSeen};
pub use laser_drives::LaserDrives;
pub use laser_map::{JointLaserMap, MappedObject, MappedWall};
pub use marginals::Marginals;
pub use params::JointParams;
pub use problem::{JointError, JointProblem, MAX_FACTORS};
pub use solve::{Descent, Solved};
pub use start::landmark_by_rays;
pub use survey::{CameraStated, DriveRecord, LineSeen, Motion, PlanLine, QuadView, Survey, Track};
pub use survey_map::{Closure, SurveyMap, surveyed};
pub use variables::{CameraState, LandmarkState, OdometryErrors, State, Variable, WallLine};
pub use window::{JointWindow, KeyframeSeen};

#[cfg(test)]
mod tests;
