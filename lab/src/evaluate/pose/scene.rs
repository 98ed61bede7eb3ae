//! The set-up of method 13.3: a poster of 0.60 x 0.84 m, a camera of 700 px 0.3 m below its centre,
//! panned at it.

use nalgebra::{Isometry3, Matrix2, Matrix3, Point2, Rotation3, UnitQuaternion, Vector2, Vector3};
use vision::{
    frame::{Distortion, Intrinsics},
    geometry::Corners,
    pose::{LandmarkSize, reprojection::corner_points},
    random::Random,
};

pub(super) const SIZE: LandmarkSize = LandmarkSize { width_m: 0.6, height_m: 0.84 };
pub(super) const CAMERA: Intrinsics = Intrinsics {
    fx_px: 700.0,
    fy_px: 700.0,
    cx_px: 320.0,
    cy_px: 240.0,
    distortion: Distortion::None,
    sigmas: None,
};

/// `camera_from_landmark` of a level camera `d_m` from the poster's centre in plan, at azimuth
/// `psi_deg`.
pub(super) fn view(d_m: f64, psi_deg: f64) -> Isometry3<f64> {
    let psi = psi_deg.to_radians();
    let centre = Vector3::new(d_m * psi.cos(), d_m * psi.sin(), -0.3);
    let forward = Vector3::new(-psi.cos(), -psi.sin(), 0.0);
    let down = -Vector3::z();
    let right = down.cross(&forward);
    let turn = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[right, down, forward]));
    let rotation = UnitQuaternion::from_rotation_matrix(&turn.inverse());
    Isometry3::from_parts((-(rotation * centre)).into(), rotation)
}

pub(super) fn projected(pose: &Isometry3<f64>) -> [Point2<f64>; 4] {
    corner_points(&SIZE).map(|p| CAMERA.project(&(pose.rotation * p + pose.translation.vector)))
}

pub(super) fn noisy(points: &[Point2<f64>; 4], sigma_px: f64, random: &mut Random) -> Option<Corners> {
    Corners::new(points.map(|p| p + Vector2::new(random.normal(), random.normal()) * sigma_px)).ok()
}

pub(super) fn isotropic(sigma_px: f64) -> [Matrix2<f64>; 4] {
    [Matrix2::identity() * sigma_px * sigma_px; 4]
}

/// The camera in the landmark frame: along the normal, along the wall (m), heading (rad).
pub(super) fn in_plan(camera_from_landmark: &Isometry3<f64>) -> Vector3<f64> {
    let inverse = camera_from_landmark.inverse();
    let forward = inverse.rotation * Vector3::z();
    let t = inverse.translation.vector;
    Vector3::new(t.x, t.y, forward.y.atan2(-forward.x))
}
