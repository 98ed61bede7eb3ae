//! Limits of localisation by landmarks.

use serde::{Deserialize, Serialize};

/// Parameters of localisation by landmarks.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LocaliseParams {
    /// Two solutions whose chi2 (image, and prior where there is one) differ by less are ambiguous.
    /// With 16 a wrong choice has a probability of at most 3e-5 (see
    /// `vision::localise::pose::AMBIGUOUS_CHI2`).
    pub ambiguous_chi2: f64,
    /// Gate on chi2 per degree of freedom: re-projection error above it for every floor pose is
    /// refused. 10 allows corner errors three times as large as claimed; the covariance is scaled
    /// accordingly.
    pub max_reduced_chi2: f64,
    /// Gate on the squared Mahalanobis distance to the prior: 99 % of chi2 with 3 degrees of
    /// freedom.
    pub prior_gate: f64,
    /// Two minima with a lower barrier between them count as one.
    pub merge_chi2: f64,
}

impl Default for LocaliseParams {
    fn default() -> Self {
        Self {
            ambiguous_chi2: 16.0,
            max_reduced_chi2: 10.0,
            prior_gate: crate::gate::CHI2_3_99,
            merge_chi2: 4.0,
        }
    }
}
