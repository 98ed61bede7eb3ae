//! The start value of a landmark: the rectangle nearest to the rays of its corners, the poses as
//! they are.

use super::{
    survey::QuadView,
    variables::{CameraState, LandmarkState},
};
use crate::pose2::Pose2;
use nalgebra::{Matrix3, Point2, Vector2, Vector3};

/// Rays that pass the point at this distance have half the weight, metres.
const HALF_WEIGHT_M: f64 = 0.03;
/// Reweightings.
const ROUNDS: usize = 8;
/// Refinements of a ray by the distortion.
const UNBENDINGS: usize = 8;
/// Least and largest side, metres.
const SIDE_M: [f64; 2] = [0.1, 3.0];

/// An upright landmark from its views and the pose of each: each corner is the point nearest to its
/// rays, and the size is that of the quadrilateral. `None` without a view, or where the numbers are
/// not finite.
pub fn landmark_by_rays(views: &[(Pose2, QuadView)], camera: &CameraState) -> Option<LandmarkState> {
    if views.is_empty() {
        return None;
    }
    let rays: Vec<(Vector3<f64>, [Vector3<f64>; 4])> = views
        .iter()
        .map(|(pose, view)| {
            let camera_pose = pose.to_isometry3() * camera.robot_from_camera * view.mounting_from_camera;
            let ray = |px: &Point2<f64>| camera_pose.rotation * direction(px, camera);
            (camera_pose.translation.vector, view.corners_px.each_ref().map(ray))
        })
        .collect();
    let mut weights = vec![1.0; views.len()];
    let mut points = [Vector3::zeros(); 4];
    for _ in 0..ROUNDS {
        let mut off_m = vec![0.0_f64; views.len()];
        for (k, point) in points.iter_mut().enumerate() {
            // The tiny information keeps a single ray solvable.
            let (mut a, mut b) = (Matrix3::identity() * 1e-6, Vector3::zeros());
            for ((origin, directions), weight) in rays.iter().zip(&weights) {
                let across = across(&directions[k]) * *weight;
                a += across;
                b += across * origin;
            }
            *point = a.lu().solve(&b)?;
            for ((origin, directions), off) in rays.iter().zip(&mut off_m) {
                *off = off.max((across(&directions[k]) * (*point - origin)).norm());
            }
        }
        for (weight, off) in weights.iter_mut().zip(&off_m) {
            *weight = 1.0 / (1.0 + (off / HALF_WEIGHT_M).powi(2));
        }
    }
    rectangle(&points)
}

fn across(direction: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::identity() - direction * direction.transpose() / direction.norm_squared()
}

/// Direction of a pixel's ray in the camera.
fn direction(px: &Point2<f64>, camera: &CameraState) -> Vector3<f64> {
    let offset = (px - camera.centre_px) / camera.focal_px;
    let bent = Vector2::new(offset.x, offset.y / camera.aspect);
    let mut straight = bent;
    for _ in 0..UNBENDINGS {
        straight = bent / (1.0 + camera.k1 * straight.norm_squared());
    }
    Vector3::new(straight.x, straight.y, 1.0)
}

/// The upright rectangle through four corners.
fn rectangle(p: &[Vector3<f64>; 4]) -> Option<LandmarkState> {
    let right = (p[1] + p[2] - p[0] - p[3]) / 2.0;
    let up = (p[0] + p[1] - p[2] - p[3]) / 2.0;
    let side = |length: f64| length.clamp(SIDE_M[0], SIDE_M[1]).ln();
    let made = LandmarkState {
        centre: (p[0] + p[1] + p[2] + p[3]) / 4.0,
        theta_rad: (-right.x).atan2(right.y),
        tilt_rad: 0.0,
        roll_rad: 0.0,
        log_size: Vector2::new(side(right.xy().norm()), side(up.z.abs())),
    };
    made.parameters().iter().all(|v| v.is_finite()).then_some(made)
}
