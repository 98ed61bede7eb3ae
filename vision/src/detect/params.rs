//! Parameters from image to quads.

use crate::{
    detect::{
        border_model::{
            network::Network, network_weights, quad_classifier::QUAD_FEATURES, side_features::SIDE_FEATURES,
        },
        edges::edge_map::EdgeParams,
        proposals::quad_proposals::ProposalParams,
        quad::{Quad, QuadKind},
        segments::{collinear_merge::SegmentParams, gap_closing::ChainParams},
    },
    frame::Intrinsics,
    paper::{
        relaxation::{labelling::RelaxationParams, similarity::SimilarityParams},
        tiling::tiling_params::{FloorView, TilingParams},
    },
};
use serde::{Deserialize, Deserializer, Serialize, de::Error as _};

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

impl DetectParams {
    /// The same above the floor as one camera sees it, for images of `width_px`. `None` where
    /// tiling is not removed, or the parameters have a floor of their own.
    pub(crate) fn above_floor(
        &self,
        intrinsics: Intrinsics,
        width_px: usize,
        height_m: f64,
        tilt_rad: f64,
    ) -> Option<Self> {
        if !self.tiling.remove || self.tiling.floor.is_some() {
            return None;
        }
        let mut own = self.clone();
        own.tiling.floor = Some(FloorView { intrinsics, width_px, height_m, tilt_rad });
        Some(own)
    }
}

/// How quads are formed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Grouping {
    /// Of the paper: two relaxations and sets of three sides.
    Relaxation,
    /// Corner chains with a searched fourth side, checked against the gradient.
    #[default]
    Proposals,
}

/// What becomes of a quad inside another that is not a border of the same object, with the default
/// detector.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Nested {
    /// An alternate of the outer one, unless that is less probable or contains several objects.
    #[default]
    Alternates,
    /// A quad of its own.
    Quads,
}

/// Parameters of the last stage.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct QuadParams {
    /// The paper's grouping or the default detector.
    pub grouping: Grouping,
    /// The default detector works on an image reduced by a whole factor to about this longer side,
    /// pixels; 0 for full size.
    pub working_side_px: usize,
    /// Scales of the default detector, each half the one before: ragged, ornate borders are
    /// straight at a coarse scale.
    pub scales: usize,
    /// Quad proposals of the default detector.
    pub proposals: ProposalParams,
    /// Share of each side that edges must support for the outermost border of a group to be its
    /// quad.
    pub min_side_support: f64,
    /// Nested quads above this `IoU` are borders of one object.
    pub nested_iou: f64,
    /// What other nested quads become, for the default detector.
    pub nested: Nested,
    /// How far from a rough side its edge points are searched, pixels.
    pub refit_reach_px: f64,
    /// Smallest step height of an edge point, grey levels.
    pub min_step: f64,
    /// Most seeds of a scale that are refitted, at most
    /// [`MAX_REFITTED`](crate::detect::refine::rating::MAX_REFITTED); half as many small ones come
    /// on top.
    pub max_refitted: usize,
    /// Most borders of one object that are rated on a scale.
    pub max_alike: usize,
    /// Smallest score of a quad of the default detector.
    pub min_score: f64,
    /// Whether the default detector moves each side to the line beside it that looks most like a
    /// border.
    pub choose_sides: bool,
    /// Network that scores the lines of a side; the built-in weights if absent.
    #[serde(skip_serializing_if = "Option::is_none", deserialize_with = "checked::<SIDE_FEATURES, _>")]
    pub border_model: Option<Network>,
    /// Network of the quad classifier; the built-in weights if absent.
    #[serde(skip_serializing_if = "Option::is_none", deserialize_with = "checked::<QUAD_FEATURES, _>")]
    pub quad_classifier: Option<Network>,
    /// Smallest probability that a quad of the default detector is an object, for people: in
    /// pictures of what was detected, for teaching and gathering, and in answers for quads that no
    /// landmark was recognised in.
    pub min_probability: f64,
    /// The same for quads that recognition compares with the landmarks: an identity confirms what
    /// the classifier doubts.
    pub min_asked_probability: f64,
    /// A quad with at least this probability suppresses conflicting quads before they are
    /// classified.
    pub sure_probability: f64,
    /// Whether to report sets of three sides.
    pub three_sided: bool,
    /// Smallest c5 of a set of three sides.
    pub min_three_sided_closing: f64,
    /// Smallest score of a set of three sides of the default detector.
    pub min_three_sided_score: f64,
}

impl Default for QuadParams {
    fn default() -> Self {
        Self {
            grouping: Grouping::default(),
            working_side_px: 640,
            scales: 2,
            proposals: ProposalParams::default(),
            min_side_support: 0.5,
            nested_iou: 0.6,
            nested: Nested::default(),
            refit_reach_px: 2.0,
            min_step: 4.0,
            max_refitted: 60,
            max_alike: 8,
            min_score: 0.4,
            choose_sides: true,
            border_model: None,
            quad_classifier: None,
            min_probability: 0.65,
            min_asked_probability: 0.02,
            sure_probability: 0.95,
            three_sided: true,
            min_three_sided_closing: 0.5,
            min_three_sided_score: 0.5,
        }
    }
}

/// A network for `N` features, checked when it is read.
fn checked<'de, const N: usize, D: Deserializer<'de>>(from: D) -> Result<Option<Network>, D::Error> {
    let network = Option::<Network>::deserialize(from)?;
    if let Some(network) = &network {
        network.check(N).map_err(D::Error::custom)?;
    }
    Ok(network)
}

impl QuadParams {
    /// Whether `quad` is shown to people by itself.
    pub fn is_shown(&self, quad: &Quad) -> bool {
        let is_classified = self.grouping == Grouping::Proposals && self.choose_sides;
        !is_classified || quad.kind == QuadKind::ThreeSided || quad.score >= self.min_probability
    }

    /// The network that scores the lines of a side.
    pub fn side_network(&self) -> &Network {
        self.border_model.as_ref().unwrap_or_else(|| network_weights::border_model())
    }

    /// The network of the quad classifier.
    pub fn thing_network(&self) -> &Network {
        self.quad_classifier.as_ref().unwrap_or_else(|| network_weights::quad_classifier())
    }
}
