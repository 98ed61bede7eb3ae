//! A posed view of a quad, checked and undistorted, and the placement that several views give.

use crate::{
    extrinsics::CameraExtrinsics, place::LandmarkPlace, placement::params::PlacementError,
    pose2::Pose2Covariance,
};
use nalgebra::{Matrix2, Matrix2x3};
use vision::{
    frame::Intrinsics,
    geometry::Corners,
    pose::{UndistortedCorners, straightened},
};

/// Most views of one placement; later ones are ignored.
pub const MAX_VIEWS: usize = 256;

/// A view of a quad from a known robot pose.
#[derive(Debug, Clone)]
pub struct PosedView<'a> {
    /// Measured corners in the landmark's order, px.
    pub corners: &'a Corners,
    /// Covariance of each corner, px^2.
    pub covariance_px2: &'a [Matrix2<f64>; 4],
    /// Intrinsics of the camera.
    pub camera: &'a Intrinsics,
    /// Robot pose at capture.
    pub map_from_robot: &'a Pose2Covariance,
    /// Extrinsics at capture.
    pub mounting: &'a CameraExtrinsics,
}

/// A view with checked poses and undistorted corners.
pub(super) struct CheckedView<'a> {
    pub(super) corners_px: Corners,
    pub(super) covariance_px2: [Matrix2<f64>; 4],
    pub(super) camera: Intrinsics,
    pub(super) by_camera: [Matrix2x3<f64>; 4],
    pub(super) map_from_robot: &'a Pose2Covariance,
    pub(super) mounting: &'a CameraExtrinsics,
}

pub(super) fn checked<'a>(view: &PosedView<'a>) -> Result<CheckedView<'a>, PlacementError> {
    view.map_from_robot.check()?;
    view.mounting.check()?;
    let UndistortedCorners { corners_px, covariance_px2, camera, by_camera } =
        straightened(view.corners, &view.covariance_px2.into(), view.camera)?;
    let covariance_px2 = covariance_px2.blocks();
    let (map_from_robot, mounting) = (view.map_from_robot, view.mounting);
    Ok(CheckedView { corners_px, covariance_px2, camera, by_camera, map_from_robot, mounting })
}

/// The place that several views agree on.
#[derive(Debug, Clone, PartialEq)]
pub struct Placement {
    /// Place and size.
    pub place: LandmarkPlace,
    /// Indices of the views that passed the gate.
    pub used: Vec<usize>,
}
