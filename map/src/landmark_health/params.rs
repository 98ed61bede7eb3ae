//! Parameters of the health monitor.

use crate::gate::CHI2_3_999;
use serde::{Deserialize, Serialize};

/// Parameters of the health monitor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct HealthParams {
    /// Squared Mahalanobis distance beyond which a landmark is observed elsewhere: 99.9 % of chi2
    /// with 3 degrees of freedom.
    pub moved_chi2: f64,
    /// An observation confirms a place only if a displacement of this much would be detected,
    /// metres.
    pub told_m: f64,
    /// Supporting landmarks of a pose that may flag at once. With a single one either landmark may
    /// have moved: a third must agree first.
    pub supporters: usize,
    /// Observations elsewhere count together within this distance of the same place, metres.
    pub agree_m: f64,
    /// Observations elsewhere that flag a landmark.
    pub flag_sightings: u32,
    /// Observations elsewhere that quarantine it, after another landmark has agreed.
    pub quarantine_sightings: u32,
    /// Consecutive misses that flag a landmark.
    pub flag_misses: u32,
    /// Consecutive misses that quarantine it.
    pub quarantine_misses: u32,
    /// Observations in place that clear a flag.
    pub clear_sightings: u32,
    /// An observation counts only after the robot has moved this far, metres.
    pub sighting_move_m: f64,
    /// A miss counts only after this distance, metres: a person in front of the landmark walks on.
    pub miss_move_m: f64,
    /// Least visibility probability of an expected landmark.
    pub expected_probability: f64,
    /// Largest angle of view of an expected landmark, radians.
    pub expected_incidence_rad: f64,
    /// Margin of the image, as a share, that an expected landmark must keep.
    pub image_margin: f64,
}

impl Default for HealthParams {
    fn default() -> Self {
        Self {
            moved_chi2: CHI2_3_999,
            told_m: 1.0,
            supporters: 2,
            agree_m: 0.5,
            flag_sightings: 3,
            quarantine_sightings: 5,
            flag_misses: 6,
            quarantine_misses: 20,
            clear_sightings: 3,
            sighting_move_m: 0.05,
            miss_move_m: 0.25,
            expected_probability: 0.95,
            expected_incidence_rad: 60.0_f64.to_radians(),
            image_margin: 0.1,
        }
    }
}
