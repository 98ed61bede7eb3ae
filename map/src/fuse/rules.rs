//! How to fuse: limits and statistics of the modalities.

use crate::{fuse::params::FuseParams, modality_stats::ModalityMap};
use std::sync::Arc;

/// Parameters of the fusion and statistics of the modalities.
#[derive(Debug, Clone)]
pub(super) struct Rules {
    pub(super) params: FuseParams,
    pub(super) areas: Arc<ModalityMap>,
}
