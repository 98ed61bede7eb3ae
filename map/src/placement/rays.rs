//! Intersections of corner rays with a wall or a ceiling, and their derivatives by all uncertain
//! inputs (method 11.3).

use crate::{placement::view::CheckedView, segments::LaserSegment};
use nalgebra::{Matrix3, SMatrix, Vector2, Vector3};

/// Columns of the derivatives: 8 corner coordinates, robot (x, y, theta), mounting (rotation,
/// translation), wall (facing angle, signed distance from the map's origin along the facing
/// normal).
const CORNERS: usize = 0;
pub(super) const ROBOT: usize = 8;
pub(super) const MOUNTING: usize = 11;
pub(super) const WALL: usize = 17;
pub(super) const INPUTS: usize = 19;
/// Smallest cosine of the angle between ray and wall normal: 80 degrees of incidence.
pub const MIN_COS_INCIDENCE: f64 = 0.17;

/// Intersection of a ray with the plane of a wall or ceiling.
pub(super) struct Hit {
    /// The intersection, map frame, metres.
    pub point: Vector3<f64>,
    /// Distance from the camera, metres.
    pub distance_m: f64,
    /// Derivative by all inputs.
    pub by: SMatrix<f64, 3, INPUTS>,
}

/// Facing angle and signed distance of a wall from the map's origin.
pub(super) fn plane(wall: &LaserSegment) -> (f64, f64) {
    let f = wall.facing();
    (f.y.atan2(f.x), f.dot(&wall.a.coords))
}

/// An intersection with its ray.
struct Cast {
    hit: Hit,
    ray: Vector3<f64>,
    /// Scalar product of normal and ray.
    along: f64,
}

/// Intersection of the ray of corner `i` with a wall; `None` when the ray leaves the wall, grazes
/// it, or comes from behind.
pub(super) fn hit(view: &CheckedView<'_>, i: usize, (theta, r): (f64, f64)) -> Option<Hit> {
    let Cast { mut hit, ray, along } = cast(view, i, &Vector3::new(theta.cos(), theta.sin(), 0.0), r)?;
    let side = Vector3::new(-theta.sin(), theta.cos(), 0.0);
    hit.by.set_column(WALL, &(-ray * (side.dot(&hit.point) / along)));
    hit.by.set_column(WALL + 1, &(ray / along));
    hit.by.iter().all(|v| v.is_finite()).then_some(hit)
}

/// Intersection of the ray of corner `i` with the ceiling at `height_m`, with its derivative by
/// that height in column [`WALL`].
pub(super) fn ceiling_hit(view: &CheckedView<'_>, i: usize, height_m: f64) -> Option<Hit> {
    let Cast { mut hit, ray, along } = cast(view, i, &-Vector3::z(), -height_m)?;
    hit.by.set_column(WALL, &(-ray / along));
    hit.by.iter().all(|v| v.is_finite()).then_some(hit)
}

/// Intersection of the ray of corner `i` with the plane of facing normal `n` and offset `r`, with
/// the derivatives by all inputs but the plane.
fn cast(view: &CheckedView<'_>, i: usize, n: &Vector3<f64>, r: f64) -> Option<Cast> {
    let robot = view.map_from_robot.pose.to_isometry3();
    let robot_turn = robot.rotation.to_rotation_matrix().into_inner();
    let camera = robot * view.mounting.robot_from_camera;
    let turn: Matrix3<f64> = camera.rotation.to_rotation_matrix().into_inner();
    let (c, k) = (camera.translation.vector, &view.camera);
    let px = view.corners_px.points()[i];
    let ray = Vector3::new((px.x - k.cx_px) / k.fx_px, (px.y - k.cy_px) / k.fy_px, 1.0);
    let d = turn * ray;
    let along = n.dot(&d);
    // The camera is on the free side: the ray runs against the facing normal.
    if -along / d.norm() <= MIN_COS_INCIDENCE || n.dot(&c) <= r {
        return None;
    }
    let s = (r - n.dot(&c)) / along;
    let point = c + d * s;
    let a = Matrix3::identity() - d * n.transpose() / along;
    let mut by = SMatrix::<f64, 3, INPUTS>::zeros();
    by.set_column(CORNERS + 2 * i, &(a * turn.column(0) * (s / k.fx_px)));
    by.set_column(CORNERS + 2 * i + 1, &(a * turn.column(1) * (s / k.fy_px)));
    // A left rotation phi of the camera in the map moves the hit by -s A [d]x phi; its centre's
    // shift by A.
    let by_turn = -(a * d.cross_matrix()) * s;
    by.set_column(ROBOT, &a.column(0));
    by.set_column(ROBOT + 1, &a.column(1));
    let arm = c - robot.translation.vector;
    by.set_column(ROBOT + 2, &(by_turn * Vector3::z() + a * Vector3::z().cross(&arm)));
    by.fixed_columns_mut::<3>(MOUNTING).copy_from(&(by_turn * robot_turn));
    by.fixed_columns_mut::<3>(MOUNTING + 3).copy_from(&(a * robot_turn));
    let finite = point.iter().chain(by.iter()).all(|v| v.is_finite());
    finite.then(|| Cast { hit: Hit { point, distance_m: s * d.norm(), by }, ray: d, along })
}

/// Whether an intersection lies on the wall's segment, extended by `margin_m` at both ends.
pub(super) fn is_on(wall: &LaserSegment, point: &Vector3<f64>, margin_m: f64) -> bool {
    let u = wall.direction().dot(&(Vector2::new(point.x, point.y) - wall.a.coords));
    (-margin_m..=wall.length_m() + margin_m).contains(&u)
}

/// Covariance of the intersections by corners and robot pose.
pub(super) fn by_corners_and_robot(
    view: &CheckedView<'_>,
    by: &SMatrix<f64, 8, INPUTS>,
) -> SMatrix<f64, 8, 8> {
    let mut sum = SMatrix::<f64, 8, 8>::zeros();
    for (i, covariance) in view.covariance_px2.iter().enumerate() {
        let j = by.fixed_columns::<2>(CORNERS + 2 * i);
        sum += j * covariance * j.transpose();
    }
    let j = by.fixed_columns::<3>(ROBOT);
    sum + j * view.map_from_robot.covariance * j.transpose()
}

/// Derivative of the intersections by the robot pose's errors, each of one standard deviation.
pub(super) fn by_robot(view: &CheckedView<'_>, by: &SMatrix<f64, 8, INPUTS>) -> SMatrix<f64, 8, 3> {
    let root = view.map_from_robot.covariance.cholesky().map_or_else(Matrix3::zeros, |c| c.l());
    by.fixed_columns::<3>(ROBOT) * root
}

/// Derivative of the intersections by the intrinsics' errors, each of one standard deviation. They
/// have no part in the weights: a residual of one view must not correct the camera, since it shows
/// that an object is not on the wall.
pub(super) fn by_camera(view: &CheckedView<'_>, by: &SMatrix<f64, 8, INPUTS>) -> SMatrix<f64, 8, 3> {
    let corners = view.by_camera.iter().enumerate();
    // An error of the intrinsics moves the ray through the measured corner.
    let moved: SMatrix<f64, 8, 3> =
        corners.map(|(i, by_camera)| by.fixed_columns::<2>(CORNERS + 2 * i) * by_camera).sum();
    moved * Matrix3::from_diagonal(&view.camera.error_sigmas())
}
