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
    /// The picture itself: what is near by its signature is laid on the learnt icon; slopes must agree there, beyond
    /// the frame, too, and one of the two distances must accept unless they agree very well. Ratios and order are
    /// those of the slopes.
    #[default]
    Both,
}
