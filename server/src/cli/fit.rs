//! `waymark fit`: parameters of the detector that are learnt from labelled pictures, each with what it is worth on
//! pictures that were held out. Prints parameters; changes nothing.

use super::{evaluate::rendered, evaluate::truth::Truth, parameters::ParameterArgs, pictures, screen};
use anyhow::Context as _;
use serde::Serialize;
use serde_json::json;
use sim::views::ViewsParams;
use std::path::{Path, PathBuf};
use vision::{
    detect::{
        border_model::{BorderModel, FEATURES},
        candidates,
        fitting::{Choice, FitParams, Rivals, cross_validate, fit, rank},
        pyramid,
        quads::Corners,
    },
    geometry::polygon,
    params::DetectParams,
    trace::NoTrace,
};

/// A candidate that overlaps a labelled quad by less is no rival of it.
const MIN_OVERLAP: f64 = 0.1;
/// A labelled quad whose best candidate overlaps by less has no right one.
const MIN_BEST: f64 = 0.5;

/// What to fit.
#[derive(Debug, clap::Subcommand)]
pub(crate) enum Command {
    /// The weights by which the search ranks rival borders of one thing.
    ///
    /// Every labelled quad wholly in view has rivals: what the search proposes there. The weights are those of a
    /// conditional logit that makes the rival nearest to the label the likeliest choice. How often the first choice is
    /// right is given for the present weights, for images held out from the fit in turn, and for the best choice there
    /// is. The last line (all of it with --out) is a file for --params.
    Border(Box<BorderArgs>),
}

/// `waymark fit border`.
#[derive(Debug, clap::Args)]
pub(crate) struct BorderArgs {
    /// Folders in the evaluation format, or `corridor` for rendered views.
    #[arg(required = true)]
    sets: Vec<PathBuf>,
    /// Parts that the images are dealt to; each is held out once.
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u32).range(2..=1000))]
    folds: u32,
    /// Weight of the squares of the weights (of features brought to one deviation): more for fewer labels.
    #[arg(long, default_value_t = 1.0)]
    ridge: f64,
    /// Rivals that overlap by so much less than the best one are as right.
    #[arg(long, default_value_t = 0.02)]
    tie: f64,
    /// Write the fitted weights as parameters here.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Write every rival (image, label, overlap, features) as CSV here, for other fits.
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Rendered views, where `corridor` is among the sets.
    #[arg(long, default_value_t = 300, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    views: u32,
    /// The rendered views follow from it.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// End with one JSON object instead of a table.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    parameters: ParameterArgs,
}

/// How good first choices are.
#[derive(Debug, Serialize)]
struct Line {
    chooser: &'static str,
    recall_70: f64,
    recall_85: f64,
    mean_overlap: f64,
}

#[derive(Debug, Serialize)]
struct Report {
    images: usize,
    /// Labelled quads with rivals to choose from, and those of which no candidate is near.
    quads: usize,
    without_candidate: usize,
    candidates: usize,
    choices: Vec<Line>,
    params: serde_json::Value,
}

/// Rivals of all sets.
#[derive(Default)]
struct Data {
    rivals: Vec<Rivals>,
    images: usize,
    without_candidate: usize,
    csv: String,
}

/// Runs one fit.
pub(crate) fn run(command: &Command) -> anyhow::Result<()> {
    match command {
        Command::Border(args) => border(args),
    }
}

fn border(args: &BorderArgs) -> anyhow::Result<()> {
    let params = args.parameters.parameters()?;
    let mut data = Data::default();
    for set in &args.sets {
        let views = ViewsParams { seed: args.seed, views: args.views as usize, ..ViewsParams::default() };
        let (folder, _keep) = rendered::folder(set, None, &views)?;
        gather(&Truth::read(&folder)?, &params, &mut data)?;
    }
    if let Some(path) = &args.csv {
        std::fs::write(path, &data.csv).with_context(|| format!("cannot write {}", path.display()))?;
    }
    let how = FitParams { ridge: args.ridge, tie: args.tie };
    let present = &params.quads.border_model.weights;
    let held_out = cross_validate(&data.rivals, args.folds as usize, &how)?;
    let weights = fit(&data.rivals, &how)?;
    let of = |rank: &dyn Fn(&Rivals, usize) -> f64| Choice::of(&data.rivals, rank);
    let choices = vec![
        line("present weights", of(&|r, i| rank(present, &r.features[i]))),
        line("fitted, held out", held_out),
        line("fitted, same images", of(&|r, i| rank(&weights, &r.features[i]))),
        line("best there is", of(&|r, i| r.overlap[i])),
    ];
    let weights: [f64; FEATURES] =
        weights.try_into().map_err(|w: Vec<f64>| anyhow::anyhow!("{} weights", w.len()))?;
    let model = BorderModel { weights: weights.map(|w| (w * 1e4).round() / 1e4) };
    let found = json!({"quads": {"border_model": model}});
    if let Some(path) = &args.out {
        std::fs::write(path, serde_json::to_vec_pretty(&found)?)
            .with_context(|| format!("cannot write {}", path.display()))?;
    }
    let report = Report {
        images: data.images,
        quads: data.rivals.len(),
        without_candidate: data.without_candidate,
        candidates: data.rivals.iter().map(|r| r.overlap.len()).sum(),
        choices,
        params: found,
    };
    screen::say(&if args.json { serde_json::to_string(&report)? } else { table(&report, args.folds)? });
    Ok(())
}

fn line(chooser: &'static str, c: Choice) -> Line {
    let share = |count: usize| count as f64 / (c.rivals.max(1)) as f64;
    Line { chooser, recall_70: share(c.found_70), recall_85: share(c.found_85), mean_overlap: c.mean_overlap }
}

/// Adds the rivals of a set's labelled quads.
fn gather(truth: &Truth, params: &DetectParams, data: &mut Data) -> anyhow::Result<()> {
    let progress = screen::progress(truth.images.len(), "searching");
    for image in &truth.images {
        progress.inc(1);
        let counts = |q: &&super::evaluate::truth::TruthQuad| q.counts();
        let labels: Vec<Corners> = image.quads.iter().filter(counts).map(|q| q.corners).collect();
        if image.whole_image || labels.is_empty() {
            continue;
        }
        let gray = pictures::read(&image.path).with_context(|| image.path.display().to_string())?;
        let factor = pyramid::working_factor(&gray, params.quads.working_side_px);
        let work = pyramid::reduce(&gray, factor);
        let mut rivals: Vec<Rivals> =
            labels.iter().map(|_| Rivals { group: data.images, features: vec![], overlap: vec![] }).collect();
        for candidate in candidates(&work, params, &mut NoTrace).0 {
            let Some(corners) = candidate.quad.corners_px.scaled(factor as f64) else { continue };
            let Some((label, overlap)) = nearest(&labels, &corners) else { continue };
            rivals[label].features.push(candidate.features.to_vec());
            rivals[label].overlap.push(overlap);
        }
        for (label, rivals) in rivals.into_iter().enumerate() {
            if rivals.overlap.iter().any(|o| *o >= MIN_BEST) {
                data.csv.push_str(&csv(&image.path, label, &rivals));
                data.rivals.push(rivals);
            } else {
                data.without_candidate += 1;
            }
        }
        data.images += 1;
    }
    progress.finish_and_clear();
    Ok(())
}

/// The labelled quad that a candidate overlaps most, if by enough.
fn nearest(labels: &[Corners], corners: &Corners) -> Option<(usize, f64)> {
    let overlap = |l: &Corners| polygon::iou(l.points(), corners.points());
    let best = labels.iter().map(overlap).enumerate().reduce(|a, b| if b.1 > a.1 { b } else { a });
    best.filter(|(_, overlap)| *overlap >= MIN_OVERLAP)
}

fn csv(image: &Path, label: usize, rivals: &Rivals) -> String {
    let line = |(features, overlap): (&Vec<f64>, &f64)| {
        let features: Vec<String> = features.iter().map(|f| format!("{f:.5}")).collect();
        format!("{},{label},{overlap:.5},{}\n", image.display(), features.join(","))
    };
    rivals.features.iter().zip(&rivals.overlap).map(line).collect()
}

fn table(r: &Report, folds: u32) -> anyhow::Result<String> {
    let mut lines = vec![
        format!(
            "{} images, {} labelled quads with {} candidates; {} more have none near them",
            r.images, r.quads, r.candidates, r.without_candidate
        ),
        format!("  {:<22} IoU 0.7    0.85    mean    (first choice among rivals; {folds} folds)", ""),
    ];
    lines.extend(r.choices.iter().map(|c| {
        format!("  {:<22} {:7.3} {:7.3} {:7.3}", c.chooser, c.recall_70, c.recall_85, c.mean_overlap)
    }));
    lines.push(serde_json::to_string(&r.params)?);
    Ok(lines.join("\n"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn card(x: f64) -> Corners {
        Corners::try_from([[x, 0.0], [x + 10.0, 0.0], [x + 10.0, 10.0], [x, 10.0]]).unwrap()
    }

    #[test]
    fn a_candidate_belongs_to_the_label_it_overlaps_most() {
        let labels = [card(0.0), card(12.0)];
        assert_eq!(nearest(&labels, &card(9.0)).unwrap().0, 1);
        assert!((nearest(&labels, &card(-5.0)).unwrap().1 - 1.0 / 3.0).abs() < 1e-12);
        // 1 px of 10 is 1/19; nothing overlaps by a tenth.
        assert_eq!(nearest(&labels, &card(-9.0)), None);
        assert_eq!(nearest(&[], &card(0.0)), None);
    }

    #[test]
    fn one_line_a_candidate() {
        let rivals =
            Rivals { group: 0, features: vec![vec![1.0, -0.5], vec![0.0, 2.0]], overlap: vec![0.9, 0.25] };
        let text = csv(Path::new("a/b.png"), 3, &rivals);
        assert_eq!(text, "a/b.png,3,0.90000,1.00000,-0.50000\na/b.png,3,0.25000,0.00000,2.00000\n");
    }
}
