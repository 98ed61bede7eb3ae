//! From grey image to quads, one stage a file (method 1 to 3).

use crate::{
    frame::GrayImage,
    params::DetectParams,
    trace::{Stage, Trace},
};
use edges::EdgeMap;
use evidence::Gradients;
use quads::{Grouping, Nested, Quad};
use segments::EdgeSegment;
use tiling::Untiled;

mod tiles;
mod fixed;
mod deriche;
mod maxima;
mod thinning;
mod bridging;
mod joining;
mod polyline;
#[cfg(test)]
mod rendering;
pub mod edges;
pub mod chains;
pub mod segments;
pub mod tiling;
pub mod similarity;
mod profiles;
pub mod relaxation;
pub mod grouping;
pub mod three_sided;
pub mod pyramid;
pub mod evidence;
mod side_fit;
pub mod corners;
pub mod facing;
pub mod seed_look;
pub mod hypotheses;
pub mod rating;
pub mod selection;
pub mod border;
pub mod side_band;
mod side_lines;
pub mod network;
mod learnt;
pub mod side_model;
pub mod thing_model;
pub mod nested;
mod full_size;
pub mod fitting;
pub mod calibration;
pub mod quads;
#[cfg(test)]
mod fixtures;
#[cfg(test)]
mod scenes;
#[cfg(test)]
mod any_input_tests;
#[cfg(test)]
mod symmetry_tests;

/// Most quads of one image, the best first.
pub const MAX_QUADS: usize = 64;

/// Memory of earlier images, for whoever works on many: fresh planes cost more than a tenth of the time to segments.
/// It never changes a result.
#[derive(Debug, Default)]
pub struct Memory {
    maps: Vec<EdgeMap>,
}

impl Memory {
    /// The edges of an image, in the memory of the map that was given back last.
    fn edges(&mut self, image: &GrayImage, p: &edges::EdgeParams) -> EdgeMap {
        let mut map = self.maps.pop().unwrap_or_default();
        edges::edges_into(image, p, &mut map);
        map
    }

    fn give_back(&mut self, map: EdgeMap) {
        // One map a scale; the search gives the finest back last and asks for it first.
        if self.maps.len() < MAX_SCALES {
            self.maps.push(map);
        }
    }
}

/// Finds the quads of an image, best first; ties by corners. At most [`MAX_QUADS`]. Same image, same quads.
pub fn detect(image: &GrayImage, p: &DetectParams, trace: &mut impl Trace) -> Vec<Quad> {
    detect_in(&mut Memory::default(), image, p, trace)
}

/// [`detect`] in the memory of earlier images.
pub fn detect_in(
    memory: &mut Memory,
    image: &GrayImage,
    p: &DetectParams,
    trace: &mut impl Trace,
) -> Vec<Quad> {
    let mut quads = match p.quads.grouping {
        Grouping::Relaxation => by_relaxation(memory, image, p, trace),
        Grouping::Hypotheses => by_search(memory, image, p, trace),
    };
    quads.truncate(MAX_QUADS);
    trace.quads(&quads);
    trace.finished(Stage::Quads);
    quads
}

/// The paper's way: pairs by similarity, both relaxations, sets of three sides.
fn by_relaxation(
    memory: &mut Memory,
    image: &GrayImage,
    p: &DetectParams,
    trace: &mut impl Trace,
) -> Vec<Quad> {
    let (edges, segments) = traced_segments(memory, image, p, trace);
    let candidates = similarity::pairs(&segments, image, &p.similarity);
    let matched = grouping::match_pairs(&segments, &candidates, p.similarity.min_score, &p.relaxation);
    let pairs: Vec<_> = matched.iter().map(|i| candidates[*i].clone()).collect();
    trace.pairs(&pairs);
    trace.finished(Stage::Pairs);
    let gradients = Gradients { image, gx: edges.gx(), gy: edges.gy() };
    let quads = quads::quads(&segments, &pairs, &gradients, p);
    memory.give_back(edges);
    quads
}

/// The search, on one scale or several. Coordinates of the trace are those of the working scale.
fn by_search(memory: &mut Memory, image: &GrayImage, p: &DetectParams, trace: &mut impl Trace) -> Vec<Quad> {
    let factor = pyramid::working_factor(image, p.quads.working_side_px);
    let reduced = (factor > 1).then(|| pyramid::reduce(image, factor));
    let work = reduced.as_ref().unwrap_or(image);
    let (rated, edges, segments) = searched(memory, work, p, trace);
    let gradients = Gradients { image: work, gx: edges.gx(), gy: edges.gy() };
    let found: Vec<Quad> = if p.quads.choose_sides {
        selection::things(selection::settle(rated, &gradients, &p.quads), &p.quads)
    } else {
        selection::resolve(rated, &p.quads)
    };
    let tolerance = p.relaxation.pair_tolerance_px;
    let quads = border::canonical(found, p.quads.nested_iou, p.quads.min_side_support, tolerance);
    let quads = match p.quads.nested {
        Nested::Alternates => nested::absorb(quads, tolerance),
        Nested::Quads => quads,
    };
    let mut quads: Vec<Quad> =
        quads.into_iter().map(|q| selection::sharpen(q, &gradients, &p.quads)).collect();
    if p.quads.three_sided {
        let open = three_sided::leftover(&segments, &quads, &gradients, p);
        // They never take the place of a full quad.
        quads.truncate(MAX_QUADS);
        let room = MAX_QUADS - quads.len();
        quads.extend(open.into_iter().take(room));
        quads.sort_by(|a, b| b.score.total_cmp(&a.score).then(border::by_corners(a, b)));
    }
    memory.give_back(edges);
    let quads = quads.into_iter().filter_map(|q| q.scaled(factor as f64)).collect();
    full_size::at_full_size(quads, image, factor, p, memory)
}

/// Everything the search proposes on the scales of an image, rated, not yet chosen from; and the finest edge map.
pub fn candidates(
    work: &GrayImage,
    p: &DetectParams,
    trace: &mut impl Trace,
) -> (Vec<rating::Rated>, EdgeMap) {
    let (rated, edges, _) = searched(&mut Memory::default(), work, p, trace);
    (rated, edges)
}

/// The same with the finest segments.
fn searched(
    memory: &mut Memory,
    work: &GrayImage,
    p: &DetectParams,
    trace: &mut impl Trace,
) -> (Vec<rating::Rated>, EdgeMap, Vec<EdgeSegment>) {
    let (edges, segments) = traced_segments(memory, work, p, trace);
    let gradients = Gradients { image: work, gx: edges.gx(), gy: edges.gy() };
    let seeds = hypotheses::hypotheses(&segments, &gradients, &p.quads.hypotheses);
    trace.seeds(&seeds);
    trace.finished(Stage::Pairs);
    let mut rated = rating::rate(&seeds, &gradients, &p.quads);
    let mut scale = 1;
    for _ in 1..p.quads.scales.clamp(1, MAX_SCALES) {
        scale *= 2;
        if work.width() / scale < MIN_LEVEL_SIDE_PX || work.height() / scale < MIN_LEVEL_SIDE_PX {
            break;
        }
        let level = pyramid::reduce(work, scale);
        let edges = memory.edges(&level, &p.edges);
        let segments = segments::segments(&chains::chains(&edges, &p.chains), &edges, &p.segments);
        let segments = tiling::untile(segments, (level.width(), level.height()), &p.tiling).kept;
        let gradients = Gradients { image: &level, gx: edges.gx(), gy: edges.gy() };
        let seeds = hypotheses::hypotheses(&segments, &gradients, &p.quads.hypotheses);
        let coarse = rating::rate(&seeds, &gradients, &p.quads);
        rated.extend(coarse.into_iter().filter_map(|r| r.scaled(scale as f64)));
        memory.give_back(edges);
    }
    (rated, edges, segments)
}

/// Most scales of the search.
pub const MAX_SCALES: usize = 4;
/// No scale is smaller than this.
const MIN_LEVEL_SIDE_PX: usize = 80;

fn traced_segments(
    memory: &mut Memory,
    image: &GrayImage,
    p: &DetectParams,
    trace: &mut impl Trace,
) -> (EdgeMap, Vec<EdgeSegment>) {
    let edges = memory.edges(image, &p.edges);
    trace.edges(&edges);
    trace.finished(Stage::Edges);
    let chains = chains::chains(&edges, &p.chains);
    trace.chains(&chains);
    trace.finished(Stage::Chains);
    let segments = segments::segments(&chains, &edges, &p.segments);
    let Untiled { kept: segments, removed } =
        tiling::untile(segments, (image.width(), image.height()), &p.tiling);
    if !removed.is_empty() {
        trace.tiling(&removed);
    }
    trace.segments(&segments);
    trace.finished(Stage::Segments);
    (edges, segments)
}
