//! Quad proposals in, the best of them refitted and scored by the edges along their sides out. They
//! may conflict with each other; `suppression` decides which stay.

use crate::detect::{
    edge_support::{gradients::Gradients, side_support::EdgeProbeParams},
    params::QuadParams,
    proposals::quad_seed::{Extent, QuadSeed},
    quad::{Quad, QuadKind},
    refine::corners::{RefinedQuad, refine},
};
use nalgebra::Point2;

/// Most seeds that are refitted, the best first; half as many small ones come on top.
pub const MAX_REFITTED: usize = 160;
/// Samples along a side while quads are compared; the chosen ones are refitted with more.
const RATING_SAMPLES: usize = 32;
/// Corners closer than this make two seeds the same.
const SAME_CORNER_PX: f64 = 2.0;
/// Smallest side of a quad.
const MIN_SIDE_PX: f64 = 15.0;

/// A refitted quad with its rank.
#[derive(Debug, Clone)]
pub struct ScoredQuad {
    /// Corners, support and score.
    pub quad: Quad,
    /// Order of two conflicting quads: score and size.
    pub rank: f64,
}

impl ScoredQuad {
    /// The same in an image larger by `factor`.
    pub fn scaled(&self, factor: f64) -> Option<Self> {
        Some(Self { quad: self.quad.scaled(factor)?, ..self.clone() })
    }
}

/// Refits the seeds, best first, and drops those whose sides the gradient does not support. A share
/// is reserved for small seeds: large ones on a crowded wall would take every place.
pub fn score_proposals(seeds: &[QuadSeed], g: &Gradients, p: &QuadParams) -> Vec<ScoredQuad> {
    let mut order: Vec<(f64, &QuadSeed)> = seeds.iter().map(|s| (s.fit * size(&s.corners_px), s)).collect();
    order.sort_by(|a, b| b.0.total_cmp(&a.0));
    let search = rating_search(p, p.refit_reach_px + 1.0);
    let (mut seen, mut rated): (Vec<[Point2<f64>; 4]>, Vec<ScoredQuad>) = (Vec::new(), Vec::new());
    let mut extents = Vec::new();
    let places = p.max_refitted.min(MAX_REFITTED);
    let mut left = [places, places / 2];
    for (_, seed) in order {
        if left == [0, 0] {
            break;
        }
        let small = size(&seed.corners_px) < SMALL_PERIMETER_PX.sqrt();
        let class = usize::from(small && left[1] > 0);
        if left[class] == 0 || seen.iter().any(|s| same(s, &seed.corners_px)) {
            continue;
        }
        let extent = Extent::new(&seed.corners_px);
        let same_object = extents.iter().filter(|r| extent.overlaps(r, SAME_OBJECT_IOU)).take(p.max_alike);
        if same_object.count() >= p.max_alike {
            continue;
        }
        left[class] -= 1;
        seen.push(seed.corners_px);
        let Some(refined) = refine(g, &seed.corners_px, search) else { continue };
        if rated.iter().any(|r| same(r.quad.corners_px.points(), refined.corners_px.points())) {
            continue;
        }
        if let Some(one) = rate_one(&refined, p) {
            extents.push(Extent::new(one.quad.corners_px.points()));
            rated.push(one);
        }
    }
    rated
}

/// Seeds with a shorter perimeter are small.
const SMALL_PERIMETER_PX: f64 = 240.0;
/// Rated quads that overlap a seed by more are borders of the same object.
const SAME_OBJECT_IOU: f64 = 0.6;

/// Edge search of a side while quads are rated.
pub(crate) fn rating_search(p: &QuadParams, reach_px: f64) -> EdgeProbeParams {
    EdgeProbeParams {
        reach_px,
        min_step: p.min_step,
        samples: RATING_SAMPLES,
        between_pixels: false,
        least_support: p.min_side_support,
    }
}

/// The rating of a refitted quad; none if a side is too short or has too little support.
pub(crate) fn rate_one(refined: &RefinedQuad, p: &QuadParams) -> Option<ScoredQuad> {
    if refined.min_support() < p.min_side_support || refined.corners_px.min_side_px() < MIN_SIDE_PX {
        return None;
    }
    let support = refined.support();
    let agreement: f64 = refined.sides.iter().map(|s| s.agreement).sum::<f64>() / 4.0;
    let score = refined.min_support() * (support.iter().sum::<f64>() / 4.0) * agreement;
    let rank = score * size(refined.corners_px.points());
    let quad = Quad {
        corners_px: refined.corners_px,
        corner_covariance_px2: refined.covariance_px2,
        side_support: refined.support(),
        side_clipped: refined.clipped,
        score,
        kind: QuadKind::Full,
        upright_ambiguous: refined.upright_ambiguous,
        alternates: Vec::new(),
    };
    Some(ScoredQuad { quad, rank })
}

fn size(corners: &[Point2<f64>; 4]) -> f64 {
    (0..4).map(|i| (corners[(i + 1) % 4] - corners[i]).norm()).sum::<f64>().sqrt()
}

/// Whether two quads have the same corners, whichever comes first.
pub(crate) fn same(a: &[Point2<f64>; 4], b: &[Point2<f64>; 4]) -> bool {
    let near = |p: &Point2<f64>, q: &Point2<f64>| (p - q).norm_squared() < SAME_CORNER_PX * SAME_CORNER_PX;
    (0..4).any(|shift| (0..4).all(|i| near(&a[i], &b[(i + shift) % 4])))
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::detect::edges::edge_map::{EdgeMap, EdgeParams, edges};
    use crate::frame::GrayImage;

    /// As many dark squares in rows on a bright wall, with an image that shows them.
    pub(crate) fn squares(rows: usize) -> (GrayImage, EdgeMap, Vec<QuadSeed>) {
        const PITCH: usize = 40;
        let dark = |x: usize| (8..32).contains(&(x % PITCH));
        let image =
            GrayImage::from_fn(rows * PITCH, rows * PITCH, |u, v| if dark(u) && dark(v) { 60 } else { 200 });
        let seed = |i: usize| {
            let (u, v) = ((i % rows * PITCH) as f64 + 7.5, (i / rows * PITCH) as f64 + 7.5);
            let corners_px = [[u, v], [u + 24.0, v], [u + 24.0, v + 24.0], [u, v + 24.0]].map(Point2::from);
            QuadSeed { sides: [None; 4], corners_px, similarity: 1.0, fit: 1.0 }
        };
        let map = edges(&image, &EdgeParams::default());
        (image, map, (0..rows * rows).map(seed).collect())
    }

    #[test]
    fn the_number_of_refitted_seeds_is_bounded() {
        let (image, map, seeds) = squares(16);
        let g = Gradients { image: &image, gx: map.gx(), gy: map.gy() };
        let rated = |max_refitted| {
            score_proposals(&seeds, &g, &QuadParams { max_refitted, ..QuadParams::default() }).len()
        };
        assert_eq!(seeds.len(), 256);
        assert_eq!(rated(usize::MAX), MAX_REFITTED + MAX_REFITTED / 2);
        assert_eq!([rated(0), rated(10)], [0, 15]);
    }
}
