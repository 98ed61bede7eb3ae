//! Segments in, scored candidate pairs of opposite sides out (method 2). Cheap gates come first and
//! keep the set sparse; the third-segment search and the grey profiles run on the remaining pairs
//! only. The decision is that of the relaxation.

use crate::{
    detect::{proposals::quad_seed::corner_of, segments::edge_segments::EdgeSegment},
    frame::GrayImage,
    geometry::polygon,
    paper::relaxation::{labelling::MAX_ROW_CANDIDATES, profiles::Profiles},
};
use nalgebra::{Point2, Vector2};
use serde::{Deserialize, Serialize};

/// Most segments paired, the longest first.
pub const MAX_PAIRED_SEGMENTS: usize = 500;
/// Most pairs whose third segment is searched. Photographs stay below; stripes, all equally
/// similar, do not.
pub const MAX_ROUGH_PAIRS: usize = 20_000;
/// Most pairs handed on, the best first.
pub const MAX_PAIRS: usize = 1200;

/// Cues and gates of method 2. Weights are for c1 to c6: length ratio, angle, squareness, overlap,
/// third segment, profiles.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SimilarityParams {
    /// Weights of the six cues.
    pub weights: [f64; 6],
    /// Pairs at or below this similarity are dropped.
    pub min_score: f64,
    /// Largest angle between opposite sides, degrees.
    pub max_angle_deg: f64,
    /// Smallest overlap rate c4.
    pub min_overlap: f64,
    /// Smallest mean distance between the two lines.
    pub min_distance_px: f64,
    /// Largest angle between a third segment and the chord it closes, degrees.
    pub max_closing_angle_deg: f64,
    /// Smallest c5.
    pub min_closing: f64,
    /// Share of the chord's length that a third segment may miss its ends by.
    pub closing_gap: f64,
    /// The same, in pixels on top.
    pub closing_gap_px: f64,
    /// Half width of a grey profile.
    pub profile_half_width_px: usize,
    /// Below this distance the half width is halved, so that two profiles do not overlap.
    pub profile_full_distance_px: f64,
    /// Most candidates kept for a segment, the best first.
    pub max_candidates: usize,
}

/// Weights by `waymark-lab train similarity` on photographs of paintings and rendered corridors.
///
/// Departs from method 2, which asks for this fit: lengths and the third side discriminate opposite
/// sides of a quad, profiles hardly. Figures: docs/results/README.md.
const FITTED_WEIGHTS: [f64; 6] = [0.41, 0.0, 0.17, 0.03, 0.32, 0.07];

impl Default for SimilarityParams {
    fn default() -> Self {
        Self {
            weights: FITTED_WEIGHTS,
            min_score: 0.83,
            max_angle_deg: 40.0,
            min_overlap: 0.3,
            min_distance_px: 15.0,
            max_closing_angle_deg: 20.0,
            min_closing: 0.3,
            closing_gap: 0.2,
            closing_gap_px: 3.0,
            profile_half_width_px: 10,
            profile_full_distance_px: 25.0,
            max_candidates: 8,
        }
    }
}

/// Two segments taken for opposite sides.
#[derive(Debug, Clone, PartialEq)]
pub struct SegmentPair {
    /// Index of one segment.
    pub k: usize,
    /// Index of the other, larger than `k`.
    pub l: usize,
    /// Similarity, 0 to 1.
    pub score: f64,
    /// The cues c1 to c6, 0 to 1 each.
    pub cues: [f64; 6],
    /// The 4-gon of their ends, clockwise on screen: two on `k`, two on `l`.
    pub quad_px: [Point2<f64>; 4],
    /// Best closing segment beyond corners 1-2 and beyond corners 3-0, with its c5.
    pub closing: [Option<(usize, f64)>; 2],
}

/// A pair that passed the cheap gates.
struct Rough {
    k: usize,
    l: usize,
    quad_px: [Point2<f64>; 4],
    cues: [f64; 4],
    distance_px: f64,
    /// Score if third segment and profiles were perfect.
    bound: f64,
}

/// Candidate pairs, best first; ties by index. At most [`MAX_PAIRS`], at most `p.max_candidates` a
/// segment.
pub fn pairs(segments: &[EdgeSegment], image: &GrayImage, p: &SimilarityParams) -> Vec<SegmentPair> {
    let rough = shortlist(rough_pairs(segments, p));
    // Bounds the profiles of a segment's weak candidates: three times as many are scored as may be
    // kept.
    let per_segment = p.max_candidates.min(MAX_ROW_CANDIDATES);
    let mut scored = vec![0_usize; segments.len()];
    let mut profiles = Profiles::new(segments, image);
    let mut pairs = Vec::new();
    for r in &rough {
        if scored[r.k] >= 3 * per_segment || scored[r.l] >= 3 * per_segment {
            continue;
        }
        let Some(pair) = score(r, segments, &mut profiles, p) else { continue };
        scored[r.k] += 1;
        scored[r.l] += 1;
        pairs.push(pair);
    }
    pairs.sort_by(|a, b| b.score.total_cmp(&a.score).then((a.k, a.l).cmp(&(b.k, b.l))));
    let mut per_segment_kept = vec![0_usize; segments.len()];
    pairs.retain(|pair| {
        let keep = per_segment_kept[pair.k] < per_segment && per_segment_kept[pair.l] < per_segment;
        per_segment_kept[pair.k] += usize::from(keep);
        per_segment_kept[pair.l] += usize::from(keep);
        keep
    });
    pairs.truncate(MAX_PAIRS);
    pairs
}

/// The most promising pairs, best first; ties by index. At most [`MAX_ROUGH_PAIRS`].
fn shortlist(mut rough: Vec<Rough>) -> Vec<Rough> {
    rough.sort_by(|a, b| b.bound.total_cmp(&a.bound).then((a.k, a.l).cmp(&(b.k, b.l))));
    rough.truncate(MAX_ROUGH_PAIRS);
    rough
}

/// All pairs of the longest segments that pass the cheap gates.
fn rough_pairs(segments: &[EdgeSegment], p: &SimilarityParams) -> Vec<Rough> {
    let mut order: Vec<usize> = (0..segments.len()).collect();
    order.sort_by(|a, b| segments[*b].length_px.total_cmp(&segments[*a].length_px).then(a.cmp(b)));
    order.truncate(MAX_PAIRED_SEGMENTS);
    order.sort_unstable();
    let min_cos = p.max_angle_deg.to_radians().cos();
    let mut found = Vec::new();
    for (i, &k) in order.iter().enumerate() {
        for &l in &order[i + 1..] {
            if segments[k].normal.dot(&segments[l].normal).abs() >= min_cos {
                found.extend(rough_pair(segments, k, l, p));
            }
        }
    }
    found
}

fn rough_pair(segments: &[EdgeSegment], k: usize, l: usize, p: &SimilarityParams) -> Option<Rough> {
    let (a, b) = (&segments[k], &segments[l]);
    let (cues, quad_px, distance_px) = shape(a, b, p)?;
    let bound = weigh(&[cues[0], cues[1], cues[2], cues[3], 1.0, 1.0], a.clipped || b.clipped, p);
    (bound > p.min_score).then_some(Rough { k, l, quad_px, cues, distance_px, bound })
}

/// The cues c1 to c4, the 4-gon and the mean distance of two segments; none when distance, overlap
/// or convexity refuse.
fn shape(
    a: &EdgeSegment,
    b: &EdgeSegment,
    p: &SimilarityParams,
) -> Option<([f64; 4], [Point2<f64>; 4], f64)> {
    let distance = |from: &EdgeSegment, to: &EdgeSegment| {
        (to.normal.dot(&nalgebra::center(&from.p_px, &from.q_px).coords) - to.rho_px).abs()
    };
    let h = distance(a, b) + distance(b, a);
    if h < 2.0 * p.min_distance_px {
        return None;
    }
    let overlap = overlap_rate(a, b);
    if overlap < p.min_overlap {
        return None;
    }
    let quad_px = quad_of(a, b)?;
    let cues = [
        inverse_ratio(a.length_px, b.length_px),
        (1.0 - angle_between(a, b) / p.max_angle_deg.to_radians()).max(0.0),
        inverse_ratio(a.length_px + b.length_px, h),
        overlap,
    ];
    Some((cues, quad_px, 0.5 * h))
}

/// Adds the two expensive cues; none when no third segment closes the pair or the similarity stays
/// too low.
fn score(
    r: &Rough,
    segments: &[EdgeSegment],
    profiles: &mut Profiles,
    p: &SimilarityParams,
) -> Option<SegmentPair> {
    let closing = [0, 1].map(|end| best_closing(r, end, segments, p));
    let c5 = closing.iter().flatten().map(|c| c.1).fold(0.0, f64::max);
    if c5 < p.min_closing {
        return None;
    }
    let clipped = segments[r.k].clipped || segments[r.l].clipped;
    let with = |c6| [r.cues[0], r.cues[1], r.cues[2], r.cues[3], c5, c6];
    if weigh(&with(1.0), clipped, p) <= p.min_score {
        return None;
    }
    let half_width = if r.distance_px < p.profile_full_distance_px {
        p.profile_half_width_px / 2
    } else {
        p.profile_half_width_px
    };
    let cues = with(profiles.correlation(r.k, r.l, half_width).max(0.0));
    let score = weigh(&cues, clipped, p);
    (score > p.min_score).then_some(SegmentPair { k: r.k, l: r.l, score, cues, quad_px: r.quad_px, closing })
}

/// Similarity of two segments by shape alone, cues c1 to c4, 0 to 1; none when a cheap gate of
/// method 2 refuses.
pub(crate) fn shape_similarity(a: &EdgeSegment, b: &EdgeSegment, p: &SimilarityParams) -> Option<f64> {
    if a.normal.dot(&b.normal).abs() < p.max_angle_deg.to_radians().cos() {
        return None;
    }
    let (cues, _, _) = shape(a, b, p)?;
    let weights = &p.weights[..4];
    let total: f64 = weights.iter().sum();
    Some(cues.iter().zip(weights).map(|(c, w)| c * w).sum::<f64>() / total.max(f64::MIN_POSITIVE))
}

/// c5 of a segment for the chord between two points: how near its ends come to the chord's.
pub(crate) fn closing_cue(
    from: &Point2<f64>,
    to: &Point2<f64>,
    segment: &EdgeSegment,
    p: &SimilarityParams,
) -> f64 {
    let reach = p.closing_gap * (to - from).norm() + p.closing_gap_px;
    let nearest = |e: &Point2<f64>| (segment.p_px - e).norm().min((segment.q_px - e).norm());
    (-(0.5 * (nearest(from) + nearest(to)) / reach).powi(2)).exp()
}

/// Weighted mean of the cues. The length of a clipped segment means little, so its cue has half its
/// weight.
fn weigh(cues: &[f64; 6], clipped: bool, p: &SimilarityParams) -> f64 {
    let mut weights = p.weights;
    if clipped {
        weights[0] *= 0.5;
    }
    let total: f64 = weights.iter().sum();
    cues.iter().zip(&weights).map(|(c, w)| c * w).sum::<f64>() / total.max(f64::MIN_POSITIVE)
}

/// 1 over the mean of a/b and b/a: 1 for equals, 0 at worst.
fn inverse_ratio(a: f64, b: f64) -> f64 {
    2.0 * a * b / (a * a + b * b).max(f64::MIN_POSITIVE)
}

/// Undirected angle between two segments, 0 to pi/2.
pub(crate) fn angle_between(a: &EdgeSegment, b: &EdgeSegment) -> f64 {
    let difference = (a.theta_rad - b.theta_rad).abs();
    difference.min(std::f64::consts::PI - difference)
}

/// Ends of `segment` in the order that makes it run along `direction`.
pub(crate) fn along(segment: &EdgeSegment, direction: &Vector2<f64>) -> [Point2<f64>; 2] {
    if (segment.q_px - segment.p_px).dot(direction) >= 0.0 {
        [segment.p_px, segment.q_px]
    } else {
        [segment.q_px, segment.p_px]
    }
}

/// Common part of both projections on the bisector of the directions, over the shorter projection.
fn overlap_rate(a: &EdgeSegment, b: &EdgeSegment) -> f64 {
    let direction = (a.q_px - a.p_px) / a.length_px;
    let [b0, b1] = along(b, &direction);
    let axis = direction + (b1 - b0) / b.length_px;
    let span = |p: &Point2<f64>, q: &Point2<f64>| (axis.dot(&p.coords), axis.dot(&q.coords));
    let (a_span, b_span) = (span(&a.p_px, &a.q_px), span(&b0, &b1));
    let common = a_span.1.min(b_span.1) - a_span.0.max(b_span.0);
    let shorter = (a_span.1 - a_span.0).min(b_span.1 - b_span.0);
    if shorter > 0.0 { (common / shorter).clamp(0.0, 1.0) } else { 0.0 }
}

/// The 4-gon made by two segments, clockwise on screen, the first two vertices on `a`; none unless
/// strictly convex.
fn quad_of(a: &EdgeSegment, b: &EdgeSegment) -> Option<[Point2<f64>; 4]> {
    let [b0, b1] = along(b, &(a.q_px - a.p_px));
    let mut quad = [a.p_px, a.q_px, b1, b0];
    if polygon::signed_area(&quad) < 0.0 {
        quad = [a.q_px, a.p_px, b0, b1];
    }
    polygon::is_convex(&quad).then_some(quad)
}

/// The segment that best closes the pair beyond its corners 1-2 (`end` 0) or 3-0 (`end` 1), with
/// its c5. It must follow the chord, end near the chord's ends and leave the open chain convex.
fn best_closing(
    r: &Rough,
    end: usize,
    segments: &[EdgeSegment],
    p: &SimilarityParams,
) -> Option<(usize, f64)> {
    let (from, to) = if end == 0 { (r.quad_px[1], r.quad_px[2]) } else { (r.quad_px[3], r.quad_px[0]) };
    let chord = to - from;
    let length = chord.norm();
    let reach = p.closing_gap * length + p.closing_gap_px;
    let max_gap = reach * (-p.min_closing.ln()).max(0.0).sqrt();
    let min_cos = p.max_closing_angle_deg.to_radians().cos();
    let mut best: Option<(usize, f64)> = None;
    for (m, segment) in segments.iter().enumerate() {
        // The mean gap is at least half of each: the first end alone can rule a segment out.
        let gap_from = (segment.p_px - from).norm().min((segment.q_px - from).norm());
        if gap_from > 2.0 * max_gap || m == r.k || m == r.l {
            continue;
        }
        let gap = 0.5 * (gap_from + (segment.p_px - to).norm().min((segment.q_px - to).norm()));
        let direction = segment.q_px - segment.p_px;
        if gap > max_gap || direction.dot(&chord).abs() < min_cos * length * segment.length_px {
            continue;
        }
        let c5 = (-(gap / reach).powi(2)).exp();
        if best.is_none_or(|b| c5 > b.1) && chain_is_convex(r, end, segment, segments) {
            best = Some((m, c5));
        }
    }
    best
}

/// Whether the far end of one side, its corner with the closing segment, the other corner and the
/// other far end turn one way.
fn chain_is_convex(r: &Rough, end: usize, closing: &EdgeSegment, segments: &[EdgeSegment]) -> bool {
    // Side `end` 0 runs k then closing then l, clockwise; side 1 runs l then closing then k.
    let (first, second, start, stop) = if end == 0 {
        (&segments[r.k], &segments[r.l], r.quad_px[0], r.quad_px[3])
    } else {
        (&segments[r.l], &segments[r.k], r.quad_px[2], r.quad_px[1])
    };
    let (Some(a), Some(b)) = (corner_of(first, closing), corner_of(closing, second)) else { return false };
    let chain = [start, a, b, stop];
    polygon::signed_area(&chain) > 0.0 && polygon::is_convex(&chain)
}

#[cfg(test)]
mod tests;
