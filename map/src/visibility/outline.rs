//! From bounds over direction to polygons on the floor, and what is measured on polygons.

use super::{
    LocalFrame,
    envelope::{Envelope, Piece},
};
use nalgebra::{Point2, Vector2};

/// Corners nearer to each other than this are one, metres.
const SAME_M: f64 = 1e-9;
/// Corners nearer than this to the line between their neighbours are none, metres.
const STRAIGHT_M: f64 = 1e-8;
/// Pieces of area smaller than this are left out, square metres.
const MIN_AREA_M2: f64 = 1e-6;

/// A polygon without holes, counter-clockwise; the last corner is not the first.
#[derive(Debug, Clone, PartialEq)]
pub struct Polygon {
    /// Corners, metres.
    pub corners: Vec<Point2<f64>>,
}

impl Polygon {
    fn sides(&self) -> impl Iterator<Item = (&Point2<f64>, &Point2<f64>)> {
        self.corners.iter().zip(self.corners.iter().cycle().skip(1))
    }

    /// Area, and its first moment about the first corner.
    fn moments(&self) -> (f64, Vector2<f64>) {
        let Some(o) = self.corners.first() else { return (0.0, Vector2::zeros()) };
        self.sides().fold((0.0, Vector2::zeros()), |(area, moment), (a, b)| {
            let (a, b) = (a - o, b - o);
            let part = 0.5 * a.perp(&b);
            (area + part, moment + (a + b) * (part / 3.0))
        })
    }

    /// Area, square metres.
    pub fn area_m2(&self) -> f64 {
        self.moments().0
    }

    /// Distance of a point to the nearest side, from inside or outside.
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
pub(super) fn distance_to_segment(q: &Point2<f64>, a: &Point2<f64>, b: &Point2<f64>) -> f64 {
    let (d, to) = (b - a, q - a);
    let along = (d.dot(&to) / d.norm_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
    (to - d * along).norm()
}

/// Area and centroid of several polygons.
pub(super) fn measure(polygons: &[Polygon]) -> (f64, Option<Point2<f64>>) {
    let Some(o) = polygons.first().and_then(|p| p.corners.first()) else { return (0.0, None) };
    let mut total = (0.0, Vector2::zeros());
    for polygon in polygons {
        let (area, moment) = polygon.moments();
        let first = polygon.corners.first().map_or_else(Vector2::zeros, |c| c - o);
        total = (total.0 + area, total.1 + moment + first * area);
    }
    (total.0, Some(o + total.1 / total.0))
}

/// The area between `near` and `far`.
pub(super) fn outline(frame: &LocalFrame, far: &Envelope, near: &Envelope) -> Vec<Polygon> {
    let mut made = Vec::new();
    let mut run = Run::default();
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
            run.take(frame, outer, ahead.filter(|p| p.from <= from), (from, to), &mut made);
            from = to;
        }
    }
    made.extend(run.close(frame));
    made
}

/// Without the corners at which the outline goes straight on.
fn without_straight(corners: &[Point2<f64>]) -> Vec<Point2<f64>> {
    let mut made: Vec<Point2<f64>> = Vec::with_capacity(corners.len());
    for (i, corner) in corners.iter().enumerate() {
        let next = corners[(i + 1) % corners.len()];
        let before = made.last().unwrap_or(&corners[corners.len() - 1]);
        if distance_to_segment(corner, before, &next) > STRAIGHT_M {
            made.push(*corner);
        }
    }
    made
}

/// Outer and inner corners of one piece of area, by slope.
#[derive(Default)]
struct Run {
    to: Option<f64>,
    outer: Vec<(f64, f64)>,
    /// Empty inverse: no bound, the landmark's middle itself.
    inner: Vec<(f64, Option<f64>)>,
}

impl Run {
    /// Adds what lies between the bounds from one slope to another.
    fn take(
        &mut self,
        frame: &LocalFrame,
        outer: &Piece,
        inner: Option<&Piece>,
        (from, to): (f64, f64),
        made: &mut Vec<Polygon>,
    ) {
        // Room is left where the inner bound has the larger inverse.
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
        if self.to.is_none_or(|end| from - end > 1e-12 * (1.0 + from.abs())) {
            made.extend(self.close(frame));
        }
        for slope in [from, to] {
            self.outer.push((slope, outer.at(slope)));
            self.inner.push((slope, inner.map(|i| i.at(slope))));
        }
        self.to = Some(to);
    }

    /// The polygon of what was taken; begins anew.
    fn close(&mut self, frame: &LocalFrame) -> Option<Polygon> {
        let run = std::mem::take(self);
        let floor = |slope: f64, inverse: f64| Point2::new(1.0 / inverse, slope / inverse);
        let outer = run.outer.iter().map(|(slope, inverse)| floor(*slope, *inverse));
        let inner =
            run.inner.iter().rev().map(|(slope, i)| i.map_or_else(Point2::origin, |i| floor(*slope, i)));
        let mut corners: Vec<Point2<f64>> = Vec::with_capacity(run.outer.len() + run.inner.len());
        for corner in outer.chain(inner) {
            if corners.last().is_none_or(|last| (last - corner).norm() > SAME_M) {
                corners.push(corner);
            }
        }
        while corners.len() > 1
            && corners.first().zip(corners.last()).is_some_and(|(a, b)| (a - b).norm() <= SAME_M)
        {
            corners.pop();
        }
        let corners = without_straight(&corners);
        let polygon = Polygon { corners: corners.iter().map(|c| frame.map(c)).collect() };
        (polygon.corners.len() >= 3 && polygon.area_m2() > MIN_AREA_M2).then_some(polygon)
    }
}
