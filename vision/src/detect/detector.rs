//! Picture in, quads out, best first (method 1 to 3): the stages in order, on one scale or several.

use crate::{
    detect::{
        edge_buffers::{DetectBuffers, MAX_SCALES},
        edge_support::gradients::Gradients,
        edges::edge_map::EdgeMap,
        params::{DetectParams, Grouping, Nested},
        proposals::quad_proposals::proposals,
        pyramid::{reduce, working_factor},
        quad::Quad,
        refine::{
            full_size::at_full_size,
            rating::{ScoredQuad, score_proposals},
            refit::refit_corners,
        },
        segments::{
            chains::chains,
            edge_segments::{EdgeSegment, segments as straight_segments},
        },
        suppression::{
            blank::doubt_blanks,
            nested_borders::{by_corners, canonical},
            nested_quads::absorb,
            non_maximum::{snap_sides, suppress_non_maxima, suppress_overlaps},
        },
    },
    frame::PictureRef,
    paper::{
        detector::quads_by_relaxation,
        three_sided::find_three_sided,
        tiling::floor_tiling::{Untiled, remove_floor_tiling},
    },
    trace::{Stage, Trace},
};

/// Most quads of one image, the best first.
pub const MAX_QUADS: usize = 64;

/// Finds the quads of a picture that people are shown, best first; ties by corners. At most
/// [`MAX_QUADS`]. Same picture, same quads.
pub fn detect<'a>(image: impl Into<PictureRef<'a>>, p: &DetectParams, trace: &mut impl Trace) -> Vec<Quad> {
    detect_with(&mut DetectBuffers::default(), image, p, trace)
}

/// [`detect`], reusing the memory of earlier pictures.
pub fn detect_with<'a>(
    memory: &mut DetectBuffers,
    image: impl Into<PictureRef<'a>>,
    p: &DetectParams,
    trace: &mut impl Trace,
) -> Vec<Quad> {
    let mut quads = grouped(memory, image.into(), p, trace);
    quads.retain(|quad| p.quads.is_shown(quad));
    finished(quads, trace)
}

/// The quads that recognition compares: those of [`detect`], and others that are probably no
/// objects.
pub fn detect_for_recognition<'a>(
    memory: &mut DetectBuffers,
    image: impl Into<PictureRef<'a>>,
    p: &DetectParams,
    trace: &mut impl Trace,
) -> Vec<Quad> {
    finished(grouped(memory, image.into(), p, trace), trace)
}

fn grouped(
    memory: &mut DetectBuffers,
    image: PictureRef,
    p: &DetectParams,
    trace: &mut impl Trace,
) -> Vec<Quad> {
    match p.quads.grouping {
        Grouping::Relaxation => by_relaxation(memory, image, p, trace),
        Grouping::Proposals => by_proposals(memory, image, p, trace),
    }
}

fn finished(mut quads: Vec<Quad>, trace: &mut impl Trace) -> Vec<Quad> {
    quads.truncate(MAX_QUADS);
    trace.quads(&quads);
    trace.finished(Stage::Quads);
    quads
}

/// The paper's grouping, at full size.
fn by_relaxation(
    memory: &mut DetectBuffers,
    image: PictureRef,
    p: &DetectParams,
    trace: &mut impl Trace,
) -> Vec<Quad> {
    let (edges, segments) = traced_segments(memory, image, p, trace);
    let gradients = Gradients { image: image.grey(), gx: edges.gx(), gy: edges.gy() };
    let quads = quads_by_relaxation(&segments, &gradients, p, trace);
    memory.give_back(edges);
    quads
}

/// The default detector, on one scale or several. Coordinates of the trace are those of the working
/// scale.
fn by_proposals(
    memory: &mut DetectBuffers,
    image: PictureRef,
    p: &DetectParams,
    trace: &mut impl Trace,
) -> Vec<Quad> {
    let factor = working_factor(image, p.quads.working_side_px);
    let reduced = (factor > 1).then(|| image.map(|plane| reduce(plane, factor)));
    let work = reduced.as_ref().map_or(image, PictureRef::from);
    let (rated, edges, segments) = proposed(memory, work, p, trace);
    let gradients = Gradients { image: work.grey(), gx: edges.gx(), gy: edges.gy() };
    let found: Vec<Quad> = if p.quads.choose_sides {
        let mut classified = snap_sides(rated, &gradients, &p.quads);
        doubt_blanks(&mut classified, work, &p.quads);
        suppress_non_maxima(classified, &p.quads)
    } else {
        suppress_overlaps(rated, &p.quads)
    };
    let tolerance = p.relaxation.pair_tolerance_px;
    let quads = canonical(found, p.quads.nested_iou, p.quads.min_side_support, tolerance);
    let quads = match p.quads.nested {
        Nested::Alternates => absorb(quads, tolerance),
        Nested::Quads => quads,
    };
    let mut quads: Vec<Quad> = quads.into_iter().map(|q| refit_corners(q, &gradients, &p.quads)).collect();
    if p.quads.three_sided {
        let shown: Vec<Quad> = quads.iter().filter(|quad| p.quads.is_shown(quad)).cloned().collect();
        let open = find_three_sided(&segments, &shown, &gradients, p);
        // Three-sided quads never replace a full quad.
        quads.truncate(MAX_QUADS);
        let room = MAX_QUADS - quads.len();
        quads.extend(open.into_iter().take(room));
        quads.sort_by(|a, b| b.score.total_cmp(&a.score).then(by_corners(a, b)));
    }
    memory.give_back(edges);
    let quads = quads.into_iter().filter_map(|q| q.scaled(factor as f64)).collect();
    at_full_size(quads, image, factor, p, memory)
}

/// All proposals of the default detector on all scales of a picture, rated, before suppression; and
/// the finest edge map.
pub fn scored_quads<'a>(
    work: impl Into<PictureRef<'a>>,
    p: &DetectParams,
    trace: &mut impl Trace,
) -> (Vec<ScoredQuad>, EdgeMap) {
    let (rated, edges, _) = proposed(&mut DetectBuffers::default(), work.into(), p, trace);
    (rated, edges)
}

/// The same with the finest segments.
fn proposed(
    memory: &mut DetectBuffers,
    work: PictureRef,
    p: &DetectParams,
    trace: &mut impl Trace,
) -> (Vec<ScoredQuad>, EdgeMap, Vec<EdgeSegment>) {
    let (edges, segments) = traced_segments(memory, work, p, trace);
    let gradients = Gradients { image: work.grey(), gx: edges.gx(), gy: edges.gy() };
    let seeds = proposals(&segments, &gradients, &p.quads.proposals);
    trace.seeds(&seeds);
    trace.finished(Stage::Pairs);
    let mut rated = score_proposals(&seeds, &gradients, &p.quads);
    let mut scale = 1;
    for _ in 1..p.quads.scales.clamp(1, MAX_SCALES) {
        scale *= 2;
        if work.width() / scale < MIN_LEVEL_SIDE_PX || work.height() / scale < MIN_LEVEL_SIDE_PX {
            break;
        }
        let level = work.map(|plane| reduce(plane, scale));
        let edges = memory.edges((&level).into(), &p.edges);
        let segments = straight_segments(&chains(&edges, &p.chains), &edges, &p.segments);
        let segments = remove_floor_tiling(segments, (level.width(), level.height()), &p.tiling).kept;
        let gradients = Gradients { image: level.grey(), gx: edges.gx(), gy: edges.gy() };
        let seeds = proposals(&segments, &gradients, &p.quads.proposals);
        let coarse = score_proposals(&seeds, &gradients, &p.quads);
        rated.extend(coarse.into_iter().filter_map(|r| r.scaled(scale as f64)));
        memory.give_back(edges);
    }
    (rated, edges, segments)
}

/// No scale is smaller than this.
const MIN_LEVEL_SIDE_PX: usize = 80;

fn traced_segments(
    memory: &mut DetectBuffers,
    image: PictureRef,
    p: &DetectParams,
    trace: &mut impl Trace,
) -> (EdgeMap, Vec<EdgeSegment>) {
    let edges = memory.edges(image, &p.edges);
    trace.edges(&edges);
    trace.finished(Stage::Edges);
    let chains = chains(&edges, &p.chains);
    trace.chains(&chains);
    trace.finished(Stage::Chains);
    let segments = straight_segments(&chains, &edges, &p.segments);
    let Untiled { kept: segments, removed } =
        remove_floor_tiling(segments, (image.width(), image.height()), &p.tiling);
    if !removed.is_empty() {
        trace.tiling(&removed);
    }
    trace.segments(&segments);
    trace.finished(Stage::Segments);
    (edges, segments)
}
