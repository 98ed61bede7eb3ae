//! The figures of a whole run, as they are stored: typed values from the reports of the
//! experiments, with the commands and the commit that gave them. A report in, figures out.

use super::row::{Command, Figure, Unit};
use anyhow::Context as _;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use vision::params::preset::Preset;

/// A number with what belongs to it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Measured {
    pub(super) name: String,
    pub(super) unit: Unit,
    /// `None`: nothing was counted, or it is infinite.
    pub(super) value: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) of: Option<f64>,
    /// 95 % confidence.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) interval: Option<[f64; 2]>,
    /// The value is the last of the sweep, and not reached.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub(super) beyond: bool,
}

/// What came of one command under one preset.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Outcome {
    Figures(Vec<Measured>),
    /// Why there are none.
    NotMeasured(String),
}

/// One command under one preset.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Run {
    /// As it was run, but for `--json`.
    pub(super) command: String,
    /// `None`: a preset changes nothing, or there is no other.
    pub(super) preset: Option<Preset>,
    pub(super) seed: Option<u64>,
    pub(super) seconds: f64,
    pub(super) outcome: Outcome,
}

/// One row.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct RowFigures {
    pub(super) id: String,
    pub(super) title: String,
    pub(super) paper: String,
    pub(super) runs: Vec<Run>,
}

/// A whole run: `figures.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Figures {
    /// Day by the clock of this machine, UTC.
    pub(super) date: String,
    /// `None`: not known.
    pub(super) commit: Option<String>,
    /// Files differed from the commit.
    pub(super) changed: bool,
    pub(super) processor: String,
    pub(super) cores: usize,
    /// Of all runs, those kept from an interrupted start included.
    pub(super) minutes: f64,
    /// A smoke test: no figure counts.
    pub(super) quick: bool,
    pub(super) rows: Vec<RowFigures>,
}

impl Figures {
    /// Commands under each preset, each once though several rows show it: measured, and of how
    /// many.
    pub(super) fn counts(&self) -> (usize, usize) {
        let runs = || self.rows.iter().flat_map(|row| &row.runs);
        let commands = |all: &mut dyn Iterator<Item = &Run>| {
            all.map(|run| run.command.as_str()).collect::<std::collections::BTreeSet<_>>().len()
        };
        let mut measured = runs().filter(|run| matches!(run.outcome, Outcome::Figures(_)));
        (commands(&mut measured), commands(&mut runs()))
    }
}

/// The figures of a command in its report, which is the list of the JSON objects that it printed.
/// One that says what it skipped gives that as the reason of a missing figure.
pub(super) fn measured(command: &Command, report: &Value) -> anyhow::Result<Vec<Measured>> {
    let found = command.figures.iter().map(|figure| of(figure, report)).collect::<anyhow::Result<_>>();
    found.map_err(|error| match find(report, "0/skipped/0").and_then(Value::as_str) {
        Some(why) => anyhow::anyhow!("{why}"),
        None => error,
    })
}

fn of(figure: &Figure, report: &Value) -> anyhow::Result<Measured> {
    let at = |path: &str| {
        find(report, path).with_context(|| format!("the report has no {path} ({})", figure.name))
    };
    let number = |path: &str| at(path).map(Value::as_f64);
    let ends = |path: &str| -> anyhow::Result<Option<[f64; 2]>> {
        Ok(serde_json::from_value(at(path)?.clone()).ok())
    };
    Ok(Measured {
        name: figure.name.to_owned(),
        unit: figure.unit,
        value: number(figure.path)?,
        of: figure.of.map(number).transpose()?.flatten(),
        interval: figure.interval.map(ends).transpose()?.flatten(),
        beyond: figure.beyond.map(at).transpose()?.is_some_and(|value| *value == Value::Bool(true)),
    })
}

/// What is at a path: names of fields and indices between slashes. `views=10&refined=false` is the
/// first item of a list that has these values.
pub(super) fn find<'a>(report: &'a Value, path: &str) -> Option<&'a Value> {
    path.split('/').try_fold(report, |value, step| match value {
        Value::Array(items) if step.contains('=') => items.iter().find(|item| has(item, step)),
        Value::Array(items) => items.get(step.parse::<usize>().ok()?),
        other => other.get(step),
    })
}

/// Whether an item has all values of a selection.
fn has(item: &Value, selection: &str) -> bool {
    let is = |value: &Value, wanted: &str| match value {
        Value::String(text) => text == wanted,
        other => serde_json::from_str::<Value>(wanted).is_ok_and(|wanted| wanted == *other),
    };
    selection.split('&').all(|pair| {
        pair.split_once('=').is_some_and(|(name, wanted)| find(item, name).is_some_and(|v| is(v, wanted)))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reproduce::row::Presets;
    use serde_json::json;

    #[test]
    fn numbers_are_found_by_names_indices_and_selections() {
        let report = json!([{ "curves": [
            { "way": "C1", "refined": true, "points": [{ "views": 5, "median": 0.4 }] },
            { "way": "C1", "refined": false, "points": [{ "views": 5, "median": 0.7 }, { "views": 10, "median": 0.5 }] },
        ] }]);
        let at = |path: &str| find(&report, path).and_then(Value::as_f64);
        assert_eq!(at("0/curves/way=C1&refined=false/points/views=10/median"), Some(0.5));
        assert_eq!(at("0/curves/0/points/0/median"), Some(0.4));
        for absent in ["1/curves", "0/curves/way=C2/points", "0/curves/x", "0/curves/9", "0/curves/way"] {
            assert_eq!(find(&report, absent), None, "{absent}");
        }
    }

    #[test]
    fn figures_come_with_their_whole_and_interval_and_a_missing_one_is_named() {
        const FIGURES: [Figure; 2] = [
            Figure::new("right", Unit::Count, "0/right").of("0/quads").within("0/interval"),
            Figure::new("reach", Unit::Px, "0/half/at").until("0/half/beyond"),
        ];
        let command = Command {
            full: "x",
            quick: "x",
            presets: Presets::One,
            sets: &[],
            seconds: 1,
            figures: &FIGURES,
        };
        let mut report = json!([{ "right": 3, "quads": 4, "interval": [0.3, 0.9], "half": { "at": null, "beyond": true } }]);
        let found = measured(&command, &report).unwrap();
        assert_eq!(
            (found[0].value, found[0].of, found[0].interval),
            (Some(3.0), Some(4.0), Some([0.3, 0.9]))
        );
        assert!(!found[0].beyond && found[1].beyond && found[1].value.is_none());
        report[0].as_object_mut().unwrap().remove("quads");
        let error = measured(&command, &report).unwrap_err().to_string();
        assert!(error.contains("0/quads") && error.contains("right"), "{error}");
        report[0]["skipped"] = json!(["boards: no module named cv2"]);
        let error = measured(&command, &report).unwrap_err().to_string();
        assert_eq!(error, "boards: no module named cv2");
    }
}
