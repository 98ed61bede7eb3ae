//! Every knob of the pipeline, grouped by stage. Defaults and their sources: docs/method/20-parameters.md.

mod distance_hash;

use crate::{
    detect::{
        chains::ChainParams, edges::EdgeParams, quads::QuadParams, relaxation::RelaxationParams,
        segments::SegmentParams, similarity::SimilarityParams, tiling::TilingParams,
    },
    icon::IconParams,
    learn::model::LearnParams,
    recognise::{
        correlation::CorrelationParams, descriptor::DescriptorParams, harris::HarrisParams,
        hausdorff::HausdorffParams, verdict::VerdictParams,
    },
};
use serde::{Deserialize, Serialize};

/// Parameters from image to quads.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DetectParams {
    /// Canny-Deriche edges.
    pub edges: EdgeParams,
    /// Thinning and chaining.
    pub chains: ChainParams,
    /// Straight segments.
    pub segments: SegmentParams,
    /// Removal of floor tiling.
    pub tiling: TilingParams,
    /// Cues and gates of pairs.
    pub similarity: SimilarityParams,
    /// Both relaxations.
    pub relaxation: RelaxationParams,
    /// Quads and their corners.
    pub quads: QuadParams,
}

/// Parameters of points, descriptors, distances and the decision.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RecogniseParams {
    /// Harris points.
    pub harris: HarrisParams,
    /// The 7-component descriptor.
    pub descriptor: DescriptorParams,
    /// C^r.
    pub correlation: CorrelationParams,
    /// H^r.
    pub hausdorff: HausdorffParams,
    /// The decision.
    pub verdict: VerdictParams,
}

/// All parameters of the pipeline.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Params {
    /// Image to quads.
    pub detect: DetectParams,
    /// Quad to icon.
    pub icon: IconParams,
    /// Icon to verdict.
    pub recognise: RecogniseParams,
    /// Views to model.
    pub learn: LearnParams,
}
