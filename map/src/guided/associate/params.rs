//! Limits of the association.

use crate::gate::Z_999;
use serde::{Deserialize, Serialize};

/// Limits of the association.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AssociateParams {
    /// Least picture evidence of a candidate, nats: logarithm of how much likelier the picture is
    /// if it is this landmark than if it is none. ln 100.
    pub min_picture_nats: f64,
    /// Prior odds are clamped to this in either direction, nats.
    pub max_prior_nats: f64,
    /// Two assignments whose scores differ by less are both possible, nats. 8 nats are odds of
    /// 3000, the same as a difference of 16 in chi2 (see `vision::localise::pose::AMBIGUOUS_CHI2`).
    pub margin_nats: f64,
    /// Gates, individual and joint: standard normal quantile of the share of true pairings that
    /// pass. 3.09 is 99.9 %.
    pub gate_z: f64,
    /// Standard deviation of errors of a measured corner beyond its covariance, px: frames in front
    /// of their wall, lens residuals.
    pub model_sigma_px: f64,
}

impl Default for AssociateParams {
    fn default() -> Self {
        Self {
            min_picture_nats: 100.0_f64.ln(),
            max_prior_nats: 100.0_f64.ln(),
            margin_nats: 8.0,
            gate_z: Z_999,
            model_sigma_px: 0.5,
        }
    }
}
