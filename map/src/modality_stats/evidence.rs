//! What was found of one module in one place, as sums: places and runs add up, and a run can be taken away again by adding
//! up the others. Robot-aligned throughout: along, across (left), heading.

use crate::{
    check::{self, OutOfRange},
    modality_stats::advice::ErrorModel,
};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// Measurements below which a place says nothing for itself: its parent speaks.
pub const MIN_MEASUREMENTS: u64 = 30;
/// Visits below which a bias may be chance, however many measurements they gave: those of one visit err together.
pub const MIN_VISITS: u64 = 3;
/// How many radians of heading weigh as much as a metre.
const METRE_RAD: f64 = 0.1;
/// A bias is one if it is more than this many times its standard deviation.
const BIAS_SIGMAS: f64 = 2.0;
/// Nothing adds up to more.
const MAX_SUM: f64 = 1e15;

/// Sums of one module in one place.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModalityStats {
    /// Steps of the reference here, evenly along the way.
    pub(super) steps: u64,
    /// Of those, with a position of the module that something told lately.
    pub(super) available: u64,
    /// Time that was spent here.
    pub(super) seconds: f64,
    /// Errors of the module's own position at those steps.
    pub(super) errors: [f64; 3],
    /// Their products: xx, xy, xt, yy, yt, tt.
    pub(super) products: [f64; 6],
    /// Single measurements: fixes; of odometry, stretches of a metre.
    pub(super) fixes: u64,
    /// Of those, off by more than three standard deviations of what they claim.
    pub(super) outliers: u64,
    /// By claimed variance v and error e of each measurement: the sums of 1/v...
    pub(super) weights: [f64; 3],
    /// ...of e/v...
    pub(super) weighted: [f64; 3],
    /// ...and of e^2/v.
    pub(super) normalised: [f64; 3],
    /// Passages through the place.
    pub(super) visits: u64,
    /// Weighted mean error of each passage: their sum...
    pub(super) means: [f64; 3],
    /// ...and that of their squares.
    pub(super) mean_squares: [f64; 3],
}

/// What follows from the sums, for people.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ModalitySummary {
    /// Mean error of the module's own position: metres along, across, radians.
    pub mean: [f64; 3],
    /// Standard deviations about it.
    pub sigma: [f64; 3],
    /// Share of the way on which something told its position.
    pub availability: f64,
    /// Measurements a second.
    pub rate_hz: f64,
    /// Share of measurements off by more than three standard deviations.
    pub outliers: f64,
    /// The lower the better; infinite if it was never available.
    pub score: f64,
}

impl ModalityStats {
    /// Adds what was found elsewhere or another time.
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

    /// Every sum finite, none larger than can be: for what comes from outside.
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

    /// Steps at which the module had a position that something told lately.
    pub fn available(&self) -> u64 {
        self.available
    }

    /// Single measurements.
    pub fn fixes(&self) -> u64 {
        self.fixes
    }

    /// A step of the reference here, after `seconds` on the way; the module's error if it was available.
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

    /// A single measurement that is off by `error` and claims these variances.
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

    /// Closes a passage, in which only this was measured.
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

    /// Weighed mean squared error over availability (method 15): `J = tr(W (Sigma + mu mu^T)) / availability`, W =
    /// diag(1, 1, 1 / (0.1 rad)^2). Infinite if it was never available.
    pub fn score(&self) -> f64 {
        if self.available == 0 {
            return f64::INFINITY;
        }
        let [xx, .., tt] = self.products;
        let squares = (xx + self.products[3] + tt / (METRE_RAD * METRE_RAD)) / self.available as f64;
        squares * self.steps as f64 / self.available as f64
    }

    /// How it errs beyond what it claims. A bias is subtracted only where it is one: in sums over so many `cells`, from
    /// enough passages, and more than twice its own standard deviation (method 15); never where `cells` is absent.
    pub(super) fn fault(&self, cells: Option<u64>) -> ErrorModel {
        let mut fault = ErrorModel::default();
        if self.fixes < MIN_MEASUREMENTS {
            return fault;
        }
        let n = self.fixes as f64;
        // One passage through several cells errs alike in all of them.
        let passages = cells.map_or(0.0, |cells| self.visits as f64 / cells.max(1) as f64);
        for k in 0..3 {
            if passages >= MIN_VISITS as f64 {
                let visits = self.visits as f64;
                let mean = self.means[k] / visits;
                let scatter = (self.mean_squares[k] / visits - mean * mean).max(0.0) / (passages - 1.0);
                // Few passages know their own scatter badly: about Student's quantile.
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

    /// For people.
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

/// Evidence of every module, in the order of [`Module::ALL`].
pub type StatsByModality = [ModalityStats; 3];
