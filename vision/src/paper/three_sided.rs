//! Sets of three sides of the default detector (method 3.5): segments that no chosen quad explains
//! in, three-sided quads out. Doors whose lower end is not visible, posters behind a person,
//! posters cut by the image border. Three sides must meet in two corners, have the same polarity,
//! and edges along most of their length.
//!
//! Departs from method 3.5: pairs and closing segments come from corners, as in the default
//! detector, not from the relaxations, and the free ends are where the edges along the outer sides
//! end, not where their segments do.

use crate::{
    detect::{
        edge_support::{
            gradients::Gradients,
            side_fit::FittedLine,
            side_support::{EdgeProbeParams, measure, run_end},
        },
        params::DetectParams,
        proposals::quad_seed::{corner_of, plausible},
        quad::{Quad, QuadKind},
        refine::corners::upright_ambiguous,
        segments::edge_segments::{CLIP_MARGIN_PX, EdgeSegment},
        suppression::nested_borders::by_corners,
    },
    geometry::{
        corners::Corners,
        polygon::{self, Relation},
    },
    paper::relaxation::similarity::{closing_cue, shape_similarity},
};
use nalgebra::{Matrix2, Point2, Vector2};

/// Most segments that take part, the longest first.
const MAX_LEFT_SEGMENTS: usize = 120;
/// Most corners kept at one end of a segment, the tightest first.
const MAX_CORNERS: usize = 4;
/// Most sets whose sides are measured, the best first.
const MAX_MEASURED: usize = 12;
/// Ends and lines this close to a side of a chosen quad belong to it.
const SAME_SIDE_PX: f64 = 4.0;
/// Samples along a side.
const SAMPLES: usize = 48;
/// Standard deviation of a visible end along its side.
const END_SIGMA_PX: f64 = 2.0;
/// Smallest sine of the angle at a corner: 30 degrees.
const MIN_CORNER_SIN: f64 = 0.5;

/// Three segments in a row, `sides[1]` between the others, clockwise on screen.
struct OpenSet {
    score: f64,
    sides: [usize; 3],
    /// Free end, corner, corner, free end.
    corners_px: [Point2<f64>; 4],
}

/// Three-sided quads made of what `quads` leave over, best first, ties by corners. Each segment is
/// used once; none crosses one of `quads` or lies in one.
pub fn find_three_sided(
    segments: &[EdgeSegment],
    quads: &[Quad],
    g: &Gradients,
    p: &DetectParams,
) -> Vec<Quad> {
    let left = unexplained(segments, quads);
    let mut sets = open_sets(segments, &left, g, p);
    sets.sort_by(|a, b| b.score.total_cmp(&a.score).then(a.sides.cmp(&b.sides)));
    let mut used = vec![false; segments.len()];
    let mut found: Vec<Quad> = Vec::new();
    let mut measured = 0;
    for set in sets {
        if measured == MAX_MEASURED {
            break;
        }
        let contradicts = |q: &Quad| {
            let relation = polygon::relation(q.corners_px.points(), &set.corners_px, SAME_SIDE_PX);
            !matches!(relation, Relation::Disjoint | Relation::Within)
        };
        if set.sides.iter().any(|s| used[*s]) || quads.iter().chain(&found).any(contradicts) {
            continue;
        }
        measured += 1;
        if let Some(quad) = three_sided(&set, g, p) {
            set.sides.iter().for_each(|s| used[*s] = true);
            found.push(quad);
        }
    }
    found.sort_by(|a, b| b.score.total_cmp(&a.score).then(by_corners(a, b)));
    found
}

/// Indices of the longest segments that neither lie along a border of a chosen quad nor inside one,
/// ascending.
pub fn unexplained(segments: &[EdgeSegment], quads: &[Quad]) -> Vec<usize> {
    let borders: Vec<&[Point2<f64>; 4]> = quads
        .iter()
        .flat_map(|q| std::iter::once(&q.corners_px).chain(&q.alternates))
        .map(Corners::points)
        .collect();
    let explained = |s: &EdgeSegment| {
        borders.iter().any(|c| {
            let inside = |e: &Point2<f64>| polygon::contains(*c, e, SAME_SIDE_PX);
            let along = |i: usize| {
                let (from, side) = (c[i], c[(i + 1) % 4] - c[i]);
                let near = |e: &Point2<f64>| side.perp(&(e - from)).abs() <= SAME_SIDE_PX * side.norm();
                let middle = side.dot(&(nalgebra::center(&s.p_px, &s.q_px) - from)) / side.norm_squared();
                (0.0..=1.0).contains(&middle) && near(&s.p_px) && near(&s.q_px)
            };
            (inside(&s.p_px) && inside(&s.q_px)) || (0..4).any(along)
        })
    };
    let mut left: Vec<usize> = (0..segments.len()).filter(|i| !explained(&segments[*i])).collect();
    left.sort_by(|a, b| segments[*b].length_px.total_cmp(&segments[*a].length_px).then(a.cmp(b)));
    left.truncate(MAX_LEFT_SEGMENTS);
    left.sort_unstable();
    left
}

/// A segment that meets the middle one.
struct CornerJunction {
    outer: usize,
    corner: Point2<f64>,
    /// The outer segment's end at the corner and its other end.
    near: Point2<f64>,
    far: Point2<f64>,
    gap_px: f64,
}

/// All chains of three leftover segments that pass the gates of method 3.5.
fn open_sets(segments: &[EdgeSegment], left: &[usize], g: &Gradients, p: &DetectParams) -> Vec<OpenSet> {
    let mut sets = Vec::new();
    for &m in left {
        let middle = &segments[m];
        let mut ends: [Vec<CornerJunction>; 2] = [Vec::new(), Vec::new()];
        for &outer in left.iter().filter(|o| **o != m) {
            let Some((end, meeting)) = meet(middle, outer, &segments[outer], p) else { continue };
            ends[end].push(meeting);
        }
        for list in &mut ends {
            list.sort_by(|a, b| a.gap_px.total_cmp(&b.gap_px).then(a.outer.cmp(&b.outer)));
            list.truncate(MAX_CORNERS);
        }
        for first in &ends[0] {
            for last in ends[1].iter().filter(|l| l.outer != first.outer) {
                sets.extend(open_set(segments, (first, m, last), g, p));
            }
        }
    }
    sets
}

/// Whether an outer segment starts where the middle one ends, at its end 0 (p) or 1 (q).
fn meet(
    middle: &EdgeSegment,
    outer: usize,
    s: &EdgeSegment,
    p: &DetectParams,
) -> Option<(usize, CornerJunction)> {
    if middle.normal.perp(&s.normal).abs() < MIN_CORNER_SIN {
        return None;
    }
    let corner = corner_of(middle, s)?;
    let distance = |e: &Point2<f64>| (e - corner).norm();
    let end = usize::from(distance(&middle.q_px) < distance(&middle.p_px));
    let (near, far) =
        if distance(&s.p_px) <= distance(&s.q_px) { (s.p_px, s.q_px) } else { (s.q_px, s.p_px) };
    let ends = [middle.p_px, middle.q_px];
    let gap_px = distance(&ends[end]) + distance(&near);
    // Both gaps count towards c5, whose reach grows with the chord; beyond this neither end can
    // pass.
    let reach = p.similarity.closing_gap * middle.length_px + p.similarity.closing_gap_px;
    (gap_px <= 3.0 * reach && distance(&far) > distance(&near))
        .then_some((end, CornerJunction { outer, corner, near, far, gap_px }))
}

fn open_set(
    segments: &[EdgeSegment],
    (first, m, last): (&CornerJunction, usize, &CornerJunction),
    g: &Gradients,
    p: &DetectParams,
) -> Option<OpenSet> {
    let (k, l) = (&segments[first.outer], &segments[last.outer]);
    let c5 = closing_cue(&first.near, &last.near, &segments[m], &p.similarity);
    if c5 < p.quads.min_three_sided_closing {
        return None;
    }
    let shape = shape_similarity(k, l, &p.similarity)?;
    let free = |meeting: &CornerJunction| free_end(g, &meeting.near, &meeting.far, p.quads.min_step);
    let mut corners_px = [free(first), first.corner, last.corner, free(last)];
    let mut sides = [first.outer, m, last.outer];
    if polygon::signed_area(&corners_px) < 0.0 {
        corners_px.reverse();
        sides.reverse();
    }
    let centre = corners_px.iter().fold(Vector2::zeros(), |sum, c| sum + c.coords * 0.25);
    // The side of each line on which the middle of the set lies, relative to the brighter side: the
    // same for all three.
    let bright = |i: usize| segments[sides[i]].normal.dot(&centre) > segments[sides[i]].rho_px;
    let fits =
        bright(0) == bright(1) && bright(1) == bright(2) && plausible(&corners_px, (g.width(), g.height()));
    fits.then_some(OpenSet { score: f64::midpoint(shape, c5), sides, corners_px })
}

/// Where the edge from `near` through `far` ends; on the image border when it comes close to it.
fn free_end(g: &Gradients, near: &Point2<f64>, far: &Point2<f64>, min_step: f64) -> Point2<f64> {
    let end = run_end(g, near, far, min_step);
    let direction = (far - near).normalize();
    let room = |x: f64, d: f64, last: f64| {
        if d > 0.0 {
            (last - x) / d
        } else if d < 0.0 {
            -x / d
        } else {
            f64::INFINITY
        }
    };
    let (right, bottom) = ((g.width() - 1) as f64, (g.height() - 1) as f64);
    let to_border = room(end.x, direction.x, right).min(room(end.y, direction.y, bottom));
    if (0.0..=CLIP_MARGIN_PX).contains(&to_border) { end + direction * to_border } else { end }
}

/// Refits the three sides; none unless edges support them. The chord keeps its ends.
fn three_sided(set: &OpenSet, g: &Gradients, p: &DetectParams) -> Option<Quad> {
    let search = EdgeProbeParams {
        reach_px: p.quads.refit_reach_px,
        min_step: p.quads.min_step,
        samples: SAMPLES,
        between_pixels: true,
        least_support: 0.0,
    };
    let c = &set.corners_px;
    let sides: [_; 4] = std::array::from_fn(|i| measure(g, &c[i], &c[(i + 1) % 4], search));
    let worst = sides[..3].iter().fold(1.0_f64, |w, s| w.min(s.support));
    if worst < p.quads.min_side_support {
        return None;
    }
    let [Some(first), Some(middle), Some(last)] = [&sides[0].line, &sides[1].line, &sides[2].line] else {
        return None;
    };
    let placed =
        [foot(first, &c[0]), meeting_point(first, middle)?, meeting_point(middle, last)?, foot(last, &c[3])];
    let moved = (0..4).any(|i| (placed[i].0 - c[i]).norm() > 4.0 * search.reach_px);
    let clockwise = placed.map(|k| k.0);
    if moved || !plausible(&clockwise, (g.width(), g.height())) {
        return None;
    }
    let mean = |f: fn(&crate::detect::edge_support::side_support::SideSupport) -> f64| {
        sides[..3].iter().map(f).sum::<f64>() / 3.0
    };
    let score = set.score * worst * mean(|s| s.support) * mean(|s| s.agreement);
    let corners_px = Corners::from_unordered(clockwise).ok()?;
    let top_left = corners_px.points()[0];
    let shift = (0..4).find(|i| (clockwise[*i] - top_left).norm_squared() <= 0.0)?;
    let on_border = |p: &Point2<f64>| {
        let (right, bottom) = ((g.width() - 1) as f64, (g.height() - 1) as f64);
        p.x.min(p.y).min(right - p.x).min(bottom - p.y) < CLIP_MARGIN_PX
    };
    let points = corners_px.points();
    (score >= p.quads.min_three_sided_score).then(|| Quad {
        corners_px,
        corner_covariance_px2: std::array::from_fn(|i| placed[(i + shift) % 4].1),
        side_support: std::array::from_fn(|i| sides[(i + shift) % 4].support),
        side_clipped: std::array::from_fn(|i| on_border(&points[i]) || on_border(&points[(i + 1) % 4])),
        score: score.clamp(0.0, 1.0),
        kind: QuadKind::ThreeSided,
        upright_ambiguous: upright_ambiguous(&corners_px, &nalgebra::Vector2::y()),
        alternates: Vec::new(),
    })
}

/// A visible end moved onto its refitted line, with its covariance: across from the line, along
/// from the search for the end. It is the end of the visible edge, not of the object.
fn foot(line: &FittedLine, end: &Point2<f64>) -> (Point2<f64>, Matrix2<f64>) {
    let at = end + line.normal * (line.rho_px - line.normal.dot(&end.coords));
    let along = Vector2::new(-line.normal.y, line.normal.x);
    let covariance = line.normal * line.normal.transpose() * line.variance_at(&at)
        + along * along.transpose() * (END_SIGMA_PX * END_SIGMA_PX);
    (at, covariance)
}

/// Corner of two lines and its covariance `M^-1 diag(s_i^2, s_j^2) M^-T` (method 3.6).
fn meeting_point(a: &FittedLine, b: &FittedLine) -> Option<(Point2<f64>, Matrix2<f64>)> {
    let inverse = Matrix2::new(a.normal.x, a.normal.y, b.normal.x, b.normal.y).try_inverse()?;
    let corner = Point2::from(inverse * Vector2::new(a.rho_px, b.rho_px));
    let variances = Matrix2::from_diagonal(&Vector2::new(a.variance_at(&corner), b.variance_at(&corner)));
    Some((corner, inverse * variances * inverse.transpose()))
}

#[cfg(test)]
mod tests;
