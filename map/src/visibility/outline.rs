//! From bounds over direction to polygons on the floor, and measures of polygons.

use crate::visibility::{
    envelope::{MAX_SLOPE, Piece},
    local_frame::LocalFrame,
    quadrants::Quadrant,
    quarter_turn::turned_back,
};
use nalgebra::{Point2, Vector2};

/// Corners nearer to each other than this are merged, metres.
const SAME_M: f64 = 1e-9;
/// Corners nearer than this to the landmark's centre are moved there, metres.
const MIDDLE_M: f64 = 1e-5;
/// Corners nearer than this to the line between their neighbours are dropped, metres.
const STRAIGHT_M: f64 = 1e-8;
/// Smaller pieces and holes are dropped, square metres.
const MIN_AREA_M2: f64 = 1e-6;

/// A polygon, counter-clockwise; the first corner is not repeated.
#[derive(Debug, Clone, PartialEq)]
pub struct Polygon {
    /// Corners, metres, map frame.
    pub corners: Vec<Point2<f64>>,
    /// Corners of its hole, clockwise; empty for none. A landmark under a ceiling that is visible
    /// from all sides but not from directly below has one.
    pub hole: Vec<Point2<f64>>,
}

/// The sides of a ring.
fn sides(ring: &[Point2<f64>]) -> impl Iterator<Item = (&Point2<f64>, &Point2<f64>)> {
    ring.iter().zip(ring.iter().cycle().skip(1))
}

/// Area of a ring, positive counter-clockwise, and its first moment about `o`.
fn moments(ring: &[Point2<f64>], o: &Point2<f64>) -> (f64, Vector2<f64>) {
    sides(ring).fold((0.0, Vector2::zeros()), |(area, moment), (a, b)| {
        let (a, b) = (a - o, b - o);
        let part = 0.5 * a.perp(&b);
        (area + part, moment + (a + b) * (part / 3.0))
    })
}

impl Polygon {
    fn sides(&self) -> impl Iterator<Item = (&Point2<f64>, &Point2<f64>)> {
        sides(&self.corners).chain(sides(&self.hole))
    }

    /// Area, and its first moment about `o`.
    fn moments(&self, o: &Point2<f64>) -> (f64, Vector2<f64>) {
        let (outer, hole) = (moments(&self.corners, o), moments(&self.hole, o));
        (outer.0 + hole.0, outer.1 + hole.1)
    }

    /// Area, square metres.
    pub fn area_m2(&self) -> f64 {
        self.corners.first().map_or(0.0, |o| self.moments(o).0)
    }

    /// Distance of a point to the nearest side, from inside or outside, metres.
    pub fn boundary_distance_m(&self, q: &Point2<f64>) -> f64 {
        self.sides().map(|(a, b)| distance_to_segment(q, a, b)).fold(f64::INFINITY, f64::min)
    }

    /// Whether a point is inside, by the crossings of a ray.
    pub fn contains(&self, q: &Point2<f64>) -> bool {
        let crossed = self.sides().filter(|(a, b)| {
            (a.y > q.y) != (b.y > q.y) && q.x < a.x + (b.x - a.x) * ((q.y - a.y) / (b.y - a.y))
        });
        crossed.count() % 2 == 1
    }
}

/// Distance of `q` to the segment from `a` to `b`.
pub(crate) fn distance_to_segment(q: &Point2<f64>, a: &Point2<f64>, b: &Point2<f64>) -> f64 {
    let (d, to) = (b - a, q - a);
    let along = (d.dot(&to) / d.norm_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
    (to - d * along).norm()
}

/// Area and centroid of several polygons.
pub(super) fn measure(polygons: &[Polygon]) -> (f64, Option<Point2<f64>>) {
    let Some(o) = polygons.first().and_then(|p| p.corners.first()) else { return (0.0, None) };
    let total = polygons
        .iter()
        .map(|p| p.moments(o))
        .fold((0.0, Vector2::zeros()), |total, part| (total.0 + part.0, total.1 + part.1));
    (total.0, Some(o + total.1 / total.0))
}

/// The area between the near and the far bounds.
pub(super) fn outline(frame: &LocalFrame, quadrants: &[Quadrant; 4]) -> Vec<Polygon> {
    let mut runs: Vec<Run> = Vec::new();
    for (quarter, Quadrant { far, near }) in quadrants.iter().enumerate() {
        let (nears, mut next) = (near.pieces(), 0);
        for outer in far.pieces() {
            let mut from = outer.from;
            while from < outer.to {
                while nears.get(next).is_some_and(|p| p.to <= from) {
                    next += 1;
                }
                let ahead = nears.get(next);
                let change = |p: &Piece| if p.from > from { p.from } else { p.to };
                let to = ahead.map_or(outer.to, |p| change(p).min(outer.to));
                let strip = Strip { quarter, outer, inner: ahead.filter(|p| p.from <= from), from, to };
                strip.join(&mut runs);
                from = to;
            }
        }
    }
    closed(runs).into_iter().filter_map(|(run, round)| run.polygon(frame, round)).collect()
}

/// The last run goes on with the first where both reach the direction at which directions begin;
/// one that meets itself there goes all round.
fn closed(mut runs: Vec<Run>) -> Vec<(Run, bool)> {
    let begins = runs.first().is_some_and(|r| r.from <= -MAX_SLOPE + SAME);
    let ends = runs.last().is_some_and(|r| r.to >= direction(3, MAX_SLOPE) - SAME);
    let meets = begins && ends;
    if meets && runs.len() > 1 {
        let first = runs.remove(0);
        if let Some(last) = runs.last_mut() {
            last.outer.extend(first.outer);
            last.inner.extend(first.inner);
        }
        return runs.into_iter().map(|r| (r, false)).collect();
    }
    runs.into_iter().map(|r| (r, meets)).collect()
}

/// Directions closer than this are equal.
const SAME: f64 = 1e-12;

/// A continuous measure of direction over all quadrants: from -1, 2 for each.
fn direction(quarter: usize, slope: f64) -> f64 {
    2.0 * MAX_SLOPE * quarter as f64 + slope
}

/// The area between two bounds from one slope to another.
struct Strip<'a> {
    quarter: usize,
    outer: &'a Piece,
    inner: Option<&'a Piece>,
    from: f64,
    to: f64,
}

/// Outer and inner corners of one piece of area, by direction, about the landmark's centre.
struct Run {
    from: f64,
    to: f64,
    outer: Vec<Point2<f64>>,
    inner: Vec<Point2<f64>>,
}

impl Strip<'_> {
    /// Adds it to the last run if that ends where this begins.
    fn join(self, runs: &mut Vec<Run>) {
        let Self { quarter, outer, inner, from, to } = self;
        // The strip is open where the inner bound has the larger inverse.
        let room = |slope: f64| inner.map_or(f64::INFINITY, |i| i.at(slope) - outer.at(slope));
        let (first, last) = (room(from), room(to));
        if first <= 0.0 && last <= 0.0 {
            return;
        }
        let meet = || (from + (to - from) * first / (first - last)).clamp(from, to);
        let (from, to) = match (first < 0.0, last < 0.0) {
            (true, _) => (meet(), to),
            (_, true) => (from, meet()),
            _ => (from, to),
        };
        let (begin, end) = (direction(quarter, from), direction(quarter, to));
        if runs.last().is_none_or(|run| begin - run.to > SAME) {
            runs.push(Run { from: begin, to: begin, outer: Vec::new(), inner: Vec::new() });
        }
        let Some(run) = runs.last_mut() else { return };
        for slope in [from, to] {
            let floor = |inverse: f64| turned_back(&Point2::new(1.0 / inverse, slope / inverse), quarter);
            run.outer.push(floor(outer.at(slope)));
            let near = inner.map_or_else(Point2::origin, |i| floor(i.at(slope)));
            run.inner.push(if near.coords.norm() < MIDDLE_M { Point2::origin() } else { near });
        }
        run.to = end;
    }
}

impl Run {
    /// Its polygon; one that goes all round has its inner corners as a hole.
    fn polygon(self, frame: &LocalFrame, round: bool) -> Option<Polygon> {
        let back = self.inner.into_iter().rev();
        let (outer, hole): (Vec<_>, Vec<_>) = if round {
            (self.outer, back.collect())
        } else {
            (self.outer.into_iter().chain(back).collect(), vec![])
        };
        let ring = |corners: Vec<Point2<f64>>| -> Vec<Point2<f64>> {
            tidied(&corners).iter().map(|c| frame.map(c)).collect()
        };
        let (corners, mut hole) = (ring(outer), ring(hole));
        if hole.first().is_none_or(|o| -moments(&hole, o).0 <= MIN_AREA_M2) {
            hole.clear();
        }
        let polygon = Polygon { corners, hole };
        (polygon.corners.len() >= 3 && polygon.area_m2() > MIN_AREA_M2).then_some(polygon)
    }
}

/// A ring without coinciding corners and without corners on a straight line.
fn tidied(corners: &[Point2<f64>]) -> Vec<Point2<f64>> {
    let mut apart: Vec<Point2<f64>> = Vec::with_capacity(corners.len());
    for corner in corners {
        if apart.last().is_none_or(|last| (last - corner).norm() > SAME_M) {
            apart.push(*corner);
        }
    }
    while apart.len() > 1 && apart.first().zip(apart.last()).is_some_and(|(a, b)| (a - b).norm() <= SAME_M) {
        apart.pop();
    }
    let mut made: Vec<Point2<f64>> = Vec::with_capacity(apart.len());
    for (i, corner) in apart.iter().enumerate() {
        let next = apart[(i + 1) % apart.len()];
        let before = made.last().unwrap_or(&apart[apart.len() - 1]);
        if distance_to_segment(corner, before, &next) > STRAIGHT_M {
            made.push(*corner);
        }
    }
    made
}
