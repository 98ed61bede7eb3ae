//! Limits of loop closure.

use crate::slam::correlative::CorrelativeParams;
use serde::{Deserialize, Serialize};

/// Widest window that is searched; when the robot may be farther off, nothing is closed.
pub(super) const MAX_REACH_M: f64 = 12.0;
/// The same for the heading.
pub(super) const MAX_REACH_RAD: f64 = 0.9;

/// Knobs of loop closure.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LoopParams {
    /// A place is met again after this way at least.
    pub min_way_m: f64,
    /// Poses nearer than this (and the doubt about it) may see the same.
    pub near_m: f64,
    /// Places tried from one pose.
    pub places: usize,
    /// Way between two tries.
    pub every_m: f64,
    /// Way on each side of the old pose whose scans are matched with.
    pub old_m: f64,
    /// Way back from the new pose whose scans are matched, when the doubt is large.
    pub new_m: f64,
    /// Error of scans laid together along that way: position...
    pub way_m: f64,
    /// ...and heading.
    pub way_rad: f64,
    /// Doubt (standard deviation) up to which one loop is believed alone.
    pub sure_m: f64,
    /// What the graph says of its own doubt is multiplied by this: errors of neighbouring matches are not independent.
    pub doubt: f64,
    /// Search on the grid when in doubt.
    pub search: CorrelativeParams,
    /// Least score on the grid.
    pub min_score: f64,
    /// The second best place in the window must be this much worse.
    pub min_margin: f64,
    /// Least share of the points that find their surface.
    pub min_matched: f64,
    /// Largest root mean square distance of them.
    pub max_rms_m: f64,
    /// Most of the beams that may pass through what the others saw.
    pub max_through: f64,
    /// Gate on the difference to what is believed: 99.9 % of chi2 with 3 degrees of freedom.
    pub gate_chi2: f64,
    /// Loops in agreement that are believed together.
    pub together: usize,
    /// Gate of their agreement: 99 % with 3 degrees of freedom.
    pub agree_chi2: f64,
    /// Beyond this chi2 a loop's weight in the fit falls off.
    pub doubt_chi2: f64,
    /// A loop whose weight falls below it is refused.
    pub min_weight: f64,
}

impl Default for LoopParams {
    fn default() -> Self {
        Self {
            min_way_m: 10.0,
            near_m: 4.0,
            places: 3,
            every_m: 0.8,
            old_m: 12.0,
            new_m: 8.0,
            sure_m: 0.4,
            doubt: 2.0,
            way_m: 0.04,
            way_rad: 0.006,
            search: CorrelativeParams { cell_m: 0.1, sigma_m: 0.12, turn_rad: 0.015 },
            min_score: 0.55,
            min_margin: 0.08,
            min_matched: 0.55,
            max_rms_m: 0.08,
            max_through: 0.12,
            gate_chi2: 16.27,
            together: 3,
            agree_chi2: crate::gate::CHI2_3_99,
            doubt_chi2: 5.0,
            min_weight: 0.2,
        }
    }
}
