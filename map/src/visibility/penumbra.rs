//! What obstacles hide: of each its full penumbra, from everywhere in which some part of the landmark is not seen
//! (method 12.4), as bounds over direction. Exact, not sampled.

use super::{LocalFrame, Obstacle, envelope::Piece};
use nalgebra::Point2;

/// How near to the line through the landmark obstacles are looked at, metres.
const MIN_AHEAD_M: f64 = 1e-6;

/// The near borders of all penumbrae: each obstacle, and the crossing tangents beyond its ends. None when an obstacle
/// cuts the landmark itself.
pub(super) fn penumbrae(frame: &LocalFrame, half_width: f64, obstacles: &[Obstacle]) -> Option<Vec<Piece>> {
    let mut pieces = Vec::with_capacity(3 * obstacles.len());
    for obstacle in obstacles {
        let (a, b) = (frame.local(&obstacle.a), frame.local(&obstacle.b));
        if cuts(&a, &b, half_width) {
            return None;
        }
        let Some((a, b)) = ahead(a, b) else { continue };
        let seen = |q: &Point2<f64>| (q.y / q.x, 1.0 / q.x);
        pieces.extend(Piece::through(seen(&a), seen(&b)));
        // A viewer to the right sees the last of the landmark's left end, and the other way about: the tangent from
        // the left end leaves the obstacle's rightmost point, as seen from there, and goes on to its own direction.
        let from_left = |q: &Point2<f64>| (q.y + half_width) / q.x;
        let from_right = |q: &Point2<f64>| (q.y - half_width) / q.x;
        let rightmost = if from_left(&a) >= from_left(&b) { a } else { b };
        let leftmost = if from_right(&a) <= from_right(&b) { a } else { b };
        pieces.extend(Piece::through(seen(&rightmost), (from_left(&rightmost), 0.0)));
        pieces.extend(Piece::through(seen(&leftmost), (from_right(&leftmost), 0.0)));
    }
    Some(pieces)
}

/// Whether a to b touches the landmark, which lies on x = 0 within `half_width` of y = 0.
fn cuts(a: &Point2<f64>, b: &Point2<f64>, half_width: f64) -> bool {
    if a.x * b.x > 0.0 {
        return false;
    }
    let (low, high) = if a.x.abs() + b.x.abs() < MIN_AHEAD_M {
        (a.y.min(b.y), a.y.max(b.y))
    } else {
        let y = a.y + (b.y - a.y) * (a.x / (a.x - b.x));
        (y, y)
    };
    low <= half_width && high >= -half_width
}

/// The part of a to b before the landmark.
fn ahead(a: Point2<f64>, b: Point2<f64>) -> Option<(Point2<f64>, Point2<f64>)> {
    if a.x.max(b.x) < MIN_AHEAD_M {
        return None;
    }
    let cut = |inside: &Point2<f64>, outside: Point2<f64>| {
        if outside.x >= MIN_AHEAD_M {
            return outside;
        }
        let share = (MIN_AHEAD_M - outside.x) / (inside.x - outside.x);
        Point2::new(MIN_AHEAD_M, outside.y + (inside.y - outside.y) * share)
    };
    Some((cut(&b, a), cut(&a, b)))
}
