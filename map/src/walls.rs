//! The map of walls for poses that are known: segments are associated and merged (method 17.4,
//! 17.5).
//!
//! In: segments of a scan with the robot's pose and covariance. Out: the walls observed often
//! enough. It corrects no pose; [`crate::slam`] does.

use crate::{
    check::OutOfRange,
    pose2::{Pose2Covariance, wrap_rad},
    segments::LaserSegment,
};
use nalgebra::{Matrix2, Point2, Vector2};
use serde::{Deserialize, Serialize};

/// Most walls stored, confirmed or not.
pub const MAX_WALLS: usize = 4096;

/// Parameters of the wall map.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct WallParams {
    /// Gate on the squared Mahalanobis distance of two lines (2 degrees of freedom, 99 %).
    pub gate_chi2: f64,
    /// Unevenness of real walls, added to the offset of every line: standard deviation, metres.
    pub rough_m: f64,
    /// Unevenness of real walls, added to the direction of every line: standard deviation, radians.
    pub rough_rad: f64,
    /// Segments that overlap by this share of the shorter one belong together.
    pub overlap: f64,
    /// So do segments whose gap is smaller than this, metres.
    pub gap_m: f64,
    /// Observations that confirm a wall.
    pub min_hits: u32,
}

impl Default for WallParams {
    fn default() -> Self {
        Self { gate_chi2: 9.21, rough_m: 0.01, rough_rad: 0.005, overlap: 0.5, gap_m: 0.3, min_hits: 3 }
    }
}

/// Walls collected so far, map frame.
#[derive(Debug, Clone, Default)]
pub struct Walls {
    params: WallParams,
    segments: Vec<LaserSegment>,
}

impl Walls {
    /// An empty map.
    pub fn new(params: WallParams) -> Self {
        Self { params, segments: Vec::new() }
    }

    /// Confirmed walls, in the order of their first observation.
    pub fn segments(&self) -> impl Iterator<Item = &LaserSegment> {
        self.segments.iter().filter(|s| s.hits >= self.params.min_hits)
    }

    /// All segments, unconfirmed ones included.
    pub fn candidates(&self) -> &[LaserSegment] {
        &self.segments
    }

    /// Adds the segments (robot frame) of one scan taken at `map_from_robot`. At [`MAX_WALLS`] the
    /// oldest of the candidates with fewest observations is dropped.
    pub fn add(
        &mut self,
        map_from_robot: &Pose2Covariance,
        segments: &[LaserSegment],
    ) -> Result<(), OutOfRange> {
        map_from_robot.check()?;
        for segment in segments {
            let mut segment = segment.transformed(map_from_robot);
            segment.hits = 1;
            self.insert(segment);
        }
        Ok(())
    }

    fn insert(&mut self, segment: LaserSegment) {
        let nearest = (0..self.segments.len())
            .filter_map(|i| Some((i, self.distance2(&self.segments[i], &segment)?)))
            .min_by(|a, b| a.1.total_cmp(&b.1));
        let Some((i, _)) = nearest else {
            if self.segments.len() >= MAX_WALLS {
                let least = (0..self.segments.len()).min_by_key(|&i| self.segments[i].hits).unwrap_or(0);
                self.segments.remove(least);
            }
            self.segments.push(segment);
            return;
        };
        self.segments[i] = fused(&self.segments[i], &segment);
        // The longer wall may now reach another one.
        while let Some(j) = (0..self.segments.len())
            .find(|&j| j != i && self.distance2(&self.segments[i], &self.segments[j]).is_some())
        {
            let (keep, gone) = (i.min(j), i.max(j));
            self.segments[keep] = fused(&self.segments[keep], &self.segments[gone]);
            self.segments.remove(gone);
            if keep != i {
                break;
            }
        }
    }

    /// Squared Mahalanobis distance of the lines if both are one wall's: same face, near enough
    /// along it, in the gate.
    fn distance2(&self, wall: &LaserSegment, segment: &LaserSegment) -> Option<f64> {
        let p = &self.params;
        let (d, s) = difference(wall, segment);
        let rough = Matrix2::new(p.rough_rad.powi(2), 0.0, 0.0, p.rough_m.powi(2));
        let same_face = wall.facing().dot(&segment.facing()) > 0.5;
        let (overlap_m, gap_m) = along(wall, segment);
        let near = gap_m <= p.gap_m || overlap_m >= p.overlap * wall.length_m().min(segment.length_m());
        let d2 = (s + rough).cholesky().map(|c| d.dot(&c.solve(&d)))?;
        (same_face && near && d2 <= p.gate_chi2).then_some(d2)
    }
}

/// Both lines as (angle, offset) around the middle of both segments: `b - a`, and the sum of their
/// covariances there.
fn difference(a: &LaserSegment, b: &LaserSegment) -> (Vector2<f64>, Matrix2<f64>) {
    let middle = Point2::from((a.a.coords + a.b.coords + b.a.coords + b.b.coords) * 0.25);
    let ((la, ca), (lb, cb)) = (local(a, &middle), local(b, &middle));
    (Vector2::new(wrap_rad(lb.x - la.x), lb.y - la.y), ca + cb)
}

/// The line as (direction of its facing normal, signed distance from `origin` along it), with
/// covariance.
pub(crate) fn local(s: &LaserSegment, origin: &Point2<f64>) -> (Vector2<f64>, Matrix2<f64>) {
    let n = s.facing();
    let angle = n.y.atan2(n.x);
    let offset = n.dot(&(s.a - origin));
    // (alpha, rho) belongs to +n or -n; the angle's error is the same, the offset's changes its
    // sign.
    let sign = if n.dot(&Vector2::new(s.alpha_rad.cos(), s.alpha_rad.sin())) < 0.0 { -1.0 } else { 1.0 };
    let t = Vector2::new(-n.y, n.x);
    // offset = sign * rho - n(angle) . origin
    let j = Matrix2::new(1.0, 0.0, -t.dot(&origin.coords), sign);
    (Vector2::new(angle, offset), j * s.covariance * j.transpose())
}

/// Overlap and gap of two segments along the first, metres (one of them is zero).
fn along(a: &LaserSegment, b: &LaserSegment) -> (f64, f64) {
    let t = a.direction();
    let (p, q) = (t.dot(&(b.a - a.a)), t.dot(&(b.b - a.a)));
    let (low, high) = (p.min(q).max(0.0), p.max(q).min(a.length_m()));
    ((high - low).max(0.0), (low - high).max(0.0))
}

/// Two observations of one wall merged; the extent is the union.
fn fused(a: &LaserSegment, b: &LaserSegment) -> LaserSegment {
    let middle = Point2::from((a.a.coords + a.b.coords + b.a.coords + b.b.coords) * 0.25);
    let ((la, ca), (lb, cb)) = (local(a, &middle), local(b, &middle));
    let d = Vector2::new(wrap_rad(lb.x - la.x), lb.y - la.y);
    let (Some(ia), Some(ib)) = (ca.try_inverse(), cb.try_inverse()) else { return a.clone() };
    // Departs from method 17.6, a filter over robot and lines, which knows what they share.
    // Covariance intersection, weighted by hits: observations share the robot's pose error by an
    // unknown amount, so their number must not shrink the covariance (method 11.5 solves the same
    // by inflation).
    let share = f64::from(a.hits) / (f64::from(a.hits) + f64::from(b.hits));
    let Some(covariance) = (ia * share + ib * (1.0 - share)).try_inverse() else { return a.clone() };
    let line = la + covariance * ib * (1.0 - share) * d;
    let covariance = 0.5 * (covariance + covariance.transpose());
    // Back to (alpha, rho) of the map: rho = offset + n . origin, and positive.
    let n = Vector2::new(line.x.cos(), line.x.sin());
    let t = Vector2::new(-n.y, n.x);
    let j = Matrix2::new(1.0, 0.0, t.dot(&middle.coords), 1.0);
    let rho = line.y + n.dot(&middle.coords);
    let covariance = j * covariance * j.transpose();
    // `a` to `b` keeps the free side, on which n points, on the left: direction is -t.
    let forward = -t;
    let reach = |p: &Point2<f64>| forward.dot(&(p - middle));
    let ends = [a.a, a.b, b.a, b.b];
    let (mut first, mut last) = (ends[0], ends[0]);
    for p in ends {
        if reach(&p) < reach(&first) {
            first = p;
        }
        if reach(&p) > reach(&last) {
            last = p;
        }
    }
    LaserSegment::on_line((wrap_rad(line.x), rho), (first, last), covariance, a.hits.saturating_add(b.hits))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pose2::Pose2;
    use nalgebra::{Matrix3, Vector3};
    use std::f64::consts::PI;

    fn at(x: f64, y: f64, theta: f64) -> Pose2Covariance {
        let v = Vector3::new(1e-4, 1e-4, 4e-6);
        Pose2Covariance { pose: Pose2::new(x, y, theta), covariance: Matrix3::from_diagonal(&v) }
    }

    /// A wall of the map as a segment in the robot frame.
    fn segment(from: &Pose2Covariance, a: [f64; 2], b: [f64; 2]) -> LaserSegment {
        let inverse = from.pose.inverse();
        let covariance = Matrix2::new(1e-6, 0.0, 0.0, 1e-5);
        LaserSegment::from_ends(inverse.apply(&Point2::from(a)), inverse.apply(&Point2::from(b)), covariance)
            .unwrap()
    }

    #[test]
    fn pieces_of_a_wall_are_merged() {
        let mut walls = Walls::default();
        for i in 0..6 {
            let robot = at(f64::from(i), 0.0, 0.3 * f64::from(i));
            let x = f64::from(i);
            // North wall, free side to the south: it runs from east to west.
            walls.add(&robot, &[segment(&robot, [x + 1.5, 2.0], [x - 1.0, 2.0])]).unwrap();
        }
        let all: Vec<_> = walls.segments().collect();
        assert_eq!(all.len(), 1);
        assert!((all[0].a - Point2::new(6.5, 2.0)).norm() < 1e-6, "{:?}", all[0]);
        assert!((all[0].b - Point2::new(-1.0, 2.0)).norm() < 1e-6);
        assert_eq!(all[0].hits, 6);
        assert!((all[0].facing() + Vector2::y()).norm() < 1e-9);
    }

    #[test]
    fn a_third_observation_joins_two_walls_and_two_are_not_enough() {
        let mut walls = Walls::default();
        let robot = at(0.0, 0.0, 0.0);
        walls
            .add(&robot, &[segment(&robot, [1.0, 2.0], [0.0, 2.0]), segment(&robot, [4.0, 2.0], [3.0, 2.0])])
            .unwrap();
        assert_eq!((walls.candidates().len(), walls.segments().count()), (2, 0));
        walls.add(&robot, &[segment(&robot, [3.5, 2.0], [0.5, 2.0])]).unwrap();
        assert_eq!((walls.candidates().len(), walls.segments().count()), (1, 1));
        assert!((walls.candidates()[0].length_m() - 4.0).abs() < 1e-9);
    }

    #[test]
    fn two_faces_and_a_doorway_stay_apart() {
        let mut walls = Walls::default();
        let (south, north) = (at(0.0, 0.0, 0.0), at(0.0, 4.0, 1.0));
        for _ in 0..3 {
            walls.add(&south, &[segment(&south, [1.0, 2.0], [-1.0, 2.0])]).unwrap();
            walls.add(&north, &[segment(&north, [-1.0, 2.01], [1.0, 2.01])]).unwrap();
            // The same wall behind a door 0.9 m wide.
            walls.add(&south, &[segment(&south, [3.0, 2.0], [1.9, 2.0])]).unwrap();
            // A parallel wall 15 cm further.
            walls.add(&south, &[segment(&south, [1.0, 2.15], [-1.0, 2.15])]).unwrap();
        }
        assert_eq!(walls.segments().count(), 4);
    }

    #[test]
    fn repeated_observations_of_a_standing_robot_add_nothing() {
        let mut walls = Walls::default();
        let robot = at(0.0, 0.0, 0.0);
        let one = segment(&robot, [1.0, 2.0], [-1.0, 2.0]).transformed(&robot).covariance;
        for _ in 0..50 {
            walls.add(&robot, &[segment(&robot, [1.0, 2.0], [-1.0, 2.0])]).unwrap();
        }
        let stored = walls.candidates()[0].covariance;
        assert!((stored - one).norm() < 1e-9, "{stored} {one}");
    }

    #[test]
    fn many_walls_are_bounded() {
        let mut walls = Walls::default();
        let robot = at(0.0, 0.0, 0.0);
        for i in 0..MAX_WALLS + 10 {
            let y = 2.0 + i as f64;
            let hits = if i < 5 { 3 } else { 1 };
            for _ in 0..hits {
                walls.add(&robot, &[segment(&robot, [1.0, y], [-1.0, y])]).unwrap();
            }
        }
        assert_eq!(walls.candidates().len(), MAX_WALLS);
        assert_eq!(walls.segments().count(), 5, "walls with many observations stay");
        assert!(walls.add(&at(f64::NAN, 0.0, 0.0), &[]).is_err());
    }

    #[test]
    fn noisy_observations_stay_within_their_covariance() {
        // Oracle: Monte Carlo over robot poses; the line's error against its claimed covariance.
        let mut random = vision::random::Random::new(4);
        let (mut sum, draws) = (0.0, 300);
        for _ in 0..draws {
            let mut walls = Walls::default();
            for i in 0..5 {
                let believed = at(f64::from(i), 0.0, 0.0);
                let e = Vector3::new(0.01 * random.normal(), 0.01 * random.normal(), 0.002 * random.normal());
                let truth = Pose2Covariance { pose: believed.pose.plus(&e), ..believed };
                walls.add(&believed, &[segment(&truth, [4.0, 2.0], [-1.0, 2.0])]).unwrap();
            }
            let wall = &walls.candidates()[0];
            let e = Vector2::new(wrap_rad(wall.alpha_rad - 0.5 * PI), wall.rho_m - 2.0);
            sum += e.dot(&wall.covariance.cholesky().unwrap().solve(&e));
        }
        // Never overconfident; independent errors are not credited, so well below 2.
        let mean = sum / f64::from(draws);
        assert!((0.2..2.0).contains(&mean), "{mean}");
    }
}
