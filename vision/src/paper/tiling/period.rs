//! Offsets of parallel lines in, the distance at which they repeat out (method 1.5, period
//! accumulator).

use crate::paper::tiling::tiling_params::TilingParams;
use std::f64::consts::TAU;

/// Most periods that are tried.
const MAX_PERIODS: usize = 2000;
/// Periods tried across one beat of the outermost lines.
const OVERSAMPLING: f64 = 6.0;
/// Largest expected number of patterns by chance among as many lines anywhere.
///
/// Departs from method 1.5, which asks for concentration and five lines alone: five random lines
/// often repeat at one of the many periods tried.
const MAX_CHANCE: f64 = 0.05;

/// The periods that are tried for some offsets: even in 1 / period.
struct Trials {
    /// The first and the last 1 / period.
    range: [f64; 2],
    count: usize,
    /// Least offset: phases are counted from it.
    low: f64,
    /// Least concentration of a pattern.
    enough: f64,
}

impl Trials {
    fn new(offsets: &[(f64, f64)], p: &TilingParams) -> Option<Self> {
        let (low, high) =
            offsets.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), o| (l.min(o.0), h.max(o.0)));
        let span = high - low;
        let [shortest, longest] = p.period_range;
        if offsets.len() < p.min_lines || !(span > 0.0 && shortest > 0.0 && longest > shortest) {
            return None;
        }
        // Fewer periods than lines of a pattern within the span cannot be one.
        let longest = longest.min(span / (p.min_lines.max(2) - 1) as f64 * (1.0 + 2.0 * p.max_residual));
        let (first, last) = (longest.recip(), shortest.recip());
        let beats = (last - first) * span;
        let wanted = (beats * OVERSAMPLING).ceil();
        if wanted.is_nan() || wanted < 1.0 {
            return None;
        }
        let count = (wanted as usize).min(MAX_PERIODS);
        // Chance that n phases anywhere concentrate to R is about exp(-n R^2).
        let lines = effective(offsets, p.max_residual * shortest);
        let enough = ((beats.max(1.0) / MAX_CHANCE).ln() / lines).sqrt().max(p.min_regularity);
        Some(Self { range: [first, last], count, low, enough })
    }

    fn frequency(&self, i: usize) -> f64 {
        let [first, last] = self.range;
        first + (last - first) * i as f64 / self.count as f64
    }
}

/// Evenly spaced places on a line: `phase + i * period`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Lattice {
    pub(super) period: f64,
    phase: f64,
}

impl Lattice {
    /// The largest period at which the offsets (with weights) repeat: fractions of a period repeat
    /// as well.
    ///
    /// Departs from method 1.5, which steps the period by 5 mm: that jumps over the narrow peaks of
    /// small tiles on a wide floor. Steps here are even in 1 / period and as fine as the spread of
    /// the lines asks for.
    pub(crate) fn find(offsets: &[(f64, f64)], p: &TilingParams) -> Option<Self> {
        let trials = Trials::new(offsets, p)?;
        let Trials { range: [first, last], count, low, enough } = trials;
        let frequency = |i: usize| trials.frequency(i);
        let mut before = concentration(offsets, low, frequency(0)).0;
        let mut here = concentration(offsets, low, frequency(1)).0;
        for i in 1..count {
            let after = concentration(offsets, low, frequency(i + 1)).0;
            if here >= enough && here >= before && here >= after {
                let bend = before - 2.0 * here + after;
                let shift = if bend < 0.0 { (0.5 * (before - after) / bend).clamp(-0.5, 0.5) } else { 0.0 };
                let exact = frequency(i) + shift * (last - first) / count as f64;
                let turn = concentration(offsets, low, exact).1;
                return Some(Self { period: exact.recip(), phase: low + turn / TAU / exact });
            }
            (before, here) = (here, after);
        }
        None
    }

    /// Number of the nearest place.
    pub(crate) fn index(&self, offset: f64) -> i64 {
        ((offset - self.phase) / self.period).round() as i64
    }

    /// Distance from the nearest place, in periods.
    pub(crate) fn residual(&self, offset: f64) -> f64 {
        let places = (offset - self.phase) / self.period;
        (places - places.round()).abs()
    }
}

/// `R = |sum w exp(2 pi i rho / T)| / sum w`, 0 to 1, and the argument of that sum, at a frequency
/// 1 / T.
fn concentration(offsets: &[(f64, f64)], origin: f64, frequency: f64) -> (f64, f64) {
    let (mut re, mut im, mut total) = (0.0, 0.0, 0.0);
    for (offset, weight) in offsets {
        let (sin, cos) = (TAU * (offset - origin) * frequency).sin_cos();
        re += weight * cos;
        im += weight * sin;
        total += weight;
    }
    (re.hypot(im) / f64::max(total, f64::MIN_POSITIVE), im.atan2(re))
}

/// How many lines of equal weight say as much as these; those closer than `same` count as one, as
/// the two edges of a joint or pieces of one line.
fn effective(offsets: &[(f64, f64)], same: f64) -> f64 {
    let mut sorted = offsets.to_vec();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (mut sum, mut squares) = (0.0, 0.0);
    for group in sorted.chunk_by(|a, b| b.0 - a.0 < same) {
        let weight: f64 = group.iter().map(|o| o.1).sum();
        sum += weight;
        squares += weight * weight;
    }
    sum * sum / f64::max(squares, f64::MIN_POSITIVE)
}
