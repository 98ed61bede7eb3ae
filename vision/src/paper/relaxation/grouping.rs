//! The two relaxations of the method with their constraint tables (method 3.3, 3.4). In: candidate
//! pairs, then matched pairs. Out: matched pairs, then quad proposals. `labelling` is the solver;
//! `three_sided` makes sets of three sides.

use crate::{
    detect::{
        proposals::quad_seed::{Bounds, QuadSeed, corner_of, overlap_exceeds, plausible},
        segments::edge_segments::EdgeSegment,
    },
    geometry::polygon::{self, Relation},
    paper::relaxation::{
        labelling::{Label, Problem, RelaxationParams, mutual, relax},
        similarity::SegmentPair,
    },
};
use nalgebra::Point2;

/// Most matched pairs of the second pass, the best first.
pub const MAX_MATCHED_PAIRS: usize = 150;
/// Most candidate quads of the second pass, the best first.
pub const MAX_QUAD_CANDIDATES: usize = 600;
/// A possible match of two items.
struct Match {
    i: usize,
    j: usize,
    start: f64,
    bias: f64,
}

/// Relaxes and returns the matches that both sides chose. `compatible` is called once for every two
/// matches without a common item.
fn solve(
    items: usize,
    matches: &[Match],
    p: &RelaxationParams,
    compatible: impl Fn(usize, usize) -> f64,
) -> Vec<usize> {
    let mut rows = vec![Vec::new(); items];
    for m in matches {
        rows[m.i].push(Label { item: m.j, start: m.start, bias: m.bias });
        rows[m.j].push(Label { item: m.i, start: m.start, bias: m.bias });
    }
    let mut problem = Problem::new(&rows);
    // Matches dropped by a full row are ignored.
    let variables: Vec<Option<[usize; 2]>> =
        matches.iter().map(|m| Some([problem.variable(m.i, m.j)?, problem.variable(m.j, m.i)?])).collect();
    for (a, m) in matches.iter().enumerate() {
        let Some([forth, back]) = variables[a] else { continue };
        problem.link(forth, back, p.reciprocal);
        for (b, n) in matches.iter().enumerate().skip(a + 1) {
            let Some(others) = variables[b] else { continue };
            let shared = m.i == n.i || m.i == n.j || m.j == n.i || m.j == n.j;
            let weight = if shared { p.shared } else { compatible(a, b) };
            if weight != 0.0 {
                for (x, y) in [(forth, others[0]), (forth, others[1]), (back, others[0]), (back, others[1])] {
                    problem.link(x, y, weight);
                }
            }
        }
    }
    let start = problem.start().to_vec();
    let chosen = relax(&problem, start, p).chosen;
    let mutual_matches = mutual(&chosen);
    let is_mutual = |m: &Match| mutual_matches.contains(&(m.i.min(m.j), m.i.max(m.j)));
    matches.iter().enumerate().filter(|(_, m)| is_mutual(m)).map(|(i, _)| i).collect()
}

/// Pass 1: the pairs of opposite sides that survive uniqueness and convexity, as indices into
/// `pairs`, ascending.
pub fn match_pairs(
    segments: &[EdgeSegment],
    pairs: &[SegmentPair],
    min_score: f64,
    p: &RelaxationParams,
) -> Vec<usize> {
    let matches: Vec<Match> = pairs
        .iter()
        .map(|s| Match { i: s.k, j: s.l, start: s.score, bias: p.linear_weight * (s.score - min_score) })
        .collect();
    let bounds: Vec<_> = pairs.iter().map(|s| polygon::bounds(&s.quad_px)).collect();
    solve(segments.len(), &matches, p, |a, b| {
        if boxes_apart(&bounds[a], &bounds[b], 2.0 * p.pair_tolerance_px) {
            return 0.0;
        }
        pair_weight(segments, &pairs[a], &pairs[b], p)
    })
}

/// Table Q1 for two pairs without a common segment.
fn pair_weight(segments: &[EdgeSegment], a: &SegmentPair, b: &SegmentPair, p: &RelaxationParams) -> f64 {
    /// Sides of one quad stand at more than about 45 degrees.
    const MAX_SIDE_COS: f64 = 0.7;
    let cos = segments[a.k].normal.dot(&segments[b.k].normal).abs();
    if cos < MAX_SIDE_COS && overlap_exceeds(&a.quad_px, &b.quad_px, p.same_iou) {
        return p.same_quad;
    }
    match polygon::relation(&a.quad_px, &b.quad_px, p.pair_tolerance_px) {
        Relation::Crossing => p.pairs_crossing,
        _ => 0.0,
    }
}

/// Pass 2: quads from matched pairs, best fit first.
pub fn match_quads(
    segments: &[EdgeSegment],
    pairs: &[SegmentPair],
    image_size: (usize, usize),
    p: &RelaxationParams,
) -> Vec<QuadSeed> {
    let mut order: Vec<usize> = (0..pairs.len()).collect();
    order.sort_by(|a, b| pairs[*b].score.total_cmp(&pairs[*a].score).then(a.cmp(b)));
    order.truncate(MAX_MATCHED_PAIRS);
    let mut found: Vec<(usize, usize, QuadSeed)> = Vec::new();
    for (n, &a) in order.iter().enumerate() {
        for &b in &order[n + 1..] {
            found.extend(quad_seed(segments, &pairs[a], &pairs[b], image_size).map(|seed| (a, b, seed)));
        }
    }
    found.sort_by(|x, y| y.2.fit.total_cmp(&x.2.fit).then((x.0, x.1).cmp(&(y.0, y.1))));
    found.truncate(MAX_QUAD_CANDIDATES);
    let matches: Vec<Match> = found
        .iter()
        .map(|(i, j, s)| Match { i: *i, j: *j, start: s.fit, bias: p.linear_weight * (s.fit - MIN_FIT) })
        .collect();
    let chosen = solve(pairs.len(), &matches, p, |a, b| {
        quad_weight(&found[a].2.corners_px, &found[b].2.corners_px, p)
    });
    chosen.into_iter().map(|i| found[i].2.clone()).collect()
}

/// Smallest s^2 of a candidate quad.
const MIN_FIT: f64 = 0.5;

/// The quad of two pairs: none unless strictly convex, inside the image up to a margin, with sides
/// of 15 px and a fair fit.
fn quad_seed(
    segments: &[EdgeSegment],
    a: &SegmentPair,
    b: &SegmentPair,
    image_size: (usize, usize),
) -> Option<QuadSeed> {
    if a.k == b.k || a.k == b.l || a.l == b.k || a.l == b.l {
        return None;
    }
    let mut sides = [a.k, b.k, a.l, b.l];
    let mut corners_px = corners_of(segments, sides)?;
    if polygon::signed_area(&corners_px) < 0.0 {
        sides.swap(1, 3);
        corners_px = corners_of(segments, sides)?;
    }
    if !plausible(&corners_px, image_size) {
        return None;
    }
    let gap = mean_gap(segments, &sides, &corners_px);
    let fit = 0.5 * polygon::iou(&a.quad_px, &b.quad_px) + 0.5 * (-gap / 0.25).exp();
    let similarity = f64::midpoint(a.score, b.score);
    (fit >= MIN_FIT).then_some(QuadSeed { sides: sides.map(Some), corners_px, similarity, fit })
}

/// Corner i is where side i-1 meets side i.
pub(crate) fn corners_of(segments: &[EdgeSegment], sides: [usize; 4]) -> Option<[Point2<f64>; 4]> {
    let [a, b, c, d] = sides.map(|i| &segments[i]);
    Some([corner_of(d, a)?, corner_of(a, b)?, corner_of(b, c)?, corner_of(c, d)?])
}

/// Mean over the eight segment ends of their distance to their corner, in segment lengths.
fn mean_gap(segments: &[EdgeSegment], sides: &[usize; 4], corners_px: &[Point2<f64>; 4]) -> f64 {
    let gap = |i: usize| {
        let s = &segments[sides[i]];
        let (from, to) = (corners_px[i], corners_px[(i + 1) % 4]);
        let [p, q] = crate::paper::relaxation::similarity::along(s, &(to - from));
        ((p - from).norm() + (q - to).norm()) / s.length_px
    };
    (0..4).map(gap).sum::<f64>() / 8.0
}

/// Table Q2 for two quads without a common pair.
fn quad_weight(a: &[Point2<f64>; 4], b: &[Point2<f64>; 4], p: &RelaxationParams) -> f64 {
    let near_equal = overlap_exceeds(a, b, p.same_iou);
    let tolerance = if near_equal { p.quad_tolerance_px } else { p.pair_tolerance_px };
    match polygon::relation(a, b, tolerance) {
        Relation::Crossing => p.quads_crossing,
        _ => 0.0,
    }
}

fn boxes_apart(a: &Bounds, b: &Bounds, slack_px: f64) -> bool {
    a.1.x - slack_px < b.0.x
        || b.1.x - slack_px < a.0.x
        || a.1.y - slack_px < b.0.y
        || b.1.y - slack_px < a.0.y
}

#[cfg(test)]
#[path = "grouping_tests.rs"]
mod tests;
