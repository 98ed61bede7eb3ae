//! Edge map in, chains of edge points out (method 1.2).

/// Parameters of this stage.
#[derive(Debug, Clone, PartialEq, Default, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ChainParams {}

/// A chain of edge points.
#[derive(Debug, Clone)]
pub struct EdgeChain {}
