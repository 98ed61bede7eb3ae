//! Everything that the detector reports, recorded for drawing.

use vision::{
    detect::{
        DetectParams, Quad, detect,
        edges::edge_map::EdgeMap,
        proposals::quad_seed::QuadSeed,
        pyramid,
        segments::{chains::EdgeChain, edge_segments::EdgeSegment},
    },
    frame::{GrayImage, Picture},
    paper::relaxation::similarity::SegmentPair,
    trace::Trace,
};

/// The stages of one image. All but the quads are in pixels of `work`.
#[derive(Debug, Clone)]
pub(crate) struct Record {
    /// The picture that the stages worked on, in grey: reduced, where the working scale is.
    pub(crate) work: GrayImage,
    /// How many pixels of the image make one of `work`.
    pub(crate) factor: usize,
    pub(crate) edges: EdgeMap,
    pub(crate) chains: Vec<EdgeChain>,
    pub(crate) segments: Vec<EdgeSegment>,
    pub(crate) tiling: Vec<EdgeSegment>,
    pub(crate) pairs: Vec<SegmentPair>,
    pub(crate) seeds: Vec<QuadSeed>,
    pub(crate) quads: Vec<Quad>,
}

impl Record {
    /// Detects once more and records everything.
    pub(crate) fn of(picture: &Picture, params: &DetectParams) -> Self {
        let mut record = Self {
            work: picture.grey().clone(),
            factor: 1,
            edges: EdgeMap::default(),
            chains: vec![],
            segments: vec![],
            tiling: vec![],
            pairs: vec![],
            seeds: vec![],
            quads: vec![],
        };
        detect(picture, params, &mut record);
        // Both ways of grouping have their own scale; the edges say which it was.
        let width = record.edges.width().max(1);
        record.factor = (picture.width() / width).max(1);
        record.work = pyramid::reduce(picture.grey(), record.factor);
        record
    }
}

impl Trace for Record {
    fn edges(&mut self, edges: &EdgeMap) {
        self.edges = edges.clone();
    }

    fn chains(&mut self, chains: &[EdgeChain]) {
        self.chains = chains.to_vec();
    }

    fn segments(&mut self, segments: &[EdgeSegment]) {
        self.segments = segments.to_vec();
    }

    fn tiling(&mut self, removed: &[EdgeSegment]) {
        self.tiling = removed.to_vec();
    }

    fn pairs(&mut self, pairs: &[SegmentPair]) {
        self.pairs = pairs.to_vec();
    }

    fn seeds(&mut self, seeds: &[QuadSeed]) {
        self.seeds = seeds.to_vec();
    }

    fn quads(&mut self, quads: &[Quad]) {
        self.quads = quads.to_vec();
    }
}
