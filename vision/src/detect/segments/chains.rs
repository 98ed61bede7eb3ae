//! Edge map in, chains of edge points out (method 1.2): tracing, then closing of small gaps.
//!
//! A chain keeps one polarity: the brighter side never changes over. Corners stay inside chains;
//! finding the straight parts is the next stage's work.

use crate::detect::{
    edges::{
        edge_map::EdgeMap,
        edge_thinning::{BRANCHES, EDGE, RING, changing_ring_code, ring_code},
    },
    segments::gap_closing::{ChainParams, PixelRun, bridged},
};
use nalgebra::{Point2, Vector2};

/// Most points of a chain; a longer edge goes on in a further chain. Bounds the work of splitting a
/// chain.
pub const MAX_CHAIN_POINTS: usize = 4096;

/// A point of an edge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EdgePoint {
    /// Sub-pixel position; pixel centres at integers.
    pub position_px: Point2<f64>,
    /// Gradient in grey levels of step height, to the brighter side.
    pub gradient: Vector2<f32>,
}

/// Edge points in the order of the edge. In a closed chain the last point is a neighbour of the
/// first.
#[derive(Debug, Clone, PartialEq)]
pub struct EdgeChain {
    /// The points, at most [`MAX_CHAIN_POINTS`].
    pub points: Vec<EdgePoint>,
    /// Whether the edge returns to its start.
    pub closed: bool,
}

/// All chains of the map, in a fixed order.
pub fn chains(edges: &EdgeMap, p: &ChainParams) -> Vec<EdgeChain> {
    let (pixels, runs) = Tracer::new(edges).trace_all();
    let mut chains = Vec::new();
    bridged(edges, p, &pixels, &runs, |indices, closed| {
        for part in indices.chunks(MAX_CHAIN_POINTS).filter(|part| part.len() >= p.min_points.max(2)) {
            let point = |at: &u32| {
                let at = *at as usize;
                EdgePoint {
                    position_px: edges.position_px(at),
                    gradient: Vector2::new(edges.gx()[at], edges.gy()[at]),
                }
            };
            chains.push(EdgeChain {
                points: part.iter().map(point).collect(),
                closed: closed && part == indices,
            });
        }
    });
    chains
}

struct Tracer<'a> {
    edges: &'a EdgeMap,
    /// Branches that meet in each edge pixel, 0 elsewhere.
    branches: Vec<u8>,
    /// Edge pixels not yet in a run. Junctions stay free: several runs may end there.
    free: Vec<u8>,
    pixels: Vec<u32>,
    runs: Vec<PixelRun>,
}

impl<'a> Tracer<'a> {
    fn new(edges: &'a EdgeMap) -> Self {
        let mut branches = vec![0; edges.marks().len()];
        for &at in edges.pixels() {
            branches[at as usize] = BRANCHES[ring_code(edges.marks(), edges.width(), at as usize)];
        }
        let pixels = Vec::with_capacity(edges.pixels().len() + 16);
        Self { edges, branches, free: edges.marks().to_vec(), pixels, runs: Vec::new() }
    }

    /// From ends, from junctions, then what is left: closed loops.
    fn trace_all(mut self) -> (Vec<u32>, Vec<PixelRun>) {
        let mut junctions = Vec::new();
        let all = self.edges.pixels();
        for &at in all {
            let at = at as usize;
            match self.branches[at] {
                0 | 1 if self.free[at] == EDGE => self.trace(at),
                3.. => junctions.push(at),
                _ => {}
            }
        }
        for &at in &junctions {
            for _ in 0..RING.len() {
                let before = self.runs.len();
                self.trace(at);
                if self.runs.len() == before {
                    break;
                }
            }
        }
        for &at in all {
            if self.free[at as usize] == EDGE && self.branches[at as usize] < 3 {
                self.trace(at as usize);
            }
        }
        (self.pixels, self.runs)
    }

    /// Follows free pixels from `at` as long as the edge goes on, then, if it did not start at an
    /// end, from `at` the other way. Stops at junctions, which it includes.
    fn trace(&mut self, at: usize) {
        let start = self.pixels.len();
        self.pixels.push(at as u32);
        self.free[at] = 0;
        self.follow(at, start, None);
        let last = self.pixels[self.pixels.len() - 1] as usize;
        let long = self.pixels.len() - start > 3;
        let closed = long && self.branches[at] < 3 && self.touches(last, at) && self.same_side(last, at);
        if !closed && self.branches[at] < 3 {
            // Walk the other way from the same pixel: bright side on the other hand.
            let forward = self.pixels.len();
            let sense = (forward - start > 1).then(|| -self.sense(at, self.pixels[start + 1] as usize));
            self.follow(at, start, sense);
            self.pixels[start..forward].reverse();
        }
        if self.branches[at] >= 3 {
            self.free[at] = EDGE;
        }
        let end = self.pixels.len();
        if end - start > 1 {
            self.runs.push(PixelRun { start, end, closed });
        } else {
            self.pixels.truncate(start);
        }
    }

    /// Appends the pixels after `at`. `sense` is the hand on which the brighter side lies; None
    /// takes either.
    fn follow(&mut self, mut at: usize, start: usize, mut sense: Option<f32>) {
        while self.pixels.len() - start < MAX_CHAIN_POINTS {
            let Some((next, hand)) = self.next(at, sense) else { return };
            self.pixels.push(next as u32);
            if self.branches[next] >= 3 {
                return;
            }
            self.free[next] = 0;
            (at, sense) = (next, Some(hand));
        }
    }

    /// The free neighbour that lies best along the edge's tangent at `at`, and the hand of the
    /// bright side.
    ///
    /// Departs from method 1.2, which takes the least change of direction: steps between pixels
    /// have eight directions only, the gradient has them all, and it keeps a chain from changing
    /// over to an edge of the other polarity.
    fn next(&self, at: usize, sense: Option<f32>) -> Option<(usize, f32)> {
        let mut best = None;
        let mut best_cos = MIN_COS_TURN;
        // Runs between two touching junctions would be found again and again; closing joins what
        // they separate.
        let junction = self.branches[at] >= 3;
        let mut ring = changing_ring_code(&self.free, self.edges.width(), at);
        while ring != 0 {
            let i = ring.trailing_zeros() as usize;
            ring &= ring - 1;
            let (du, dv) = RING[i];
            let near = at.wrapping_add_signed(dv as isize * self.edges.width() as isize + du as isize);
            if !self.same_side(at, near) || (junction && self.branches[near] >= 3) {
                continue;
            }
            let cos = self.along(at, du as f32, dv as f32)
                * if i % 2 == 1 { std::f32::consts::FRAC_1_SQRT_2 } else { 1.0 };
            let hand = if cos < 0.0 { -1.0 } else { 1.0 };
            let cos = sense.map_or(cos.abs(), |s| cos * s);
            if cos > best_cos {
                (best, best_cos) = (Some((near, sense.unwrap_or(hand))), cos);
            }
        }
        best
    }

    /// Cosine between a step and the tangent that has the bright side on its right, times the
    /// step's length.
    fn along(&self, at: usize, du: f32, dv: f32) -> f32 {
        let (gx, gy) = (self.edges.gx()[at], self.edges.gy()[at]);
        (gy * du - gx * dv) / self.edges.magnitude(at)
    }

    /// On which hand the bright side lies when walking from `at` to its neighbour `to`.
    fn sense(&self, at: usize, to: usize) -> f32 {
        let width = self.edges.width();
        let (du, dv) = ((to % width) as f32 - (at % width) as f32, (to / width) as f32 - (at / width) as f32);
        if self.along(at, du, dv) < 0.0 { -1.0 } else { 1.0 }
    }

    fn touches(&self, a: usize, b: usize) -> bool {
        let width = self.edges.width();
        (a % width).abs_diff(b % width) <= 1 && (a / width).abs_diff(b / width) <= 1
    }

    /// Whether the gradients at two pixels point to the same half plane.
    fn same_side(&self, a: usize, b: usize) -> bool {
        let (gx, gy) = (self.edges.gx(), self.edges.gy());
        gx[a] * gx[b] + gy[a] * gy[b] > 0.0
    }
}

/// Least cosine between a step and the edge's tangent.
const MIN_COS_TURN: f32 = 0.1;

#[cfg(test)]
#[path = "chains_tests.rs"]
mod tests;
