//! The request of a lesson, stored with its job.

use serde::{Deserialize, Serialize};

/// Most generated views that can be asked for, of each photograph.
pub(crate) const MAX_GENERATED: usize = 100;

/// What to learn.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub(crate) struct Request {
    /// Names; `None` means every landmark that has views.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) landmarks: Option<Vec<String>>,
    /// Views generated from each photograph; `None` fills up to thirty views where photographs are
    /// few.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) generated_views: Option<usize>,
}
