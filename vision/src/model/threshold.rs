//! tau of a distance with its error rates, or why there is none.

use serde::{Deserialize, Serialize};

/// What limits tau.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LimitedBy {
    /// The least weighted cost.
    Cost,
    /// The share of the nearest other distance.
    NearestNegative,
    /// The absolute cap, which holds where there are few negatives.
    AbsoluteCap,
}

/// A threshold with its evidence. A distance is accepted only when it is strictly below `tau`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Threshold {
    /// The threshold; 0 accepts nothing.
    #[serde(rename = "threshold")]
    pub tau: f64,
    /// Share of other distances below tau.
    pub false_positive_rate: f64,
    /// Share of own distances at or above tau.
    pub false_negative_rate: f64,
    /// Own distances used (n+).
    pub positives: usize,
    /// Other distances used (n-). Below 300 a rate of 1 % is not measurable.
    pub negatives: usize,
    /// What limits tau.
    pub limited_by: LimitedBy,
}

impl Threshold {
    /// Accepts nothing: for a landmark without a threshold.
    pub const NEVER: Threshold = Threshold {
        tau: 0.0,
        false_positive_rate: 0.0,
        false_negative_rate: 1.0,
        positives: 0,
        negatives: 0,
        limited_by: LimitedBy::Cost,
    };
}

/// Why there is no threshold.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, thiserror::Error, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ThresholdError {
    /// No distance of the landmark's own icons.
    #[error("the landmark has no held-out view to measure its own distances")]
    NoPositive,
    /// No negative distance.
    #[error("there are no negatives to separate the landmark from")]
    NoNegative,
    /// A distance is NaN or negative.
    #[error("a distance is not a number, or is negative")]
    NotADistance,
    /// No own distance is finite.
    #[error("every own distance is infinite: too few points")]
    NothingFinite,
    /// Refusing everything is cheapest.
    #[error("no threshold separates this landmark from the negatives: refusing everything costs least")]
    Overlap,
}
