//! `waymark-lab evaluate confidence`: calibration of confidences. Of answers with confidence 0.9,
//! nine in ten should be right.

use super::{
    Common,
    answers::{Answers, LOOK_ALIKES, MATED, Named, answers},
    say, write_plot,
};
use crate::evaluate::{
    chart::{COLOURS, Panel, picture},
    statistics::{Interval, bootstrap, upper_bound, wilson},
};
use serde::Serialize;
use vision::recognise::DistanceKind;

/// Bins of equal mass.
const BINS: usize = 15;
/// Answers with at least this confidence are reported apart.
const SURE: f64 = 0.99;

/// `waymark-lab evaluate confidence`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Quads, of which about four in ten are named.
    #[arg(long, default_value_t = 15_000, value_parser = clap::value_parser!(u32).range(100..=1_000_000))]
    quads: u32,
    #[command(flatten)]
    common: Common,
}

/// One bin of a reliability diagram.
#[derive(Debug, Clone, Copy, Serialize)]
pub(crate) struct Bin {
    answers: usize,
    /// Mean confidence, and share right with its interval.
    confidence: f64,
    right: f64,
    right_interval: Interval,
}

/// Calibration of one distance's confidence.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct Reliability {
    distance: &'static str,
    named: usize,
    right: usize,
    /// Expected calibration error, over bins of equal mass.
    pub(crate) ece: f64,
    ece_interval: Option<Interval>,
    largest_gap: f64,
    /// Mean squared error of the confidence.
    brier: f64,
    /// Answers of at least 0.99, the wrong among them, and the exact upper 95 % bound of their
    /// share.
    sure: usize,
    sure_wrong: usize,
    sure_bound: f64,
    bins: Vec<Bin>,
}

#[derive(Debug, Serialize)]
struct Report {
    set: &'static str,
    seed: u64,
    quads: usize,
    mated: f64,
    lookalikes: f64,
    results: Vec<Reliability>,
}

pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    anyhow::ensure!(!args.common.detector, "there is no --detector here");
    let found = answers(&args.common, args.quads, &args.common.preset.params())?;
    let report = Report {
        set: args.common.part.name(),
        seed: args.common.seed,
        quads: found[0].quads,
        mated: MATED,
        lookalikes: LOOK_ALIKES,
        results: reliabilities(&found),
    };
    write_plot(args.common.plot.as_deref(), || svg(&report.results))?;
    say(args.common.json, &report, || table(&report))
}

/// Calibration over all answers that name a landmark, by distance.
pub(crate) fn reliabilities(found: &[Answers; 3]) -> Vec<Reliability> {
    super::answers::KINDS
        .iter()
        .zip(found)
        .map(|(kind, answers)| reliability(*kind, &answers.named))
        .collect()
}

fn reliability(kind: DistanceKind, named: &[Named]) -> Reliability {
    let bins = bins(&named.iter().collect::<Vec<_>>());
    let sure: Vec<&Named> = named.iter().filter(|n| n.confidence >= SURE).collect();
    let sure_wrong = sure.iter().filter(|n| !n.is_right).count();
    let miss = |n: &Named| (n.confidence - f64::from(u8::from(n.is_right))).powi(2);
    Reliability {
        distance: match kind {
            DistanceKind::Both => "both",
            DistanceKind::Correlation => "correlation",
            DistanceKind::Hausdorff => "hausdorff",
        },
        named: named.len(),
        right: named.iter().filter(|n| n.is_right).count(),
        ece: ece(&bins),
        ece_interval: bootstrap(named, |drawn| Some(ece(&self::bins(drawn)))),
        largest_gap: bins.iter().map(|b| (b.confidence - b.right).abs()).fold(0.0, f64::max),
        brier: named.iter().map(miss).sum::<f64>() / named.len().max(1) as f64,
        sure: sure.len(),
        sure_wrong,
        sure_bound: upper_bound(sure_wrong, sure.len()),
        bins,
    }
}

/// Bins of equal mass by rising confidence.
fn bins(named: &[&Named]) -> Vec<Bin> {
    let mut sorted: Vec<&Named> = named.to_vec();
    sorted.sort_by(|a, b| a.confidence.total_cmp(&b.confidence));
    let edge = |i: usize| i * sorted.len() / BINS;
    let bin = |i: usize| {
        let part = &sorted[edge(i)..edge(i + 1)];
        let right = part.iter().filter(|n| n.is_right).count();
        let n = part.len() as f64;
        (!part.is_empty()).then(|| Bin {
            answers: part.len(),
            confidence: part.iter().map(|n| n.confidence).sum::<f64>() / n,
            right: right as f64 / n,
            right_interval: wilson(right, part.len()),
        })
    };
    (0..BINS).filter_map(bin).collect()
}

fn ece(bins: &[Bin]) -> f64 {
    let all: usize = bins.iter().map(|b| b.answers).sum();
    bins.iter().map(|b| b.answers as f64 * (b.confidence - b.right).abs()).sum::<f64>() / all.max(1) as f64
}

/// One line of a table.
pub(crate) fn line(r: &Reliability) -> String {
    let interval = r.ece_interval.map_or(String::new(), |i| format!(" ({:.4}-{:.4})", i.0, i.1));
    format!(
        "  {:<12} {:>6} answers, {:>6} right,  ECE {:.4}{interval}, largest gap {:.3}, Brier {:.4}; of {} with at least 0.99 {} wrong (at most {:.2e})",
        r.distance, r.named, r.right, r.ece, r.largest_gap, r.brier, r.sure, r.sure_wrong, r.sure_bound
    )
}

fn table(report: &Report) -> Vec<String> {
    let mut lines = vec![format!(
        "confidence: set {}, seed {}, {} quads ({:.0} % landmarks, {:.0} % look-alikes, the rest distractors)",
        report.set,
        report.seed,
        report.quads,
        100.0 * report.mated,
        100.0 * report.lookalikes
    )];
    lines.extend(report.results.iter().map(line));
    if let Some(first) = report.results.first() {
        lines.push("  both: mean confidence and share right (95 %), bins of equal mass".into());
        lines.extend(first.bins.iter().map(|b| {
            let i = b.right_interval;
            format!("    {:.4}  {:.4} ({:.4}-{:.4})  {} answers", b.confidence, b.right, i.0, i.1, b.answers)
        }));
    }
    lines
}

/// Reliability diagrams, one panel a distance: share right over confidence.
fn svg(results: &[Reliability]) -> String {
    let words: Vec<(&str, String)> =
        results.iter().map(|r| (COLOURS[0], line(r).trim().to_owned())).collect();
    picture(results.len().max(3), &words, |svg| {
        for (i, r) in results.iter().enumerate() {
            let title = format!("{}: share right (bars: 95 %)", r.distance);
            let panel = Panel::of_shares(i, &title, "confidence", [0.0, 1.0], false);
            panel.axes(svg, &[0.0, 0.2, 0.4, 0.6, 0.8, 1.0]);
            panel.curve(svg, &[(0.0, 0.0), (1.0, 1.0)], "#999");
            let points: Vec<(f64, f64)> = r.bins.iter().map(|b| (b.confidence, b.right)).collect();
            panel.curve(svg, &points, COLOURS[0]);
            for b in &r.bins {
                panel.interval(svg, b.confidence, [b.right_interval.0, b.right_interval.1], COLOURS[0]);
            }
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn named(confidence: f64, is_right: bool) -> Named {
        Named { measures: Default::default(), confidence, is_right }
    }

    #[test]
    fn the_calibration_error_by_hand() {
        // Fifteen pairs, each with one right answer; confidences 0.5 and, in the last bin, 0.9.
        let mut all: Vec<Named> = (0..28).map(|i| named(0.5, i % 2 == 0)).collect();
        all.extend([named(0.9, true), named(0.9, false)]);
        let r = reliability(DistanceKind::Both, &all);
        assert_eq!((r.bins.len(), r.named, r.right), (15, 30, 15));
        assert!((r.ece - 0.4 / 15.0).abs() < 1e-12 && (r.largest_gap - 0.4).abs() < 1e-12, "{}", r.ece);
        assert!(svg(&[r.clone(), r]).contains("<polyline"));
        assert!(bins(&[]).is_empty() && ece(&[]).abs() < 1e-12);
    }
}
