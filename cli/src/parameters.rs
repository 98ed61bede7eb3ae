//! Detection parameters from the command line: a file, flags for those that are changed most, and
//! any other by its path. Later ones win: file, then flags, then `--set`.

use super::pictures;
use anyhow::{Context as _, bail};
use serde_json::Value;
use std::path::PathBuf;
use vision::{detect::DetectParams, params::preset::Preset};

/// Parameters of quad detection.
#[derive(Debug, Clone, Default, clap::Args)]
#[command(next_help_heading = "Detection parameters")]
pub struct ParameterArgs {
    /// The parameters that the others change: `default`, or those of the `paper`: relaxation over
    /// all six cues, floor tiling removed.
    #[arg(long, value_name = "NAME", default_value = "default")]
    preset: Preset,
    /// Parameters as JSON, only what differs from the defaults, such as {"quads": {"grouping":
    /// "relaxation"}}.
    #[arg(long, value_name = "FILE")]
    params: Option<PathBuf>,
    /// How segments become quads: `proposals` searches and completes missing sides, `relaxation` is
    /// the paper's way.
    #[arg(long, value_name = "NAME")]
    grouping: Option<String>,
    /// Work on the image reduced by a whole factor to about this longer side; 0 for full size.
    /// Larger finds smaller quads and takes longer.
    #[arg(long, value_name = "PX")]
    working_side: Option<u32>,
    /// Scales of the search, 1 to 4, each half the one before: coarse ones see through ragged,
    /// ornate frames.
    #[arg(long, value_name = "N")]
    scales: Option<u32>,
    /// Segments shorter than this are left out: lower for small quads.
    #[arg(long, value_name = "PX")]
    min_segment: Option<f64>,
    /// Step heights, in grey levels, that continue and that start an edge: lower for faint borders.
    #[arg(long, value_name = "LOW,HIGH", value_parser = two)]
    edge_steps: Option<[f64; 2]>,
    /// Share of each side that edges must support, 0 to 1: higher for fewer false quads.
    #[arg(long, value_name = "SHARE")]
    min_support: Option<f64>,
    /// Smallest score of a quad of the search, the probability that it is an object, 0 to 1: higher
    /// for fewer false quads.
    #[arg(long, value_name = "SCORE")]
    min_score: Option<f64>,
    /// What a quad inside another becomes: one of its `alternates`, or one of the `quads`.
    #[arg(long, value_name = "WHAT")]
    nested: Option<String>,
    /// Leave out sets of three sides (doors, half-hidden posters).
    #[arg(long)]
    no_three_sided: bool,
    /// Remove floor tiling before sides are grouped.
    #[arg(long)]
    remove_tiling: bool,
    /// Any parameter by its path, as in `quads.proposals.min_corner_angle_deg=20`. May be
    /// repeated; --show-params of `waymark detect` lists all.
    #[arg(long, value_name = "PATH=VALUE")]
    set: Vec<String>,
}

impl ParameterArgs {
    /// The preset that the others change.
    pub fn preset(&self) -> Preset {
        self.preset
    }

    /// The parameters asked for; those not mentioned have their defaults.
    pub fn parameters(&self) -> anyhow::Result<DetectParams> {
        let mut all = serde_json::to_value(pictures::detect_params(self.preset, self.params.as_deref())?)?;
        for (path, value) in self.flags() {
            put(&mut all, path, value)?;
        }
        self.set.iter().try_for_each(|assignment| assign(&mut all, assignment))?;
        serde_path_to_error::deserialize(&all)
            .map_err(|error| anyhow::anyhow!("parameter {}: {}", error.path(), error.inner()))
    }

    /// Their name in a report.
    pub fn name(&self) -> String {
        let file = self.params.as_deref().and_then(std::path::Path::file_stem);
        let file = file.map(|stem| stem.to_string_lossy().into_owned());
        let flag = |(path, value): (&str, Value)| {
            let leaf = path.rsplit('.').next().unwrap_or(path);
            format!("{leaf}={}", value.to_string().replace('"', ""))
        };
        let preset = (self.preset != Preset::Default).then(|| self.preset.word().to_owned());
        let parts = preset
            .into_iter()
            .chain(file)
            .chain(self.flags().into_iter().map(flag))
            .chain(self.set.iter().cloned());
        let name = parts.collect::<Vec<_>>().join(" ");
        if name.is_empty() { "default".to_owned() } else { name }
    }

    /// The same with one more change by its path.
    #[must_use]
    pub fn with(&self, assignment: &str) -> Self {
        let set = self.set.iter().cloned().chain([assignment.to_owned()]).collect();
        Self { set, ..self.clone() }
    }

    fn flags(&self) -> Vec<(&'static str, Value)> {
        [
            ("quads.grouping", self.grouping.clone().map(Value::from)),
            ("quads.working_side_px", self.working_side.map(Value::from)),
            ("quads.scales", self.scales.map(Value::from)),
            ("segments.min_length_range_px", self.min_segment.map(|px| Value::from(vec![px, px]))),
            ("edges.low", self.edge_steps.map(|s| s[0].into())),
            ("edges.high", self.edge_steps.map(|s| s[1].into())),
            ("quads.min_side_support", self.min_support.map(Value::from)),
            ("quads.min_probability", self.min_score.map(Value::from)),
            ("quads.nested", self.nested.clone().map(Value::from)),
            ("quads.three_sided", self.no_three_sided.then_some(Value::from(false))),
            ("tiling.remove", self.remove_tiling.then_some(Value::from(true))),
        ]
        .into_iter()
        .filter_map(|(path, value)| Some((path, value?)))
        .collect()
    }
}

fn two(text: &str) -> Result<[f64; 2], String> {
    let numbers: Result<Vec<f64>, _> = text.split(',').map(|part| part.trim().parse()).collect();
    let numbers = numbers.map_err(|error| error.to_string())?;
    numbers.try_into().map_err(|other: Vec<f64>| format!("{} numbers, not two", other.len()))
}

/// Sets one parameter by `PATH=VALUE`; words need no quotes.
pub fn assign(all: &mut Value, assignment: &str) -> anyhow::Result<()> {
    let (path, text) =
        assignment.split_once('=').with_context(|| format!("{assignment} is not PATH=VALUE"))?;
    put(all, path, serde_json::from_str(text).unwrap_or_else(|_| Value::from(text)))
}

/// Sets what is at a path of names between dots. The path must exist: a typing error must not add a
/// parameter.
fn put(all: &mut Value, path: &str, value: Value) -> anyhow::Result<()> {
    let mut at = all;
    for name in path.split('.') {
        let Some(object) = at.as_object_mut() else {
            bail!("{path}: {name} is within no group of parameters")
        };
        let known = object.keys().cloned().collect::<Vec<_>>().join(", ");
        at = object.get_mut(name).with_context(|| format!("{path}: there is no {name}, but {known}"))?;
    }
    *at = value;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;
    use vision::detect::{Grouping, Nested};

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        parameters: ParameterArgs,
    }

    fn of(args: &[&str]) -> anyhow::Result<DetectParams> {
        let args = std::iter::once(&"x").chain(args);
        Line::try_parse_from(args)?.parameters.parameters()
    }

    #[test]
    fn nothing_said_is_the_defaults() {
        assert_eq!(of(&[]).unwrap(), DetectParams::default());
        assert_eq!(Line::parse_from(["x"]).parameters.name(), "default");
    }

    /// The preset first, then the file, then flags and `--set`.
    #[test]
    fn others_change_the_preset() {
        let paper = Preset::Paper.params().detect;
        assert_eq!(of(&["--preset=paper"]).unwrap(), paper);
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("p.json");
        std::fs::write(&file, r#"{"relaxation": {"linear_weight": 1.5}}"#).unwrap();
        let changed = of(&["--preset=paper", "--params", file.to_str().unwrap(), "--scales=1"]).unwrap();
        assert!((changed.relaxation.linear_weight - 1.5).abs() < 1e-12 && changed.quads.scales == 1);
        assert_eq!((changed.similarity, changed.tiling), (paper.similarity, paper.tiling));
        assert_eq!(changed.quads.grouping, Grouping::Relaxation);
        assert!(of(&["--preset=papers"]).unwrap_err().to_string().contains("default, paper"));
        assert_eq!(
            Line::parse_from(["x", "--preset=paper", "--scales=1"]).parameters.name(),
            "paper scales=1"
        );
    }

    #[test]
    fn every_flag_reaches_its_parameter() {
        let p = of(&[
            "--grouping=relaxation",
            "--working-side=900",
            "--scales=1",
            "--min-segment=9",
            "--edge-steps=3,7",
            "--min-support=0.7",
            "--min-score=0.4",
            "--nested=quads",
            "--no-three-sided",
            "--remove-tiling",
        ])
        .unwrap();
        assert_eq!((p.quads.grouping, p.quads.nested), (Grouping::Relaxation, Nested::Quads));
        assert_eq!((p.quads.working_side_px, p.quads.scales), (900, 1));
        assert!((p.segments.min_length_px(100) - 9.0).abs() < 1e-12);
        assert!((p.segments.min_length_px(9000) - 9.0).abs() < 1e-12);
        assert!((p.edges.low - 3.0).abs() < 1e-6 && (p.edges.high - 7.0).abs() < 1e-6);
        assert!(
            (p.quads.min_side_support - 0.7).abs() < 1e-12 && (p.quads.min_probability - 0.4).abs() < 1e-12
        );
        assert!(!p.quads.three_sided && p.tiling.remove);
    }

    #[test]
    fn any_parameter_by_its_path() {
        let p = of(&["--scales=1", "--set", "quads.scales=3", "--set=quads.nested=quads"]).unwrap();
        assert_eq!((p.quads.scales, p.quads.nested), (3, Nested::Quads));
        for (wrong, word) in [
            ("quads.scale=3", "there is no scale"),
            ("quads.scales.x=3", "within no group"),
            ("quads.scales=many", "quads.scales"),
            ("quads.scales", "PATH=VALUE"),
        ] {
            let error = of(&["--set", wrong]).unwrap_err().to_string();
            assert!(error.contains(word), "{wrong}: {error}");
        }
    }

    #[test]
    fn the_name_says_what_is_changed() {
        let line = Line::parse_from([
            "x",
            "--params",
            "a/fine.json",
            "--grouping=relaxation",
            "--set",
            "edges.low=2",
        ]);
        assert_eq!(line.parameters.name(), "fine grouping=relaxation edges.low=2");
    }
}
