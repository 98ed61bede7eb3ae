//! Relaxation by projected gradient (method 3.1 to 3.3).

/// Parameters of this stage.
#[derive(Debug, Clone, PartialEq, Default, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RelaxationParams {}
