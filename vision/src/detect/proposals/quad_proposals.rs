//! Quad proposals, the default instead of the paper's two relaxations. Segments that meet in
//! corners are followed round: four in a circle, or three with the fourth side searched in the
//! gradient planes, or two that face each other. Edges must support all four sides. In: segments.
//! Out: proposals; `suppression` decides which become quads.
//!
//! Departs from method 3.3, 3.4: there a segment takes part in one pair and a pair in one quad, and
//! one side without a segment loses the quad. Measurements: docs/method/24-default-detector.md.

use crate::detect::{
    edge_support::{coarse_support::fit_of, gradients::Gradients, side_support::run_end},
    proposals::{
        facing::partners,
        quad_seed::{QuadSeed, corner_of, plausible},
    },
    segments::edge_segments::EdgeSegment,
};
use nalgebra::Point2;
use serde::{Deserialize, Serialize};

/// Most segments that take part, the longest first.
pub const MAX_SEARCHED_SEGMENTS: usize = 400;
/// Most corners kept at one end of a segment, the tightest first.
pub const MAX_CORNERS_PER_END: usize = 8;
/// Most proposals that are checked against the gradient, the tightest first.
pub const MAX_PROPOSALS: usize = 6000;
/// Most proposals in memory: at this number only the tightest [`MAX_PROPOSALS`] stay.
pub const MAX_COLLECTED: usize = 4 * MAX_PROPOSALS;

/// How proposals are formed and checked.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ProposalParams {
    /// Smallest angle at a corner, degrees.
    pub min_corner_angle_deg: f64,
    /// A segment may end this share of its length before the corner.
    pub max_gap: f64,
    /// The same in pixels, whichever is more.
    pub max_gap_px: f64,
    /// A segment may run past the corner by this share of its length.
    pub max_overshoot: f64,
    /// Smallest coarse support of any side, 0 to 1.
    pub min_support: f64,
    /// Smallest step height of an edge point, grey levels.
    pub min_step: f64,
    /// Whether a fourth side without a segment is searched.
    pub complete: bool,
    /// Whether two segments that face each other make a quad, their ends its corners.
    pub facing: bool,
}

impl Default for ProposalParams {
    fn default() -> Self {
        Self {
            min_corner_angle_deg: 30.0,
            max_gap: 0.6,
            max_gap_px: 12.0,
            max_overshoot: 0.2,
            min_support: 0.5,
            min_step: 4.0,
            complete: true,
            facing: true,
        }
    }
}

/// A corner at the end of one of its segments.
#[derive(Debug, Clone, Copy)]
struct Corner {
    other: usize,
    /// End of the other segment at this corner: 0 for p, 1 for q.
    other_end: usize,
    at: Point2<f64>,
    /// Missed length per segment length; small is tight.
    looseness: f64,
}

/// Corners at both ends of every segment, tightest first.
type CornerTable = Vec<[Vec<Corner>; 2]>;

/// Proposals whose sides the gradient supports, best first.
pub fn proposals(segments: &[EdgeSegment], g: &Gradients, p: &ProposalParams) -> Vec<QuadSeed> {
    let order = longest(segments);
    let table = corners(segments, &order, p);
    let mut found = BestProposals::default();
    for &a in &order {
        for end in [0, 1] {
            chains_from(&table, a, end, |chain| {
                closed(&table, chain, &mut found);
            });
        }
    }
    if p.complete {
        complete(segments, &table, &order, g, p, &mut found);
    }
    if p.facing {
        paired(segments, &order, &mut found);
    }
    let size = (g.width(), g.height());
    found
        .in_order()
        .filter(|seed| plausible(&seed.corners_px, size))
        .filter_map(|mut seed| {
            // The side without a segment is the likeliest to fail.
            let first = seed.sides.iter().position(Option::is_none).unwrap_or(0);
            seed.fit = fit_of(g, &seed.corners_px, first, p.min_step, p.min_support)?;
            Some(seed)
        })
        .collect()
}

/// Proposals with their looseness, in bounded memory.
#[derive(Debug, Default)]
struct BestProposals {
    found: Vec<(f64, QuadSeed)>,
}

impl BestProposals {
    fn add(&mut self, looseness: f64, seed: QuadSeed) {
        self.found.push((looseness, seed));
        if self.found.len() >= MAX_COLLECTED {
            self.prune();
        }
    }

    /// Equally tight proposals keep their order, so the result does not depend on when this is
    /// called.
    fn prune(&mut self) {
        self.found.sort_by(|x, y| x.0.total_cmp(&y.0).then(x.1.sides.cmp(&y.1.sides)));
        self.found.truncate(MAX_PROPOSALS);
    }

    /// At most [`MAX_PROPOSALS`], the tightest first.
    fn in_order(mut self) -> impl Iterator<Item = QuadSeed> {
        self.prune();
        self.found.into_iter().map(|(_, seed)| seed)
    }
}

fn longest(segments: &[EdgeSegment]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..segments.len()).collect();
    order.sort_by(|a, b| segments[*b].length_px.total_cmp(&segments[*a].length_px).then(a.cmp(b)));
    order.truncate(MAX_SEARCHED_SEGMENTS);
    order.sort_unstable();
    order
}

fn corners(segments: &[EdgeSegment], order: &[usize], p: &ProposalParams) -> CornerTable {
    let mut table: CornerTable = vec![[Vec::new(), Vec::new()]; segments.len()];
    let min_sin = p.min_corner_angle_deg.to_radians().sin();
    for (i, &a) in order.iter().enumerate() {
        for &b in &order[i + 1..] {
            if segments[a].normal.perp(&segments[b].normal).abs() < min_sin {
                continue;
            }
            let Some(at) = corner_of(&segments[a], &segments[b]) else { continue };
            let (Some((end_a, gap_a)), Some((end_b, gap_b))) =
                (end_at(&segments[a], &at, p), end_at(&segments[b], &at, p))
            else {
                continue;
            };
            let looseness = (gap_a + gap_b + 3.0) / (segments[a].length_px + segments[b].length_px);
            table[a][end_a].push(Corner { other: b, other_end: end_b, at, looseness });
            table[b][end_b].push(Corner { other: a, other_end: end_a, at, looseness });
        }
    }
    for list in table.iter_mut().flatten() {
        list.sort_by(|x, y| x.looseness.total_cmp(&y.looseness).then(x.other.cmp(&y.other)));
        list.truncate(MAX_CORNERS_PER_END);
    }
    table
}

/// Which end of the segment the corner belongs to and how far that end misses it; none when too
/// far.
fn end_at(segment: &EdgeSegment, corner: &Point2<f64>, p: &ProposalParams) -> Option<(usize, f64)> {
    let length = segment.length_px;
    let t = (corner - segment.p_px).dot(&(segment.q_px - segment.p_px)) / length;
    let (end, beyond) = if t > 0.5 * length { (1, t - length) } else { (0, -t) };
    let allowed = if beyond > 0.0 {
        (p.max_gap * length).max(p.max_gap_px)
    } else {
        (p.max_overshoot * length).max(p.max_gap_px.min(0.5 * length))
    };
    (beyond.abs() <= allowed).then_some((end, beyond.abs()))
}

/// Three segments in a row: `a` from its start end, then `b`, then `c`.
struct Chain {
    /// Segment and the end where the next one is met.
    a: usize,
    a_end: usize,
    ab: Corner,
    bc: Corner,
}

fn chains_from(table: &CornerTable, a: usize, a_end: usize, mut found: impl FnMut(&Chain)) {
    for ab in &table[a][a_end] {
        for bc in &table[ab.other][1 - ab.other_end] {
            if bc.other != a {
                found(&Chain { a, a_end, ab: *ab, bc: *bc });
            }
        }
    }
}

/// Adds the quads that a fourth segment closes. Each is added once: its smallest index first, in
/// the direction with the smaller second index.
fn closed(table: &CornerTable, chain: &Chain, found: &mut BestProposals) {
    let (a, b, c) = (chain.a, chain.ab.other, chain.bc.other);
    for cd in &table[c][1 - chain.bc.other_end] {
        let d = cd.other;
        if d == a || d == b || a > b || a > c || a > d || b > d {
            continue;
        }
        let last = table[d][1 - cd.other_end].iter().find(|k| k.other == a && k.other_end == 1 - chain.a_end);
        let Some(da) = last else { continue };
        let looseness = chain.ab.looseness + chain.bc.looseness + cd.looseness + da.looseness;
        found.add(looseness, clockwise([a, b, c, d].map(Some), [da.at, chain.ab.at, chain.bc.at, cd.at]));
    }
}

/// Corner i is where side i begins; both are turned clockwise on screen.
fn clockwise(mut sides: [Option<usize>; 4], mut corners_px: [Point2<f64>; 4]) -> QuadSeed {
    if crate::geometry::polygon::signed_area(&corners_px) < 0.0 {
        corners_px.swap(1, 3);
        sides.reverse();
    }
    QuadSeed { sides, corners_px, similarity: 1.0, fit: 0.0 }
}

/// Adds quads of three segments whose fourth side lies where the edges along the two outer ones
/// end.
fn complete(
    segments: &[EdgeSegment],
    table: &CornerTable,
    order: &[usize],
    g: &Gradients,
    p: &ProposalParams,
    found: &mut BestProposals,
) {
    let ends: Vec<[Point2<f64>; 2]> = segments
        .iter()
        .map(|s| [run_end(g, &s.q_px, &s.p_px, p.min_step), run_end(g, &s.p_px, &s.q_px, p.min_step)])
        .collect();
    for &a in order {
        for end in [0, 1] {
            chains_from(table, a, end, |chain| {
                // Both directions give the same chain.
                if chain.a > chain.bc.other {
                    return;
                }
                let c = chain.bc.other;
                let (from, to) = (ends[a][1 - end], ends[c][1 - chain.bc.other_end]);
                let base = chain.bc.at - chain.ab.at;
                let looseness = 1.5 * (chain.ab.looseness + chain.bc.looseness) + 0.05;
                let mut add = |from: Point2<f64>, to: Point2<f64>| {
                    let seed = clockwise(
                        [Some(a), Some(chain.ab.other), Some(c), None],
                        [from, chain.ab.at, chain.bc.at, to],
                    );
                    found.add(looseness, seed);
                };
                add(from, to);
                // One of the two may be broken off early or run on: a fourth side parallel to the
                // second instead.
                let side_a = chain.ab.at - from;
                let side_c = chain.bc.at - to;
                if side_a.norm() > 0.0 && side_c.norm() > 0.0 && base.norm() > 0.0 {
                    let ratio = side_a.norm() / side_c.norm();
                    if !(0.95..=1.05).contains(&ratio) {
                        add(from, chain.bc.at - side_c * ratio);
                        add(chain.ab.at - side_a / ratio, to);
                    }
                }
            });
        }
    }
}

/// Adds quads of two segments that face each other.
fn paired(segments: &[EdgeSegment], order: &[usize], found: &mut BestProposals) {
    for (i, &a) in order.iter().enumerate() {
        for p in partners(segments, a, &order[i + 1..]) {
            let seed = clockwise([Some(a), None, Some(p.other), None], p.corners_px);
            found.add(FACING_LOOSENESS + p.slack, seed);
        }
    }
}

/// Looseness of two segments that face each other exactly: two corners that no segment closes.
const FACING_LOOSENESS: f64 = 0.1;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        detect::{
            edges::edge_map::{EdgeParams, edges},
            segments::{
                chains::chains, collinear_merge::SegmentParams, edge_segments::segments,
                gap_closing::ChainParams,
            },
            tests::fixtures::render,
        },
        geometry::polygon,
    };

    #[test]
    fn the_number_of_proposals_is_bounded_and_the_tightest_stay() {
        let seed = |i: usize| QuadSeed {
            sides: [Some(i % 3), None, None, None],
            corners_px: [Point2::new(i as f64, 0.0); 4],
            similarity: 1.0,
            fit: 0.0,
        };
        // Many equally tight proposals, which differ in sides and order only.
        let looseness = |i: usize| (i * 7919 % 1000) as f64;
        let count = 3 * MAX_COLLECTED + 5;
        let (mut tightest, mut all) = (BestProposals::default(), Vec::new());
        for i in 0..count {
            tightest.add(looseness(i), seed(i));
            assert!(tightest.found.len() < MAX_COLLECTED);
            all.push((looseness(i), i % 3, i));
        }
        all.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let expected: Vec<usize> = all.iter().take(MAX_PROPOSALS).map(|x| x.2).collect();
        let order: Vec<usize> = tightest.in_order().map(|s| s.corners_px[0].x as usize).collect();
        assert_eq!(order, expected);
    }

    #[test]
    fn a_sign_with_two_sides_too_short_for_segments_is_proposed() {
        let sign = [[300.0, 200.0], [360.0, 206.0], [358.0, 228.0], [298.0, 222.0]];
        let image = render(640, 480, 90, &[(sign, 180)]);
        let map = edges(&image, &EdgeParams::default());
        let g = Gradients { image: &image, gx: map.gx(), gy: map.gy() };
        let found = segments(&chains(&map, &ChainParams::default()), &map, &SegmentParams::default());
        assert_eq!(found.len(), 2, "{found:?}");
        let seeds = |facing| proposals(&found, &g, &ProposalParams { facing, ..Default::default() });
        let overlap = polygon::iou(&sign.map(Point2::from), &seeds(true)[0].corners_px);
        assert!(overlap > 0.8, "{overlap}");
        assert!(seeds(false).is_empty());
    }
}
