//! Limits of the tracker.

use serde::{Deserialize, Serialize};
use vision::learn::thinning::ThinningParams;

/// Knobs of following.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GatherParams {
    /// Glimpses of a thing that is no landmark before the first is kept: what is seen once is mostly nothing.
    pub min_sightings: u32,
    /// A track without kept views is forgotten when it was not seen for so long, seconds.
    pub memory_s: f64,
    /// By the picture alone a thing is followed over gaps of at most so long, seconds.
    pub gap_s: f64,
    /// By the picture alone: least intersection over union of the quads.
    pub min_iou: f64,
    /// By place: centres at most so far apart, as a share of the longer side...
    pub centre_share: f64,
    /// ... sides within this ratio...
    pub size_ratio: f64,
    /// ... and normals within this angle.
    pub normal_rad: f64,
    /// Largest C^r to the icons of the track: the cap that tau of C^r has where nothing else is known
    /// (`vision::learn::model::LearnParams`), beyond which no painting was like another.
    pub max_correlation: f64,
    /// From half of [`MAX_TRACK_VIEWS`] on a view must be so many times farther from the others.
    pub late_novelty: f64,
    /// What is new.
    pub thinning: ThinningParams,
}

impl Default for GatherParams {
    fn default() -> Self {
        Self {
            min_sightings: 3,
            memory_s: 5.0,
            gap_s: 1.5,
            min_iou: 0.3,
            centre_share: 0.25,
            size_ratio: 1.2,
            normal_rad: 0.26,
            max_correlation: 0.5,
            late_novelty: 2.0,
            thinning: ThinningParams::default(),
        }
    }
}
