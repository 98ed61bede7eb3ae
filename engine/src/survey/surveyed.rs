//! What a drive gives: walls, objects, and the camera as it was found.

use super::objects::ObjectView;
use map::{
    joint::CameraState,
    place::LandmarkPlace,
    pose2::{Pose2, Pose2Covariance},
    segments::LaserSegment,
};
use nalgebra::{Isometry3, SVector};
use vision::frame::Intrinsics;

/// An object of a surveyed building.
#[derive(Debug, Clone)]
pub struct SurveyedObject {
    /// Where it hangs.
    pub place: LandmarkPlace,
    /// Its views.
    pub views: Vec<ObjectView>,
    /// Why it is no landmark; none where it is one.
    pub refused: Option<String>,
}

/// What a drive gave.
#[derive(Debug)]
pub struct SurveyedBuilding {
    /// Walls, map frame.
    pub walls: Vec<LaserSegment>,
    /// Walls of the laser map alone, for comparison.
    pub laser_walls: Vec<LaserSegment>,
    /// `map_from_robot` of each frame by the laser map alone.
    pub laser_frames: Vec<Pose2>,
    /// Objects.
    pub objects: Vec<SurveyedObject>,
    /// `map_from_robot` of each frame.
    pub frames: Vec<Pose2Covariance>,
    /// The camera as found, without its lens, and its standard deviations.
    pub camera: (CameraState, SVector<f64, 10>),
    /// The camera as stated.
    pub stated: CameraState,
    /// Scale of odometry as found, minus 1.
    pub odometry_scale: f64,
    /// Loop closures of the laser map.
    pub loops: usize,
    /// Frames that could not be decoded.
    pub undecodable: usize,
}

impl SurveyedBuilding {
    /// The mounting of a frame by the camera as found.
    pub fn mounting(&self, stated: &Isometry3<f64>) -> Isometry3<f64> {
        self.camera.0.robot_from_camera * self.stated.robot_from_camera.inverse() * stated
    }

    /// Intrinsics with the focal length as found; their lens stays.
    pub fn intrinsics(&self, stated: &Intrinsics) -> Intrinsics {
        with_focal(stated, self.camera.0.focal_px)
    }
}

/// Intrinsics with this focal length; aspect ratio and lens stay.
pub(super) fn with_focal(camera: &Intrinsics, focal_px: f64) -> Intrinsics {
    Intrinsics { fx_px: focal_px, fy_px: focal_px * camera.fy_px / camera.fx_px, ..*camera }
}
