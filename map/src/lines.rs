//! Line extraction from a laser scan: break at jumps, split, merge, fit (method 17.1 to 17.3).
//!
//! In: a checked scan. Out: segments in the robot frame, each with the covariance of its line, free
//! side on the left. Beams without a return break a run. Pieces that are not straight or too short
//! are left out.

use crate::{laser::Scan, pose2::Pose2Covariance, segments::LaserSegment};
use nalgebra::{Matrix2, Matrix3, Point2, Vector2};
use serde::{Deserialize, Serialize};

/// Most segments taken from one scan.
pub const MAX_SEGMENTS_PER_SCAN: usize = 256;

/// Parameters of line extraction.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LineParams {
    /// Standard deviation of a range, metres.
    pub range_sigma_m: f64,
    /// A jump in range of at least this breaks the run, metres.
    pub jump_m: f64,
    /// Added to the jump, as a multiple of `range * bearing step`: a wall at a grazing angle is one
    /// run.
    pub jump_steps: f64,
    /// A point farther than this from the chord splits the run, metres.
    pub split_m: f64,
    /// Neighbours whose lines differ by less than this chi2 are merged (2 degrees of freedom, 99
    /// %).
    pub merge_chi2: f64,
    /// Fewest points of a segment.
    pub min_points: usize,
    /// Length of the shortest segment, metres.
    pub min_length_m: f64,
}

impl Default for LineParams {
    fn default() -> Self {
        Self {
            range_sigma_m: 0.01,
            jump_m: 0.10,
            jump_steps: 5.0,
            split_m: 0.03,
            merge_chi2: 9.21,
            min_points: 8,
            min_length_m: 0.4,
        }
    }
}

/// Straight pieces of wall in the robot frame, in order of bearing; the longest
/// [`MAX_SEGMENTS_PER_SCAN`] at most.
pub fn segments(scan: &Scan, p: &LineParams) -> Vec<LaserSegment> {
    let mut found = Vec::new();
    for run in runs(scan, p) {
        let mut pieces = split(&run, p.split_m);
        merge(&run, &mut pieces, p);
        found.extend(pieces.iter().filter_map(|&(first, last)| segment(&run[first..=last], scan, p)));
    }
    if found.len() > MAX_SEGMENTS_PER_SCAN {
        let mut lengths: Vec<f64> = found.iter().map(LaserSegment::length_m).collect();
        lengths.sort_by(|a, b| b.total_cmp(a));
        let shortest = lengths[MAX_SEGMENTS_PER_SCAN - 1];
        found.retain(|s| s.length_m() >= shortest);
        found.truncate(MAX_SEGMENTS_PER_SCAN);
    }
    let mount = Pose2Covariance { pose: *scan.robot_from_laser(), covariance: Matrix3::zeros() };
    found.iter().map(|s| s.transformed(&mount)).collect()
}

/// Consecutive returns without a jump between them, laser frame.
fn runs(scan: &Scan, p: &LineParams) -> Vec<Vec<Point2<f64>>> {
    let step = scan.bearing_step_rad().abs();
    let (mut runs, mut run) = (Vec::new(), Vec::new());
    let mut before: Option<f64> = None;
    for i in 0..scan.ranges_m().len() {
        let range = scan.range_m(i);
        let joined = matches!((before, range), (Some(a), Some(b))
            if (a - b).abs() <= p.jump_m.max(3.0 * p.range_sigma_m + p.jump_steps * step * a.min(b)));
        if !joined && !run.is_empty() {
            runs.push(std::mem::take(&mut run));
        }
        run.extend(scan.point(i));
        before = range;
    }
    runs.push(run);
    runs.retain(|r| r.len() >= p.min_points.max(2));
    runs
}

/// Inclusive index ranges of pieces whose points lie within `tolerance_m` of their chord.
/// Neighbours share no point: the corner itself belongs to the earlier piece.
fn split(run: &[Point2<f64>], tolerance_m: f64) -> Vec<(usize, usize)> {
    let mut pieces = Vec::new();
    // An explicit stack: a scan decides how deep this goes.
    let mut open = vec![(0, run.len() - 1)];
    while let Some((first, last)) = open.pop() {
        let chord = run[last] - run[first];
        let length = chord.norm();
        let off = |i: &usize| {
            let d = run[*i] - run[first];
            if length > 0.0 { (chord.perp(&d) / length).abs() } else { d.norm() }
        };
        let farthest = (first + 1..last).max_by(|a, b| off(a).total_cmp(&off(b)));
        match farthest {
            Some(at) if off(&at) > tolerance_m => {
                open.push((at + 1, last));
                open.push((first, at));
            }
            _ => pieces.push((first, last)),
        }
    }
    pieces
}

/// Joins neighbours that are one line, until none are left to join.
fn merge(run: &[Point2<f64>], pieces: &mut Vec<(usize, usize)>, p: &LineParams) {
    let mut i = 0;
    while i + 1 < pieces.len() {
        let (a, b) = (pieces[i], pieces[i + 1]);
        if is_one_line(&run[a.0..=a.1], &run[b.0..=b.1], &run[a.0..=b.1], p) {
            pieces[i] = (a.0, b.1);
            pieces.remove(i + 1);
            i = i.saturating_sub(1);
        } else {
            i += 1;
        }
    }
}

/// Both lines agree within their covariance, and no point leaves the joint line.
fn is_one_line(a: &[Point2<f64>], b: &[Point2<f64>], joint: &[Point2<f64>], p: &LineParams) -> bool {
    let (Some(fa), Some(fb), Some(fj)) =
        (fit(a, p.range_sigma_m), fit(b, p.range_sigma_m), fit(joint, p.range_sigma_m))
    else {
        return false;
    };
    // In line coordinates of the joint fit, both lines are (angle, offset) with zero expectation of
    // the difference.
    let d = Vector2::new(half_turn(fa.alpha_rad - fb.alpha_rad), fa.offset(&fj) - fb.offset(&fj));
    let s = fa.local_covariance(&fj) + fb.local_covariance(&fj);
    let agree = s.cholesky().is_some_and(|c| d.dot(&c.solve(&d)) <= p.merge_chi2);
    agree && joint.iter().all(|q| fj.distance(q).abs() <= p.split_m)
}

/// Wraps the difference of two undirected line angles into (-pi/2, pi/2].
fn half_turn(angle_rad: f64) -> f64 {
    let a = angle_rad.rem_euclid(std::f64::consts::PI);
    if a > std::f64::consts::FRAC_PI_2 { a - std::f64::consts::PI } else { a }
}

/// A line fitted to points.
#[derive(Debug, Clone)]
pub(crate) struct LineFit {
    /// Direction of the normal; `cos(alpha) x + sin(alpha) y = rho`, rho >= 0.
    pub alpha_rad: f64,
    pub rho_m: f64,
    /// Covariance of (alpha, rho): rad^2, rad m, m^2.
    pub covariance: Matrix2<f64>,
    centre: Point2<f64>,
    var_alpha: f64,
    var_offset: f64,
}

impl LineFit {
    fn normal(&self) -> Vector2<f64> {
        Vector2::new(self.alpha_rad.cos(), self.alpha_rad.sin())
    }

    fn distance(&self, p: &Point2<f64>) -> f64 {
        self.normal().dot(&p.coords) - self.rho_m
    }

    /// Where this line crosses the normal of `at` through its centre.
    fn offset(&self, at: &Self) -> f64 {
        let n = at.normal();
        -self.distance(&at.centre) / self.normal().dot(&n)
    }

    /// Covariance of (angle, offset at the centre of `at`).
    fn local_covariance(&self, at: &Self) -> Matrix2<f64> {
        let n = at.normal();
        let u = Vector2::new(-n.y, n.x).dot(&(at.centre - self.centre));
        // Turning about its own centre moves the line there by -u times the angle.
        let c = -u * self.var_alpha;
        Matrix2::new(self.var_alpha, c, c, self.var_offset + u * u * self.var_alpha)
    }
}

/// Total least squares with the closed covariance of method 17.3; `None` for fewer than two
/// distinct points.
pub(crate) fn fit(points: &[Point2<f64>], sigma_m: f64) -> Option<LineFit> {
    let n = points.len() as f64;
    let centre = Point2::from(points.iter().fold(Vector2::zeros(), |sum, p| sum + p.coords) / n);
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for p in points {
        let d = p - centre;
        (xx, xy, yy) = (xx + d.x * d.x, xy + d.x * d.y, yy + d.y * d.y);
    }
    let mut alpha_rad = 0.5 * (-2.0 * xy).atan2(yy - xx);
    let mut rho_m = alpha_rad.cos() * centre.x + alpha_rad.sin() * centre.y;
    if rho_m < 0.0 {
        (alpha_rad, rho_m) = (crate::pose2::wrap_rad(alpha_rad + std::f64::consts::PI), -rho_m);
    }
    let t = Vector2::new(-alpha_rad.sin(), alpha_rad.cos());
    let along: f64 = points.iter().map(|p| t.dot(&(p - centre)).powi(2)).sum();
    if points.len() < 2 || along <= 1e-12 {
        return None;
    }
    let u = t.dot(&centre.coords);
    let (var_alpha, var_offset) = (sigma_m * sigma_m / along, sigma_m * sigma_m / n);
    let covariance = Matrix2::new(var_alpha, u * var_alpha, u * var_alpha, var_offset + u * u * var_alpha);
    Some(LineFit { alpha_rad, rho_m, covariance, centre, var_alpha, var_offset })
}

/// The segment of a piece, if it is long enough and has enough points.
fn segment(points: &[Point2<f64>], scan: &Scan, p: &LineParams) -> Option<LaserSegment> {
    if points.len() < p.min_points {
        return None;
    }
    let line = fit(points, p.range_sigma_m)?;
    let (first, last) = (*points.first()?, *points.last()?);
    // Counter-clockwise order keeps the laser on the left.
    let ends = if scan.bearing_step_rad() > 0.0 { (first, last) } else { (last, first) };
    let made = LaserSegment::on_line((line.alpha_rad, line.rho_m), ends, line.covariance, 1);
    (made.length_m() >= p.min_length_m).then_some(made)
}

#[cfg(test)]
mod tests;
