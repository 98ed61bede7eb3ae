//! A learnt model as it is stored.

use std::sync::Arc;
use vision::{learn::LearnRules, model::LandmarkModel};

/// A model with the digest of its stored bytes: the same digest is the same model.
#[derive(Debug, Clone)]
pub struct StoredModel {
    /// SHA-256 of the bytes.
    pub digest: [u8; 32],
    /// The landmark's own weights and gates, by which it was read.
    pub rules: LearnRules,
    /// The model.
    pub model: Arc<LandmarkModel>,
}
