//! Parameters of template alignment.

use serde::{Deserialize, Serialize};

/// Most Gauss-Newton steps at one level, whatever the parameters say.
pub const MAX_STEPS: usize = 50;

/// Levels of the alignment, from coarse to fine.
pub(crate) const LEVELS: usize = 3;

/// Parameters of this stage.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AlignParams {
    /// No corner moves further than this share of the icon's side, along either axis.
    pub max_shift: f64,
    /// Both pictures are smoothed by these, one after the other, in icon pixels. At the first only
    /// the four sides move, each along its normal; then all corners.
    pub sigmas: [f64; LEVELS],
    /// Gauss-Newton steps at each smoothing, at most [`MAX_STEPS`].
    pub steps: usize,
    /// Mean squared correlation of the buckets below which a picture is rejected after each
    /// smoothing. Accepted quads of real photographs stay above 0.42 and 0.56; an occluder lowers
    /// it by its share.
    pub min_alike: [f64; LEVELS],
}

impl Default for AlignParams {
    fn default() -> Self {
        Self { max_shift: 0.2, sigmas: [4.0, 2.0, 1.0], steps: 10, min_alike: [0.36, 0.44, 0.0] }
    }
}
