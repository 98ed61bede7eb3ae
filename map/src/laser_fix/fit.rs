//! Gauss-Newton of one scan in a map of walls from one start, and the covariance of the result.

use crate::{
    check::MAX_VARIANCE,
    laser_fix::{
        fix::{LaserFix, WallPart},
        index::WallIndex,
        params::LaserFixParams,
    },
    pose2::{Pose2, Pose2Covariance},
    slam::cloud::Cloud,
};
use nalgebra::{Matrix2, Matrix3, Matrix3x2, Point2, SymmetricEigen, Vector2, Vector3};

/// Variance of an undetermined coordinate: (100 m)^2, and about pi^2 for the heading.
const UNKNOWN: [f64; 3] = [1e4, 1e4, 10.0];
/// A direction with a larger standard deviation counts as undetermined, metres: there the result is
/// mostly the walls' own error.
const LEAST_M: f64 = 1.0;
/// Metres that weigh as much as one radian.
const LEVER_M: f64 = 3.0;
/// Walls whose errors a fix names one by one: those that affect it most.
const NAMED_WALLS: usize = 6;

/// A point with its wall: derivative of the distance, position along the wall, weight, distance.
struct Matched {
    wall: usize,
    j: Vector3<f64>,
    along_m: f64,
    weight: f64,
    residual: f64,
}

fn matched(
    walls: &WallIndex,
    cloud: &Cloud,
    pose: &Pose2,
    radius_m: f64,
    p: &LaserFixParams,
) -> Vec<Matched> {
    let (s, c) = pose.theta_rad.sin_cos();
    let cos_turn = p.max_turn_rad.cos();
    let outlier2 = (p.outlier_m * radius_m / p.end_radius_m).powi(2);
    let one = |point: &crate::slam::cloud::SurfacePoint| {
        let n = point.normal?;
        let normal = Vector2::new(c * n.x - s * n.y, s * n.x + c * n.y);
        let turned = Vector2::new(c * point.at.x - s * point.at.y, s * point.at.x + c * point.at.y);
        let at = Point2::from(turned + pose.position());
        let i = walls.nearest(&at, &normal, radius_m, cos_turn)?;
        let wall = &walls.walls[i];
        let residual = wall.normal.dot(&(at - wall.a));
        let j =
            Vector3::new(wall.normal.x, wall.normal.y, wall.normal.dot(&Vector2::new(-turned.y, turned.x)));
        let weight = 1.0 / (1.0 + residual * residual / outlier2).powi(2);
        let along_m = wall.along.dot(&(at - wall.a)) - 0.5 * wall.length_m;
        Some(Matched { wall: i, j, along_m, weight, residual })
    };
    cloud.points.iter().filter_map(one).collect()
}

/// Gauss-Newton from one start.
pub(super) fn descend(
    walls: &WallIndex,
    cloud: &Cloud,
    start: &Pose2,
    p: &LaserFixParams,
) -> Option<LaserFix> {
    let (mut pose, mut radius_m) = (*start, p.start_radius_m);
    for step in 0..p.iterations.max(1) {
        let (mut h, mut g) = (Matrix3::from_diagonal_element(1e-6), Vector3::zeros());
        let points = matched(walls, cloud, &pose, radius_m, p);
        for m in &points {
            h += m.j * m.j.transpose() * m.weight;
            g += m.j * (m.weight * m.residual);
        }
        let d = h.cholesky()?.solve(&-g);
        pose = pose.plus(&d);
        let at_rest = d.xy().norm() < 2e-4 && d.z.abs() < 5e-5;
        if at_rest && radius_m <= p.end_radius_m {
            break;
        }
        if at_rest || step % 2 == 1 {
            radius_m = (0.6 * radius_m).max(p.end_radius_m);
        }
    }
    pose.check().ok()?;
    let points = matched(walls, cloud, &pose, p.end_radius_m, p);
    let weights: f64 = points.iter().map(|m| m.weight).sum();
    let squares: f64 = points.iter().map(|m| m.weight * m.residual * m.residual).sum();
    let variance = (squares / weights.max(1e-9)).max(p.sigma_m * p.sigma_m);
    let scale = 1.0 / (p.correlated.max(1.0) * variance);
    let information =
        points.iter().fold(Matrix3::zeros(), |h, m| h + m.j * m.j.transpose() * (scale * m.weight));
    let spread = spread(&information)?;
    let (mut parts, uneven) = by_walls(walls, &points, &(spread * scale), p);
    let all = |parts: &[WallPart]| parts.iter().map(WallPart::spread).sum::<Matrix3<f64>>();
    let (known, unknown) = known(&(spread + all(&parts) + uneven));
    let noise = known * spread * known.transpose() + unknown;
    for part in &mut parts {
        part.by_wall = known * part.by_wall;
    }
    let covariance = noise + known * uneven * known.transpose() + all(&parts);
    parts.truncate(NAMED_WALLS);
    let (count, flat) = (points.len(), cloud.points.len());
    let pose = Pose2Covariance { pose, covariance };
    pose.check().ok()?;
    let matched = count as f64 / flat.max(1) as f64;
    Some(LaserFix { pose, noise, walls: parts, matched, points: count, rms_m: variance.sqrt() })
}

/// The effect of the walls' own errors on the pose, each propagated through the fit, the largest
/// first; and that of their unevenness where the scan sees them. Many points on one wall do not
/// make its place more certain than the map says, nor the wall straight.
fn by_walls(
    walls: &WallIndex,
    points: &[Matched],
    gain: &Matrix3<f64>,
    p: &LaserFixParams,
) -> (Vec<WallPart>, Matrix3<f64>) {
    let rough = Matrix2::from_diagonal(&Vector2::new(p.rough_rad.powi(2), p.rough_m.powi(2)));
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.sort_by_key(|&i| points[i].wall);
    let (mut parts, mut uneven) = (Vec::new(), Matrix3::zeros());
    for group in order.chunk_by(|&a, &b| points[a].wall == points[b].wall) {
        let Some(&first) = group.first() else { continue };
        let mut pull = Matrix3x2::zeros();
        let (weights, weighted_m) = group.iter().fold((0.0, 0.0), |(weights, sum), &i| {
            (weights + points[i].weight, sum + points[i].weight * points[i].along_m)
        });
        for &i in group {
            let m = &points[i];
            // A turn of the wall moves a point by its distance from the middle, an offset by the
            // same everywhere.
            pull += m.j * Vector2::new(m.along_m, 1.0).transpose() * m.weight;
        }
        let by_wall = -gain * pull;
        // Uneven about the middle of what is seen of it.
        let seen = Matrix2::new(1.0, 0.0, -weighted_m / weights.max(1e-9), 1.0);
        let by_seen = by_wall * seen;
        uneven += by_seen * rough * by_seen.transpose();
        let wall = &walls.walls[points[first].wall];
        parts.push(WallPart { wall: wall.name, by_wall, covariance: wall.covariance });
    }
    let weight = |part: &WallPart| part.spread().diagonal().dot(&Vector3::new(1.0, 1.0, LEVER_M * LEVER_M));
    parts.sort_by(|a, b| weight(b).total_cmp(&weight(a)).then(a.wall.cmp(&b.wall)));
    (parts, uneven)
}

/// The determined part of a covariance, as a projection, and the covariance of the rest: directions
/// beyond [`LEAST_M`] count as undetermined.
fn known(covariance: &Matrix3<f64>) -> (Matrix3<f64>, Matrix3<f64>) {
    let lever = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, LEVER_M));
    let back = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, 1.0 / LEVER_M));
    let eigen = SymmetricEigen::new(lever * covariance * lever);
    let (mut known, mut unknown) = (Matrix3::identity(), Matrix3::zeros());
    for k in (0..3).filter(|&k| eigen.eigenvalues[k] > LEAST_M * LEAST_M) {
        let axis = eigen.eigenvectors.column(k);
        known -= axis * axis.transpose();
        unknown += axis * axis.transpose() * UNKNOWN[0];
    }
    (back * known * lever, back * unknown * back)
}

/// Covariance of an information that may be singular: undetermined coordinates have the variance
/// [`UNKNOWN`].
fn spread(information: &Matrix3<f64>) -> Option<Matrix3<f64>> {
    let floor = Matrix3::from_diagonal(&Vector3::from(UNKNOWN).map(|v| 1.0 / v));
    let made = (information + floor).cholesky()?.inverse();
    let made = 0.5 * (made + made.transpose());
    made.iter().all(|v| v.is_finite() && v.abs() <= MAX_VARIANCE).then_some(made)
}
