//! The rectangle that one view gives on the nearest wall.

use crate::{
    placement::{
        params::{PlacementError, PlacementParams},
        rays::{self, Hit, INPUTS, MOUNTING, WALL, by_camera, by_corners_and_robot, by_robot},
        view::{CheckedView, PosedView, checked},
    },
    segments::LaserSegment,
};
use nalgebra::{Matrix4, Matrix4x2, Matrix4x3, Matrix6, SMatrix, SVector, Vector2, Vector4};
use vision::pose::{LandmarkSize, PoseError};

/// The rectangle that one view gives on its wall.
#[derive(Debug, Clone, PartialEq)]
pub struct WallRectangle {
    /// Index of the wall.
    pub wall: usize,
    /// Centre along the wall (metres from the foot of the map's origin, towards the viewer's
    /// right), height of the centre, width, height; metres.
    pub rectangle: Vector4<f64>,
    /// Covariance by the corners and the robot's pose.
    pub covariance: Matrix4<f64>,
    /// Derivative by the robot's pose, in its standard deviations.
    pub by_robot: Matrix4x3<f64>,
    /// Derivative by the extrinsics' (rotation, translation).
    pub by_mounting: SMatrix<f64, 4, 6>,
    /// Covariance of the extrinsics.
    pub mounting_covariance: Matrix6<f64>,
    /// Derivative by the intrinsics' (focal length, principal point), each in its standard
    /// deviations.
    pub by_camera: Matrix4x3<f64>,
    /// Derivative by the wall's facing angle and signed distance.
    pub by_wall: Matrix4x2<f64>,
    /// Roll, radians.
    pub roll_rad: f64,
    /// Root mean square distance of the intersections from the rectangle, metres.
    pub rms_m: f64,
}

/// The rectangle of a view on the nearest wall that all four rays meet.
pub fn view_on_wall(
    view: &PosedView<'_>,
    walls: &[LaserSegment],
    p: &PlacementParams,
) -> Result<WallRectangle, PlacementError> {
    let checked = checked(view)?;
    let (wall, hits) = nearest(&checked, walls, p)?;
    fit(&checked, wall, rays::plane(&walls[wall]).0, &hits, p)
}

/// The nearest wall that all four rays meet. Refused when the quad reaches beyond the end of a wall
/// to one behind it: a place on the wrong wall would be off by their distance.
fn nearest(
    checked: &CheckedView<'_>,
    walls: &[LaserSegment],
    p: &PlacementParams,
) -> Result<(usize, [Hit; 4]), PlacementError> {
    let mut met: Vec<(usize, [Hit; 4], f64)> = Vec::new();
    let mut partly = f64::INFINITY;
    for (i, wall) in walls.iter().enumerate() {
        let plane = rays::plane(wall);
        let found = [0, 1, 2, 3]
            .map(|c| rays::hit(checked, c, plane).filter(|h| rays::is_on(wall, &h.point, p.margin_m)));
        match found {
            [Some(a), Some(b), Some(c), Some(d)] => {
                let near = [&a, &b, &c, &d].iter().map(|h| h.distance_m).fold(f64::INFINITY, f64::min);
                met.push((i, [a, b, c, d], near));
            }
            // The end of a wall within the margin is no obstacle.
            _ => partly = partly.min(strictly(&found, wall)),
        }
    }
    // Stable: of walls at the same distance the first.
    met.sort_by(|a, b| a.2.total_cmp(&b.2));
    let behind = met.get(1).map_or(f64::INFINITY, |m| m.2);
    let (wall, hits, near) = met.into_iter().next().ok_or(PlacementError::NoWall)?;
    let overhangs = hits.iter().any(|h| !rays::is_on(&walls[wall], &h.point, 0.0));
    let other = behind.is_finite() && behind > near + p.margin_m;
    if partly < near - p.margin_m || (overhangs && other) {
        return Err(PlacementError::Straddles);
    }
    Ok((wall, hits))
}

/// Distance of the nearest intersection on the segment itself.
fn strictly(found: &[Option<Hit>; 4], wall: &LaserSegment) -> f64 {
    let on = found.iter().flatten().filter(|h| rays::is_on(wall, &h.point, 0.0));
    on.map(|h| h.distance_m).fold(f64::INFINITY, f64::min)
}

/// The upright rectangle through the intersections, by least squares with their full covariance.
fn fit(
    view: &CheckedView<'_>,
    wall: usize,
    theta: f64,
    hits: &[Hit; 4],
    p: &PlacementParams,
) -> Result<WallRectangle, PlacementError> {
    // Coordinates on the wall: along it towards the viewer's right, and up.
    let side = Vector2::new(-theta.sin(), theta.cos());
    let facing = Vector2::new(theta.cos(), theta.sin());
    let mut intersections = SVector::<f64, 8>::zeros();
    let mut by = SMatrix::<f64, 8, INPUTS>::zeros();
    for (i, hit) in hits.iter().enumerate() {
        let xy = hit.point.xy();
        (intersections[2 * i], intersections[2 * i + 1]) = (side.dot(&xy), hit.point.z);
        let mut row = side.transpose() * hit.by.fixed_rows::<2>(0);
        // The axis turns with the wall.
        row[WALL] -= facing.dot(&xy);
        by.set_row(2 * i, &row);
        by.set_row(2 * i + 1, &hit.by.row(2));
    }
    let own = by_corners_and_robot(view, &by);
    let m = by.fixed_columns::<6>(MOUNTING);
    let weight = (own + m * view.mounting.covariance * m.transpose())
        .cholesky()
        .ok_or(PoseError::Degenerate)?
        .inverse();
    let (q, gain) = rectangle(&intersections, &weight, p.roll_sigma_rad).ok_or(PoseError::Degenerate)?;
    let rms_m = ((intersections - corners_of(&q)).norm_squared() / 4.0).sqrt();
    let possible = |v: f64| (LandmarkSize::MIN_M..=LandmarkSize::MAX_M).contains(&v);
    if rms_m > p.max_rms_m || q[4].abs() > p.max_roll_rad || !possible(q[2]) || !possible(q[3]) {
        return Err(PlacementError::NotOnWall { rms_m, roll_rad: q[4] });
    }
    let gain = gain.fixed_rows::<4>(0).into_owned();
    Ok(WallRectangle {
        wall,
        rectangle: q.fixed_rows::<4>(0).into_owned(),
        covariance: gain * own * gain.transpose(),
        by_robot: gain * by_robot(view, &by),
        by_mounting: gain * m,
        mounting_covariance: view.mounting.covariance,
        by_camera: gain * by_camera(view, &by),
        by_wall: gain * by.fixed_columns::<2>(WALL),
        roll_rad: q[4],
        rms_m,
    })
}

/// Corners TL, TR, BR, BL (along, up) of a rectangle (centre along, centre height, width, height,
/// roll).
fn corners_of(q: &SVector<f64, 5>) -> SVector<f64, 8> {
    let (s, c) = q[4].sin_cos();
    let mut made = SVector::<f64, 8>::zeros();
    for (i, (y, z)) in [(-0.5, 0.5), (0.5, 0.5), (0.5, -0.5), (-0.5, -0.5)].iter().enumerate() {
        let (y, z) = (y * q[2], z * q[3]);
        (made[2 * i], made[2 * i + 1]) = (q[0] + c * y - s * z, q[1] + s * y + c * z);
    }
    made
}

/// Weighted least squares over the rectangle, with a prior on its roll; with the gain from
/// intersections to rectangle.
fn rectangle(
    intersections: &SVector<f64, 8>,
    weight: &SMatrix<f64, 8, 8>,
    roll_sigma_rad: f64,
) -> Option<(SVector<f64, 5>, SMatrix<f64, 5, 8>)> {
    /// Steps: the problem is linear but for the roll.
    const STEPS: usize = 5;
    let mean = |k: usize| {
        (intersections[k] + intersections[k + 2] + intersections[k + 4] + intersections[k + 6]) / 4.0
    };
    let width = 0.5 * (intersections[2] - intersections[0] + intersections[4] - intersections[6]);
    let height = 0.5 * (intersections[1] - intersections[7] + intersections[3] - intersections[5]);
    let mut q = SVector::<f64, 5>::from([mean(0), mean(1), width, height, 0.0]);
    let mut gain = SMatrix::<f64, 5, 8>::zeros();
    for _ in 0..STEPS {
        let (s, c) = q[4].sin_cos();
        let mut j = SMatrix::<f64, 8, 5>::zeros();
        for (i, (y, z)) in [(-0.5, 0.5), (0.5, 0.5), (0.5, -0.5), (-0.5, -0.5)].into_iter().enumerate() {
            let (wide, high) = (y * q[2], z * q[3]);
            let rows = [
                [1.0, 0.0, c * y, -s * z, -s * wide - c * high],
                [0.0, 1.0, s * y, c * z, c * wide - s * high],
            ];
            j.row_mut(2 * i).copy_from_slice(&rows[0]);
            j.row_mut(2 * i + 1).copy_from_slice(&rows[1]);
        }
        let mut h = j.transpose() * weight * j;
        let level = 1.0 / roll_sigma_rad.max(1e-6).powi(2);
        h[(4, 4)] += level;
        let inverse = h.cholesky()?.inverse();
        gain = inverse * j.transpose() * weight;
        let mut g = j.transpose() * weight * (intersections - corners_of(&q));
        g[4] -= level * q[4];
        q += inverse * g;
    }
    q.iter().all(|v| v.is_finite()).then_some((q, gain))
}
