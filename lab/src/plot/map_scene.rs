//! What the pictures of the map's stages are made of: a camera, posters, looks at them.

use crate::evaluate::pose::stated_camera::{Cameras, StatedCamera};
use anyhow::Context as _;
use map::{
    extrinsics::{CameraExtrinsics, pan_tilt},
    localise::{Fix, FixResult, LandmarkObservation, LocaliseParams, robot_pose},
    place::{LandmarkPlace, PlaceSigmas},
    pose2::{Pose2, Pose2Covariance, wrap_rad},
};
use nalgebra::{Matrix3, Point2, Point3, Vector3};
use vision::{
    frame::{Distortion, Intrinsics},
    pose::{LandmarkPose, LandmarkSize},
    random::Random,
};

/// 640 x 480 px, 64 degrees wide.
pub(super) const CAMERA: Intrinsics = Intrinsics {
    fx_px: 512.0,
    fy_px: 512.0,
    cx_px: 319.5,
    cy_px: 239.5,
    distortion: Distortion::None,
    sigmas: None,
};
pub(super) const IMAGE_PX: [f64; 2] = [640.0, 480.0];
pub(super) const CAMERA_HEIGHT_M: f64 = 1.2;
pub(super) const POSTER: LandmarkSize = LandmarkSize { width_m: 0.6, height_m: 0.84 };
const POSTER_HEIGHT_M: f64 = 1.5;
/// Standard deviation of a measured corner.
pub(super) const SIGMA_PX: f64 = 0.5;

/// A poster on a wall, its outward normal in direction `theta_rad`, measured by hand.
pub(super) fn poster(x_m: f64, y_m: f64, theta_rad: f64) -> anyhow::Result<LandmarkPlace> {
    let centre = Vector3::new(x_m, y_m, POSTER_HEIGHT_M);
    Ok(LandmarkPlace::by_hand(centre, theta_rad, POSTER, PlaceSigmas::default())?)
}

/// The centre of a landmark.
pub(super) fn centre(place: &LandmarkPlace) -> Point3<f64> {
    Point3::new(place.x_m, place.y_m, place.z_m)
}

/// The camera panned and tilted at a point of the map.
pub(super) fn aimed(robot: &Pose2, at: &Point3<f64>) -> anyhow::Result<CameraExtrinsics> {
    let to = at.xy() - Point2::from(robot.position());
    let pan_rad = wrap_rad(to.y.atan2(to.x) - robot.theta_rad);
    let tilt_rad = (at.z - CAMERA_HEIGHT_M).atan2(to.norm());
    Ok(CameraExtrinsics::new(pan_tilt(pan_rad, tilt_rad, Vector3::new(0.0, 0.0, CAMERA_HEIGHT_M)))?)
}

/// What the camera sees of a landmark; `None` where not all of it is in the image.
pub(super) fn look(
    robot: &Pose2,
    mounting: &CameraExtrinsics,
    place: &LandmarkPlace,
    sigma_px: f64,
    random: &mut Random,
) -> Option<LandmarkPose> {
    let camera_from_landmark =
        mounting.robot_from_camera.inverse() * robot.to_isometry3().inverse() * place.map_from_landmark();
    let camera = StatedCamera::drawn(&CAMERA, Cameras::Exact, random);
    camera.observe(&camera_from_landmark, (place.size, place.size), sigma_px, random)
}

/// A pose with independent standard deviations of x, y (m) and heading (rad).
pub(super) fn around(pose: Pose2, sigmas: [f64; 3]) -> anyhow::Result<Pose2Covariance> {
    Ok(Pose2Covariance::new(pose, Matrix3::from_diagonal(&Vector3::from(sigmas.map(|s| s * s))))?)
}

/// The solutions of a frame, best first.
pub(super) fn fixes(
    seen: &[LandmarkObservation<'_>],
    mounting: &CameraExtrinsics,
    prior: Option<&Pose2Covariance>,
) -> anyhow::Result<Vec<Fix>> {
    Ok(match robot_pose(seen, mounting, prior, &LocaliseParams::default())? {
        FixResult::Fixed(fix) => vec![*fix],
        FixResult::Ambiguous(fixes) => fixes,
        FixResult::Refused(_) => Vec::new(),
    })
}

/// The solution of a frame that has one.
pub(super) fn the_fix(
    seen: &[LandmarkObservation<'_>],
    mounting: &CameraExtrinsics,
    prior: Option<&Pose2Covariance>,
) -> anyhow::Result<Fix> {
    let mut all = fixes(seen, mounting, prior)?;
    let fix = all.pop().context("the scene gives a fix")?;
    anyhow::ensure!(all.is_empty(), "the scene gives one fix");
    Ok(fix)
}
