//! Landmarks that should be visible in an image, by the pose alone.

use crate::{
    extrinsics::CameraExtrinsics,
    landmark_health::params::HealthParams,
    place::LandmarkPlace,
    pose2::Pose2Covariance,
    visibility::{PoseDraws, VisibilityMap},
};
use nalgebra::{Point2, Point3};
use vision::{
    frame::Intrinsics,
    model::LandmarkId,
    pose::reprojection::{corner_points, pixel},
};

/// A landmark that may be in view.
#[derive(Debug, Clone, Copy)]
pub struct ExpectedLandmark<'a> {
    /// Number of the landmark.
    pub landmark: LandmarkId,
    /// Place of the landmark, map frame.
    pub place: &'a LandmarkPlace,
    /// Its visibility area.
    pub visible: &'a VisibilityMap,
}

/// A camera with its extrinsics.
#[derive(Debug, Clone, Copy)]
pub struct MountedCamera<'a> {
    /// Extrinsics at the time of the image.
    pub mounting: &'a CameraExtrinsics,
    /// Intrinsics of the camera.
    pub camera: &'a Intrinsics,
    /// Width and height of the image, pixels.
    pub image_px: [f64; 2],
}

/// The landmarks that should be visible as a whole, not obliquely and well inside the image,
/// everywhere within the uncertainty of the pose; by number.
pub fn expected(
    pose: &Pose2Covariance,
    camera: &MountedCamera<'_>,
    landmarks: &[ExpectedLandmark<'_>],
    p: &HealthParams,
) -> Vec<LandmarkId> {
    let draws = PoseDraws::new(pose, camera.mounting.robot_from_camera.translation.vector.xy());
    let expected = landmarks.iter().filter(|l| {
        l.visible.probability(&draws) >= p.expected_probability
            && l.place.incidence_rad(&camera_at(&draws.mean(), camera)) <= p.expected_incidence_rad
            && draws.poses().all(|at| is_inside(&at, camera, l.place, p))
    });
    expected.map(|l| l.landmark).collect()
}

fn camera_at(on_floor: &Point2<f64>, camera: &MountedCamera<'_>) -> Point3<f64> {
    Point3::new(on_floor.x, on_floor.y, camera.mounting.robot_from_camera.translation.z)
}

fn is_inside(
    at: &crate::pose2::Pose2,
    camera: &MountedCamera<'_>,
    place: &LandmarkPlace,
    p: &HealthParams,
) -> bool {
    let map_from_camera = at.to_isometry3() * camera.mounting.robot_from_camera;
    let camera_from_landmark = map_from_camera.inverse() * place.map_from_landmark();
    let inside =
        |value: f64, side: f64| value >= p.image_margin * side && value <= (1.0 - p.image_margin) * side;
    corner_points(&place.size).iter().all(|corner| {
        pixel(&camera_from_landmark, corner, camera.camera)
            .is_some_and(|px| inside(px.x, camera.image_px[0]) && inside(px.y, camera.image_px[1]))
    })
}
