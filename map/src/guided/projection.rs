//! Corners of a landmark in an image as it comes, lens included, with their derivatives; the part
//! that the image shows.

use super::joint::{ByCommon, CornerVector};
use crate::{extrinsics::CameraExtrinsics, localise::predict, place::LandmarkPlace, pose2::Pose2};
use nalgebra::{Isometry3, Matrix2, Point2, Point3, SMatrix, Vector3};
use vision::{
    frame::{Distortion, Intrinsics, MAX_RAY_RAD},
    pose::reprojection::{MIN_DEPTH_M, corner_points},
};

/// A lens describes a point if undoing it gives that point back within this, px.
const SAME_PX: f64 = 1e-3;

/// Extrinsics and intrinsics.
#[derive(Clone, Copy)]
pub(super) struct Camera<'a> {
    pub mounting: &'a CameraExtrinsics,
    pub intrinsics: &'a Intrinsics,
}

impl Camera<'_> {
    /// Camera coordinates of map points for a robot pose.
    pub(super) fn camera_from_map(&self, pose: &Pose2) -> Isometry3<f64> {
        (pose.to_isometry3() * self.mounting.robot_from_camera).inverse()
    }
}

/// Corners of a landmark in the map, metres.
pub(super) fn corners_m(place: &LandmarkPlace) -> [Point3<f64>; 4] {
    let map_from_landmark = place.map_from_landmark();
    corner_points(&place.size).map(|corner| map_from_landmark * Point3::from(corner))
}

fn camera_from_landmark(pose: &Pose2, place: &LandmarkPlace, camera: &Camera<'_>) -> Isometry3<f64> {
    camera.camera_from_map(pose) * place.map_from_landmark()
}

/// Image corners by the common errors, and by the place.
pub(super) fn derivatives(
    pose: &Pose2,
    place: &LandmarkPlace,
    camera: &Camera<'_>,
    corners_px: &[Point2<f64>; 4],
) -> Option<(ByCommon, SMatrix<f64, 8, 6>)> {
    let Camera { mounting, intrinsics } = *camera;
    let pinhole = predict::corners(pose, place, mounting, intrinsics)?;
    let camera_from_landmark = camera_from_landmark(pose, place, camera);
    let mut by_common = ByCommon::zeros();
    let mut by_place = SMatrix::<f64, 8, 6>::zeros();
    for (c, point) in corner_points(&place.size).iter().enumerate() {
        let straight = camera_from_landmark * Point3::from(*point);
        let straight = Point2::new(straight.x / straight.z, straight.y / straight.z);
        let focal = Matrix2::new(intrinsics.fx_px, 0.0, 0.0, intrinsics.fy_px);
        let back = Matrix2::new(1.0 / intrinsics.fx_px, 0.0, 0.0, 1.0 / intrinsics.fy_px);
        let lens = focal * intrinsics.distortion.distort(&straight).by_straight * back;
        let row = 2 * c;
        by_common.fixed_view_mut::<2, 3>(row, 0).copy_from(&(lens * pinhole.pose.fixed_rows::<2>(row)));
        by_common.fixed_view_mut::<2, 6>(row, 3).copy_from(&(lens * pinhole.mounting.fixed_rows::<2>(row)));
        // A longer focal length moves a corner away from the principal point.
        by_common[(row, 9)] = corners_px[c].x - intrinsics.cx_px;
        by_common[(row + 1, 9)] = corners_px[c].y - intrinsics.cy_px;
        by_common.fixed_view_mut::<2, 2>(row, 10).fill_with_identity();
        by_place.fixed_rows_mut::<2>(row).copy_from(&(lens * pinhole.place.fixed_rows::<2>(row)));
    }
    Some((by_common, by_place))
}

/// Image corners from a pose, px. `None` when one is behind the camera or beyond what the lens
/// model describes.
pub(super) fn corners(pose: &Pose2, place: &LandmarkPlace, camera: &Camera<'_>) -> Option<[Point2<f64>; 4]> {
    project(&camera.camera_from_map(pose), &corners_m(place), camera.intrinsics)
}

/// Pixels of four points of the map, as [`corners`].
pub(super) fn project(
    camera_from_map: &Isometry3<f64>,
    points_m: &[Point3<f64>; 4],
    camera: &Intrinsics,
) -> Option<[Point2<f64>; 4]> {
    let mut px = [Point2::origin(); 4];
    for (px, point) in px.iter_mut().zip(points_m) {
        let p = camera_from_map * point;
        if p.z.is_nan() || p.z <= MIN_DEPTH_M || p.x.hypot(p.y).atan2(p.z) > MAX_RAY_RAD {
            return None;
        }
        *px = camera.project(&p.coords);
        let describes = camera.distortion == Distortion::None
            || camera.undistort(px).is_some_and(|straight| {
                let expected = Point2::new(
                    camera.fx_px * p.x / p.z + camera.cx_px,
                    camera.fy_px * p.y / p.z + camera.cy_px,
                );
                (straight - expected).norm() <= SAME_PX
            });
        if !describes || !px.x.is_finite() || !px.y.is_finite() {
            return None;
        }
    }
    Some(px)
}

pub(super) fn corner_vector(corners_px: &[Point2<f64>; 4]) -> CornerVector {
    CornerVector::from_fn(|i, _| corners_px[i / 2][i % 2])
}

pub(super) fn shortest_side_px(corners_px: &[Point2<f64>; 4]) -> f64 {
    (0..4).map(|i| (corners_px[(i + 1) % 4] - corners_px[i]).norm()).fold(f64::INFINITY, f64::min)
}

/// The part of a convex polygon inside the image domain `[-1/2, W - 1/2] x [-1/2, H - 1/2]`.
pub(super) fn clipped(polygon_px: &[Point2<f64>], [width, height]: [f64; 2]) -> Vec<Point2<f64>> {
    let border = [
        Vector3::new(1.0, 0.0, 0.5),
        Vector3::new(-1.0, 0.0, width - 0.5),
        Vector3::new(0.0, 1.0, 0.5),
        Vector3::new(0.0, -1.0, height - 0.5),
    ];
    let mut part = polygon_px.to_vec();
    for line in border {
        let inside = |p: &Point2<f64>| line.x * p.x + line.y * p.y + line.z;
        let mut next = Vec::with_capacity(part.len() + 1);
        for (i, to) in part.iter().enumerate() {
            let from = part[(i + part.len() - 1) % part.len()];
            let (a, b) = (inside(&from), inside(to));
            if (a < 0.0) != (b < 0.0) {
                next.push(from + (to - from) * (a / (a - b)));
            }
            if b >= 0.0 {
                next.push(*to);
            }
        }
        part = next;
    }
    part
}
