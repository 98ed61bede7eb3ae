//! `waymark-lab train similarity`: the weights of the six cues (method 2) from labelled pictures.

use super::cue_fit::{FOLDS, FittedSimilarity, LabelledPair, fit, label_pairs, ungraded};
use crate::evaluate::{rendered, truth::Truth};
use anyhow::{Context as _, bail};
use cli::{parameters::ParameterArgs, pictures, screen};
use serde_json::json;
use sim::views::ViewsParams;
use std::path::PathBuf;
use vision::{
    detect::{
        DetectParams,
        edges::edge_map::edges,
        segments::{chains::chains, edge_segments::segments},
    },
    geometry::Corners,
    paper::relaxation::similarity::{self, SimilarityParams},
};

/// Names of the cues c1 to c6.
const CUES: [&str; 6] = ["length ratio", "angle", "squareness", "overlap", "third segment", "profiles"];

/// `waymark-lab train similarity`.
#[derive(Debug, clap::Args)]
pub(crate) struct SimilarityArgs {
    /// Folders in the evaluation format, or `corridor` for rendered views.
    #[arg(required = true)]
    sets: Vec<PathBuf>,
    /// Write the weights and the smallest score here, as parameters for --params.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// One JSON object instead of a table.
    #[arg(long)]
    json: bool,
    /// Leave out every fifth picture of each set, from this one on: to evaluate on those.
    #[arg(long, value_name = "0-4", value_parser = clap::value_parser!(u8).range(0..5))]
    without: Option<u8>,
    /// Rendered views, where `corridor` is among the sets.
    #[arg(long, default_value_t = 300, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    views: u32,
    /// The rendered views follow from it.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    #[command(flatten)]
    parameters: ParameterArgs,
}

pub(crate) fn run(args: &SimilarityArgs) -> anyhow::Result<()> {
    let params = args.parameters.parameters()?;
    let pairs = judged(args, &params)?;
    let fitted = fit(&pairs, &params.similarity)?;
    let found = json!({ "similarity": { "weights": fitted.weights, "min_score": fitted.min_score } });
    if let Some(path) = &args.out {
        std::fs::write(path, format!("{found:#}\n"))
            .with_context(|| format!("cannot write {}", path.display()))?;
    }
    let report = if args.json {
        json(&fitted, &params.similarity).to_string()
    } else {
        table(&fitted, &params.similarity)
    };
    screen::say(&report);
    Ok(())
}

/// Candidate pairs of all completely labelled pictures, judged by their labels.
fn judged(args: &SimilarityArgs, params: &DetectParams) -> anyhow::Result<Vec<LabelledPair>> {
    let keep_all = ungraded(&params.similarity);
    let mut pairs = Vec::new();
    for folder in &args.sets {
        let views = ViewsParams { seed: args.seed, views: args.views as usize, ..ViewsParams::default() };
        let (folder, _keep) = rendered::folder(folder, None, &views)?;
        let truth = Truth::read(&folder)?;
        let walls: Vec<_> = truth.images.iter().filter(|i| !i.whole_image).collect();
        if !walls.iter().any(|i| i.quads_complete) {
            bail!("{} has no picture whose quads are all labelled", folder.display());
        }
        let progress = screen::progress(walls.len(), "pictures");
        for (position, picture) in walls.into_iter().enumerate() {
            progress.inc(1);
            let left_out = args.without.is_some_and(|w| usize::from(w) == position % FOLDS);
            if left_out || !picture.quads_complete {
                continue;
            }
            let image = pictures::read(&picture.path)
                .with_context(|| format!("cannot use {}", picture.path.display()))?;
            let map = edges(&image, &params.edges);
            let found = segments(&chains(&map, &params.chains), &map, &params.segments);
            let candidates = similarity::pairs(&found, &image, &keep_all);
            let quads: Vec<Corners> = picture.quads.iter().map(|q| q.corners).collect();
            pairs.extend(label_pairs(&found, &candidates, &quads, &picture.others, position));
        }
        progress.finish_and_clear();
    }
    Ok(pairs)
}

fn json(fitted: &FittedSimilarity, before: &SimilarityParams) -> serde_json::Value {
    json!({
        "pairs": { "opposite": fitted.counts[0], "others": fitted.counts[1] },
        "before": { "weights": before.weights, "order": fitted.order_before, "others_passing": fitted.passing[0] },
        "fitted": {
            "weights": fitted.weights,
            "min_score": fitted.min_score,
            "order_held_out": fitted.order_after,
            "others_passing_held_out": fitted.passing[1],
        },
        "mean_cues": { "opposite": fitted.mean_cues[0], "others": fitted.mean_cues[1] },
    })
}

fn table(fitted: &FittedSimilarity, before: &SimilarityParams) -> String {
    let mut lines = vec![
        format!("{} pairs of opposite sides, {} other pairs", fitted.counts[0], fitted.counts[1]),
        "cue             before   fitted   mean in pairs   in others".to_owned(),
    ];
    for (c, name) in CUES.iter().enumerate() {
        lines.push(format!(
            "{name:14} {:7.3}  {:7.3}   {:13.3}   {:9.3}",
            before.weights[c], fitted.weights[c], fitted.mean_cues[0][c], fitted.mean_cues[1][c]
        ));
    }
    lines.push(format!("smallest score {:7.3}  {:7.3}", before.min_score, fitted.min_score));
    lines.push(format!(
        "a pair scores above another in {:.4} of cases before, {:.4} after (on pictures it was not fitted on)",
        fitted.order_before, fitted.order_after
    ));
    lines.push(format!(
        "other pairs that pass where 95 % of the pairs do: {:.4} before, {:.4} after (likewise)",
        fitted.passing[0], fitted.passing[1]
    ));
    lines.join("\n")
}
