//! What a row of the table is: data alone. A command, the figures to take from its report, and what
//! the paper says.

use serde::{Deserialize, Serialize};
use vision::params::preset::Preset;

/// What a number counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Unit {
    /// Of one.
    Share,
    Count,
    /// A share, shown in percent.
    Percent,
    /// Without a unit.
    Plain,
    Px,
    M,
    Deg,
    Bytes,
}

impl Unit {
    /// Whether the number is counted in a whole, rather than divided by it already.
    pub(super) const fn is_counted(self) -> bool {
        matches!(self, Self::Count)
    }
}

/// Which of two values is the better one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Better {
    Larger,
    Smaller,
}

/// One experiment of the table.
#[derive(Debug)]
pub(super) struct Row {
    /// E1 to E14 are the paper's, S: sets made by others, B: beyond the paper.
    pub(super) id: &'static str,
    pub(super) title: &'static str,
    /// What the paper reports, and its figure or section; empty beyond the paper.
    pub(super) paper: &'static str,
    pub(super) commands: &'static [Command],
}

/// One command, and what is taken from its JSON.
#[derive(Debug)]
pub(super) struct Command {
    /// Arguments after `waymark-lab evaluate`, without `--preset` and `--json`.
    pub(super) full: &'static str,
    /// The same, small, for a smoke test.
    pub(super) quick: &'static str,
    pub(super) presets: Presets,
    /// Folders of the data that it reads.
    pub(super) sets: &'static [&'static str],
    /// About how long the full form takes under one preset on two idle cores, for the estimate of
    /// the time that remains.
    pub(super) seconds: u32,
    pub(super) figures: &'static [Figure],
}

/// Whether a preset changes what is measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Presets {
    Each,
    /// Neither detection nor recognition plays a part, or the command has the default's alone.
    One,
}

impl Presets {
    /// The runs of a command: `None` is without `--preset`.
    pub(super) fn runs(self) -> &'static [Option<Preset>] {
        match self {
            Self::Each => &[Some(Preset::Default), Some(Preset::Paper)],
            Self::One => &[None],
        }
    }
}

/// A number in a report.
#[derive(Debug)]
pub(super) struct Figure {
    pub(super) name: &'static str,
    pub(super) unit: Unit,
    /// Where the number is; see [`super::figures::find`].
    pub(super) path: &'static str,
    /// What it is a part of.
    pub(super) of: Option<&'static str>,
    pub(super) interval: Option<&'static str>,
    /// Whether the number is only a bound: the sweep ended before.
    pub(super) beyond: Option<&'static str>,
    /// `None`: neither, or no two presets are compared.
    pub(super) better: Option<Better>,
}

impl Figure {
    pub(super) const fn new(name: &'static str, unit: Unit, path: &'static str) -> Self {
        Self { name, unit, path, of: None, interval: None, beyond: None, better: None }
    }

    /// A number of which the larger is better.
    pub(super) const fn more(name: &'static str, unit: Unit, path: &'static str) -> Self {
        Self { better: Some(Better::Larger), ..Self::new(name, unit, path) }
    }

    /// A number of which the smaller is better.
    pub(super) const fn less(name: &'static str, unit: Unit, path: &'static str) -> Self {
        Self { better: Some(Better::Smaller), ..Self::new(name, unit, path) }
    }

    pub(super) const fn of(self, path: &'static str) -> Self {
        Self { of: Some(path), ..self }
    }

    pub(super) const fn within(self, path: &'static str) -> Self {
        Self { interval: Some(path), ..self }
    }

    pub(super) const fn until(self, path: &'static str) -> Self {
        Self { beyond: Some(path), ..self }
    }
}

/// A line of the table in README.md.
#[derive(Debug)]
pub(super) struct Highlight {
    pub(super) what: &'static str,
    pub(super) on: &'static str,
    pub(super) row: &'static str,
    pub(super) figure: &'static str,
}

/// What README.md shows.
pub(super) const HIGHLIGHTS: [Highlight; 7] = [
    Highlight {
        what: "landmarks named, taught from one photograph each",
        on: "path-traced rooms of an independent generator",
        row: "S1",
        figure: "full views named",
    },
    Highlight {
        what: "the same without doors and windows",
        on: "the same pictures",
        row: "S1",
        figure: "without doors and windows",
    },
    Highlight { what: "wrong names", on: "the same pictures", row: "S1", figure: "wrong names" },
    Highlight {
        what: "where the camera was, median error",
        on: "the same pictures",
        row: "S1",
        figure: "camera position, median",
    },
    Highlight {
        what: "paintings named right",
        on: "photographs of gallery walls, 287 works",
        row: "S4",
        figure: "right",
    },
    Highlight {
        what: "a poster behind glass, filmed by hand, named",
        on: "a public video",
        row: "S2",
        figure: "full views named",
    },
    Highlight {
        what: "error along the corridor, 95 %",
        on: "rendered drives of 25 m past four posters",
        row: "E10",
        figure: "along the corridor, 95 %",
    },
];
