//! Which distance decides.

use serde::{Deserialize, Serialize};

/// Which distance decides. A setting of a map.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DistanceKind {
    /// Partial Hausdorff distance over Harris points, H^r.
    Hausdorff,
    /// Bucketed correlation, C^r.
    Correlation,
    /// Gradient similarity after alignment with the learnt icons of the short list; it must hold
    /// beyond the frame, too, and one of the two distances must accept unless the similarity is
    /// very high. Ratios and order are those of the gradient similarity.
    #[default]
    Both,
}
