//! From grey image to quads, one stage a file (method 1 to 3).

use crate::{
    frame::GrayImage,
    params::DetectParams,
    trace::{Stage, Trace},
};

mod deriche;
mod thinning;
mod bridging;
mod joining;
mod polyline;
#[cfg(test)]
mod rendering;
pub mod edges;
pub mod chains;
pub mod segments;
pub mod similarity;
mod profiles;
pub mod relaxation;
pub mod grouping;
pub mod three_sided;
pub mod evidence;
pub mod corners;
pub mod hypotheses;
pub mod selection;
pub mod border;
pub mod quads;
#[cfg(test)]
mod fixtures;
#[cfg(test)]
mod scenes;

/// Most quads of one image, the best first.
pub const MAX_QUADS: usize = 64;

/// Finds the quads of an image, best first; ties by corners. At most [`MAX_QUADS`]. Same image, same quads.
pub fn detect(image: &GrayImage, p: &DetectParams, trace: &mut impl Trace) -> Vec<quads::Quad> {
    let edges = edges::edges(image, &p.edges);
    trace.edges(&edges);
    trace.finished(Stage::Edges);
    let chains = chains::chains(&edges, &p.chains);
    trace.chains(&chains);
    trace.finished(Stage::Chains);
    let segments = segments::segments(&chains, &edges, &p.segments);
    trace.segments(&segments);
    trace.finished(Stage::Segments);
    let candidates = similarity::pairs(&segments, image, &p.similarity);
    let matched = grouping::match_pairs(&segments, &candidates, p.similarity.min_score, &p.relaxation);
    let pairs: Vec<_> = matched.iter().map(|i| candidates[*i].clone()).collect();
    trace.pairs(&pairs);
    trace.finished(Stage::Pairs);
    let gradients =
        evidence::Gradients { width: image.width(), height: image.height(), gx: edges.gx(), gy: edges.gy() };
    let mut quads = quads::quads(&segments, &pairs, &gradients, p);
    quads.truncate(MAX_QUADS);
    trace.quads(&quads);
    trace.finished(Stage::Quads);
    quads
}
