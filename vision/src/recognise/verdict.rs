//! Distances in, verdict out (method 10).

/// Parameters of this stage.
#[derive(Debug, Clone, PartialEq, Default, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct VerdictParams {}
