//! Which hypotheses become quads: seeds in, refitted quads that do not contradict each other out. Nested quads may
//! stay together, quads that partly cross may not. The choice of the border within a group is `border`'s.

use super::{
    corners::{RefinedQuad, refine},
    evidence::{Gradients, Search},
    grouping::QuadSeed,
    quads::{Quad, QuadKind, QuadParams},
};
use crate::geometry::polygon::{self, Relation};
use nalgebra::Point2;

/// Most seeds that are refitted, the best first.
pub const MAX_REFITTED: usize = 400;
/// Corners closer than this make two seeds the same.
const SAME_CORNER_PX: f64 = 3.0;

/// A refitted quad with its place in the queue.
struct Rated {
    quad: Quad,
    weight: f64,
    strength: [f64; 4],
}

/// How the sides of two quads lie that are named from the corners that fit best: for each side of `a` the side of
/// `b` that it faces, and whether both lie on one line.
struct Facing {
    other: [usize; 4],
    shared: [bool; 4],
}

impl Facing {
    fn new(a: &[Point2<f64>; 4], b: &[Point2<f64>; 4]) -> Self {
        let gap = |shift: usize| (0..4).map(|i| (a[i] - b[(i + shift) % 4]).norm()).sum::<f64>();
        let shift = (0..4).min_by(|x, y| gap(*x).total_cmp(&gap(*y))).unwrap_or(0);
        let other = std::array::from_fn(|i| (i + shift) % 4);
        let shared = std::array::from_fn(|i| {
            let (from, side, j) = (a[i], a[(i + 1) % 4] - a[i], (i + shift) % 4);
            let off = |q: &Point2<f64>| side.perp(&(q - from)).abs() / side.norm();
            off(&b[j]) <= SHARED_SIDE_PX && off(&b[(j + 1) % 4]) <= SHARED_SIDE_PX
        });
        Self { other, shared }
    }

    fn count(&self) -> usize {
        self.shared.iter().filter(|s| **s).count()
    }
}

/// Whether `outer` is `inner` plus a shadow or a stretch of bare wall: it contains it, shares sides with it, and
/// either what it adds to a shared side or all the sides of its own are much weaker than the inner one's.
fn extends_weakly(outer: &Rated, inner: &Rated, p: &QuadParams) -> bool {
    let (a, b) = (outer.quad.corners_px.points(), inner.quad.corners_px.points());
    if outer.quad.corners_px.area_px2() <= inner.quad.corners_px.area_px2()
        || inner.quad.side_support.iter().any(|s| *s < p.min_inner_support)
        || polygon::relation(a, b, SHARED_SIDE_PX) != Relation::Contains
    {
        return false;
    }
    let facing = Facing::new(a, b);
    if !(1..4).contains(&facing.count()) {
        return false;
    }
    let length = |c: &[Point2<f64>; 4], i: usize| (c[(i + 1) % 4] - c[i]).norm();
    // A weak frame is weak all round; a shadow or a stray line is weak next to the sides it borrowed.
    let borrowed = (0..4).filter(|i| facing.shared[*i]).map(|i| inner.strength[facing.other[i]]);
    let borrowed = borrowed.sum::<f64>() / facing.count() as f64;
    let mut own_weak = true;
    for i in 0..4 {
        let j = facing.other[i];
        let weak = p.weak_extension * inner.strength[j];
        if facing.shared[i] {
            let (long, short) = (length(a, i), length(b, j));
            let added = long - short;
            let strength = (outer.strength[i] * long - inner.strength[j] * short) / added.max(1.0);
            if added > 0.1 * short && strength < weak {
                return true;
            }
        } else {
            own_weak &= outer.strength[i] < weak.min(p.weak_extension * borrowed);
        }
    }
    own_weak
}

/// Lines closer than this count as the same side.
const SHARED_SIDE_PX: f64 = 4.0;

/// Refits the seeds, best first, and keeps those that do not cross a better one.
pub fn select(seeds: &[QuadSeed], g: &Gradients, p: &QuadParams) -> Vec<Quad> {
    let mut order: Vec<&QuadSeed> = seeds.iter().collect();
    order.sort_by(|a, b| (b.fit * size(&b.corners_px)).total_cmp(&(a.fit * size(&a.corners_px))));
    let mut seen: Vec<[Point2<f64>; 4]> = Vec::new();
    let mut rated: Vec<Rated> = Vec::new();
    for seed in order {
        if seen.len() >= MAX_REFITTED {
            break;
        }
        if seen.iter().any(|s| same(s, &seed.corners_px)) {
            continue;
        }
        seen.push(seed.corners_px);
        let search = Search { reach_px: p.refit_reach_px + 1.0, min_step: p.min_step };
        let Some(rough) = refine(g, &seed.corners_px, search) else { continue };
        let search = Search { reach_px: p.refit_reach_px, min_step: p.min_step };
        let Some(refined) = refine(g, rough.corners_px.points(), search) else { continue };
        rated.extend(rate(&refined, p));
    }
    rated.sort_by(|a, b| b.weight.total_cmp(&a.weight).then(super::border::by_corners(&a.quad, &b.quad)));
    let keep: Vec<bool> = rated.iter().map(|a| !rated.iter().any(|b| extends_weakly(a, b, p))).collect();
    let mut keep = keep.into_iter();
    rated.retain(|_| keep.next().unwrap_or(true));
    let mut kept: Vec<Quad> = Vec::new();
    for r in rated {
        let corners = r.quad.corners_px.points();
        let free = kept.iter().all(|k| {
            let other = k.corners_px.points();
            match polygon::relation(other, corners, SHARED_SIDE_PX) {
                Relation::Disjoint => true,
                Relation::Crossing => false,
                // Two borders of one thing differ on all four sides; else one edge would belong to both.
                Relation::Contains | Relation::Within => Facing::new(other, corners).count() == 0,
            }
        });
        if free {
            kept.push(r.quad);
        }
    }
    kept
}

fn size(corners: &[Point2<f64>; 4]) -> f64 {
    (0..4).map(|i| (corners[(i + 1) % 4] - corners[i]).norm()).sum::<f64>().sqrt()
}

fn same(a: &[Point2<f64>; 4], b: &[Point2<f64>; 4]) -> bool {
    let near = |p: &Point2<f64>, q: &Point2<f64>| (p - q).norm_squared() < SAME_CORNER_PX * SAME_CORNER_PX;
    (0..4).any(|shift| (0..4).all(|i| near(&a[i], &b[(i + shift) % 4])))
}

fn rate(refined: &RefinedQuad, p: &QuadParams) -> Option<Rated> {
    let worst = refined.min_support();
    if worst < p.min_side_support || refined.corners_px.min_side_px() < 15.0 {
        return None;
    }
    let support = refined.support();
    let agreement: f64 = refined.sides.iter().map(|s| s.agreement).sum::<f64>() / 4.0;
    let mean = support.iter().sum::<f64>() / 4.0;
    let score = worst * mean * agreement;
    let weight = score * size(refined.corners_px.points());
    let quad = Quad {
        corners_px: refined.corners_px,
        corner_covariance_px2: refined.covariance_px2,
        side_support: support,
        side_clipped: refined.clipped,
        score,
        kind: QuadKind::Full,
        upright_ambiguous: refined.upright_ambiguous,
        alternates: Vec::new(),
    };
    let strength = std::array::from_fn(|i| refined.sides[i].strength);
    Some(Rated { quad, weight, strength })
}
