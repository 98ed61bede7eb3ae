//! An optional record of every stage, for pictures and timings. The pipeline hands each stage's
//! output to a `Trace`; with [`NoTrace`] that costs nothing. Implementations measure time and draw.

use crate::{
    detect::{
        edges::edge_map::EdgeMap,
        proposals::quad_seed::QuadSeed,
        quad::Quad,
        segments::{chains::EdgeChain, edge_segments::EdgeSegment},
    },
    paper::relaxation::similarity::SegmentPair,
};

/// The stages in their order; names appear in timings and picture files.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Stage {
    /// Canny-Deriche gradient, non-maximum suppression, hysteresis.
    Edges,
    /// Thinning and chaining.
    Chains,
    /// Recursive segmentation.
    Segments,
    /// Similarity and the first relaxation, or the quad proposals.
    Pairs,
    /// Second relaxation, border choice, sub-pixel corners.
    Quads,
    /// Points, descriptors and distances to the models.
    Recognition,
    /// Landmarks without a border.
    Texture,
    /// Poses from recognised landmarks.
    Poses,
}

impl Stage {
    /// Every stage, in order.
    pub const ALL: [Stage; 8] = [
        Stage::Edges,
        Stage::Chains,
        Stage::Segments,
        Stage::Pairs,
        Stage::Quads,
        Stage::Recognition,
        Stage::Texture,
        Stage::Poses,
    ];

    /// Lower-case name, as in timings.
    pub fn name(self) -> &'static str {
        match self {
            Stage::Edges => "edges",
            Stage::Chains => "chains",
            Stage::Segments => "segments",
            Stage::Pairs => "pairs",
            Stage::Quads => "quads",
            Stage::Recognition => "recognition",
            Stage::Texture => "texture",
            Stage::Poses => "poses",
        }
    }
}

/// Receives the output of each stage. Every method has an empty default.
pub trait Trace {
    /// `stage` has just ended.
    fn finished(&mut self, _stage: Stage) {}
    /// The edge map.
    fn edges(&mut self, _edges: &EdgeMap) {}
    /// The edge chains.
    fn chains(&mut self, _chains: &[EdgeChain]) {}
    /// The straight segments that later stages work on.
    fn segments(&mut self, _segments: &[EdgeSegment]) {}
    /// The segments that were removed as tiling, when there are any.
    fn tiling(&mut self, _removed: &[EdgeSegment]) {}
    /// The matched pairs of opposite sides.
    fn pairs(&mut self, _pairs: &[SegmentPair]) {}
    /// The quad proposals that edges support, on the finest scale, in place of pairs.
    fn seeds(&mut self, _seeds: &[QuadSeed]) {}
    /// The quads.
    fn quads(&mut self, _quads: &[Quad]) {}
}

/// Records nothing.
#[derive(Debug, Clone, Copy, Default)]
pub struct NoTrace;

impl Trace for NoTrace {}
