//! Surface points of a scan, robot frame: thinned to even spacing, with the surface's direction
//! where neighbouring beams determine it. In: a scan. Out: the points that scan matching uses.

use crate::laser::Scan;
use nalgebra::{Matrix2, Point2, Vector2};
use serde::{Deserialize, Serialize};

/// The surface points of one scan.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CloudParams {
    /// Longer returns are left out: their points are too far apart, metres.
    pub max_range_m: f64,
    /// Points nearer than this to the one before are left out, so that near walls do not outweigh
    /// far ones, metres.
    pub spacing_m: f64,
    /// Neighbouring returns are one surface if their ranges differ by less than this, metres,
    pub jump_m: f64,
    /// or by less than this many times the beam step times the range: a wall at a grazing angle.
    pub jump_steps: f64,
    /// Least beams on each side that determine the surface's direction,
    pub reach: usize,
    /// and all beams up to this distance, metres: near walls have many.
    pub reach_m: f64,
    /// A surface with a neighbour farther off its line is not flat, metres.
    pub flat_m: f64,
}

impl Default for CloudParams {
    fn default() -> Self {
        Self {
            max_range_m: 40.0,
            spacing_m: 0.06,
            jump_m: 0.15,
            jump_steps: 8.0,
            reach: 3,
            reach_m: 0.2,
            flat_m: 0.05,
        }
    }
}

/// A point of a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfacePoint {
    /// Position, robot frame, metres.
    pub at: Point2<f64>,
    /// Unit normal towards the laser, where the surface is flat.
    pub normal: Option<Vector2<f64>>,
    /// Variance of the normal's direction, rad^2; 0 without a normal.
    pub turn_variance: f64,
    /// Whether the surface continues to the previous point in the list.
    pub joined: bool,
}

/// The points of one scan.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Cloud {
    /// In the order of the beams.
    pub points: Vec<SurfacePoint>,
    /// Position of the laser, robot frame, metres.
    pub origin: Point2<f64>,
    /// Bearings of the first and the last beam, robot frame, radians.
    pub fan_rad: [f64; 2],
}

/// Extracts the surface points of a scan.
pub fn cloud(scan: &Scan, p: &CloudParams) -> Cloud {
    let n = scan.ranges_m().len();
    let range = |i: usize| scan.range_m(i).filter(|r| *r <= p.max_range_m);
    let step = scan.bearing_step_rad().abs();
    // joined[i]: beams i - 1 and i hit one surface.
    let joined: Vec<bool> = (0..n)
        .map(|i| {
            let before = if i > 0 { range(i - 1) } else { None };
            matches!((before, range(i)), (Some(a), Some(b))
                if (a - b).abs() <= p.jump_m.max(p.jump_steps * step * a.min(b)))
        })
        .collect();
    let mount = scan.robot_from_laser();
    let heading = mount.theta_rad;
    let mut points: Vec<SurfacePoint> = Vec::with_capacity(n);
    let mut chain = false;
    for i in 0..n {
        chain &= joined[i];
        let (Some(_), Some(point)) = (range(i), scan.point(i)) else { continue };
        let at = mount.apply(&point);
        let crowded = chain && points.last().is_some_and(|q| (q.at - at).norm() < p.spacing_m);
        if crowded {
            continue;
        }
        let flat = normal(scan, i, &joined, p);
        let normal = flat.map(|(v, _)| mount.apply(&Point2::from(v)) - mount.apply(&Point2::origin()));
        let turn_variance = flat.map_or(0.0, |(_, variance)| variance);
        points.push(SurfacePoint { at, normal, turn_variance, joined: chain });
        chain = true;
    }
    let fan_rad = [scan.bearing_rad(0) + heading, scan.bearing_rad(n.saturating_sub(1)) + heading];
    Cloud { points, origin: Point2::new(mount.x_m, mount.y_m), fan_rad }
}

/// Direction of the surface at beam `i` from its neighbours on the same surface, laser frame, and
/// its variance.
fn normal(scan: &Scan, i: usize, joined: &[bool], p: &CloudParams) -> Option<(Vector2<f64>, f64)> {
    let here = scan.point(i)?;
    let near = |k: usize| scan.point(k).is_some_and(|q| (q - here).norm() <= p.reach_m);
    let (mut first, mut last) = (i, i);
    while first > 0 && joined[first] && (i - first < p.reach || near(first - 1)) {
        first -= 1;
    }
    while last + 1 < joined.len() && joined[last + 1] && (last - i < p.reach || near(last + 1)) {
        last += 1;
    }
    let near: Vec<Point2<f64>> = (first..=last).filter_map(|k| scan.point(k)).collect();
    if near.len() < 3 {
        return None;
    }
    let n = near.len() as f64;
    let centre = near.iter().fold(Vector2::zeros(), |sum, q| sum + q.coords) / n;
    let scatter: Matrix2<f64> =
        near.iter().map(|q| (q.coords - centre) * (q.coords - centre).transpose()).sum();
    // The smaller eigenvector of a symmetric 2 x 2 matrix in closed form.
    let angle = 0.5 * (2.0 * scatter[(0, 1)]).atan2(scatter[(0, 0)] - scatter[(1, 1)]);
    let across = Vector2::new(-angle.sin(), angle.cos());
    let off = near.iter().map(|q| across.dot(&(q.coords - centre)).abs()).fold(0.0, f64::max);
    let along = near.iter().map(|q| across.perp(&(q.coords - centre)).abs()).fold(0.0, f64::max);
    if off > p.flat_m || off > 0.5 * along {
        return None;
    }
    let (squares, spread) = (across.dot(&(scatter * across)), scatter.trace());
    // The line itself takes two degrees of freedom.
    let variance = (squares / (n - 2.0)).max(0.0) / (spread - squares).max(1e-9);
    Some((if across.dot(&-here.coords) < 0.0 { -across } else { across }, variance))
}
