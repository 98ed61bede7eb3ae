//! Names of landmarks and corners of named ones, over all drives.

use super::journey::{Journey, Named};
use crate::evaluate::statistics::quantile;
use serde::Serialize;
use std::collections::BTreeMap;

/// Names of one kind of landmark in one state.
#[derive(Debug, Serialize)]
pub(super) struct Row {
    kind: &'static str,
    state: &'static str,
    #[serde(flatten)]
    named: Named,
}

impl Row {
    pub(super) fn in_words(&self) -> String {
        let Named { shown, global, shown_to_pose, guided } = self.named;
        let share = |count: usize, of: usize| 100.0 * count as f64 / of.max(1) as f64;
        let what = format!("{} {}", self.kind, self.state);
        let (alone, with) = (share(global, shown), share(guided, shown_to_pose));
        format!("  {what:<33} {alone:>5.1} % of {shown:<6} {with:>5.1} % of {shown_to_pose}")
    }
}

pub(super) fn rows(journeys: &[Journey]) -> Vec<Row> {
    let mut all: BTreeMap<(&'static str, &'static str), Named> = BTreeMap::new();
    for (key, named) in journeys.iter().flat_map(|j| &j.named) {
        let sum = all.entry(*key).or_default();
        sum.shown += named.shown;
        sum.global += named.global;
        sum.shown_to_pose += named.shown_to_pose;
        sum.guided += named.guided;
    }
    all.into_iter().map(|((kind, state), named)| Row { kind, state, named }).collect()
}

/// Corners of rightly named landmarks.
#[derive(Debug, Serialize)]
pub(super) struct CornerErrors {
    named: &'static str,
    corners: usize,
    median_px: f64,
    p90_px: f64,
    /// Squared Mahalanobis distance of a corner: mean (2 expected), median (1.39 expected); share
    /// of corners within 95 %.
    nees: f64,
    median_square: f64,
    within_95: f64,
}

/// 95 % of chi2 with 2 degrees of freedom.
const CHI2_2_95: f64 = 5.991;

impl CornerErrors {
    fn of(named: &'static str, all: &[(f64, f64)]) -> Option<Self> {
        let mut errors: Vec<f64> = all.iter().map(|(px, _)| *px).collect();
        let mut squares: Vec<f64> = all.iter().map(|(_, d2)| *d2).collect();
        let count = all.len().max(1) as f64;
        Some(Self {
            named,
            corners: all.len(),
            median_px: quantile(&mut errors, 0.5)?,
            p90_px: quantile(&mut errors, 0.9)?,
            median_square: quantile(&mut squares, 0.5)?,
            nees: all.iter().map(|(_, d2)| d2).sum::<f64>() / count,
            within_95: all.iter().filter(|(_, d2)| *d2 < CHI2_2_95).count() as f64 / count,
        })
    }

    pub(super) fn in_words(&self) -> String {
        let Self { named, corners, median_px, p90_px, nees, median_square, within_95 } = self;
        let within = 100.0 * within_95;
        format!(
            "  {named:<33} {corners:>6}   {median_px:>6.2}  {p90_px:>6.2}    {nees:>6.2}  {median_square:>6.2}   {within:>5.1} %"
        )
    }
}

pub(super) fn corner_errors(journeys: &[Journey]) -> Vec<CornerErrors> {
    let mut all: BTreeMap<&'static str, Vec<(f64, f64)>> = BTreeMap::new();
    for (named, corners) in journeys.iter().flat_map(|j| &j.corners) {
        all.entry(named).or_default().extend(corners);
    }
    all.into_iter().filter_map(|(named, corners)| CornerErrors::of(named, &corners)).collect()
}
