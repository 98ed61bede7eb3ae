//! All parameters of the pipeline, grouped by stage. Defaults and their sources:
//! docs/method/20-parameters.md.

mod distance_hash;
pub mod preset;

use crate::{
    detect::params::DetectParams, icon::IconParams, learn::params::LearnParams,
    recognise::params::RecogniseParams,
};
use serde::{Deserialize, Serialize};

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
