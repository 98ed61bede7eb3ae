//! Fits a linear ranking: sets of rivals in, of which it is known how right each one is; weights of their features out,
//! such that the right one ranks first. For the model of `border_model`, whatever its features are. Reads no images and
//! keeps no state.
//!
//! Conditional logit: the chance that a rival is chosen is its share of the exponentials of all ranks; the weights make
//! the right ones' chance largest, less a ridge on weights of standardised features. Concave, solved by Newton's steps.

use nalgebra::{DMatrix, DVector};
use std::collections::BTreeSet;

/// Most Newton steps; some ten are usual.
const MAX_STEPS: usize = 60;
/// Most halvings of a step that does not improve.
const MAX_HALVINGS: usize = 40;
/// A gain below this ends the steps.
const ENOUGH: f64 = 1e-10;
/// A feature that varies less than this tells nothing; its weight is 0.
const MIN_DEVIATION: f64 = 1e-9;

/// Candidates for one thing, of which one or more are right.
#[derive(Debug, Clone, PartialEq)]
pub struct Rivals {
    /// Rivals of one group (one image) are never on both sides of a cross-validation.
    pub group: usize,
    /// Each candidate's features.
    pub features: Vec<Vec<f64>>,
    /// How right each candidate is, 0 to 1: its overlap with the labelled quad.
    pub overlap: Vec<f64>,
}

/// How to fit.
#[derive(Debug, Clone, PartialEq)]
pub struct FitParams {
    /// Weight of the squares of standardised weights; greater is smoother. Above 0.
    pub ridge: f64,
    /// Candidates whose overlap is less than this below the best one's are as right as it.
    pub tie: f64,
}

impl Default for FitParams {
    fn default() -> Self {
        Self { ridge: 1.0, tie: 0.02 }
    }
}

/// Why there are no weights.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FitError {
    /// Nothing to learn from: no set of rivals has a right and a wrong one.
    #[error("no labelled quad has rivals to choose from")]
    NoRivals,
    /// Rivals differ in the number of features or overlaps, or hold a number that is not finite.
    #[error("rivals {0}: features and overlaps do not fit each other or are not finite")]
    Malformed(usize),
    /// The ridge is not above 0.
    #[error("ridge {0} is not above 0")]
    Ridge(f64),
    /// Fewer than two groups, or folds.
    #[error("{groups} images in {folds} folds leave nothing to hold out")]
    Folds {
        /// Groups there are.
        groups: usize,
        /// Folds asked for.
        folds: usize,
    },
    /// The equations have no solution in numbers: features differ too much in size.
    #[error("the equations cannot be solved")]
    Unsolvable,
}

/// How often the first choice is right.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Choice {
    /// Sets of rivals.
    pub rivals: usize,
    /// Sets whose first choice overlaps by 0.7.
    pub found_70: usize,
    /// Sets whose first choice overlaps by 0.85.
    pub found_85: usize,
    /// Mean overlap of the first choices.
    pub mean_overlap: f64,
}

impl Choice {
    /// Over all `rivals`, the candidate of greatest `rank` (of equals the earlier) being the first choice.
    pub fn of<'a>(
        rivals: impl IntoIterator<Item = &'a Rivals>,
        rank: impl Fn(&Rivals, usize) -> f64,
    ) -> Self {
        let mut sum = Self::default();
        for r in rivals {
            let ranks: Vec<f64> = (0..r.overlap.len()).map(|i| rank(r, i)).collect();
            let Some(first) = (0..ranks.len()).reduce(|a, b| if ranks[b] > ranks[a] { b } else { a }) else {
                continue;
            };
            sum.rivals += 1;
            sum.found_70 += usize::from(r.overlap[first] >= 0.7);
            sum.found_85 += usize::from(r.overlap[first] >= 0.85);
            sum.mean_overlap += r.overlap[first];
        }
        sum.mean_overlap /= (sum.rivals.max(1)) as f64;
        sum
    }
}

/// Rank of a candidate by these weights.
pub fn rank(weights: &[f64], features: &[f64]) -> f64 {
    weights.iter().zip(features).map(|(w, f)| w * f).sum()
}

/// The weights, one a feature.
pub fn fit(rivals: &[Rivals], p: &FitParams) -> Result<Vec<f64>, FitError> {
    let all: Vec<&Rivals> = rivals.iter().collect();
    check(&all)?;
    fit_checked(&all, p)
}

/// First choices on images that the weights were not fitted on: the images are dealt to `folds` parts in turn, each is
/// judged by weights fitted on the others.
pub fn cross_validate(rivals: &[Rivals], folds: usize, p: &FitParams) -> Result<Choice, FitError> {
    let groups: Vec<usize> = rivals.iter().map(|r| r.group).collect::<BTreeSet<_>>().into_iter().collect();
    let folds = folds.min(groups.len());
    if folds < 2 {
        return Err(FitError::Folds { groups: groups.len(), folds });
    }
    let all: Vec<&Rivals> = rivals.iter().collect();
    check(&all)?;
    let fold = |r: &Rivals| groups.binary_search(&r.group).unwrap_or(0) % folds;
    let mut weights = Vec::with_capacity(folds);
    for held_out in 0..folds {
        let others: Vec<&Rivals> = all.iter().copied().filter(|r| fold(r) != held_out).collect();
        weights.push(fit_checked(&others, p)?);
    }
    Ok(Choice::of(rivals, |r, i| rank(&weights[fold(r)], &r.features[i])))
}

fn check(rivals: &[&Rivals]) -> Result<(), FitError> {
    let width = rivals.iter().flat_map(|r| &r.features).map(Vec::len).next().unwrap_or(0);
    for (i, r) in rivals.iter().enumerate() {
        let sound = r.features.len() == r.overlap.len()
            && r.features.iter().all(|f| f.len() == width && f.iter().all(|x| x.is_finite()))
            && r.overlap.iter().all(|o| o.is_finite());
        if !sound {
            return Err(FitError::Malformed(i));
        }
    }
    Ok(())
}

/// One set of rivals, standardised, with the chance that each should have.
struct Task {
    features: Vec<DVector<f64>>,
    wanted: Vec<f64>,
}

fn fit_checked(rivals: &[&Rivals], p: &FitParams) -> Result<Vec<f64>, FitError> {
    if p.ridge.is_nan() || p.ridge <= 0.0 {
        return Err(FitError::Ridge(p.ridge));
    }
    let (mean, deviation) = spread(rivals);
    let scale = |f: &Vec<f64>| {
        let x = f
            .iter()
            .enumerate()
            .map(|(i, x)| if deviation[i] < MIN_DEVIATION { 0.0 } else { (x - mean[i]) / deviation[i] });
        DVector::from_iterator(f.len(), x)
    };
    let tasks: Vec<Task> = rivals
        .iter()
        .filter_map(|r| {
            let wanted = wanted(&r.overlap, p.tie)?;
            Some(Task { features: r.features.iter().map(scale).collect(), wanted })
        })
        .collect();
    if tasks.is_empty() {
        return Err(FitError::NoRivals);
    }
    let weights = newton(&tasks, mean.len(), p.ridge)?;
    let unscaled = weights.iter().zip(&deviation).map(|(w, d)| if *d < MIN_DEVIATION { 0.0 } else { w / d });
    Ok(unscaled.collect())
}

/// Mean and standard deviation of every feature over all candidates.
fn spread(rivals: &[&Rivals]) -> (Vec<f64>, Vec<f64>) {
    let all: Vec<&Vec<f64>> = rivals.iter().flat_map(|r| &r.features).collect();
    let width = all.first().map_or(0, |f| f.len());
    let n = all.len().max(1) as f64;
    let mean: Vec<f64> = (0..width).map(|i| all.iter().map(|f| f[i]).sum::<f64>() / n).collect();
    let deviation = |i: usize| (all.iter().map(|f| (f[i] - mean[i]).powi(2)).sum::<f64>() / n).sqrt();
    let deviation = (0..width).map(deviation).collect();
    (mean, deviation)
}

/// Equal chances for the best and those next to it; none when nothing is wrong, so that there is no choice.
fn wanted(overlap: &[f64], tie: f64) -> Option<Vec<f64>> {
    let best = overlap.iter().copied().reduce(f64::max)?;
    let right: Vec<bool> = overlap.iter().map(|o| best - o < tie.max(f64::MIN_POSITIVE)).collect();
    let count = right.iter().filter(|r| **r).count();
    (count < overlap.len()).then(|| right.into_iter().map(|r| f64::from(r) / count as f64).collect())
}

fn newton(tasks: &[Task], width: usize, ridge: f64) -> Result<DVector<f64>, FitError> {
    let mut weights = DVector::zeros(width);
    let (mut value, mut slope, mut curve) = derivatives(tasks, &weights, ridge);
    for _ in 0..MAX_STEPS {
        let step = curve.clone().cholesky().ok_or(FitError::Unsolvable)?.solve(&slope);
        let mut share = 1.0;
        let mut next = None;
        for _ in 0..MAX_HALVINGS {
            let tried = &weights + &step * share;
            let at = derivatives(tasks, &tried, ridge);
            if at.0 >= value {
                next = Some((tried, at));
                break;
            }
            share *= 0.5;
        }
        let Some((tried, at)) = next else { break };
        let gain = at.0 - value;
        weights = tried;
        (value, slope, curve) = at;
        if gain < ENOUGH * value.abs().max(1.0) {
            break;
        }
    }
    Ok(weights)
}

/// The logarithm of the chances less the ridge, its gradient, and its negated second derivatives.
fn derivatives(tasks: &[Task], weights: &DVector<f64>, ridge: f64) -> (f64, DVector<f64>, DMatrix<f64>) {
    let width = weights.len();
    let mut value = -0.5 * ridge * weights.norm_squared();
    let mut slope = -ridge * weights;
    let mut curve = DMatrix::identity(width, width) * ridge;
    for task in tasks {
        let ranks: Vec<f64> = task.features.iter().map(|f| f.dot(weights)).collect();
        let top = ranks.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let sum: f64 = ranks.iter().map(|r| (r - top).exp()).sum();
        let mut mean = DVector::zeros(width);
        for (i, f) in task.features.iter().enumerate() {
            let chance = (ranks[i] - top).exp() / sum;
            value += task.wanted[i] * (ranks[i] - top - sum.ln());
            slope.axpy(task.wanted[i] - chance, f, 1.0);
            mean.axpy(chance, f, 1.0);
            curve.ger(chance, f, f, 1.0);
        }
        curve.ger(-1.0, &mean, &mean, 1.0);
    }
    (value, slope, curve)
}

#[cfg(test)]
#[path = "fitting_tests.rs"]
mod tests;
