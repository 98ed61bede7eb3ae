//! Limits of the health monitor.

use crate::gate::CHI2_3_999;
use serde::{Deserialize, Serialize};

/// Knobs of the watch.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct HealthParams {
    /// Squared Mahalanobis distance from which on a landmark is seen elsewhere: 99.9 % of chi2 with 3 degrees of freedom.
    pub moved_chi2: f64,
    /// A look tells that a landmark is in place when a move of this much would stand out.
    pub told_m: f64,
    /// On how many other landmarks the pose must rest for a flag at once. By a pose that rests on one other it may be
    /// either that has moved: then a third must agree first.
    pub supporters: usize,
    /// Sightings elsewhere count together when the landmark appears within this of the same place.
    pub agree_m: f64,
    /// So many sightings elsewhere flag a landmark...
    pub flag_sightings: u32,
    /// ...so many quarantine it, once another landmark has agreed since.
    pub quarantine_sightings: u32,
    /// So many looks in a row without it flag a landmark...
    pub flag_misses: u32,
    /// ...and so many quarantine it.
    pub quarantine_misses: u32,
    /// So many sightings in place clear a flag.
    pub clear_sightings: u32,
    /// A sighting is new only after the robot has moved this far...
    pub sighting_move_m: f64,
    /// ...and a look without the landmark after this: whoever stands before it walks on.
    pub miss_move_m: f64,
    /// What is seen less probably is not missed.
    pub expected_probability: f64,
    /// Nor what would be seen more obliquely.
    pub expected_incidence_rad: f64,
    /// Share of the image left free all round what is expected in it.
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
