//! Statistics of one modality in one place, as sums: cells and runs add up, and a run is removed by
//! adding the others again. Robot-aligned: along, across (left), heading.

use crate::{
    check::{self, OutOfRange},
    modality_stats::advice::ErrorModel,
};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// A place with fewer measurements takes the statistics of its parent.
pub const MIN_MEASUREMENTS: u64 = 30;
/// With fewer passages a bias cannot be distinguished from chance: the errors of one passage are
/// correlated.
pub const MIN_VISITS: u64 = 3;
/// Radians of heading that weigh as much as one metre (method 15, matrix W).
const METRE_RAD: f64 = 0.1;
/// A bias is significant beyond this many of its standard deviations (method 15).
const BIAS_SIGMAS: f64 = 2.0;
/// Largest accepted sum.
const MAX_SUM: f64 = 1e15;

/// Error sums of one modality in one place.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModalityStats {
    /// Steps of the reference trajectory here, at equal distances.
    pub(super) steps: u64,
    /// Of those, steps with a recent fix of the modality.
    pub(super) available: u64,
    /// Time spent here, seconds.
    pub(super) seconds: f64,
    /// Sums of the errors of the modality's own position at those steps: metres, metres, radians.
    pub(super) errors: [f64; 3],
    /// Sums of their products: xx, xy, xt, yy, yt, tt.
    pub(super) products: [f64; 6],
    /// Single measurements: fixes; for odometry, stretches of a metre.
    pub(super) fixes: u64,
    /// Of those, with an error of more than three claimed standard deviations.
    pub(super) outliers: u64,
    /// Sum of 1/v over the measurements, v the claimed variance.
    pub(super) weights: [f64; 3],
    /// Sum of e/v, e the error.
    pub(super) weighted: [f64; 3],
    /// Sum of e^2/v.
    pub(super) normalised: [f64; 3],
    /// Passages through the place.
    pub(super) visits: u64,
    /// Sum of the weighted mean errors of the passages.
    pub(super) means: [f64; 3],
    /// Sum of their squares.
    pub(super) mean_squares: [f64; 3],
}

/// Figures that follow from the sums.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ModalitySummary {
    /// Mean error of the modality's own position: metres along, metres across, radians.
    pub mean: [f64; 3],
    /// Standard deviations about the mean, same units.
    pub sigma: [f64; 3],
    /// Share of the steps with a recent fix, 0 to 1.
    pub availability: f64,
    /// Measurements per second.
    pub rate_hz: f64,
    /// Share of measurements off by more than three claimed standard deviations, 0 to 1.
    pub outliers: f64,
    /// Weighted mean squared error over availability; lower is better, infinite without any fix.
    pub score: f64,
}

impl ModalityStats {
    /// Adds the statistics of another place or run.
    pub fn add(&mut self, more: &Self) {
        let sum = |a: &mut [f64], b: &[f64]| a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
        self.steps = self.steps.saturating_add(more.steps);
        self.available = self.available.saturating_add(more.available);
        self.seconds += more.seconds;
        sum(&mut self.errors, &more.errors);
        sum(&mut self.products, &more.products);
        self.fixes = self.fixes.saturating_add(more.fixes);
        self.outliers = self.outliers.saturating_add(more.outliers);
        sum(&mut self.weights, &more.weights);
        sum(&mut self.weighted, &more.weighted);
        sum(&mut self.normalised, &more.normalised);
        self.visits = self.visits.saturating_add(more.visits);
        sum(&mut self.means, &more.means);
        sum(&mut self.mean_squares, &more.mean_squares);
    }

    /// Refuses sums that are not finite, too large or contradictory; for statistics from outside.
    pub fn check(&self) -> Result<(), OutOfRange> {
        let free = [&self.errors[..], &self.products, &self.weighted, &self.means];
        for value in free.into_iter().flatten() {
            check::within("evidence", *value, -MAX_SUM, MAX_SUM)?;
        }
        let positive = [&self.weights[..], &self.normalised, &self.mean_squares, &[self.seconds]];
        for value in positive.into_iter().flatten() {
            check::within("evidence", *value, 0.0, MAX_SUM)?;
        }
        check::within("available", self.available as f64, 0.0, self.steps as f64)?;
        check::within("outliers", self.outliers as f64, 0.0, self.fixes as f64)?;
        check::within("visits", self.visits as f64, 0.0, self.fixes as f64)
    }

    /// Steps with a recent fix of the modality.
    pub fn available(&self) -> u64 {
        self.available
    }

    /// Number of single measurements.
    pub fn fixes(&self) -> u64 {
        self.fixes
    }

    /// Adds a step of the reference trajectory that took `seconds`, with the modality's error if it
    /// was available.
    pub(super) fn step(&mut self, seconds: f64, error: Option<&Vector3<f64>>) {
        self.steps += 1;
        self.seconds += seconds;
        let Some(e) = error else { return };
        self.available += 1;
        let products = [e.x * e.x, e.x * e.y, e.x * e.z, e.y * e.y, e.y * e.z, e.z * e.z];
        for (sum, v) in self.errors.iter_mut().zip(e.iter()) {
            *sum += v;
        }
        for (sum, v) in self.products.iter_mut().zip(products) {
            *sum += v;
        }
    }

    /// Adds a measurement with its error and its claimed variances.
    pub(super) fn measure(&mut self, error: &Vector3<f64>, variances: &Vector3<f64>) {
        self.fixes += 1;
        let mut outlier = false;
        for k in 0..3 {
            let (e, v) = (error[k], variances[k]);
            outlier |= e * e > 9.0 * v;
            self.weights[k] += 1.0 / v;
            self.weighted[k] += e / v;
            self.normalised[k] += e * e / v;
        }
        self.outliers += u64::from(outlier);
    }

    /// Ends the only passage that was measured.
    pub(super) fn end_visit(&mut self) {
        if self.fixes == 0 {
            return;
        }
        self.visits = 1;
        for k in 0..3 {
            let mean = self.weighted[k] / self.weights[k];
            (self.means[k], self.mean_squares[k]) = (mean, mean * mean);
        }
    }

    /// Weighted mean squared error over availability (method 15):
    /// `J = tr(W (Sigma + mu mu^T)) / availability`, W = diag(1, 1, 1 / (0.1 rad)^2). Infinite if
    /// the modality was never available.
    pub fn score(&self) -> f64 {
        if self.available == 0 {
            return f64::INFINITY;
        }
        let [xx, .., tt] = self.products;
        let squares = (xx + self.products[3] + tt / (METRE_RAD * METRE_RAD)) / self.available as f64;
        squares * self.steps as f64 / self.available as f64
    }

    /// The error model. A bias counts only in sums over `cells`, after enough passages, and if
    /// significant (method 15); `None` for `cells` gives no bias.
    pub(super) fn fault(&self, cells: Option<u64>) -> ErrorModel {
        let mut fault = ErrorModel::default();
        if self.fixes < MIN_MEASUREMENTS {
            return fault;
        }
        let n = self.fixes as f64;
        // The errors of one passage are the same in all cells that it crosses.
        let passages = cells.map_or(0.0, |cells| self.visits as f64 / cells.max(1) as f64);
        for k in 0..3 {
            if passages >= MIN_VISITS as f64 {
                let visits = self.visits as f64;
                let mean = self.means[k] / visits;
                let scatter = (self.mean_squares[k] / visits - mean * mean).max(0.0) / (passages - 1.0);
                // Few passages determine their own scatter badly: an approximation of Student's
                // quantile.
                let sigmas = BIAS_SIGMAS * (1.0 + 2.0 / (passages - 1.0));
                if mean * mean > sigmas * sigmas * scatter {
                    fault.bias[k] = mean;
                }
            }
            let b = fault.bias[k];
            let mean_square = (self.normalised[k] - 2.0 * b * self.weighted[k] + b * b * self.weights[k]) / n;
            fault.excess[k] = (mean_square - 1.0).max(0.0);
        }
        fault
    }

    /// The figures that follow from the sums.
    pub fn figures(&self) -> ModalitySummary {
        let n = self.available.max(1) as f64;
        let mean = self.errors.map(|e| e / n);
        let second = [self.products[0], self.products[3], self.products[5]];
        let sigma = std::array::from_fn(|k| (second[k] / n - mean[k] * mean[k]).max(0.0).sqrt());
        ModalitySummary {
            mean,
            sigma,
            availability: self.available as f64 / self.steps.max(1) as f64,
            rate_hz: if self.seconds > 0.0 { self.fixes as f64 / self.seconds } else { 0.0 },
            outliers: self.outliers as f64 / self.fixes.max(1) as f64,
            score: self.score(),
        }
    }
}

/// Statistics of every modality, in the order of [`Modality::ALL`](super::Modality::ALL).
pub type StatsByModality = [ModalityStats; 3];
