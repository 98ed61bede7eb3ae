//! Quads of the paper's grouping (method 3.4 to 3.6): matched pairs in, quads with refitted corners
//! out, best first.

use crate::{
    detect::{
        edge_support::{
            gradients::Gradients,
            side_support::{EdgeProbeParams, MAX_SAMPLES},
        },
        params::{DetectParams, QuadParams},
        proposals::quad_seed::QuadSeed,
        quad::{Quad, QuadKind},
        refine::corners::refine,
        segments::edge_segments::EdgeSegment,
        suppression::nested_borders::canonical,
    },
    paper::relaxation::{grouping::match_quads, similarity::SegmentPair, three_sided::three_sided},
};

/// Quads from the matched pairs of pass 1: pass 2, three-sided sets, refitted corners, canonical
/// border. Best first.
pub fn quads(segments: &[EdgeSegment], pairs: &[SegmentPair], g: &Gradients, p: &DetectParams) -> Vec<Quad> {
    let size = (g.width(), g.height());
    let full = match_quads(segments, pairs, size, &p.relaxation);
    let mut found: Vec<Quad> = full.iter().filter_map(|s| quad(s, QuadKind::Full, g, &p.quads)).collect();
    if p.quads.three_sided {
        let mut in_quad = vec![false; segments.len()];
        full.iter().flat_map(|s| s.sides).flatten().for_each(|i| in_quad[i] = true);
        let left: Vec<SegmentPair> =
            pairs.iter().filter(|s| !in_quad[s.k] && !in_quad[s.l]).cloned().collect();
        for s in pairs {
            (in_quad[s.k], in_quad[s.l]) = (true, true);
        }
        let sets = three_sided(segments, &left, &in_quad, p.quads.min_three_sided_closing, size);
        found.extend(sets.iter().filter_map(|s| quad(s, QuadKind::ThreeSided, g, &p.quads)));
    }
    canonical(found, p.quads.nested_iou, p.quads.min_side_support, p.relaxation.pair_tolerance_px)
}

/// Refits a seed on the gradient planes. The score is the similarity of its pairs times the support
/// of its worst side (method 3.6); of three sides, the worst of those that were seen.
fn quad(seed: &QuadSeed, kind: QuadKind, g: &Gradients, p: &QuadParams) -> Option<Quad> {
    let search = EdgeProbeParams {
        reach_px: p.refit_reach_px,
        min_step: p.min_step,
        samples: MAX_SAMPLES,
        between_pixels: true,
        least_support: 0.0,
    };
    let refined = refine(g, &seed.corners_px, search)?;
    let mut support = refined.support();
    let side_support = support;
    if kind == QuadKind::ThreeSided {
        support.sort_by(f64::total_cmp);
        support[0] = 1.0;
    }
    let worst = support.into_iter().fold(1.0, f64::min);
    Some(Quad {
        corners_px: refined.corners_px,
        corner_covariance_px2: refined.covariance_px2,
        side_support,
        side_clipped: refined.clipped,
        score: (seed.similarity * worst).clamp(0.0, 1.0),
        kind,
        upright_ambiguous: refined.upright_ambiguous,
        alternates: Vec::new(),
    })
}
