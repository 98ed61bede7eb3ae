//! `/robots/{robot}/relocalisation`: relocalisation, where a robot may be while nothing that it
//! sees is unique.

use serde::{Deserialize, Serialize};

/// A place where a robot may be.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct PoseHypothesisBody {
    /// Its share of the belief, 0 to 1; all of them together leave some for everywhere else.
    pub probability: f64,
    /// Metres, in the map.
    pub x_m: f64,
    /// Metres, in the map.
    pub y_m: f64,
    /// Heading in the map.
    pub theta_rad: f64,
    /// Over (x, y, theta), row-major.
    #[cfg_attr(feature = "openapi", schema(value_type = super::arrays::Covariance))]
    pub covariance: [f64; 9],
}

/// Why the first hypothesis is not yet the pose.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum MissingConditionBody {
    /// It is not probable enough: other places are too probable still.
    HigherProbability,
    /// All observations could be of one landmark: a second is to be seen.
    SecondLandmark,
    /// It does not explain enough of what was seen.
    ConsistentObservations,
    /// The landmarks hang so evenly that another place would explain what was seen nearly as well.
    NoRivalPose,
}

/// How far a robot's relocalisation has come.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct RelocalisationStatus {
    /// False for a robot that knows where it is, or has seen nothing to search with: all else is
    /// empty then.
    pub relocalising: bool,
    /// The map it searches.
    pub map: Option<String>,
    /// Version of that map.
    pub map_version: Option<u64>,
    /// Most probable first, eight at most.
    pub hypotheses: Vec<PoseHypothesisBody>,
    /// Of the belief over the whole map, nats: 0 when one cell of 0.2 m and 10 degrees has it all.
    pub entropy_nats: f64,
    /// Sightings that it rests on.
    pub sightings: usize,
    /// The landmarks by which the first hypothesis explains them.
    pub landmarks: Vec<String>,
    /// What is missing before the first one becomes the robot's pose; empty if nothing is.
    pub missing: Vec<MissingConditionBody>,
    /// The first one must be more probable than this.
    pub min_probability: f64,
}
