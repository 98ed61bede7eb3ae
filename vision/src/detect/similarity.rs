//! Segments in, scored candidate pairs out (method 2).

/// Parameters of this stage.
#[derive(Debug, Clone, PartialEq, Default, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SimilarityParams {}

/// Two segments taken for opposite sides.
#[derive(Debug, Clone)]
pub struct SegmentPair {}
