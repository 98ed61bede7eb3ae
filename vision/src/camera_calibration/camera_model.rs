//! Parameter vector of the camera and all poses; the projection of a point with its derivatives.

use crate::pose::reprojection::{MIN_DEPTH_M, perturbed};
use nalgebra::{Isometry3, Matrix2, Matrix2x3, Point2, SMatrix, Vector2, Vector3, Vector6};

/// Number of parameters that all views share, in order: focal length, `fy / fx`, principal point,
/// radial coefficients, log of the plane's height over width divided by the stated ratio, height of
/// the camera over the plane's origin.
pub(crate) const CAMERA: usize = 8;

pub(crate) const ALPHA: usize = 0;

pub(crate) const PIXEL_ASPECT: usize = 1;

pub(crate) const U0: usize = 2;

pub(crate) const V0: usize = 3;

pub(crate) const K1: usize = 4;

pub(crate) const K2: usize = 5;

pub(crate) const POSTER: usize = 6;

pub(crate) const HEIGHT: usize = 7;

#[derive(Debug, Clone)]
pub(crate) struct State {
    pub camera: [f64; CAMERA],
    pub poses: Vec<Isometry3<f64>>,
}

pub(crate) struct Point {
    pub(crate) plane: Point2<f64>,
    pub(crate) seen: Point2<f64>,
    /// `W^T W = covariance^-1`.
    pub(crate) weight: Matrix2<f64>,
}

/// A point's pixel with its derivatives.
pub(crate) struct ProjectedPoint {
    pub(crate) px: Point2<f64>,
    pub(crate) by_pose: SMatrix<f64, 2, 6>,
    pub(crate) by_shared: SMatrix<f64, 2, CAMERA>,
}

pub(crate) fn moved(pose: &Isometry3<f64>, step: &Vector6<f64>) -> Isometry3<f64> {
    perturbed(pose, &step.fixed_rows::<3>(0).into(), &step.fixed_rows::<3>(3).into())
}

pub(crate) fn view_chi2(view: &[Point], pose: &Isometry3<f64>, state: &State) -> f64 {
    let mut sum = 0.0;
    for point in view {
        let Some(px) = pixel(point, pose, &state.camera) else { return f64::INFINITY };
        sum += (point.weight * (point.seen - px)).norm_squared();
    }
    if sum.is_nan() { f64::INFINITY } else { sum }
}

/// A point of the plane in the camera frame, and its lever arm for rotations.
fn placed(point: &Point, pose: &Isometry3<f64>, poster: f64) -> (Vector3<f64>, Vector3<f64>) {
    let arm = pose.rotation * Vector3::new(0.0, point.plane.x, point.plane.y * poster.exp());
    (arm, arm + pose.translation.vector)
}

pub(crate) fn pixel(point: &Point, pose: &Isometry3<f64>, c: &[f64; CAMERA]) -> Option<Point2<f64>> {
    let (_, p) = placed(point, pose, c[POSTER]);
    let (x, y) = (p.x / p.z, p.y / p.z);
    let r2 = x * x + y * y;
    let g = 1.0 + r2 * (c[K1] + r2 * c[K2]);
    let made = Point2::new(c[ALPHA] * g * x + c[U0], c[ALPHA] * c[PIXEL_ASPECT] * g * y + c[V0]);
    (p.z > MIN_DEPTH_M).then_some(made)
}

pub(crate) fn projected(point: &Point, pose: &Isometry3<f64>, c: &[f64; CAMERA]) -> Option<ProjectedPoint> {
    let px = pixel(point, pose, c)?;
    let (arm, p) = placed(point, pose, c[POSTER]);
    let inverse = 1.0 / p.z;
    let (x, y) = (p.x * inverse, p.y * inverse);
    let r2 = x * x + y * y;
    let (g, dg) = (1.0 + r2 * (c[K1] + r2 * c[K2]), c[K1] + 2.0 * r2 * c[K2]);
    let (fx, fy) = (c[ALPHA], c[ALPHA] * c[PIXEL_ASPECT]);
    let bend = Matrix2::new(g + 2.0 * x * x * dg, 2.0 * x * y * dg, 2.0 * x * y * dg, g + 2.0 * y * y * dg);
    let perspective = Matrix2x3::new(1.0, 0.0, -x, 0.0, 1.0, -y) * inverse;
    let by_point = Matrix2::new(fx, 0.0, 0.0, fy) * bend * perspective;
    let mut by_pose = SMatrix::<f64, 2, 6>::zeros();
    by_pose.fixed_columns_mut::<3>(0).copy_from(&(by_point * -arm.cross_matrix()));
    by_pose.fixed_columns_mut::<3>(3).copy_from(&by_point);
    let mut by_shared = SMatrix::<f64, 2, CAMERA>::zeros();
    by_shared.set_column(ALPHA, &Vector2::new(g * x, c[PIXEL_ASPECT] * g * y));
    by_shared.set_column(PIXEL_ASPECT, &Vector2::new(0.0, fx * g * y));
    by_shared.set_column(U0, &Vector2::x());
    by_shared.set_column(V0, &Vector2::y());
    by_shared.set_column(K1, &(Vector2::new(fx * x, fy * y) * r2));
    by_shared.set_column(K2, &(Vector2::new(fx * x, fy * y) * (r2 * r2)));
    let higher = pose.rotation * Vector3::new(0.0, 0.0, point.plane.y * c[POSTER].exp());
    by_shared.set_column(POSTER, &(by_point * higher));
    Some(ProjectedPoint { px, by_pose, by_shared })
}
