//! `waymark-lab evaluate detection`: the detector against labelled pictures. Recall at two
//! overlaps, false quads, corner error, time; by class, stratum, size and angle, with confidence
//! intervals; as a table, JSON, a plot and pictures of the worst. The detector runs on one thread,
//! pictures one after the other.

pub(crate) mod score;
mod easy;
mod report;
mod table;
mod plot;
mod pictures;

use super::{rendered, reviewed::Reviewed, truth::Truth};
use anyhow::Context as _;
use cli::{parameters::ParameterArgs, pictures as files, screen};
use report::Report;
use score::{FOUND, ImageScore};
use sim::views::ViewsParams;
use std::path::{Path, PathBuf};
use vision::{
    detect::{DetectParams, Grouping, QuadParams},
    params::preset::Preset,
};

/// Worst images that are drawn when their number is not given.
const DRAWN: usize = 20;

/// `waymark-lab evaluate detection`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Folders in the evaluation format (each with a truth.json), or `corridor` or `scenes` for
    /// rendered pictures with exact truth.
    #[arg(required = true)]
    sets: Vec<PathBuf>,
    /// Leave out labelled quads with a side shorter than this, in pixels.
    #[arg(long, default_value_t = 0.0)]
    min_side_px: f64,
    /// Also evaluate these parameters: a file as for --params, `relaxation` for the paper's
    /// grouping, `paper` for its preset, or one change as for --set. May be repeated.
    #[arg(long, value_name = "FILE|relaxation|paper|PATH=VALUE")]
    compare: Vec<PathBuf>,
    /// One JSON object per set and parameters instead of tables.
    #[arg(long)]
    json: bool,
    /// Write an SVG picture: recall over overlap and over size, distribution of the corner errors.
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
    /// Name the worst images (missed and false quads first, then loose and inexact ones).
    #[arg(long, value_name = "N")]
    worst: Option<usize>,
    /// Write the worst images (20 without --worst) with labelled and detected quads drawn into this
    /// folder.
    #[arg(long, value_name = "DIR")]
    draw: Option<PathBuf>,
    /// Name every labelled quad that was missed and every false one.
    #[arg(long)]
    misses: bool,
    /// List of real quads that the set does not label, reviewed by a person: false quads on them
    /// are counted apart. Default: the list that comes with the program, if there is one for the
    /// set.
    #[arg(long, value_name = "FILE")]
    reviewed: Option<PathBuf>,
    /// Write the rendered pictures to this folder, as a set like any other.
    #[arg(long, value_name = "DIR")]
    keep: Option<PathBuf>,
    /// Rendered views of the corridor, or scenes.
    #[arg(long, default_value_t = 300, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    views: u32,
    /// Seed of the rendered views.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    #[command(flatten)]
    parameters: ParameterArgs,
}

/// Parameters with the name they go by in the report.
struct Named {
    name: String,
    params: DetectParams,
}

pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    let all = parameters(args)?;
    let mut reports = Vec::new();
    for folder in &args.sets {
        let views = ViewsParams { seed: args.seed, views: args.views as usize, ..Default::default() };
        let (folder, _keep) = rendered::folder(folder, args.keep.as_deref(), &views)?;
        let truth = Truth::read(&folder)?;
        let reviewed = Reviewed::of(&truth.name, args.reviewed.as_deref())?;
        for named in &all {
            let report = evaluate(&truth, &reviewed, args, named);
            screen::say(&if args.json { serde_json::to_string(&report)? } else { table::table(&report) });
            if let Some(folder) = &args.draw {
                let folder = if all.len() > 1 { folder.join(&named.name) } else { folder.clone() };
                pictures::draw_worst(&folder, &truth, &report.scores, args.worst.unwrap_or(DRAWN))?;
            }
            reports.push(report);
        }
    }
    if let Some(path) = &args.plot {
        std::fs::write(path, plot::svg(&reports))
            .with_context(|| format!("cannot write {}", path.display()))?;
    }
    Ok(())
}

fn parameters(args: &Args) -> anyhow::Result<Vec<Named>> {
    let stem = |path: &Path| path.file_stem().map_or(String::new(), |s| s.to_string_lossy().into_owned());
    let mut all = vec![Named { name: args.parameters.name(), params: args.parameters.parameters()? }];
    for other in &args.compare {
        if let Some(assignment) = other.to_str().filter(|text| text.contains('=')) {
            let changed = args.parameters.with(assignment);
            all.push(Named { name: changed.name(), params: changed.parameters()? });
            continue;
        }
        let params = if other.as_os_str() == "relaxation" {
            let quads = QuadParams { grouping: Grouping::Relaxation, ..QuadParams::default() };
            DetectParams { quads, ..DetectParams::default() }
        } else if other.as_os_str() == "paper" {
            Preset::Paper.params().detect
        } else {
            files::detect_params(Preset::Default, Some(other))?
        };
        all.push(Named { name: stem(other), params });
    }
    Ok(all)
}

fn evaluate(truth: &Truth, reviewed: &Reviewed, args: &Args, named: &Named) -> Report {
    let (mut scores, mut unreadable) = (Vec::new(), 0);
    let progress = screen::progress(truth.images.len(), "detecting");
    for image in &truth.images {
        progress.inc(1);
        if image.whole_image {
            continue; // a crop has no border to find
        }
        let picture = match files::read_picture(&image.path) {
            Ok(picture) => picture,
            Err(error) => {
                unreadable += 1;
                screen::complain(&format!("{}: {error}", image.path.display()));
                continue;
            }
        };
        let reviewed_quads = reviewed.quads(&image.file);
        let score = score::score(image, &picture, &named.params, args.min_side_px, reviewed_quads);
        if args.misses {
            name_misses(&score);
        }
        scores.push(score);
    }
    progress.finish_and_clear();
    Report::new(&truth.name, &named.name, scores, unreadable, args.worst.unwrap_or(0))
}

fn name_misses(score: &ImageScore) {
    for label in score.labels.iter().filter(|l| l.iou < FOUND) {
        screen::complain(&format!(
            "missed {} {} best IoU {:.2}{}",
            score.file,
            words(&label.corners),
            label.iou,
            if label.is_easy { ", easy" } else { "" }
        ));
    }
    for quad in score.false_quads.iter().flatten() {
        let what = quad.reviewed.as_ref().map_or(String::new(), |what| format!(" reviewed: {what}"));
        screen::complain(&format!("false {} {}{what}", score.file, words(&quad.corners)));
    }
}

/// Corners as the reviewed lists have them.
fn words(corners: &vision::geometry::Corners) -> String {
    let points = corners.points().map(|p| format!("[{:.1}, {:.1}]", p.x, p.y));
    format!("[{}]", points.join(", "))
}
