//! Sweeps as tables for people and as the paper's plots (Fig. 12 and 13): D/tau over the condition.

use super::{
    Setting, say,
    sweep::{Crossing, Curve, RATIOS},
    write_plot,
};
use crate::evaluate::{
    chart::{COLOURS, Panel, picture},
    statistics::Interval,
};
use serde::Serialize;
use std::path::Path;

/// D/tau up to which plots reach, as the paper's.
const HIGHEST: f64 = 2.0;

#[derive(Debug, Serialize)]
struct Report<'a> {
    #[serde(flatten)]
    setting: &'a Setting,
    curves: &'a [Curve],
}

/// Prints the curves and writes their plot.
pub(crate) fn show(
    setting: &Setting,
    curves: &[Curve],
    json: bool,
    plot: Option<&Path>,
) -> anyhow::Result<()> {
    write_plot(plot, || svg(setting, curves))?;
    say(json, &Report { setting, curves }, || table(setting, curves))
}

fn table(setting: &Setting, curves: &[Curve]) -> Vec<String> {
    let mut lines = setting.lines();
    for curve in curves {
        lines.push(format!("  {:<28} median (and 90 %); the decision accepts below 1", curve.name));
        lines.push(format!(
            "  {:>9} {:>6}  {:<13} {:<13} {:<13} {:<22} not recognised",
            "", "views", RATIOS[0], RATIOS[1], RATIOS[2], "rightly recognised"
        ));
        for p in &curve.points {
            let ratio = |d: usize| {
                let number = |x: Option<f64>| x.map_or("-".to_owned(), |x| format!("{x:.2}"));
                format!("{} ({})", number(p.median[d]), number(p.ninety[d]))
            };
            let why: Vec<String> = p
                .outcomes
                .iter()
                .filter(|(name, _)| **name != "right")
                .map(|(n, c)| format!("{n} {c}"))
                .collect();
            lines.push(format!(
                "  {:>9.2} {:>6}  {:<13} {:<13} {:<13} {:.3} ({:.3}-{:.3})    {}",
                p.value,
                p.views,
                ratio(0),
                ratio(1),
                ratio(2),
                p.right,
                p.right_interval.0,
                p.right_interval.1,
                why.join(", ")
            ));
        }
        for (d, name) in RATIOS.iter().enumerate() {
            lines.push(format!("    median {name} reaches 1 at {}", words(&curve.crossings[d])));
        }
        lines.push(format!("    half are recognised up to   {}", words(&curve.half)));
        lines.push(format!("    95 % are recognised up to   {}", words(&curve.most)));
        lines.push(format!("    wrong: {} of {} views", curve.wrong, curve.views));
    }
    lines.push("  In brackets after a place: 95 % confidence, by resampling the landmarks 1000 times".into());
    lines
}

fn words(crossing: &Crossing) -> String {
    let interval = crossing.interval.map_or(String::new(), |i| format!(" ({:.2}-{:.2})", i.0, i.1));
    format!("{}{:.2}{interval}", if crossing.beyond { "more than " } else { "" }, crossing.at)
}

fn svg(setting: &Setting, curves: &[Curve]) -> String {
    let mut words: Vec<(&str, String)> = RATIOS
        .iter()
        .zip(COLOURS)
        .map(|(name, colour)| (colour, format!("{name}: median, bars to the 90 % quantile")))
        .collect();
    words.push((COLOURS[3], "share rightly recognised by the whole decision (1 is the dashed line)".into()));
    words.push(("none", setting.lines().swap_remove(0)));
    picture(curves.len().max(2), &words, |svg| {
        for (i, curve) in curves.iter().enumerate() {
            let value = |i: usize| curve.points.get(i).map_or(0.0, |p| p.value);
            let (first, last) = (value(0), value(curve.points.len().saturating_sub(1)));
            let x = [first.min(last), first.max(last)];
            let panel = Panel { y: [0.0, HIGHEST], ..Panel::of_shares(i, "D/tau", curve.name, x, false) };
            let ticks: Vec<f64> = (0..=5)
                .map(|t| x[0] + 0.2 * f64::from(t) * (x[1] - x[0]))
                .map(|t| (t * 100.0).round() / 100.0)
                .collect();
            panel.axes(svg, &ticks);
            panel.level(svg, 1.0);
            for (d, colour) in COLOURS.iter().enumerate().take(RATIOS.len()) {
                let of = |y: Option<f64>| y.unwrap_or(HIGHEST);
                let line: Vec<(f64, f64)> = curve.points.iter().map(|p| (p.value, of(p.median[d]))).collect();
                panel.curve(svg, &line, colour);
                for p in &curve.points {
                    panel.interval(svg, p.value, [of(p.median[d]), of(p.ninety[d])], colour);
                }
            }
            let shares: Vec<(f64, f64)> = curve.points.iter().map(|p| (p.value, p.right)).collect();
            panel.curve(svg, &shares, COLOURS[3]);
            for p in &curve.points {
                let Interval(low, high) = p.right_interval;
                panel.interval(svg, p.value, [low, high], COLOURS[3]);
            }
        }
    })
}
