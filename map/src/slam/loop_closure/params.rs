//! Parameters of loop closure.

use crate::slam::correlative::CorrelativeParams;
use serde::{Deserialize, Serialize};

/// Widest search window, metres; with a larger uncertainty no loop is closed.
pub(super) const MAX_REACH_M: f64 = 12.0;
/// Widest search window of the heading, radians.
pub(super) const MAX_REACH_RAD: f64 = 0.9;

/// Parameters of loop closure.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LoopParams {
    /// A place counts as revisited only after this distance along the path, metres.
    pub min_way_m: f64,
    /// Poses nearer than this, plus their uncertainty, may observe the same walls, metres.
    pub near_m: f64,
    /// Places tried from one keyframe.
    pub places: usize,
    /// Distance between two tries, metres.
    pub every_m: f64,
    /// Distance along the path on each side of the old keyframe whose scans are matched to, metres.
    pub old_m: f64,
    /// Distance back from the new keyframe whose scans are matched when the uncertainty is large,
    /// metres.
    pub new_m: f64,
    /// Error of the scans joined along that distance: position, metres,
    pub way_m: f64,
    /// and heading, radians.
    pub way_rad: f64,
    /// Standard deviation up to which a single loop is accepted, metres.
    pub sure_m: f64,
    /// Factor on the graph's standard deviations: errors of neighbouring matches are not
    /// independent.
    pub doubt: f64,
    /// Correlative search, used when the uncertainty is large.
    pub search: CorrelativeParams,
    /// Least score of the search.
    pub min_score: f64,
    /// The second best pose in the window must score lower by this much.
    pub min_margin: f64,
    /// Least share of matched points.
    pub min_matched: f64,
    /// Largest root mean square distance of the matched points, metres.
    pub max_rms_m: f64,
    /// Largest share of beams that may pass through known surfaces.
    pub max_through: f64,
    /// Gate on the difference to the expected pose: 99.9 % of chi2 with 3 degrees of freedom.
    pub gate_chi2: f64,
    /// Agreeing loops that are accepted together.
    pub together: usize,
    /// Gate of their agreement: 99 % of chi2 with 3 degrees of freedom.
    pub agree_chi2: f64,
    /// A loop's weight in the fit falls off beyond this chi2.
    pub doubt_chi2: f64,
    /// A loop with a smaller weight is refused.
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
