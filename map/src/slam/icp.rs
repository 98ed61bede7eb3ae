//! Point-to-line ICP: refines a good guess. Points of a scan are matched to surfaces of others,
//! with distances across the surface only (method 17.4 for points). In: a guess, an optional prior.
//! Out: the pose and its information by the walls alone: zero along a bare corridor.

use crate::{
    pose2::Pose2,
    slam::{cloud::Cloud, information::with_floor, surface_index::SurfaceIndex},
};
use nalgebra::{Matrix3, Vector2, Vector3};
use serde::{Deserialize, Serialize};

/// Parameters of the ICP.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct IcpParams {
    /// Search radius for a point's surface at first, metres,
    pub start_radius_m: f64,
    /// and at last, metres.
    pub end_radius_m: f64,
    /// Largest angle between matched surfaces, radians.
    pub max_turn_rad: f64,
    /// Largest number of iterations.
    pub iterations: usize,
    /// Smallest standard deviation of a point across its surface, metres.
    pub sigma_m: f64,
    /// Distance beyond which a point's weight falls off, metres.
    pub outlier_m: f64,
    /// Number of points with a common error; the information is divided by it.
    pub correlated: f64,
    /// Smallest standard deviation of the position, whatever the number of points, metres.
    pub floor_m: f64,
    /// Smallest standard deviation of the heading, radians.
    pub floor_rad: f64,
}

impl Default for IcpParams {
    fn default() -> Self {
        Self {
            start_radius_m: 0.5,
            end_radius_m: 0.15,
            max_turn_rad: 0.6,
            iterations: 20,
            sigma_m: 0.02,
            outlier_m: 0.06,
            correlated: 4.0,
            floor_m: 0.005,
            floor_rad: 0.001,
        }
    }
}

/// A prior pose: mean and information.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PosePrior {
    pub pose: Pose2,
    pub information: Matrix3<f64>,
}

/// A matched scan.
#[derive(Debug, Clone, Copy)]
pub(crate) struct IcpResult {
    /// Pose of the robot in the reference frame.
    pub pose: Pose2,
    /// Information over (x, y, theta) by the points alone; singular where they determine nothing.
    pub information: Matrix3<f64>,
    /// Share of the scan's flat points with a surface, 0 to 1.
    pub matched: f64,
    /// Root mean square distance of those points, metres.
    pub rms_m: f64,
}

/// Matches `scan` to `reference`, starting at `guess`. `None` if fewer than three points have a
/// surface.
pub(crate) fn align(
    reference: &SurfaceIndex,
    scan: &Cloud,
    guess: &Pose2,
    prior: Option<&PosePrior>,
    p: &IcpParams,
) -> Option<IcpResult> {
    let mut pose = *guess;
    let mut radius_m = p.start_radius_m;
    let mut done = None;
    for step in 0..p.iterations.max(1) {
        let sums = sums(reference, scan, &pose, radius_m, p)?;
        let scale = 1.0 / (p.correlated.max(1.0) * sums.variance(p));
        let (mut h, mut g) = (sums.h * scale, sums.g * scale);
        done = Some((sums.clone(), scale));
        if let Some(prior) = prior {
            // Without the correction, noise of the normals would hold the pose at the guess against
            // the prior.
            h = sums.determined() * scale + prior.information;
            g += prior.information * pose.minus(&prior.pose);
        }
        // Slight damping keeps the pose where it is not determined.
        let damped = h + Matrix3::from_diagonal(&Vector3::new(1e-3, 1e-3, 1e-3));
        let d = damped.cholesky()?.solve(&-g);
        pose = pose.plus(&d);
        let at_rest = d.xy().norm() < 2e-4 && d.z.abs() < 2e-5;
        if at_rest && radius_m <= p.end_radius_m {
            break;
        }
        if at_rest || step % 2 == 1 {
            radius_m = (radius_m * 0.6).max(p.end_radius_m);
        }
    }
    let (sums, scale) = done?;
    let flat = scan.points.iter().filter(|q| q.normal.is_some()).count();
    let information = with_floor(&(sums.determined() * scale), [p.floor_m, p.floor_rad]);
    let finite = pose.check().is_ok() && information.iter().all(|v| v.is_finite());
    finite.then(|| IcpResult {
        pose,
        information,
        matched: sums.points as f64 / flat.max(1) as f64,
        rms_m: sums.variance(p).sqrt(),
    })
}

/// Normal equations with unit variance, and residuals, over the matched points.
#[derive(Debug, Clone)]
struct Sums {
    h: Matrix3<f64>,
    g: Vector3<f64>,
    /// Part of `h` that the noise of the normals adds.
    by_noise: Matrix3<f64>,
    squares: f64,
    weights: f64,
    points: usize,
}

impl Sums {
    /// The information without the part by noise of the normals: by that noise walls of a bare
    /// corridor face slightly along it.
    fn determined(&self) -> Matrix3<f64> {
        // Metres and radians have equal weight at the mean distance of the points.
        let arm = (self.h[(2, 2)] / (self.h[(0, 0)] + self.h[(1, 1)]).max(1e-12)).sqrt().clamp(0.1, 100.0);
        let unit = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, 1.0 / arm));
        let back = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, arm));
        let mut eigen = (unit * (self.h - self.by_noise) * unit).symmetric_eigen();
        eigen.eigenvalues.apply(|v| *v = v.max(0.0));
        back * eigen.recompose() * back
    }

    fn variance(&self, p: &IcpParams) -> f64 {
        (self.squares / self.weights.max(1e-9)).max(p.sigma_m * p.sigma_m)
    }
}

fn sums(reference: &SurfaceIndex, scan: &Cloud, pose: &Pose2, radius_m: f64, p: &IcpParams) -> Option<Sums> {
    let (s, c) = pose.theta_rad.sin_cos();
    let cos_turn = p.max_turn_rad.cos();
    let (mut h, mut g) = (Matrix3::zeros(), Vector3::zeros());
    let mut by_noise = Matrix3::zeros();
    let (mut squares, mut weights, mut points) = (0.0, 0.0, 0);
    // The kernel is as wide as the radius, since the first steps are long.
    let outlier2 = (p.outlier_m * (radius_m / p.end_radius_m)).powi(2);
    for point in &scan.points {
        let Some(n) = point.normal else { continue };
        let normal = Vector2::new(c * n.x - s * n.y, s * n.x + c * n.y);
        let turned = Vector2::new(c * point.at.x - s * point.at.y, s * point.at.x + c * point.at.y);
        let at = nalgebra::Point2::from(turned + pose.position());
        let Some(surface) = reference.nearest(&at, &normal, radius_m, cos_turn) else { continue };
        let residual = surface.normal.dot(&(at - surface.at));
        let arm = Vector2::new(-turned.y, turned.x);
        let j = Vector3::new(surface.normal.x, surface.normal.y, surface.normal.dot(&arm));
        let w = 1.0 / (1.0 + residual * residual / outlier2).powi(2);
        h += j * j.transpose() * w;
        g += j * (w * residual);
        let t = Vector2::new(-surface.normal.y, surface.normal.x);
        let turned = Vector3::new(t.x, t.y, t.dot(&arm));
        by_noise += turned * turned.transpose() * (w * surface.turn_variance);
        squares += w * residual * residual;
        weights += w;
        points += 1;
    }
    (points >= 3).then_some(Sums { h, g, by_noise, squares, weights, points })
}

#[cfg(test)]
mod tests;
