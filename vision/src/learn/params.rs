//! Parameters from views to a model.

use crate::learn::{gates::GateParams, threshold::ThresholdParams};
use serde::{Deserialize, Serialize};

/// Parameters of learning.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LearnParams {
    /// Choice of tau.
    pub threshold: ThresholdParams,
    /// tau of C^r is never larger. Measured with the cap of H^r on 287 paintings, each trained
    /// alone from one photograph, without negatives, and 2281 quads of other photographs (2102 of
    /// them cut at random): of 654 000 comparisons with the wrong painting both distances accepted
    /// 3, all of one look-alike; of 162 trained paintings 150 were accepted.
    pub correlation_cap: f64,
    /// tau of H^r is never larger. Measured as above.
    pub hausdorff_cap: f64,
    /// The distance of slopes after alignment (1 minus their likeness) is accepted below this at
    /// most, whatever the negatives are. Chosen on 107 photographs of trained paintings; with
    /// thresholds fitted to the negatives, none of 732 quads of other buildings was accepted.
    pub likeness_cap: f64,
    /// From this many views on, own distances are measured by cross-validation; below, on the icons
    /// that are not exemplars.
    pub min_views_for_folds: usize,
    /// Number of folds.
    pub folds: usize,
    /// Gates.
    pub gates: GateParams,
    /// Generated views.
    pub synthesis: SynthesisParams,
}

impl Default for LearnParams {
    fn default() -> Self {
        Self {
            threshold: ThresholdParams::default(),
            correlation_cap: 0.5,
            hausdorff_cap: 8.0,
            likeness_cap: 0.55,
            min_views_for_folds: 40,
            folds: 5,
            gates: GateParams::default(),
            synthesis: SynthesisParams::default(),
        }
    }
}

/// Ranges of the generated views.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SynthesisParams {
    /// Largest angle between the landmark's normal and the line of sight, in the horizontal plane.
    pub max_yaw_rad: f64,
    /// The same in the vertical plane.
    pub max_pitch_rad: f64,
    /// Largest roll of the camera.
    pub max_roll_rad: f64,
    /// Smallest apparent size (square root of the frontal area), in pixels.
    pub min_size_px: f64,
    /// Largest apparent size, in pixels.
    pub max_size_px: f64,
    /// Standard deviation of the corners per coordinate, as of the detector.
    pub corner_noise_px: f64,
    /// Contrast factor is drawn from 1 / `max_gain` to `max_gain`.
    pub max_gain: f64,
    /// Brightness offset is drawn from minus to plus this, in grey levels.
    pub max_offset: f64,
    /// Exponent of the tone curve is drawn from 1 / `max_gamma` to `max_gamma`.
    pub max_gamma: f64,
    /// Largest standard deviation of the blur, in pixels.
    pub max_blur_px: f64,
    /// Largest standard deviation of the noise, in grey levels.
    pub max_noise: f64,
    /// Largest occluded share of the landmark; 0 for none.
    pub max_occluded_share: f64,
}

impl Default for SynthesisParams {
    fn default() -> Self {
        Self {
            max_yaw_rad: 60f64.to_radians(),
            max_pitch_rad: 15f64.to_radians(),
            max_roll_rad: 3f64.to_radians(),
            min_size_px: 80.0,
            max_size_px: 240.0,
            corner_noise_px: 1.0,
            max_gain: 1.6,
            max_offset: 30.0,
            max_gamma: 1.4,
            max_blur_px: 0.8,
            max_noise: 5.0,
            max_occluded_share: 0.0,
        }
    }
}
