//! Distances of a landmark's own views and of all else, as two histograms with normal curves (the
//! paper's Fig. 11), both thresholds of method 8 and their errors. Distances in, figures and the
//! picture out.

use super::gaussian::{Gaussian, crossing};
use crate::evaluate::{
    chart::{COLOURS, Panel, picture},
    statistics::upper_bound,
};
use serde::Serialize;

/// A wrong acceptance costs as much as so many misses (method 8).
const COST: f64 = 6.0;
/// Steps of the sum that approximates the overlap.
const STEPS: usize = 2000;
/// Bars of a histogram.
const BARS: usize = 40;

/// Errors of a distance alone.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct Pairs {
    false_positives: usize,
    unknown: usize,
    false_positive_bound: f64,
    false_negatives: usize,
    own: usize,
}

impl Pairs {
    pub(crate) fn new(false_positives: usize, unknown: usize, false_negatives: usize, own: usize) -> Self {
        let false_positive_bound = upper_bound(false_positives, unknown);
        Self { false_positives, unknown, false_positive_bound, false_negatives, own }
    }

    pub(crate) fn line(&self) -> String {
        let share = |count: usize, of: usize| count as f64 / of.max(1) as f64;
        format!(
            "per pair: {} of {} unknown below tau, {:.2e} (at most {:.2e}); {} of {} own views not, {:.3}",
            self.false_positives,
            self.unknown,
            share(self.false_positives, self.unknown),
            self.false_positive_bound,
            self.false_negatives,
            self.own,
            share(self.false_negatives, self.own)
        )
    }
}

/// Own and other distances of one landmark.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct DistanceHistograms {
    distance: &'static str,
    own_views: usize,
    other_quads: usize,
    /// Mean and standard deviation of own and other distances, finite ones only.
    own_normal: Option<[f64; 2]>,
    other_normal: Option<[f64; 2]>,
    /// Area under both normal curves.
    overlap: Option<f64>,
    /// tau as learnt, and where the weighted normal curves cross; for each the share of others
    /// below and of own not below.
    tau: [Option<f64>; 2],
    false_positives: [Option<f64>; 2],
    false_negatives: [Option<f64>; 2],
    #[serde(skip)]
    own: Vec<f64>,
    #[serde(skip)]
    others: Vec<f64>,
}

impl DistanceHistograms {
    pub(crate) fn new(distance: &'static str, own: Vec<f64>, others: Vec<f64>, tau: f64) -> Self {
        let fits = Gaussian::fit(&own).zip(Gaussian::fit(&others));
        let taus = [Some(tau), fits.and_then(|(own, others)| crossing(own, others, COST))];
        let share = |all: &[f64], is: &dyn Fn(f64) -> bool| {
            all.iter().filter(|d| is(**d)).count() as f64 / all.len().max(1) as f64
        };
        let pair = |g: Gaussian| [g.mean, g.deviation];
        Self {
            distance,
            own_views: own.len(),
            other_quads: others.len(),
            own_normal: fits.map(|f| pair(f.0)),
            other_normal: fits.map(|f| pair(f.1)),
            overlap: fits.map(|(a, b)| overlap(a, b)),
            tau: taus,
            false_positives: taus.map(|t| t.map(|t| share(&others, &|d| d < t))),
            false_negatives: taus.map(|t| t.map(|t| share(&own, &|d| d >= t))),
            own,
            others,
        }
    }

    pub(crate) fn line(&self) -> String {
        let number = |x: Option<f64>| x.map_or("-".to_owned(), |x| format!("{x:.3}"));
        let normal = |n: Option<[f64; 2]>| n.map_or("-".to_owned(), |[m, s]| format!("{m:.2} +- {s:.2}"));
        format!(
            "{}: own {} ({} views), others {} ({}), overlap {}; tau learnt {} (FP {}, FN {}), of normal curves {} (FP {}, FN {})",
            self.distance,
            normal(self.own_normal),
            self.own_views,
            normal(self.other_normal),
            self.other_quads,
            number(self.overlap),
            number(self.tau[0]),
            number(self.false_positives[0]),
            number(self.false_negatives[0]),
            number(self.tau[1]),
            number(self.false_positives[1]),
            number(self.false_negatives[1])
        )
    }
}

fn density(g: Gaussian, x: f64) -> f64 {
    (-0.5 * ((x - g.mean) / g.deviation).powi(2)).exp() / (g.deviation * std::f64::consts::TAU.sqrt())
}

/// Area under both curves.
fn overlap(a: Gaussian, b: Gaussian) -> f64 {
    let low = (a.mean - 8.0 * a.deviation).min(b.mean - 8.0 * b.deviation);
    let high = (a.mean + 8.0 * a.deviation).max(b.mean + 8.0 * b.deviation);
    let step = (high - low) / STEPS as f64;
    let at = |i: usize| low + (i as f64 + 0.5) * step;
    (0..STEPS).map(|i| density(a, at(i)).min(density(b, at(i))) * step).sum()
}

/// One panel for each: histograms as densities, normal curves, tau.
pub(crate) fn svg(histograms: &[&DistanceHistograms]) -> String {
    let words: Vec<(&str, String)> = histograms.iter().map(|h| (COLOURS[0], h.line())).collect();
    picture(histograms.len().max(3), &words, |svg| {
        for (i, h) in histograms.iter().enumerate() {
            let finite = || h.own.iter().chain(&h.others).copied().filter(|d| d.is_finite());
            let high = finite().fold(f64::MIN_POSITIVE, f64::max);
            let bars = |all: &[f64]| {
                let mut counts = [0_usize; BARS];
                for d in all.iter().filter(|d| d.is_finite()) {
                    counts[((d / high * BARS as f64).max(0.0) as usize).min(BARS - 1)] += 1;
                }
                counts.map(|c| c as f64 / all.len().max(1) as f64 / (high / BARS as f64))
            };
            let sets = [(bars(&h.own), h.own_normal), (bars(&h.others), h.other_normal)];
            let top = sets.iter().flat_map(|s| s.0).fold(f64::MIN_POSITIVE, f64::max);
            let title = format!("{}: one landmark's own views (blue) and others", h.distance);
            let panel = Panel {
                y: [0.0, top],
                ..Panel::of_shares(i, &title, "distance (line: tau)", [0.0, high], false)
            };
            let ticks: Vec<f64> = (0..=5).map(|t| (20.0 * f64::from(t) * high).round() / 100.0).collect();
            panel.axes(svg, &ticks);
            for ((bars, normal), colour) in sets.iter().zip(COLOURS) {
                for (b, height) in bars.iter().enumerate() {
                    let x = |b: usize| high * b as f64 / BARS as f64;
                    panel.bar(svg, [x(b), x(b + 1)], *height, colour);
                }
                if let Some([mean, deviation]) = *normal {
                    let x = |i: usize| high * i as f64 / 200.0;
                    let curve = Gaussian { mean, deviation };
                    let line: Vec<(f64, f64)> = (0..=200).map(|i| (x(i), density(curve, x(i)))).collect();
                    panel.curve(svg, &line, colour);
                }
            }
            if let Some(tau) = h.tau[0] {
                panel.interval(svg, tau, [0.0, top], "#333");
            }
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn overlap_of_two_normal_curves_as_in_the_tables() {
        // Two unit normals two apart share 2 Phi(-1).
        let g = |mean| Gaussian { mean, deviation: 1.0 };
        assert!((overlap(g(0.0), g(2.0)) - 0.317_311).abs() < 1e-5);
        assert!((overlap(g(3.0), g(3.0)) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn both_thresholds_have_their_errors() {
        let histograms =
            DistanceHistograms::new("x", vec![1.0, 2.0, 3.0, 4.0], vec![8.0, 9.0, 10.0, 9.5], 3.0);
        assert_eq!((histograms.false_positives[0], histograms.false_negatives[0]), (Some(0.0), Some(0.5)));
        let tau = histograms.tau[1].expect("the means are apart");
        assert!(tau > 2.5 && tau < 9.1);
        let svg = svg(&[&histograms]);
        assert!(svg.contains("<polyline") && !svg.contains("NaN"));
        assert!(Pairs::new(0, 2_995, 1, 4).line().contains("at most 1.00e-3"));
    }
}
