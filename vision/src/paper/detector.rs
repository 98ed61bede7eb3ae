//! Edges and segments in, quads by the paper's grouping out (method 2 to 3.6).

use crate::{
    detect::{
        edge_support::gradients::Gradients, params::DetectParams, quad::Quad,
        segments::edge_segments::EdgeSegment,
    },
    paper::relaxation::{grouping::match_pairs, paired_quads::quads, similarity::pairs},
    trace::{Stage, Trace},
};

/// The paper's grouping: pairs by similarity, both relaxations, sets of three sides.
pub(crate) fn quads_by_relaxation(
    segments: &[EdgeSegment],
    gradients: &Gradients,
    p: &DetectParams,
    trace: &mut impl Trace,
) -> Vec<Quad> {
    let candidates = pairs(segments, gradients.image, &p.similarity);
    let matched = match_pairs(segments, &candidates, p.similarity.min_score, &p.relaxation);
    let pairs: Vec<_> = matched.iter().map(|i| candidates[*i].clone()).collect();
    trace.pairs(&pairs);
    trace.finished(Stage::Pairs);
    quads(segments, &pairs, gradients, p)
}
