//! Chains in, straight segments out (method 1.3, 1.4): split, fit, join, drop the short ones.
//!
//! Each segment knows its bright side, contrast and the variances of its line. Nothing is dropped
//! here for its direction or surroundings.

use crate::detect::{
    edges::{edge_map::EdgeMap, maxima::BORDER_PX},
    segments::{
        chains::EdgeChain,
        collinear_merge::{Fragment, MAX_SEGMENTS, SegmentParams, join},
        polyline::{Polyline, Tolerance, interior},
    },
};
use nalgebra::{Point2, Vector2};

/// An end this close to the image border counts as cut off by it.
pub const CLIP_MARGIN_PX: f64 = BORDER_PX as f64 + 2.0;

/// A straight piece of edge. Coordinates in pixels; pixel centres at integers.
#[derive(Debug, Clone, PartialEq)]
pub struct EdgeSegment {
    /// One end.
    pub p_px: Point2<f64>,
    /// The other end. Walking from `p_px` to `q_px`, the brighter side lies to the right on screen
    /// (u right, v down).
    pub q_px: Point2<f64>,
    /// Distance between the ends.
    pub length_px: f64,
    /// Undirected direction in [0, pi), from +u towards +v.
    pub theta_rad: f64,
    /// Unit normal, pointing to the brighter side. The supporting line is `normal . x = rho_px`.
    pub normal: Vector2<f64>,
    /// Signed distance of the supporting line from the origin along `normal`.
    pub rho_px: f64,
    /// Mean gradient magnitude along the segment, as step height in grey levels.
    pub contrast: f64,
    /// Edge points that support the line.
    pub support: usize,
    /// Index of the chain it came from.
    pub chain: usize,
    /// Variance of the line's direction, rad^2.
    pub theta_variance: f64,
    /// Variance of the line's offset at the segment's mid point, px^2.
    pub offset_variance: f64,
    /// An end lies on the image border, so the true side may be longer.
    pub clipped: bool,
}

impl SegmentParams {
    /// Shortest segment that is kept in an image of this width.
    pub fn min_length_px(&self, width: usize) -> f64 {
        let [low, high] = self.min_length_range_px;
        (self.min_length_share * width as f64).min(high).max(low)
    }
}

/// Straight segments of all chains, longest first, at most `max_segments`.
pub fn segments(chains: &[EdgeChain], edges: &EdgeMap, p: &SegmentParams) -> Vec<EdgeSegment> {
    let mut fragments = Vec::new();
    let mut line = Polyline::default();
    for (index, chain) in chains.iter().enumerate() {
        fragments_of(chain, index, p, &mut line, &mut fragments);
    }
    let min_length_px = p.min_length_px(edges.width());
    let mut joined = join(fragments, p);
    joined.retain(|f| f.length_px() >= min_length_px);
    joined.sort_by(|a, b| b.length_px().total_cmp(&a.length_px()));
    joined.truncate(p.max_segments.min(MAX_SEGMENTS));
    joined.iter().map(|f| segment(f, edges)).collect()
}

fn fragments_of(
    chain: &EdgeChain,
    index: usize,
    p: &SegmentParams,
    line: &mut Polyline,
    fragments: &mut Vec<Fragment>,
) {
    let n = chain.points.len();
    let tolerance = Tolerance { split_px: p.split_px.max(0.0), merge_rad: p.merge_angle_deg.to_radians() };
    line.cut(chain.points.iter().map(|e| e.position_px), chain.closed, tolerance);
    line.grow(p.end_px);
    for (i, piece) in line.grown.iter().enumerate() {
        let Some(piece) = piece else { continue };
        let ends = [line.point(piece.start), line.point(piece.end - 1)];
        if (ends[1] - ends[0]).norm() < p.min_fragment_px || line.swallowed(i, piece) {
            continue;
        }
        let inner = interior(piece);
        let start = (line.wrapped(inner.start) + line.turn) % n;
        let (to_end, wrapped) = (inner.len().min(n - start), inner.len().saturating_sub(n - start));
        let mut gradient = Vector2::zeros();
        let mut magnitude = 0.0;
        for e in chain.points[start..start + to_end].iter().chain(&chain.points[..wrapped]) {
            let g: Vector2<f64> = e.gradient.cast();
            gradient += g;
            magnitude += g.norm();
        }
        fragments.extend(Fragment::new(line.sums(&inner), gradient, magnitude, &ends, index));
    }
}

fn segment(f: &Fragment, edges: &EdgeMap) -> EdgeSegment {
    let (right, bottom) = (edges.width() as f64 - 1.0, edges.height() as f64 - 1.0);
    let near_border = |e: &Point2<f64>| e.x.min(e.y).min(right - e.x).min(bottom - e.y) <= CLIP_MARGIN_PX;
    EdgeSegment {
        p_px: f.p,
        q_px: f.q,
        length_px: f.length_px(),
        theta_rad: f.fit.line.theta_rad(),
        normal: f.fit.line.normal,
        rho_px: f.fit.line.rho_px,
        contrast: f.magnitude / f.sums.count(),
        support: f.sums.count() as usize,
        chain: f.chain,
        theta_variance: f.fit.theta_variance(),
        offset_variance: offset_variance(f),
        clipped: near_border(&f.p) || near_border(&f.q),
    }
}

/// Variance of the offset at the mid point: that at the mean of the points, extrapolated.
fn offset_variance(f: &Fragment) -> f64 {
    let away = f.fit.line.direction().dot(&(nalgebra::center(&f.p, &f.q) - f.fit.mean_px));
    f.fit.offset_variance() + away * away * f.fit.theta_variance()
}

#[cfg(test)]
#[path = "edge_segments_tests.rs"]
mod tests;
