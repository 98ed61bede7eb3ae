//! `waymark-lab train detector`: trains border model and quad classifier from labelled pictures.
//! Labels in, parameters out; `held_out` has the figures on held-out pictures.

use super::network_training::{ChoiceExample, LabelledExample, TrainParams, train_choice, train_classifier};
use super::{
    data::{Data, Set},
    held_out::{self, HeldOutFigures, Line},
    provenance::Provenance,
    source,
};
use crate::evaluate::{rendered, reviewed::Reviewed, truth::Truth};
use anyhow::Context as _;
use cli::{parameters::ParameterArgs, scratch, screen};
use serde::Serialize;
use serde_json::json;
use sim::{scenes::ScenesParams, views::ViewsParams};
use std::path::{Path, PathBuf};
use vision::detect::{DetectParams, border_model::network::Network};

/// `waymark-lab train detector`.
#[derive(Debug, clap::Args)]
pub(crate) struct DetectorArgs {
    /// Folders in the evaluation format, folders with a reviewed list (see docs/EVALUATION.md), or
    /// `corridor` for rendered views, besides the rendered scenes.
    sets: Vec<PathBuf>,
    /// Rendered scenes to learn from; 0 for none.
    #[arg(long, default_value_t = 600, value_parser = clap::value_parser!(u32).range(0..=10_000))]
    scenes: u32,
    /// A folder of pictures to hang in the scenes beside generated ones.
    #[arg(long, value_name = "DIR")]
    pictures: Option<PathBuf>,
    /// Weight of the labels of a set; default 1. May be repeated.
    #[arg(long, value_name = "SET=TIMES", value_parser = named_weight)]
    weight: Vec<(String, f64)>,
    /// Sides of labelled quads with a shorter side than this, in pixels of the working image, are
    /// not learnt from.
    #[arg(long, default_value_t = 18.0)]
    min_side_px: f64,
    /// Parts that the images are dealt to; each is held out once.
    #[arg(long, default_value_t = 2, value_parser = clap::value_parser!(u32).range(2..=1000))]
    folds: u32,
    /// Hidden units of the border model, and of the quad classifier.
    #[arg(long, default_values_t = [16, 8], num_args = 2, value_names = ["BORDER", "QUADS"])]
    hidden: Vec<usize>,
    /// Ridge that keeps their weights small.
    #[arg(long, default_values_t = [5.0, 10.0], num_args = 2, value_names = ["BORDER", "QUADS"])]
    ridge: Vec<f64>,
    /// Steps of their training.
    #[arg(long, default_values_t = [500, 400], num_args = 2, value_names = ["BORDER", "QUADS"])]
    steps: Vec<usize>,
    /// Write the networks as parameters here, for --params.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Write the networks as the source file `vision/src/detect/border_model/network_weights.rs`
    /// here; run `cargo fmt` after.
    #[arg(long, value_name = "FILE")]
    rust: Option<PathBuf>,
    /// Rendered views to learn from, where `corridor` is among the sets.
    #[arg(long, default_value_t = 500, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    views: u32,
    /// Seed of the rendered pictures and of the initial weights.
    #[arg(long, default_value_t = 2)]
    seed: u64,
    /// Seed of the rendered pictures for evaluation: another than --seed.
    #[arg(long, default_value_t = 1)]
    held_out_seed: u64,
    /// Rendered pictures of either kind for evaluation; 0 for none.
    #[arg(long, default_value_t = 300, value_parser = clap::value_parser!(u32).range(0..=10_000))]
    held_out_views: u32,
    /// Print one JSON object instead of a table.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    parameters: ParameterArgs,
}

fn named_weight(text: &str) -> Result<(String, f64), String> {
    let (name, times) = text.split_once('=').ok_or("not SET=TIMES")?;
    let times: f64 = times.parse().map_err(|error| format!("{times}: {error}"))?;
    if times > 0.0 && times.is_finite() { Ok((name.to_owned(), times)) } else { Err("not above 0".into()) }
}

#[derive(Debug, Serialize)]
struct Report {
    images: usize,
    sides: usize,
    lines: usize,
    objects: usize,
    no_objects: usize,
    /// Factor of Platt scaling of the quad classifier.
    calibration: f64,
    results: Vec<Line>,
    detection: Vec<HeldOutFigures>,
}

/// Names of rendered sets.
const CORRIDOR: &str = "corridor";
const SCENES: &str = "scenes";

pub(super) fn run(args: &DetectorArgs) -> anyhow::Result<()> {
    anyhow::ensure!(args.seed != args.held_out_seed, "--held-out-seed: must differ from --seed");
    let params = args.parameters.parameters()?;
    let (sets, _keep) = sets(args)?;
    anyhow::ensure!(!sets.is_empty(), "no sets, and --scenes 0: nothing to learn from");
    let each = |i: usize| TrainParams {
        hidden: args.hidden[i],
        ridge: args.ridge[i],
        steps: args.steps[i],
        seed: args.seed,
        ..TrainParams::default()
    };
    let fit = Fit { sets: &sets, params: &params, min_side_px: args.min_side_px, how: [each(0), each(1)] };
    let present = [params.quads.side_network().clone(), params.quads.thing_network().clone()];
    let data = Data::gather(&sets, &params, args.min_side_px)?;
    let in_use = held_out::line("in use", &data, &data, &present, &params);
    // Every part is evaluated by networks from which it was held out.
    let mut parts = Vec::new();
    for part in 0..args.folds as usize {
        parts.push(fit.networks(&data.sides, Some(part))?);
    }
    let all = fit.networks(&data.sides, None)?;
    let calibration = held_out::calibration(&parts)?;
    let final_networks =
        [all.networks[0].clone(), calibration.applied(all.networks[1].clone())].map(source::rounded);
    let results = vec![
        in_use,
        held_out::line_of_parts("new, held out", &data, &parts, &calibration, &params),
        held_out::line("new, same images", &data, &all.data, &final_networks, &params),
    ];
    let networks: Vec<[Network; 2]> = parts
        .into_iter()
        .map(|p| [p.networks[0].clone(), calibration.applied(p.networks[1].clone())])
        .collect();
    let mut detection = held_out::photographs(&sets, &networks, &params)?;
    detection.extend(others(args, &sets, &final_networks, &params)?);
    let report = Report {
        images: data.images,
        sides: data.sides.len(),
        lines: data.sides.iter().map(|r| r.off.len()).sum(),
        objects: all.data.quads.iter().filter(|e| e.is_one).count(),
        no_objects: all.data.quads.iter().filter(|e| !e.is_one).count(),
        calibration: calibration.factor,
        results,
        detection,
    };
    write_networks(args, final_networks)?;
    screen::say(&if args.json { serde_json::to_string(&report)? } else { table(&report, args.folds) });
    Ok(())
}

/// The sets to learn from, and the folders of those that were rendered.
fn sets(args: &DetectorArgs) -> anyhow::Result<(Vec<Set>, Vec<scratch::Folder>)> {
    let (mut sets, mut folders) = (Vec::new(), Vec::new());
    let mut add = |truth: Truth| {
        let named = args.weight.iter().find(|(name, _)| *name == truth.name);
        sets.push(Set::new(truth, named.map_or(1.0, |(_, times)| *times), args.folds as usize));
    };
    for set in &args.sets {
        let views = ViewsParams { seed: args.seed, views: args.views as usize, ..ViewsParams::default() };
        let (folder, rendered) = rendered::folder(set, None, &views)?;
        folders.extend(rendered);
        let name = folder.file_name().map_or(String::new(), |n| n.to_string_lossy().into_owned());
        let list = Reviewed::of(&name, None)?;
        // A folder without truth.json has a reviewed list.
        let unlabelled = !folder.join("truth.json").exists() && list.pictures().next().is_some();
        add(if unlabelled {
            Truth::of_reviewed(&name, &folder, &list)
        } else {
            Truth::read(&folder)?.with_reviewed(&list)
        });
    }
    if args.scenes > 0 {
        let folder = scratch::Folder::new("scenes")?;
        let params =
            ScenesParams { seed: args.seed, scenes: args.scenes as usize, ..ScenesParams::default() };
        let pictures = args.pictures.as_deref().map(rendered::pictures).transpose()?.unwrap_or_default();
        rendered::write_scenes(folder.path(), &params, pictures)?;
        add(Truth::read(folder.path())?);
        folders.push(folder);
    }
    Ok((sets, folders))
}

/// Figures of the final networks on rendered pictures of another seed.
fn others(
    args: &DetectorArgs,
    sets: &[Set],
    networks: &[Network; 2],
    params: &DetectParams,
) -> anyhow::Result<Vec<HeldOutFigures>> {
    let mut evaluated = Vec::new();
    for name in [CORRIDOR, SCENES].into_iter().filter(|name| sets.iter().any(|s| s.truth.name == *name)) {
        if args.held_out_views == 0 {
            continue;
        }
        let views = ViewsParams {
            seed: args.held_out_seed,
            views: args.held_out_views as usize,
            ..ViewsParams::default()
        };
        let (folder, _keep) = rendered::folder(Path::new(name), None, &views)?;
        let set = Set::new(Truth::read(&folder)?, 1.0, 1);
        let title = format!("{name}, seed {}", args.held_out_seed);
        evaluated.push(held_out::evaluated(&title, &set, std::slice::from_ref(networks), params)?);
    }
    Ok(evaluated)
}

/// What networks are fitted with.
struct Fit<'a> {
    sets: &'a [Set],
    params: &'a DetectParams,
    min_side_px: f64,
    how: [TrainParams; 2],
}

impl Fit<'_> {
    /// Both networks from all but one part of the data. The classifier sees quads as the new border
    /// model places them.
    fn networks(&self, sides: &[ChoiceExample], without: Option<usize>) -> anyhow::Result<held_out::Part> {
        let learnt: Vec<ChoiceExample> = sides.iter().filter(|r| Some(r.group) != without).cloned().collect();
        let border_model = train_choice(&learnt, &self.how[0]).context("the border model")?;
        let mut params = self.params.clone();
        params.quads.border_model = Some(border_model.clone());
        let data = Data::gather(self.sets, &params, self.min_side_px)?;
        let learnt: Vec<LabelledExample> =
            data.quads.iter().filter(|e| Some(e.group) != without).cloned().collect();
        let classifier = train_classifier(&learnt, &self.how[1]).context("the quad classifier")?;
        Ok(held_out::Part { held_out: without, networks: [border_model, classifier], data })
    }
}

/// Writes the networks to --out and --rust.
fn write_networks(args: &DetectorArgs, [border_model, classifier]: [Network; 2]) -> anyhow::Result<()> {
    let models = [("border_model", border_model), ("quad_classifier", classifier)];
    if let Some(path) = &args.out {
        let [(_, border_model), (_, classifier)] = &models;
        write(
            path,
            &serde_json::to_string(
                &json!({"quads": {"border_model": border_model, "quad_classifier": classifier}}),
            )?,
        )?;
    }
    if let Some(path) = &args.rust {
        let folders: Vec<PathBuf> = args.sets.iter().chain(&args.pictures).cloned().collect();
        let from = Provenance::of_this_run(&folders)?;
        write(path, &source::source(&models, &from))?;
    }
    Ok(())
}

fn write(path: &Path, text: &str) -> anyhow::Result<()> {
    std::fs::write(path, text).with_context(|| format!("cannot write {}", path.display()))
}

fn table(r: &Report, folds: u32) -> String {
    let mut lines = vec![
        format!(
            "{} images: {} sides with {} lines beside them; {} quads on objects, {} false",
            r.images, r.sides, r.lines, r.objects, r.no_objects
        ),
        format!(
            "  {:<18} sides right    off, px  objects kept   false an image   ({folds} folds)",
            "networks"
        ),
    ];
    lines.extend(r.results.iter().map(|l| {
        format!(
            "  {:<18} {:11.3} {:10.2} {:13.3} {:16.3}",
            l.network, l.sides_right, l.side_off_px, l.objects_kept, l.false_per_image
        )
    }));
    lines.push(format!("  log odds of the classifier were scaled by {:.2}", r.calibration));
    lines.push(format!(
        "  {:<34} quads  recall 0.7   0.85  false an image  corner, px",
        "detection, held out"
    ));
    lines.extend(r.detection.iter().map(|d| {
        let rate = d.false_per_image.map_or_else(|| "not labelled".to_owned(), |f| format!("{f:.3}"));
        format!(
            "  {:<34} {:5} {:11.3} {:6.3} {rate:>15} {:11.2}",
            d.set, d.quads, d.recall_70, d.recall_85, d.corner_px
        )
    }));
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_are_checked() {
        assert_eq!(named_weight("museum=3"), Ok(("museum".into(), 3.0)));
        for text in ["museum", "museum=", "museum=0", "museum=inf"] {
            assert!(named_weight(text).is_err(), "{text}");
        }
    }
}
