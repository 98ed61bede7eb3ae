//! Views in, landmark model out (method 7).

/// Parameters of this stage.
#[derive(Debug, Clone, PartialEq, Default, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LearnParams {}
