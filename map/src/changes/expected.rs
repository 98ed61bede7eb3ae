//! Which landmarks should be in a picture, by the pose alone.

use super::ChangeParams;
use crate::{
    mounting::Mounting,
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

/// A landmark that might be in the picture.
#[derive(Debug, Clone, Copy)]
pub struct Expectation<'a> {
    /// Which.
    pub landmark: LandmarkId,
    /// Where it hangs.
    pub place: &'a LandmarkPlace,
    /// From where it is seen.
    pub visible: &'a VisibilityMap,
}

/// The camera and where it looks.
#[derive(Debug, Clone, Copy)]
pub struct Eye<'a> {
    /// Robot from camera.
    pub mounting: &'a Mounting,
    /// Its calibration.
    pub camera: &'a Intrinsics,
    /// Width and height of the image, pixels.
    pub image_px: [f64; 2],
}

/// Those that should be seen whole, not obliquely, and well inside the picture, wherever within its uncertainty the
/// robot is; by number.
pub fn expected(
    pose: &Pose2Covariance,
    eye: &Eye<'_>,
    landmarks: &[Expectation<'_>],
    p: &ChangeParams,
) -> Vec<LandmarkId> {
    let draws = PoseDraws::new(pose, eye.mounting.robot_from_camera.translation.vector.xy());
    let expected = landmarks.iter().filter(|l| {
        l.visible.probability(&draws) >= p.expected_probability
            && l.place.incidence_rad(&camera_at(&draws.mean(), eye)) <= p.expected_incidence_rad
            && draws.poses().all(|at| is_inside(&at, eye, l.place, p))
    });
    expected.map(|l| l.landmark).collect()
}

fn camera_at(on_floor: &Point2<f64>, eye: &Eye<'_>) -> Point3<f64> {
    Point3::new(on_floor.x, on_floor.y, eye.mounting.robot_from_camera.translation.z)
}

fn is_inside(at: &crate::pose2::Pose2, eye: &Eye<'_>, place: &LandmarkPlace, p: &ChangeParams) -> bool {
    let map_from_camera = at.to_isometry3() * eye.mounting.robot_from_camera;
    let camera_from_landmark = map_from_camera.inverse() * place.map_from_landmark();
    let inside =
        |value: f64, side: f64| value >= p.image_margin * side && value <= (1.0 - p.image_margin) * side;
    corner_points(&place.size).iter().all(|corner| {
        pixel(&camera_from_landmark, corner, eye.camera)
            .is_some_and(|px| inside(px.x, eye.image_px[0]) && inside(px.y, eye.image_px[1]))
    })
}
