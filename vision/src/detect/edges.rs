//! Grey image in, edge map out (method 1.1, 1.2).

/// Parameters of this stage.
#[derive(Debug, Clone, PartialEq, Default, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EdgeParams {}

/// Edge pixels with their gradient.
#[derive(Debug, Clone)]
pub struct EdgeMap {}
