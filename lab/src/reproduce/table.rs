//! Figures as Markdown: the tables of docs/EVALUATION.md and README.md. Figures in, text out.

use super::{
    comparison,
    figures::{Figures, Measured, Outcome, RowFigures, Run},
    row::{HIGHLIGHTS, Unit},
};
use std::fmt::Write as _;
use vision::params::preset::Preset;

/// The part of docs/EVALUATION.md, without the marks around it.
pub(super) fn evaluation(figures: &Figures) -> String {
    let mut text = head(figures);
    text += "\n| | figure | paper | default | paper's preset |\n|---|---|---|---|---|\n";
    for row in &figures.rows {
        text += &lines(row);
    }
    text += "\n| | command; `--preset paper` for the last column | seed | seconds |\n|---|---|---|---|\n";
    for row in &figures.rows {
        text += &commands(row);
    }
    text
}

/// The part of README.md.
pub(super) fn readme(figures: &Figures) -> String {
    let mut text = head(figures);
    text += "\n| what | default | paper's preset | on |\n|---|---|---|---|\n";
    for highlight in &HIGHLIGHTS {
        let row = figures.rows.iter().find(|row| row.id == highlight.row);
        let [default, paper] = [Preset::Default, Preset::Paper].map(|preset| {
            row.map_or_else(|| "not measured".to_owned(), |row| cell(row, highlight.figure, preset))
        });
        let bold = row.map_or("", |row| bold(row, highlight.figure));
        writeln!(text, "| {} | {default} | {bold}{paper}{bold} | {} |", highlight.what, highlight.on).ok();
    }
    text
}

/// When, where, from what, and how much of it.
fn head(figures: &Figures) -> String {
    let commit = figures.commit.as_deref().map_or("unknown", |commit| &commit[..commit.len().min(8)]);
    let changed = if figures.changed { " with changes" } else { "" };
    let quick = if figures.quick { "**A smoke test: no figure counts.** " } else { "" };
    let (measured, of) = figures.counts();
    format!(
        "{quick}Measured on {} at commit {commit}{changed} by `waymark-lab reproduce`, {measured} of {of} commands, in {:.0}\n\
         minutes on {} cores of {}. Brackets are 95 % intervals; bold: the paper's preset is better.\n",
        figures.date, figures.minutes, figures.cores, figures.processor
    )
}

/// Names of figures in the order in which runs give them.
fn names(row: &RowFigures) -> Vec<&str> {
    let mut names: Vec<&str> = Vec::new();
    for run in &row.runs {
        if let Outcome::Figures(all) = &run.outcome {
            let new: Vec<&str> = all.iter().map(|m| m.name.as_str()).filter(|n| !names.contains(n)).collect();
            names.extend(new);
        }
    }
    names
}

/// Marks around a figure in which the paper's preset is better.
fn bold(row: &RowFigures, name: &str) -> &'static str {
    if comparison::is_better(row, name) { "**" } else { "" }
}

fn lines(row: &RowFigures) -> String {
    let (mut text, mut left) = (String::new(), format!("**{}** {}", row.id, row.title));
    let mut paper = row.paper.as_str();
    for name in names(row) {
        let [default, preset] = [Preset::Default, Preset::Paper].map(|preset| cell(row, name, preset));
        let bold = bold(row, name);
        writeln!(text, "| {left} | {name} | {paper} | {default} | {bold}{preset}{bold} |").ok();
        (left, paper) = (String::new(), "");
    }
    if text.is_empty() {
        let why = absent(row).next().map_or("no command", |(_, why)| why);
        return format!("| {left} | | {paper} | {0} | {0} |\n", not_measured(why));
    }
    for (run, why) in absent(row) {
        let which = run.seed.map_or_else(|| format!("`{}`", run.command), |seed| format!("seed {seed}"));
        let why = not_measured(why);
        let [default, paper] =
            if run.preset == Some(Preset::Paper) { ["-", why.as_str()] } else { [why.as_str(), "-"] };
        writeln!(text, "|  | {which} |  | {default} | {paper} |").ok();
    }
    if let Some(reason) = comparison::reason(&row.id) {
        writeln!(text, "| | *{reason}* | | | |").ok();
    }
    text
}

/// Commands without figures, and why.
fn absent(row: &RowFigures) -> impl Iterator<Item = (&Run, &str)> {
    row.runs.iter().filter_map(|run| match &run.outcome {
        Outcome::NotMeasured(why) => Some((run, why.as_str())),
        Outcome::Figures(_) => None,
    })
}

fn not_measured(why: &str) -> String {
    format!("not measured: {}", escaped(why))
}

/// The figure under a preset; one that no preset changes stands in the first column.
fn cell(row: &RowFigures, name: &str, preset: Preset) -> String {
    if let Some(measured) = comparison::under(row, name, Some(preset)) {
        return shown(measured);
    }
    match comparison::under(row, name, None).map(shown) {
        Some(text) if preset == Preset::Default => text,
        Some(_) => "-".to_owned(),
        None => "not measured".to_owned(),
    }
}

fn commands(row: &RowFigures) -> String {
    let mut text = String::new();
    // The paper's preset stands beside the default, whose command names no preset.
    for run in row.runs.iter().filter(|run| run.preset != Some(Preset::Paper)) {
        let other = format!("{} --preset paper", run.command);
        let paper = row.runs.iter().find(|run| run.command == other);
        let seed = run.seed.map_or_else(String::new, |seed| seed.to_string());
        let of = |run: &Run| match &run.outcome {
            Outcome::Figures(_) => format!("{:.0}", run.seconds),
            Outcome::NotMeasured(why) => not_measured(why),
        };
        let seconds = std::iter::once(run).chain(paper).map(of).collect::<Vec<_>>().join(", ");
        writeln!(text, "| {} | `{}` | {seed} | {seconds} |", row.id, run.command).ok();
    }
    text
}

fn escaped(text: &str) -> String {
    text.replace('|', "/").replace('`', "'")
}

/// A value with its unit, whole and interval.
fn shown(m: &Measured) -> String {
    let Some(value) = m.value else { return "-".to_owned() };
    let number = |x: f64| match m.unit {
        Unit::Count | Unit::Bytes => format!("{x:.0}"),
        Unit::Share | Unit::M => format!("{x:.3}"),
        Unit::Percent => format!("{:.2}", 100.0 * x),
        Unit::Plain if x.abs() < 0.01 && x != 0.0 => format!("{x:.1e}"),
        Unit::Plain | Unit::Px => format!("{x:.2}"),
        Unit::Deg if x.abs() < 1.0 => format!("{x:.2}"),
        Unit::Deg => format!("{x:.1}"),
    };
    let mut text = if m.beyond { format!("beyond {}", number(value)) } else { number(value) };
    text += match m.unit {
        Unit::Count | Unit::Share | Unit::Plain | Unit::Bytes => "",
        Unit::Percent => " %",
        Unit::Px => " px",
        Unit::M => " m",
        Unit::Deg => " deg",
    };
    if let Some([low, high]) = m.interval {
        write!(text, " ({}-{})", number(low), number(high)).ok();
    }
    if let Some(of) = m.of {
        write!(text, " of {of:.0}").ok();
    }
    text
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    pub(crate) fn fixture() -> Figures {
        let m = |name: &str, unit, value: f64| Measured {
            name: name.into(),
            unit,
            value: Some(value),
            of: None,
            interval: None,
            beyond: false,
        };
        let recall =
            Measured { of: Some(432.0), interval: Some([0.86, 0.92]), ..m("recall", Unit::Share, 0.894) };
        let run = |command: &str, preset, outcome| Run {
            command: format!("waymark-lab evaluate {command}"),
            preset,
            seed: Some(931),
            seconds: 12.4,
            outcome,
        };
        let detection = [
            run("detection corridor", Some(Preset::Default), Outcome::Figures(vec![recall.clone()])),
            run(
                "detection corridor --preset paper",
                Some(Preset::Paper),
                Outcome::Figures(vec![Measured { value: Some(0.5), ..recall }]),
            ),
        ];
        let reach = Measured { beyond: true, ..m("reach", Unit::Deg, 85.0) };
        let once = [
            run("calibration", None, Outcome::Figures(vec![m("error", Unit::Percent, 0.0035), reach])),
            run("calibration --seed 931", None, Outcome::NotMeasured("it was refused".into())),
        ];
        let absent = [run("outside x", Some(Preset::Default), Outcome::NotMeasured("set x absent".into()))];
        let row = |id: &str, paper: &str, runs: &[Run]| RowFigures {
            id: id.into(),
            title: "a title".into(),
            paper: paper.into(),
            runs: runs.to_vec(),
        };
        Figures {
            date: "2026-11-28".into(),
            commit: Some("0123456789abcdef".into()),
            changed: false,
            processor: "a processor".into(),
            cores: 2,
            minutes: 71.6,
            quick: false,
            rows: vec![row("E1", "88 %", &detection), row("E9", "", &once), row("S1", "", &absent)],
        }
    }

    #[test]
    fn a_table_has_a_line_for_each_figure_both_presets_and_what_was_not_measured() {
        let text = evaluation(&fixture());
        for line in [
            "Measured on 2026-11-28 at commit 01234567 by `waymark-lab reproduce`, 3 of 5 commands, in 72",
            "| **E1** a title | recall | 88 % | 0.894 (0.860-0.920) of 432 | 0.500 (0.860-0.920) of 432 |",
            "| **E9** a title | error |  | 0.35 % | - |",
            "|  | reach |  | beyond 85.0 deg | - |",
            "|  | seed 931 |  | not measured: it was refused | - |",
            "| **S1** a title | |  | not measured: set x absent | not measured: set x absent |",
            "| E1 | `waymark-lab evaluate detection corridor` | 931 | 12, 12 |",
            "| S1 | `waymark-lab evaluate outside x` | 931 | not measured: set x absent |",
        ] {
            assert!(text.lines().any(|l| l == line), "{line}\n{text}");
        }
        let text = readme(&fixture());
        assert!(text.contains("| wrong names | not measured | not measured |"), "{text}");
    }
}
