//! One landmark: the table of method 13.3, exactness, consistency of the covariance, flips of the
//! planar ambiguity, time.

use super::scene::{CAMERA, SIZE, in_plan, isotropic, noisy, projected, view};
use nalgebra::{Isometry3, Matrix3, SMatrix, UnitQuaternion, Vector3, Vector6};
use serde::Serialize;
use std::time::Instant;
use vision::{
    geometry::Corners,
    pose::{LandmarkPose, PoseSolution, landmark_pose, linear_pose, reprojection::perturbed},
    random::Random,
};

/// Rows of the table: distance, azimuth; the method's sigma along the normal, along the wall, of
/// the heading (degrees): refined, linear.
const ROWS: [(f64, f64, [f64; 3], [f64; 3]); 5] = [
    (2.0, 0.0, [0.006, 0.020, 0.56], [0.006, 0.024, 0.65]),
    (4.0, 0.0, [0.022, 0.158, 2.25], [0.026, 0.176, 2.51]),
    (4.0, 30.0, [0.029, 0.035, 0.61], [0.118, 0.113, 2.20]),
    (4.0, 60.0, [0.023, 0.014, 0.33], [0.128, 0.040, 1.38]),
    (6.0, 45.0, [0.060, 0.043, 0.64], [0.47, 0.20, 4.3]),
];
/// Corner noise of the table.
const ROW_SIGMA_PX: f64 = 0.5;
const ROW_DRAWS: usize = 2_000;
/// Error of the squared Mahalanobis distance from which an unflagged pose nearer to the mirror
/// image is a flip.
const FLIP_NEES: f64 = 30.0;

/// One row, all sigmas in metres and degrees.
#[derive(Debug, Clone, Serialize)]
pub(super) struct Row {
    pub(super) distance_m: f64,
    pub(super) azimuth_deg: f64,
    pub(super) refined: [f64; 3],
    pub(super) linear: [f64; 3],
    /// Standard deviations by the covariance, to first order at the true pose.
    pub(super) analytic: [f64; 3],
    pub(super) method_refined: [f64; 3],
    pub(super) method_linear: [f64; 3],
}

pub(super) fn table(seed: u64) -> Vec<Row> {
    let mut random = Random::new(seed);
    ROWS.iter().map(|(d, psi, refined, linear)| row(*d, *psi, *refined, *linear, &mut random)).collect()
}

fn row(d: f64, psi: f64, method_refined: [f64; 3], method_linear: [f64; 3], random: &mut Random) -> Row {
    let truth = view(d, psi);
    let origin = in_plan(&truth);
    let mut errors: [Vec<Vector3<f64>>; 2] = [vec![], vec![]];
    for _ in 0..ROW_DRAWS {
        let found = noisy(&projected(&truth), ROW_SIGMA_PX, random)
            .and_then(|corners| landmark_pose(&corners, &isotropic(ROW_SIGMA_PX), SIZE, &CAMERA).ok());
        let Some(found) = found else { continue };
        errors[0].push(in_plan(&found.best.camera_from_landmark) - origin);
        errors[1].extend(linear_pose(&found.measured).map(|pose| in_plan(&pose) - origin));
    }
    let [refined, linear] = errors.map(|e| spread(&e));
    Row {
        distance_m: d,
        azimuth_deg: psi,
        refined,
        linear,
        analytic: analytic(&truth),
        method_refined,
        method_linear,
    }
}

fn spread(errors: &[Vector3<f64>]) -> [f64; 3] {
    let n = errors.len().max(1) as f64;
    let mean = errors.iter().sum::<Vector3<f64>>() / n;
    let s = (errors.iter().map(|e| (e - mean).component_mul(&(e - mean))).sum::<Vector3<f64>>() / n)
        .map(f64::sqrt);
    [s.x, s.y, s.z.to_degrees()]
}

/// `(J^T S^-1 J)^-1` in plan coordinates, both derivatives by differences.
fn analytic(truth: &Isometry3<f64>) -> [f64; 3] {
    let step = |k: usize, d: f64| {
        let (mut turn, mut shift) = (Vector3::zeros(), Vector3::zeros());
        if k < 3 {
            turn[k] = d;
        } else {
            shift[k - 3] = d;
        }
        perturbed(truth, &turn, &shift)
    };
    let h = 1e-5;
    let (mut j, mut g) = (SMatrix::<f64, 8, 6>::zeros(), SMatrix::<f64, 3, 6>::zeros());
    for k in 0..6 {
        let (up, down) = (step(k, h), step(k, -h));
        for (i, (a, b)) in projected(&up).iter().zip(projected(&down)).enumerate() {
            let d = (a - b) / (2.0 * h);
            (j[(2 * i, k)], j[(2 * i + 1, k)]) = (d.x, d.y);
        }
        g.set_column(k, &((in_plan(&up) - in_plan(&down)) / (2.0 * h)));
    }
    let Some(inverse) = (j.transpose() * j).try_inverse() else { return [f64::NAN; 3] };
    let covariance: Matrix3<f64> = g * inverse * g.transpose() * ROW_SIGMA_PX * ROW_SIGMA_PX;
    let s = covariance.diagonal().map(f64::sqrt);
    [s.x, s.y, s.z.to_degrees()]
}

/// Consistency in one cell.
#[derive(Debug, Clone, Serialize)]
pub(super) struct Cell {
    pub(super) distance_m: f64,
    pub(super) azimuth_deg: f64,
    pub(super) sigma_px: f64,
    /// Mean of the squared Mahalanobis distance of the truth, 6 degrees of freedom, over the draws
    /// that were not flagged.
    pub(super) nees: f64,
    pub(super) unflagged: usize,
    pub(super) draws: usize,
    pub(super) inside_95: bool,
    pub(super) inside_99: bool,
    /// Poses nearer to the mirror image, not flagged as ambiguous.
    pub(super) flips: usize,
}

/// Twelve cells of distance, angle and noise.
pub(super) fn cells(draws: usize, seed: u64) -> Vec<Cell> {
    let mut random = Random::new(seed);
    let mut all = vec![];
    for sigma_px in [0.3, 0.8] {
        for d in [2.0, 4.0, 6.0] {
            for psi in [10.0, 45.0] {
                all.push(cell(d, psi, sigma_px, draws, &mut random));
            }
        }
    }
    all
}

fn cell(d: f64, psi: f64, sigma_px: f64, draws: usize, random: &mut Random) -> Cell {
    let truth = view(d, psi);
    let (mut sum, mut n, mut flips) = (0.0, 0_usize, 0);
    for _ in 0..draws {
        let found = noisy(&projected(&truth), sigma_px, random)
            .and_then(|corners| landmark_pose(&corners, &isotropic(sigma_px), SIZE, &CAMERA).ok());
        let Some(found) = found.filter(|f| !f.ambiguous) else { continue };
        let value = nees(&truth, &found.best);
        flips += usize::from(nearer_to_mirror(&found.best.camera_from_landmark, &truth) && value > FLIP_NEES);
        (sum, n) = (sum + value, n + 1);
    }
    let mean = sum / n.max(1) as f64;
    // Variance of chi2 with 6 degrees of freedom is 12.
    let inside = |z: f64| (mean - 6.0).abs() <= z * (12.0 / n.max(1) as f64).sqrt();
    Cell {
        distance_m: d,
        azimuth_deg: psi,
        sigma_px,
        nees: mean,
        unflagged: n,
        draws,
        inside_95: inside(1.960),
        inside_99: inside(2.576),
        flips,
    }
}

fn nees(truth: &Isometry3<f64>, solution: &PoseSolution) -> f64 {
    let pose = &solution.camera_from_landmark;
    let turn = (truth.rotation * pose.rotation.inverse()).scaled_axis();
    let shift = truth.translation.vector - pose.translation.vector;
    let e = Vector6::from_iterator(turn.iter().chain(shift.iter()).copied());
    solution.covariance.cholesky().map_or(f64::INFINITY, |c| e.dot(&c.solve(&e)))
}

/// Nearer to the true pose with its normal mirrored about the line of sight.
pub(super) fn nearer_to_mirror(pose: &Isometry3<f64>, truth: &Isometry3<f64>) -> bool {
    let normal = |p: &Isometry3<f64>| p.rotation * Vector3::x();
    let v = truth.translation.vector.normalize();
    let n = normal(truth);
    // The outward normal points to the viewer: mirrored, its part along the sight stays and the
    // rest turns round.
    let mirrored = v * (2.0 * n.dot(&v)) - n;
    normal(pose).angle(&mirrored) < normal(pose).angle(&n)
}

/// Largest error of poses from exact corners.
#[derive(Debug, Clone, Serialize)]
pub(super) struct Exact {
    pub(super) poses: usize,
    pub(super) worst_rad: f64,
    pub(super) worst_m: f64,
}

pub(super) fn exact(seed: u64) -> Exact {
    let mut random = Random::new(seed);
    let mut made = Exact { poses: 0, worst_rad: 0.0, worst_m: 0.0 };
    while made.poses < 1_000 {
        let base = view(random.range(1.0, 8.0), random.range(-75.0, 75.0));
        let turn = Vector3::new(random.range(-0.2, 0.2), random.range(-0.2, 0.2), random.range(-0.3, 0.3));
        let swing = UnitQuaternion::from_scaled_axis(turn);
        let truth = Isometry3::from_parts((swing * base.translation.vector).into(), swing * base.rotation);
        let points = projected(&truth);
        let inside = points.iter().all(|p| (0.0..640.0).contains(&p.x) && (0.0..480.0).contains(&p.y));
        let found = Corners::new(points)
            .ok()
            .filter(|_| inside)
            .and_then(|corners| landmark_pose(&corners, &isotropic(0.5), SIZE, &CAMERA).ok());
        let Some(found) = found else { continue };
        let pose = found.best.camera_from_landmark;
        made.poses += 1;
        made.worst_rad = made.worst_rad.max(pose.rotation.angle_to(&truth.rotation));
        made.worst_m = made.worst_m.max((pose.translation.vector - truth.translation.vector).norm());
    }
    made
}

/// Microseconds of one call.
#[derive(Debug, Clone, Serialize)]
pub(super) struct Cost {
    pub(super) median: f64,
    pub(super) least: f64,
    pub(super) p95: f64,
}

pub(super) fn cost_of(mut times_us: Vec<f64>) -> Cost {
    times_us.sort_by(f64::total_cmp);
    let at = |share: f64| {
        times_us.get((share * (times_us.len() as f64 - 1.0)) as usize).copied().unwrap_or(f64::NAN)
    };
    Cost { median: at(0.5), least: at(0.0), p95: at(0.95) }
}

/// A pose with covariance, both solutions, over the draws of the cells.
pub(super) fn cost(seed: u64) -> Cost {
    let mut random = Random::new(seed);
    let mut times = vec![];
    for i in 0..2_000 {
        let truth = view(2.0 + f64::from(i % 3) * 2.0, [10.0, 45.0][i as usize % 2]);
        let Some(corners) = noisy(&projected(&truth), 0.5, &mut random) else { continue };
        let started = Instant::now();
        let found = landmark_pose(&corners, &isotropic(0.5), SIZE, &CAMERA);
        times.push(started.elapsed().as_secs_f64() * 1e6);
        drop(std::hint::black_box(found));
    }
    cost_of(times)
}

/// The draws that are compared with a peer: truth, corners, what we make of them.
pub(super) fn draws(n: usize, seed: u64) -> Vec<(Isometry3<f64>, Corners, LandmarkPose)> {
    let mut random = Random::new(seed);
    let mut all = vec![];
    for sigma_px in [0.3, 0.8] {
        for d in [2.0, 4.0, 6.0] {
            for psi in [10.0, 45.0] {
                let truth = view(d, psi);
                all.extend((0..n).filter_map(|_| {
                    let corners = noisy(&projected(&truth), sigma_px, &mut random)?;
                    let found = landmark_pose(&corners, &isotropic(sigma_px), SIZE, &CAMERA).ok()?;
                    Some((truth, corners, found))
                }));
            }
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_and_the_covariance_agree() {
        for row in table(1) {
            for k in 0..3 {
                assert!((row.refined[k] / row.analytic[k] - 1.0).abs() < 0.12, "{row:?}");
                assert!((row.refined[k] / row.method_refined[k] - 1.0).abs() < 0.1, "{row:?}");
            }
        }
        assert!(exact(3).worst_m < 1e-6);
        let truth = view(4.0, 45.0);
        assert!(nearer_to_mirror(&view(4.0, -45.0), &truth) && !nearer_to_mirror(&view(4.0, 40.0), &truth));
    }
}
