//! Parameters of the tracker.

use serde::{Deserialize, Serialize};
use vision::learn::near_duplicates::NoveltyParams;

/// Parameters of the tracker.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GatherParams {
    /// Observations of an unknown object before its first view is stored: most single observations
    /// are noise.
    pub min_sightings: u32,
    /// A track without stored views is dropped if it was not observed for this long, seconds.
    pub memory_s: f64,
    /// By the image alone an object is followed over gaps of at most this long, seconds.
    pub gap_s: f64,
    /// By the image alone: least intersection over union of the quads, 0 to 1.
    pub min_iou: f64,
    /// By place: largest distance of the centres, as a share of the longest side.
    pub centre_share: f64,
    /// By place: largest ratio of the sides.
    pub size_ratio: f64,
    /// By place: largest angle between the normals, radians.
    pub normal_rad: f64,
    /// Largest C^r to the icons of the track: the default upper limit of the C^r threshold
    /// (`vision::learn::params::LearnParams`).
    pub max_correlation: f64,
    /// From half of [`super::MAX_TRACK_VIEWS`] on a view must be farther from the others by this
    /// factor.
    pub late_novelty: f64,
    /// What counts as a new view.
    pub thinning: NoveltyParams,
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
            thinning: NoveltyParams::default(),
        }
    }
}
