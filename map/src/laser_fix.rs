//! Where a robot is in a finished map of walls, by one scan (method 17.4, 17.5, the map frozen). In: walls, a scan, a
//! prior. Out: the pose with its covariance, wide where the walls say nothing, as along a bare corridor; or why there is
//! none. The prior only says where to look and what to refuse: it is not part of the answer, so fusing both is right.

mod index;
pub use index::{MAX_WALLS, WallIndex};

use crate::{
    check::{self, MAX_VARIANCE, OutOfRange},
    laser::Scan,
    localise::{DecidedBy, Fix, Modality, Nuisance, NuisanceKey},
    pose2::{Pose2, Pose2Covariance},
    slam::cloud::{Cloud, CloudParams, cloud},
};
use nalgebra::{Matrix2, Matrix3, Matrix3x2, Matrix3x6, Matrix6, Point2, SymmetricEigen, Vector2, Vector3};
use serde::{Deserialize, Serialize};

/// Most points of a scan that are used; evenly thinned beyond.
const MAX_POINTS: usize = 360;
/// Variance that stands for "the walls do not tell": (100 m)^2, and (pi)^2 for the heading.
const UNKNOWN: [f64; 3] = [1e4, 1e4, 10.0];
/// A pose known less well than this along some direction is not known there: what walls wrong by a centimetre say of a
/// direction that they hardly show is mostly their own error.
const LEAST_M: f64 = 1.0;
/// How many metres a radian weighs as much as.
const LEVER_M: f64 = 3.0;
/// Walls whose own errors a fix names one by one: those that move it most.
const NAMED_WALLS: usize = 6;
/// Side of the squares of floor in which all other walls err alike.
const AREA_M: f64 = 10.0;

/// Knobs of localisation in walls.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LaserFixParams {
    /// Points of the scan.
    pub cloud: CloudParams,
    /// How far from a point its wall is looked for at first...
    pub start_radius_m: f64,
    /// ...and at last.
    pub end_radius_m: f64,
    /// Surface and wall turn less than this against each other.
    pub max_turn_rad: f64,
    /// Most iterations from one start.
    pub iterations: usize,
    /// Smallest standard deviation of a point across its wall.
    pub sigma_m: f64,
    /// Beyond it a point's weight falls off.
    pub outlier_m: f64,
    /// Points that err together: their number is divided by this.
    pub correlated: f64,
    /// Standard deviation that no number of points removes: position, metres, and heading, radians.
    pub floor: [f64; 2],
    /// Fewest points with a wall.
    pub min_points: usize,
    /// Least share of the points that have a wall.
    pub min_matched: f64,
    /// Gate on the squared Mahalanobis distance to the prior: 99.9 % of chi2 with 3 degrees of freedom.
    pub prior_gate: f64,
    /// Priors wider than this are tried from several starts...
    pub wide_m: f64,
    /// ...or wider in the heading.
    pub wide_rad: f64,
    /// Another solution that matches so nearly as many points makes it ambiguous.
    pub rival_share: f64,
    /// Two results are two solutions if they differ by more than this chi2.
    pub apart_chi2: f64,
}

impl Default for LaserFixParams {
    fn default() -> Self {
        Self {
            cloud: CloudParams::default(),
            start_radius_m: 0.6,
            end_radius_m: 0.15,
            max_turn_rad: 0.5,
            iterations: 16,
            sigma_m: 0.02,
            outlier_m: 0.06,
            correlated: 3.0,
            floor: [0.003, 0.001],
            min_points: 20,
            min_matched: 0.5,
            prior_gate: 16.27,
            wide_m: 0.2,
            wide_rad: 0.06,
            rival_share: 0.9,
            apart_chi2: 25.0,
        }
    }
}

/// The robot's pose by one scan.
#[derive(Debug, Clone, PartialEq)]
pub struct LaserFix {
    /// `map_from_robot`, without the prior: along what the walls do not tell its variance is some 100 m.
    pub pose: Pose2Covariance,
    /// The part of its covariance that is new in every scan; the rest is the walls' own and lasts.
    pub noise: Matrix3<f64>,
    /// The walls that move it most.
    pub walls: Vec<WallPart>,
    /// Share of the scan's flat points on a wall.
    pub matched: f64,
    /// How many points that are.
    pub points: usize,
    /// Root mean square of their distances across the walls.
    pub rms_m: f64,
}

impl LaserFix {
    /// For [`crate::fuse::Fuser::fix`]: rests on no landmark, and cannot start or replace a pose by itself. What walls
    /// are wrong by lasts: each of the most important is named, the others count as one about a place.
    pub fn fix(&self) -> Fix {
        let named = self.walls.iter().map(|part| {
            let mut jacobian = Matrix3x6::zeros();
            jacobian.fixed_columns_mut::<2>(0).copy_from(&part.by_wall);
            let mut covariance = Matrix6::zeros();
            covariance.fixed_view_mut::<2, 2>(0, 0).copy_from(&part.covariance);
            Nuisance { key: NuisanceKey::Wall(part.wall), jacobian, covariance }
        });
        let mut jacobian = Matrix3x6::zeros();
        jacobian.fixed_columns_mut::<3>(0).copy_from(&self.by_others());
        let mut covariance = Matrix6::zeros();
        covariance.fixed_view_mut::<3, 3>(0, 0).fill_with_identity();
        let square = |v: f64| (v / AREA_M).floor() as i32;
        let key = NuisanceKey::Walls(square(self.pose.pose.x_m), square(self.pose.pose.y_m));
        let others = Nuisance { key, jacobian, covariance };
        Fix {
            modality: Modality::Laser,
            pose: self.pose,
            noise: self.noise,
            nuisances: named.chain([others]).collect(),
            landmarks: Vec::new(),
            decided_by: DecidedBy::Prior,
            chi2: 0.0,
            dof: self.points.saturating_sub(3),
        }
    }

    /// The root of what lasts of the covariance and is not of the named walls.
    fn by_others(&self) -> Matrix3<f64> {
        let named: Matrix3<f64> = self.walls.iter().map(WallPart::spread).sum();
        let eigen = SymmetricEigen::new(self.pose.covariance - self.noise - named);
        let root = eigen.eigenvalues.map(|v| v.max(0.0).sqrt());
        eigen.eigenvectors * Matrix3::from_diagonal(&root) * eigen.eigenvectors.transpose()
    }
}

/// What the error of one wall does to a fix.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WallPart {
    /// Names the wall by its place: the same in every scan and in every version of a map that keeps it.
    pub wall: u64,
    /// Derivative of (x, y, theta) by the wall's (direction, offset) about its middle.
    pub by_wall: Matrix3x2<f64>,
    /// Covariance of those.
    pub covariance: Matrix2<f64>,
}

impl WallPart {
    /// Its part of the fix's covariance.
    fn spread(&self) -> Matrix3<f64> {
        let all = self.by_wall * self.covariance * self.by_wall.transpose();
        0.5 * (all + all.transpose())
    }
}

/// Why a scan gave no pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LaserRefusal {
    /// Too few returns from flat surfaces near walls.
    FewPoints {
        /// How many there were.
        points: usize,
    },
    /// The scan shows something else than the map.
    Unlike {
        /// Share of the points that have a wall.
        matched: f64,
    },
    /// The pose contradicts the prior.
    Prior {
        /// Squared Mahalanobis distance.
        distance2: f64,
    },
    /// Several poses fit.
    Ambiguous,
}

/// The pose of the robot when it took `scan`, near `prior`. Errors name an input that is out of range.
pub fn laser_fix(
    walls: &WallIndex,
    scan: &Scan,
    prior: &Pose2Covariance,
    p: &LaserFixParams,
) -> Result<Result<LaserFix, LaserRefusal>, OutOfRange> {
    prior.check()?;
    check::within("params.end_radius_m", p.end_radius_m, 1e-3, 1.0)?;
    check::within("params.start_radius_m", p.start_radius_m, p.end_radius_m, 1.0)?;
    let mut seen = cloud(scan, &p.cloud);
    seen.points.retain(|q| q.normal.is_some());
    let stride = seen.points.len().div_ceil(MAX_POINTS).max(1);
    seen.points = seen.points.into_iter().step_by(stride).collect();
    if seen.points.len() < p.min_points || walls.is_empty() {
        return Ok(Err(LaserRefusal::FewPoints { points: seen.points.len() }));
    }
    let mut found: Vec<LaserFix> =
        starts(prior, p).iter().filter_map(|start| descend(walls, &seen, start, p)).collect();
    // Most points first, then the smallest residual; stable, so the prior's own start wins ties.
    found.sort_by(|a, b| b.points.cmp(&a.points).then(a.rms_m.total_cmp(&b.rms_m)));
    let Some(best) = found.first() else {
        return Ok(Err(LaserRefusal::FewPoints { points: 0 }));
    };
    if best.points < p.min_points {
        return Ok(Err(LaserRefusal::FewPoints { points: best.points }));
    }
    if best.matched < p.min_matched {
        return Ok(Err(LaserRefusal::Unlike { matched: best.matched }));
    }
    let distance2 = best.pose.distance2(prior).unwrap_or(f64::INFINITY);
    if distance2 > p.prior_gate {
        return Ok(Err(LaserRefusal::Prior { distance2 }));
    }
    let rival = found.iter().skip(1).any(|other| {
        other.points as f64 >= p.rival_share * best.points as f64
            && other.pose.distance2(&best.pose).is_some_and(|d2| d2 > p.apart_chi2)
            && other.pose.distance2(prior).is_some_and(|d2| d2 <= p.prior_gate)
    });
    Ok(if rival { Err(LaserRefusal::Ambiguous) } else { Ok(best.clone()) })
}

/// The prior's mean, and where it is wide, points along its axes.
fn starts(prior: &Pose2Covariance, p: &LaserFixParams) -> Vec<Pose2> {
    let mut starts = vec![prior.pose];
    let c = &prior.covariance;
    if c[(0, 0)].max(c[(1, 1)]).sqrt() <= p.wide_m && c[(2, 2)].sqrt() <= p.wide_rad {
        return starts;
    }
    let eigen = SymmetricEigen::new(*c);
    for k in 0..3 {
        let axis: Vector3<f64> = eigen.eigenvectors.column(k) * (1.5 * eigen.eigenvalues[k].max(0.0).sqrt());
        if axis.xy().norm() > 0.5 * p.wide_m || axis.z.abs() > 0.5 * p.wide_rad {
            starts.extend([prior.pose.plus(&axis), prior.pose.plus(&-axis)]);
        }
    }
    starts
}

/// Points that found their wall: the wall, the derivative of the distance, where along the wall, weight, distance.
struct Matched {
    wall: usize,
    j: Vector3<f64>,
    along_m: f64,
    weight: f64,
    residual: f64,
}

fn matched(walls: &WallIndex, seen: &Cloud, pose: &Pose2, radius_m: f64, p: &LaserFixParams) -> Vec<Matched> {
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
    seen.points.iter().filter_map(one).collect()
}

/// Gauss-Newton from one start.
fn descend(walls: &WallIndex, seen: &Cloud, start: &Pose2, p: &LaserFixParams) -> Option<LaserFix> {
    let (mut pose, mut radius_m) = (*start, p.start_radius_m);
    for step in 0..p.iterations.max(1) {
        let (mut h, mut g) = (Matrix3::from_diagonal_element(1e-6), Vector3::zeros());
        let points = matched(walls, seen, &pose, radius_m, p);
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
    let points = matched(walls, seen, &pose, p.end_radius_m, p);
    let weights: f64 = points.iter().map(|m| m.weight).sum();
    let squares: f64 = points.iter().map(|m| m.weight * m.residual * m.residual).sum();
    let variance = (squares / weights.max(1e-9)).max(p.sigma_m * p.sigma_m);
    let scale = 1.0 / (p.correlated.max(1.0) * variance);
    let told = points.iter().fold(Matrix3::zeros(), |h, m| h + m.j * m.j.transpose() * (scale * m.weight));
    let spread = spread(&told)?;
    let [floor_m, floor_rad] = p.floor.map(|sigma| sigma * sigma);
    let floor = Matrix3::from_diagonal(&Vector3::new(floor_m, floor_m, floor_rad));
    let mut parts = by_walls(walls, &points, &(spread * scale));
    let all = |parts: &[WallPart]| parts.iter().map(WallPart::spread).sum::<Matrix3<f64>>();
    let (known, unknown) = known(&(spread + all(&parts) + floor));
    let noise = known * spread * known.transpose() + unknown;
    for part in &mut parts {
        part.by_wall = known * part.by_wall;
    }
    let covariance = noise + floor + all(&parts);
    parts.truncate(NAMED_WALLS);
    let (count, flat) = (points.len(), seen.points.len());
    let pose = Pose2Covariance { pose, covariance };
    pose.check().ok()?;
    let matched = count as f64 / flat.max(1) as f64;
    Some(LaserFix { pose, noise, walls: parts, matched, points: count, rms_m: variance.sqrt() })
}

/// What the walls' own errors do to the pose that the points gave, each carried through the fit; the greatest first. A
/// hundred points on one wall do not make its place better known than the map says.
fn by_walls(walls: &WallIndex, points: &[Matched], gain: &Matrix3<f64>) -> Vec<WallPart> {
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.sort_by_key(|&i| points[i].wall);
    let mut parts = Vec::new();
    for group in order.chunk_by(|&a, &b| points[a].wall == points[b].wall) {
        let Some(&first) = group.first() else { continue };
        let mut pull = Matrix3x2::zeros();
        for &i in group {
            let m = &points[i];
            // Both move the wall towards its free side: a turn by the lever, an offset everywhere the same.
            pull += m.j * Vector2::new(m.along_m, 1.0).transpose() * m.weight;
        }
        let wall = &walls.walls[points[first].wall];
        parts.push(WallPart { wall: wall.name, by_wall: -gain * pull, covariance: wall.covariance });
    }
    let weight = |part: &WallPart| part.spread().diagonal().dot(&Vector3::new(1.0, 1.0, LEVER_M * LEVER_M));
    parts.sort_by(|a, b| weight(b).total_cmp(&weight(a)).then(a.wall.cmp(&b.wall)));
    parts
}

/// Which part of a covariance is knowledge, as a projection, and the covariance of the rest: where the walls tell less
/// than [`LEAST_M`], they tell nothing.
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

/// Covariance of an information that may be singular: what is unknown has the variance [`UNKNOWN`].
fn spread(information: &Matrix3<f64>) -> Option<Matrix3<f64>> {
    let floor = Matrix3::from_diagonal(&Vector3::from(UNKNOWN).map(|v| 1.0 / v));
    let made = (information + floor).cholesky()?.inverse();
    let made = 0.5 * (made + made.transpose());
    made.iter().all(|v| v.is_finite() && v.abs() <= MAX_VARIANCE).then_some(made)
}

#[cfg(test)]
mod tests;
