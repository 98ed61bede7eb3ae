//! A landmark's place from views of it: corner rays meet a wall, an upright rectangle is fitted (method 11).
//!
//! In: corners with covariance, the robot's pose at capture, the mounting, the walls. Out: place and size with their
//! covariance, or why the thing does not hang on a wall. Recognition is not its business: all views must be of one
//! thing.

mod ceiling;
mod rays;
pub use ceiling::{Ceiling, ViewOnCeiling, ceiling_placement, view_on_ceiling};
pub use rays::MIN_COS_INCIDENCE;

use crate::{
    check::OutOfRange, mounting::Mounting, place::LandmarkPlace, pose2::Pose2Covariance,
    segments::LaserSegment,
};
use nalgebra::{
    DMatrix, Matrix2, Matrix2x3, Matrix3, Matrix4, Matrix4x2, Matrix4x3, Matrix6, SMatrix, SVector, Vector2,
    Vector4,
};
use rays::{CORNERS, Hit, INPUTS, MOUNTING, ROBOT, WALL};
use serde::{Deserialize, Serialize};
use vision::{
    frame::Intrinsics,
    geometry::Corners,
    pose::{LandmarkSize, PoseError, UndistortedCorners, straightened},
};

/// Most views fused into one place; later ones are ignored.
pub const MAX_VIEWS: usize = 256;

/// Knobs of placing.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PlacingParams {
    /// A hit may lie this far beyond the end of a wall's segment, metres.
    pub margin_m: f64,
    /// Largest root mean square distance of the hits from an upright rectangle, metres.
    pub max_rms_m: f64,
    /// Largest roll, radians.
    pub max_roll_rad: f64,
    /// How level things are hung: standard deviation of the roll, radians.
    pub roll_sigma_rad: f64,
    /// Gate on a further view, 99 % of chi2 with 4 degrees of freedom.
    pub gate_chi2: f64,
    /// Inflation of the covariance of several views, for errors they share (method 11.5).
    pub inflation: f64,
}

impl Default for PlacingParams {
    fn default() -> Self {
        Self {
            margin_m: 0.3,
            max_rms_m: 0.05,
            max_roll_rad: 5.0_f64.to_radians(),
            roll_sigma_rad: 0.5_f64.to_radians(),
            gate_chi2: 13.277,
            inflation: 2.0,
        }
    }
}

/// Why a quad has no place.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PlacingError {
    /// A pose, mounting or wall is out of range.
    #[error(transparent)]
    OutOfRange(#[from] OutOfRange),
    /// Corners, covariance or camera are unusable.
    #[error(transparent)]
    Corners(#[from] PoseError),
    /// No wall is met by all four rays.
    #[error("no wall is met by all four corners")]
    NoWall,
    /// A nearer wall is met by some rays only.
    #[error("the quad reaches over the end of a wall")]
    Straddles,
    /// The hits are not an upright rectangle of possible size: an open door, a board on an easel, another wall.
    #[error("not on this wall: no upright rectangle (rms {rms_m:.3} m, roll {roll_rad:.3} rad)")]
    NotOnWall {
        /// Distance of the hits from the rectangle.
        rms_m: f64,
        /// Its roll.
        roll_rad: f64,
    },
    /// The hits are no rectangle of possible size under this ceiling.
    #[error("not under this ceiling: no rectangle (rms {rms_m:.3} m)")]
    NotOnCeiling {
        /// Distance of the hits from the rectangle.
        rms_m: f64,
    },
    /// No view given, or they lie on different walls.
    #[error("the views do not share a wall")]
    NoView,
}

/// One look at a quad.
#[derive(Debug, Clone)]
pub struct PlacingView<'a> {
    /// Corners as seen, in the landmark's order.
    pub corners: &'a Corners,
    /// Their covariance.
    pub covariance_px2: &'a [Matrix2<f64>; 4],
    /// The camera.
    pub camera: &'a Intrinsics,
    /// The robot at capture.
    pub map_from_robot: &'a Pose2Covariance,
    /// Where the camera sits.
    pub mounting: &'a Mounting,
}

/// Checked and undistorted.
struct WallSighting<'a> {
    corners_px: Corners,
    covariance_px2: [Matrix2<f64>; 4],
    camera: Intrinsics,
    by_camera: [Matrix2x3<f64>; 4],
    map_from_robot: &'a Pose2Covariance,
    mounting: &'a Mounting,
}

/// The rectangle that one view gives on its wall.
#[derive(Debug, Clone, PartialEq)]
pub struct ViewOnWall {
    /// Index of the wall.
    pub wall: usize,
    /// Centre along the wall (m, from the foot of the map's origin, towards the viewer's right), height of the centre,
    /// width, height.
    pub rectangle: Vector4<f64>,
    /// What is new in every view: corners and robot pose.
    pub covariance: Matrix4<f64>,
    /// By the mounting's (rotation, translation).
    pub by_mounting: SMatrix<f64, 4, 6>,
    /// Covariance of the mounting.
    pub mounting_covariance: Matrix6<f64>,
    /// By the camera's (focal length, principal point), each in its standard deviations.
    pub by_camera: Matrix4x3<f64>,
    /// By the wall's facing angle and signed distance.
    pub by_wall: Matrix4x2<f64>,
    /// Roll.
    pub roll_rad: f64,
    /// Distance of the hits from the rectangle.
    pub rms_m: f64,
}

/// The place that several views agree on.
#[derive(Debug, Clone, PartialEq)]
pub struct Placement {
    /// Place and size.
    pub place: LandmarkPlace,
    /// Indices of the views that passed the gate.
    pub used: Vec<usize>,
}

/// The rectangle a view gives on the nearest wall that all four corners meet.
pub fn view_on_wall(
    view: &PlacingView<'_>,
    walls: &[LaserSegment],
    p: &PlacingParams,
) -> Result<ViewOnWall, PlacingError> {
    let sighting = checked(view)?;
    let (wall, hits) = nearest(&sighting, walls, p)?;
    fit(&sighting, wall, rays::plane(&walls[wall]).0, &hits, p)
}

fn checked<'a>(view: &PlacingView<'a>) -> Result<WallSighting<'a>, PlacingError> {
    view.map_from_robot.check()?;
    view.mounting.check()?;
    let UndistortedCorners { corners_px, covariance_px2, camera, by_camera } =
        straightened(view.corners, view.covariance_px2, view.camera)?;
    let (map_from_robot, mounting) = (view.map_from_robot, view.mounting);
    Ok(WallSighting { corners_px, covariance_px2, camera, by_camera, map_from_robot, mounting })
}

/// The nearest wall that all four rays meet. Refused when the quad reaches over the end of a wall to one behind it: a
/// place on the wrong one would be off by their distance.
fn nearest(
    sighting: &WallSighting<'_>,
    walls: &[LaserSegment],
    p: &PlacingParams,
) -> Result<(usize, [Hit; 4]), PlacingError> {
    let mut met: Vec<(usize, [Hit; 4], f64)> = Vec::new();
    let mut partly = f64::INFINITY;
    for (i, wall) in walls.iter().enumerate() {
        let plane = rays::plane(wall);
        let found = [0, 1, 2, 3]
            .map(|c| rays::hit(sighting, c, plane).filter(|h| rays::is_on(wall, &h.point, p.margin_m)));
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
    let (wall, hits, near) = met.into_iter().next().ok_or(PlacingError::NoWall)?;
    let overhangs = hits.iter().any(|h| !rays::is_on(&walls[wall], &h.point, 0.0));
    let other = behind.is_finite() && behind > near + p.margin_m;
    if partly < near - p.margin_m || (overhangs && other) {
        return Err(PlacingError::Straddles);
    }
    Ok((wall, hits))
}

/// Distance of the nearest hit that lies on the segment itself.
fn strictly(found: &[Option<Hit>; 4], wall: &LaserSegment) -> f64 {
    let on = found.iter().flatten().filter(|h| rays::is_on(wall, &h.point, 0.0));
    on.map(|h| h.distance_m).fold(f64::INFINITY, f64::min)
}

/// The upright rectangle through the hits, by least squares weighed with their whole covariance.
fn fit(
    view: &WallSighting<'_>,
    wall: usize,
    theta: f64,
    hits: &[Hit; 4],
    p: &PlacingParams,
) -> Result<ViewOnWall, PlacingError> {
    // Along the wall and up; y is the viewer's right.
    let side = Vector2::new(-theta.sin(), theta.cos());
    let facing = Vector2::new(theta.cos(), theta.sin());
    let mut seen = SVector::<f64, 8>::zeros();
    let mut by = SMatrix::<f64, 8, INPUTS>::zeros();
    for (i, hit) in hits.iter().enumerate() {
        let xy = hit.point.xy();
        (seen[2 * i], seen[2 * i + 1]) = (side.dot(&xy), hit.point.z);
        let mut row = side.transpose() * hit.by.fixed_rows::<2>(0);
        // The axis turns with the wall.
        row[WALL] -= facing.dot(&xy);
        by.set_row(2 * i, &row);
        by.set_row(2 * i + 1, &hit.by.row(2));
    }
    let independent = new_in_each_view(view, &by);
    let m = by.fixed_columns::<6>(MOUNTING);
    let weight = (independent + m * view.mounting.covariance * m.transpose())
        .cholesky()
        .ok_or(PoseError::Degenerate)?
        .inverse();
    let (q, gain) = rectangle(&seen, &weight, p.roll_sigma_rad).ok_or(PoseError::Degenerate)?;
    let rms_m = ((seen - corners_of(&q)).norm_squared() / 4.0).sqrt();
    let possible = |v: f64| (LandmarkSize::MIN_M..=LandmarkSize::MAX_M).contains(&v);
    if rms_m > p.max_rms_m || q[4].abs() > p.max_roll_rad || !possible(q[2]) || !possible(q[3]) {
        return Err(PlacingError::NotOnWall { rms_m, roll_rad: q[4] });
    }
    let gain = gain.fixed_rows::<4>(0).into_owned();
    Ok(ViewOnWall {
        wall,
        rectangle: q.fixed_rows::<4>(0).into_owned(),
        covariance: gain * independent * gain.transpose(),
        by_mounting: gain * m,
        mounting_covariance: view.mounting.covariance,
        by_camera: gain * by_camera(view, &by),
        by_wall: gain * by.fixed_columns::<2>(WALL),
        roll_rad: q[4],
        rms_m,
    })
}

/// Covariance of the hits on the wall from corners and robot pose.
fn new_in_each_view(view: &WallSighting<'_>, by: &SMatrix<f64, 8, INPUTS>) -> SMatrix<f64, 8, 8> {
    let mut sum = SMatrix::<f64, 8, 8>::zeros();
    for (i, covariance) in view.covariance_px2.iter().enumerate() {
        let j = by.fixed_columns::<2>(CORNERS + 2 * i);
        sum += j * covariance * j.transpose();
    }
    let j = by.fixed_columns::<3>(ROBOT);
    sum + j * view.map_from_robot.covariance * j.transpose()
}

/// How the hits move with the camera's errors, each of one standard deviation. It has no part in the weights: one view's
/// departure from a rectangle is no ground to correct the camera, and is what tells that a thing is not on the wall.
fn by_camera(view: &WallSighting<'_>, by: &SMatrix<f64, 8, INPUTS>) -> SMatrix<f64, 8, 3> {
    let corners = view.by_camera.iter().enumerate();
    // What the camera has wrong is wrong with the ray through the corner where it was seen.
    let moved: SMatrix<f64, 8, 3> =
        corners.map(|(i, by_camera)| by.fixed_columns::<2>(CORNERS + 2 * i) * by_camera).sum();
    moved * Matrix3::from_diagonal(&view.camera.error_sigmas())
}

/// Corners TL, TR, BR, BL (along, up) of a rectangle (centre along, centre height, width, height, roll).
fn corners_of(q: &SVector<f64, 5>) -> SVector<f64, 8> {
    let (s, c) = q[4].sin_cos();
    let mut made = SVector::<f64, 8>::zeros();
    for (i, (y, z)) in [(-0.5, 0.5), (0.5, 0.5), (0.5, -0.5), (-0.5, -0.5)].iter().enumerate() {
        let (y, z) = (y * q[2], z * q[3]);
        (made[2 * i], made[2 * i + 1]) = (q[0] + c * y - s * z, q[1] + s * y + c * z);
    }
    made
}

/// Weighted least squares over the rectangle, its roll held by how level things hang; with the gain from hits to it.
fn rectangle(
    seen: &SVector<f64, 8>,
    weight: &SMatrix<f64, 8, 8>,
    roll_sigma_rad: f64,
) -> Option<(SVector<f64, 5>, SMatrix<f64, 5, 8>)> {
    /// Steps: the problem is linear but for the roll.
    const STEPS: usize = 5;
    let mean = |k: usize| (seen[k] + seen[k + 2] + seen[k + 4] + seen[k + 6]) / 4.0;
    let width = 0.5 * (seen[2] - seen[0] + seen[4] - seen[6]);
    let height = 0.5 * (seen[1] - seen[7] + seen[3] - seen[5]);
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
        let mut g = j.transpose() * weight * (seen - corners_of(&q));
        g[4] -= level * q[4];
        q += inverse * g;
    }
    q.iter().all(|v| v.is_finite()).then_some((q, gain))
}

/// Fuses views of one thing on one wall. The seed is the view that most others agree with; what leaves the gate is
/// left out.
pub fn placement(
    views: &[ViewOnWall],
    walls: &[LaserSegment],
    p: &PlacingParams,
) -> Result<Placement, PlacingError> {
    let views = &views[..views.len().min(MAX_VIEWS)];
    let agree = |a: &ViewOnWall, b: &ViewOnWall| {
        let d = a.rectangle - b.rectangle;
        let s = (total(a) + total(b)).cholesky();
        a.wall == b.wall && s.is_some_and(|s| d.dot(&s.solve(&d)) <= p.gate_chi2)
    };
    let votes = |i: usize| views.iter().filter(|v| agree(&views[i], v)).count();
    // Ties: the first.
    let seed =
        (0..views.len()).max_by_key(|&i| (votes(i), std::cmp::Reverse(i))).ok_or(PlacingError::NoView)?;
    let wall = walls.get(views[seed].wall).ok_or(PlacingError::NoView)?;
    let used: Vec<usize> = (0..views.len()).filter(|&i| agree(&views[seed], &views[i])).collect();
    let chosen: Vec<&ViewOnWall> = used.iter().map(|&i| &views[i]).collect();
    let place = fused(&chosen, wall, p).ok_or(PlacingError::NoView)?;
    place.check()?;
    Ok(Placement { place, used })
}

/// Covariance of a view with the wall fixed.
fn total(v: &ViewOnWall) -> Matrix4<f64> {
    let mounting = v.by_mounting * v.mounting_covariance * v.by_mounting.transpose();
    v.covariance + mounting + v.by_camera * v.by_camera.transpose()
}

/// Information form with the wall fixed; mounting, camera and wall move all views alike and are added once, at the end.
fn fused(views: &[&ViewOnWall], wall: &LaserSegment, p: &PlacingParams) -> Option<LandmarkPlace> {
    let mut information = Matrix4::zeros();
    for v in views {
        information += v.covariance.try_inverse()?;
    }
    let mean = information.cholesky()?.inverse();
    let (mut rectangle, mut by_mounting, mut by_wall) =
        (Vector4::zeros(), SMatrix::<f64, 4, 6>::zeros(), Matrix4x2::zeros());
    let (mut by_camera, mut roll_rad, n) = (Matrix4x3::zeros(), 0.0, views.len() as f64);
    for v in views {
        let share = mean * v.covariance.try_inverse()?;
        rectangle += share * v.rectangle;
        by_mounting += share * v.by_mounting;
        by_camera += share * v.by_camera;
        by_wall += share * v.by_wall;
        roll_rad += v.roll_rad / n;
    }
    let inflation = if views.len() > 1 { p.inflation } else { 1.0 };
    let shared = by_mounting * views[0].mounting_covariance * by_mounting.transpose()
        + by_camera * by_camera.transpose();
    let (theta, r) = rays::plane(wall);
    let (facing, side) = (Vector2::new(theta.cos(), theta.sin()), Vector2::new(-theta.sin(), theta.cos()));
    // (x, y) = r facing + along side, by (rectangle, wall).
    let mut j = DMatrix::zeros(6, 6);
    j.view_mut((0, 0), (2, 1)).copy_from(&side);
    for (row, k) in [(3, 1), (4, 2), (5, 3)] {
        j[(row, k)] = 1.0;
    }
    j.view_mut((0, 4), (2, 1)).copy_from(&(side * r - facing * rectangle[0]));
    j.view_mut((0, 5), (2, 1)).copy_from(&facing);
    j[(2, 4)] = 1.0;
    let moved = j.columns(0, 4) * by_wall;
    let mut wall_part = j.columns_mut(4, 2);
    wall_part += moved;
    let mut s = DMatrix::zeros(6, 6);
    s.view_mut((0, 0), (4, 4)).copy_from(&(mean * inflation + shared));
    s.view_mut((4, 4), (2, 2)).copy_from(&facing_covariance(wall));
    let covariance = &j * s * j.transpose();
    let covariance = Matrix6::from_iterator(covariance.iter().copied());
    let at = facing * r + side * rectangle[0];
    Some(LandmarkPlace {
        x_m: at.x,
        y_m: at.y,
        z_m: rectangle[1],
        theta_rad: theta,
        roll_rad,
        tilt_rad: 0.0,
        size: LandmarkSize { width_m: rectangle[2], height_m: rectangle[3] },
        covariance: 0.5 * (covariance + covariance.transpose()),
    })
}

/// Covariance of (facing angle, signed distance) from that of (alpha, rho).
fn facing_covariance(wall: &LaserSegment) -> Matrix2<f64> {
    let n = Vector2::new(wall.alpha_rad.cos(), wall.alpha_rad.sin());
    let sign = if n.dot(&wall.facing()) < 0.0 { -1.0 } else { 1.0 };
    let flip = Matrix2::new(1.0, 0.0, 0.0, sign);
    flip * wall.covariance * flip
}

#[cfg(test)]
mod tests;
