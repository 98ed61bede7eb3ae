//! A landmark's place under a ceiling of given height (method 11.2, A24: the laser does not measure
//! ceilings).
//!
//! In: posed views, the ceiling. Out: place and size with covariance, or why the object is not
//! there.

use crate::{
    check::{self, OutOfRange},
    place::{LandmarkPlace, MAX_HEIGHT_M},
    placement::{
        params::{PlacementError, PlacementParams},
        rays::{self, Hit, MOUNTING, WALL, by_camera, by_corners_and_robot, by_robot},
        view::{CheckedView, MAX_VIEWS, PosedView, checked},
    },
    pose2::wrap_rad,
};
use nalgebra::{DMatrix, Matrix6, SMatrix, SVector, Vector2};
use std::f64::consts::FRAC_PI_2;
use vision::pose::{LandmarkSize, PoseError};

type Matrix5 = SMatrix<f64, 5, 5>;
type Vector5 = SVector<f64, 5>;

/// Corners TL, TR, BR, BL in widths (viewer's right) and heights (top).
const CORNERS: [(f64, f64); 4] = [(-0.5, 0.5), (0.5, 0.5), (0.5, -0.5), (-0.5, -0.5)];

/// A horizontal plane above the robots.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ceiling {
    /// Height above the floor, metres.
    pub height_m: f64,
    /// Standard deviation of the height, metres.
    pub sigma_m: f64,
}

impl Ceiling {
    /// Height within 0 to [`MAX_HEIGHT_M`], standard deviation 0 to 1 m.
    pub fn check(&self) -> Result<(), OutOfRange> {
        check::within("ceiling.height_m", self.height_m, 0.0, MAX_HEIGHT_M)?;
        check::within("ceiling.sigma_m", self.sigma_m, 0.0, 1.0)
    }
}

/// The rectangle that one view gives under the ceiling.
#[derive(Debug, Clone, PartialEq)]
pub struct CeilingRectangle {
    /// Centre x and y, direction of the top, width, height; metres and radians.
    pub rectangle: SVector<f64, 5>,
    /// Covariance by the corners and the robot's pose.
    pub covariance: SMatrix<f64, 5, 5>,
    /// Derivative by the robot's pose, in its standard deviations.
    pub by_robot: SMatrix<f64, 5, 3>,
    /// Derivative by the extrinsics' (rotation, translation).
    pub by_mounting: SMatrix<f64, 5, 6>,
    /// Covariance of the extrinsics.
    pub mounting_covariance: Matrix6<f64>,
    /// Derivative by the intrinsics' (focal length, principal point), each in its standard
    /// deviations.
    pub by_camera: SMatrix<f64, 5, 3>,
    /// Derivative by the ceiling's height.
    pub by_height: SVector<f64, 5>,
    /// Root mean square distance of the intersections from the rectangle, metres.
    pub rms_m: f64,
}

/// The rectangle of a view under the ceiling.
pub fn view_on_ceiling(
    view: &PosedView<'_>,
    ceiling: &Ceiling,
    p: &PlacementParams,
) -> Result<CeilingRectangle, PlacementError> {
    ceiling.check()?;
    let checked = checked(view)?;
    let hits = [0, 1, 2, 3].map(|i| rays::ceiling_hit(&checked, i, ceiling.height_m));
    let [Some(a), Some(b), Some(c), Some(d)] = hits else { return Err(PlacementError::NoWall) };
    fit(&checked, &[a, b, c, d], p)
}

fn fit(
    view: &CheckedView<'_>,
    hits: &[Hit; 4],
    p: &PlacementParams,
) -> Result<CeilingRectangle, PlacementError> {
    let mut intersections = SVector::<f64, 8>::zeros();
    let mut by = SMatrix::<f64, 8, { rays::INPUTS }>::zeros();
    for (i, hit) in hits.iter().enumerate() {
        intersections.fixed_rows_mut::<2>(2 * i).copy_from(&hit.point.xy());
        by.fixed_rows_mut::<2>(2 * i).copy_from(&hit.by.fixed_rows::<2>(0));
    }
    let own = by_corners_and_robot(view, &by);
    let m = by.fixed_columns::<6>(MOUNTING);
    let weight = (own + m * view.mounting.covariance * m.transpose())
        .cholesky()
        .ok_or(PoseError::Degenerate)?
        .inverse();
    let (q, gain) = rectangle(&intersections, &weight).ok_or(PoseError::Degenerate)?;
    let rms_m = ((intersections - corners_of(&q)).norm_squared() / 4.0).sqrt();
    let possible = |v: f64| (LandmarkSize::MIN_M..=LandmarkSize::MAX_M).contains(&v);
    if rms_m > p.max_rms_m || !possible(q[3]) || !possible(q[4]) {
        return Err(PlacementError::NotOnCeiling { rms_m });
    }
    Ok(CeilingRectangle {
        rectangle: q,
        covariance: gain * own * gain.transpose(),
        by_robot: gain * by_robot(view, &by),
        by_mounting: gain * m,
        mounting_covariance: view.mounting.covariance,
        by_camera: gain * by_camera(view, &by),
        by_height: gain * by.column(WALL),
        rms_m,
    })
}

fn corners_of(q: &Vector5) -> SVector<f64, 8> {
    let (s, c) = q[2].sin_cos();
    let mut made = SVector::<f64, 8>::zeros();
    for (i, (y, z)) in CORNERS.iter().enumerate() {
        let (y, z) = (y * q[3], z * q[4]);
        (made[2 * i], made[2 * i + 1]) = (q[0] - s * y + c * z, q[1] + c * y + s * z);
    }
    made
}

/// Weighted least squares over the rectangle, with the gain from intersections to rectangle.
fn rectangle(
    intersections: &SVector<f64, 8>,
    weight: &SMatrix<f64, 8, 8>,
) -> Option<(Vector5, SMatrix<f64, 5, 8>)> {
    /// Steps: the problem is linear but for the direction, whose start is good.
    const STEPS: usize = 8;
    let at = |i: usize| Vector2::new(intersections[2 * i], intersections[2 * i + 1]);
    let centre = (at(0) + at(1) + at(2) + at(3)) * 0.25;
    let (up, right) = ((at(0) + at(1) - at(2) - at(3)) * 0.5, (at(1) + at(2) - at(0) - at(3)) * 0.5);
    // A mirrored quad cannot be a view from below.
    if up.x * right.y - up.y * right.x <= 0.0 {
        return None;
    }
    let mut q = Vector5::from([centre.x, centre.y, up.y.atan2(up.x), right.norm(), up.norm()]);
    let mut gain = SMatrix::<f64, 5, 8>::zeros();
    for _ in 0..STEPS {
        let (s, c) = q[2].sin_cos();
        let mut j = SMatrix::<f64, 8, 5>::zeros();
        for (i, (y, z)) in CORNERS.into_iter().enumerate() {
            let (wide, high) = (y * q[3], z * q[4]);
            let rows = [
                [1.0, 0.0, -c * wide - s * high, -s * y, c * z],
                [0.0, 1.0, -s * wide + c * high, c * y, s * z],
            ];
            j.row_mut(2 * i).copy_from_slice(&rows[0]);
            j.row_mut(2 * i + 1).copy_from_slice(&rows[1]);
        }
        let inverse = (j.transpose() * weight * j).cholesky()?.inverse();
        gain = inverse * j.transpose() * weight;
        q += gain * (intersections - corners_of(&q));
    }
    q[2] = wrap_rad(q[2]);
    q.iter().all(|v| v.is_finite()).then_some((q, gain))
}

/// Fuses views of one object under one ceiling. Views outside of the gate, 99 % of chi2 with 5
/// degrees of freedom, are left out.
pub fn ceiling_placement(
    views: &[CeilingRectangle],
    ceiling: &Ceiling,
    p: &PlacementParams,
) -> Result<super::Placement, PlacementError> {
    const CHI2_5_99: f64 = 15.086;
    ceiling.check()?;
    let views = &views[..views.len().min(MAX_VIEWS)];
    let total = |v: &CeilingRectangle| {
        let mounting = v.by_mounting * v.mounting_covariance * v.by_mounting.transpose();
        v.covariance + mounting + v.by_camera * v.by_camera.transpose()
    };
    let agree = |a: &CeilingRectangle, b: &CeilingRectangle| {
        let d = apart(&a.rectangle, &b.rectangle);
        (total(a) + total(b)).cholesky().is_some_and(|s| d.dot(&s.solve(&d)) <= CHI2_5_99)
    };
    let votes = |i: usize| views.iter().filter(|v| agree(&views[i], v)).count();
    // Ties: the first.
    let seed =
        (0..views.len()).max_by_key(|&i| (votes(i), std::cmp::Reverse(i))).ok_or(PlacementError::NoView)?;
    let used: Vec<usize> = (0..views.len()).filter(|&i| agree(&views[seed], &views[i])).collect();
    let chosen: Vec<&CeilingRectangle> = used.iter().map(|&i| &views[i]).collect();
    let place = fused(&views[seed].rectangle, &chosen, ceiling, p).ok_or(PlacementError::NoView)?;
    place.check()?;
    Ok(super::Placement { place, used })
}

/// `a - b`, the direction wrapped.
fn apart(a: &Vector5, b: &Vector5) -> Vector5 {
    let mut d = a - b;
    d[2] = wrap_rad(d[2]);
    d
}

/// Fusion in information form; the errors of extrinsics, intrinsics, ceiling and robot pose are
/// common to all views and added once.
fn fused(
    origin: &Vector5,
    views: &[&CeilingRectangle],
    ceiling: &Ceiling,
    p: &PlacementParams,
) -> Option<LandmarkPlace> {
    let mut information = Matrix5::zeros();
    for v in views {
        information += v.covariance.try_inverse()?;
    }
    let mean = information.cholesky()?.inverse();
    let (mut d, mut by_mounting, mut by_height) =
        (Vector5::zeros(), SMatrix::<f64, 5, 6>::zeros(), Vector5::zeros());
    let (mut by_camera, mut by_robot) = (SMatrix::<f64, 5, 3>::zeros(), SMatrix::<f64, 5, 3>::zeros());
    let mut own = Matrix5::zeros();
    for v in views {
        let share = mean * v.covariance.try_inverse()?;
        d += share * apart(&v.rectangle, origin);
        by_mounting += share * v.by_mounting;
        by_camera += share * v.by_camera;
        by_robot += share * v.by_robot;
        own += share * (v.covariance - v.by_robot * v.by_robot.transpose()) * share.transpose();
        by_height += share * v.by_height;
    }
    let q = origin + d;
    let inflation = if views.len() > 1 { p.inflation } else { 1.0 };
    let total = own * inflation
        + by_mounting * views[0].mounting_covariance * by_mounting.transpose()
        + by_camera * by_camera.transpose()
        + by_robot * by_robot.transpose();
    // (x, y, theta, z, w, h) by (rectangle, height of the ceiling).
    let mut j = DMatrix::zeros(6, 6);
    for (row, k) in [(0, 0), (1, 1), (2, 2), (4, 3), (5, 4)] {
        j[(row, k)] = 1.0;
        j[(row, 5)] = by_height[k];
    }
    j[(3, 5)] = 1.0;
    let mut s = DMatrix::zeros(6, 6);
    s.view_mut((0, 0), (5, 5)).copy_from(&total);
    s[(5, 5)] = ceiling.sigma_m.powi(2);
    let covariance = &j * s * j.transpose();
    let covariance = Matrix6::from_iterator(covariance.iter().copied());
    Some(LandmarkPlace {
        x_m: q[0],
        y_m: q[1],
        z_m: ceiling.height_m,
        theta_rad: wrap_rad(q[2]),
        roll_rad: 0.0,
        tilt_rad: FRAC_PI_2,
        size: LandmarkSize { width_m: q[3], height_m: q[4] },
        covariance: 0.5 * (covariance + covariance.transpose()),
        shared: None,
    })
}

/// Errors of a place in the order of its covariance: x, y, theta, z, width, height.
#[cfg(test)]
pub(crate) fn error_of(made: &LandmarkPlace, truth: &LandmarkPlace) -> nalgebra::Vector6<f64> {
    nalgebra::Vector6::new(
        made.x_m - truth.x_m,
        made.y_m - truth.y_m,
        wrap_rad(made.theta_rad - truth.theta_rad),
        made.z_m - truth.z_m,
        made.size.width_m - truth.size.width_m,
        made.size.height_m - truth.size.height_m,
    )
}

#[cfg(test)]
mod tests;
