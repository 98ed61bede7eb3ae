//! Quad proposals from two segments that face each other, their ends the corners. The other two
//! sides of a small, blurred or rounded object are too short to be segments. In: segments. Out:
//! rough corners; `quad_proposals` checks their sides.
//!
//! Departs from method 2, where the sides of such a pair are scored by cues: here the gradient
//! decides.

use crate::detect::segments::edge_segments::EdgeSegment;
use nalgebra::Point2;

/// Most partners of a segment, the best across first.
pub const MAX_PARTNERS: usize = 12;
/// The shorter of two segments is at least this share of the longer.
const MIN_RATIO: f64 = 0.6;
/// Sine of the largest angle between them: 20 degrees, for a quad seen obliquely.
const MAX_SIN: f64 = 0.35;
/// Cosine of the smallest angle between a segment and the connection of the ends: 45 degrees.
const MAX_LEAN: f64 = 0.7;
/// Smallest and largest length of a connection: a longer side would be a segment.
const ACROSS_PX: [f64; 2] = [12.0, 60.0];
/// Of the two connections the shorter is at least this share of the longer.
const MIN_ACROSS_RATIO: f64 = 0.5;

/// A segment across from another one.
#[derive(Debug, Clone, Copy)]
pub struct Partner {
    /// Index of the other segment.
    pub other: usize,
    /// First end of the one, its other end, that of the other across from it, and across from the
    /// first.
    pub corners_px: [Point2<f64>; 4],
    /// How far the two are from being opposite sides of a rectangle whose inside is brighter or
    /// darker all round, from 0.
    pub slack: f64,
}

/// Of the segments `others` those that face segment `a`, the best first, at most [`MAX_PARTNERS`].
pub fn partners(segments: &[EdgeSegment], a: usize, others: &[usize]) -> Vec<Partner> {
    let mut found: Vec<Partner> = others.iter().filter_map(|b| partner(segments, a, *b)).collect();
    found.sort_by(|x, y| x.slack.total_cmp(&y.slack).then(x.other.cmp(&y.other)));
    found.truncate(MAX_PARTNERS);
    found
}

fn partner(segments: &[EdgeSegment], a: usize, b: usize) -> Option<Partner> {
    let (first, second) = (&segments[a], &segments[b]);
    let longer = first.length_px.max(second.length_px);
    let ratio = first.length_px.min(second.length_px) / longer;
    if ratio < MIN_RATIO || first.normal.perp(&second.normal).abs() > MAX_SIN {
        return None;
    }
    // The brighter side is on the right: two sides of one object run in opposite directions.
    let same_polarity = first.normal.dot(&second.normal) < 0.0;
    let (start, stop) = if same_polarity { (second.q_px, second.p_px) } else { (second.p_px, second.q_px) };
    let across = [start - first.p_px, stop - first.q_px];
    let [s, t] = across.map(|way| way.norm());
    if s.max(t) > ACROSS_PX[1] || s.min(t) < (MIN_ACROSS_RATIO * s.max(t)).max(ACROSS_PX[0]) {
        return None;
    }
    let along = (first.q_px - first.p_px) / first.length_px;
    let lean = (along.dot(&across[0]) / s).abs().max((along.dot(&across[1]) / t).abs());
    let slack = 0.2 * (1.0 - ratio) + 0.2 * lean + if same_polarity { 0.0 } else { 0.1 };
    (lean <= MAX_LEAN).then_some(Partner {
        other: b,
        corners_px: [first.p_px, first.q_px, stop, start],
        slack,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detect::tests::fixtures::segment;

    #[test]
    fn only_opposite_sides_are_partners() {
        let side = segment([20.0, 20.0], [60.0, 20.0]);
        let one = |p: [f64; 2], q: [f64; 2]| partners(&[side.clone(), segment(p, q)], 0, &[1]);
        let found = one([60.0, 50.0], [20.0, 50.0]);
        let wanted = [[20.0, 20.0], [60.0, 20.0], [60.0, 50.0], [20.0, 50.0]].map(Point2::from);
        assert!(found.len() == 1 && found[0].other == 1 && found[0].slack < 1e-9, "{found:?}");
        assert!(found[0].corners_px.iter().zip(wanted).all(|(a, b)| (a - b).norm() < 1e-9), "{found:?}");
        // Bright outside at one side, inside at the other: the same corners at a worse slack.
        let odd = one([20.0, 50.0], [60.0, 50.0]);
        assert!(odd[0].corners_px == found[0].corners_px && odd[0].slack > 0.05, "{odd:?}");
        for (p, q) in [
            // Too close, too far, too short, too slanted, too far along.
            ([60.0, 31.0], [20.0, 31.0]),
            ([60.0, 81.0], [20.0, 81.0]),
            ([50.0, 50.0], [27.0, 50.0]),
            ([60.0, 50.0], [22.0, 66.0]),
            ([92.0, 50.0], [52.0, 50.0]),
        ] {
            assert!(one(p, q).is_empty(), "{p:?} {q:?}");
        }
    }

    #[test]
    fn the_number_of_partners_is_bounded_and_the_best_stay() {
        let segments: Vec<_> =
            (0..40).map(|i| f64::from(i) * 3.0).map(|y| segment([80.0 + 0.1 * y, y], [20.0, y])).collect();
        let others: Vec<usize> = (0..40).filter(|i| *i != 20).collect();
        let found = partners(&segments, 20, &others);
        assert_eq!(found.len(), MAX_PARTNERS);
        assert!(found.windows(2).all(|w| w[0].slack <= w[1].slack), "{found:?}");
    }
}
