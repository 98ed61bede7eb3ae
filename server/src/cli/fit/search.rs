//! `waymark fit search`: the two networks of the search from labelled pictures. Labels in, parameters out; the training
//! is `vision`'s.

use super::{data, source};
use crate::cli::{evaluate::rendered, evaluate::truth::Truth, parameters::ParameterArgs, screen};
use anyhow::Context as _;
use serde::Serialize;
use serde_json::json;
use sim::views::ViewsParams;
use std::path::{Path, PathBuf};
use vision::{
    detect::{
        fitting::{Example, Rivals, TrainParams, held_out, to_choose, to_tell},
        network::Network,
    },
    params::DetectParams,
};

/// A first choice that is off by so much more than the best rival, in pixels of the working image, is right.
const RIGHT_PX: f64 = 1.5;

/// `waymark fit search`.
#[derive(Debug, clap::Args)]
pub(crate) struct SearchArgs {
    /// Folders in the evaluation format, or `corridor` for rendered views.
    #[arg(required = true)]
    sets: Vec<PathBuf>,
    /// How many times the labels of a set count; 1 where nothing is said. May be repeated.
    #[arg(long, value_name = "SET=TIMES", value_parser = named_weight)]
    weight: Vec<(String, f64)>,
    /// Sides of labelled quads with a shorter side than this, in pixels of the working image, are not learnt from.
    #[arg(long, default_value_t = 18.0)]
    min_side_px: f64,
    /// Parts that the images are dealt to; each is held out once.
    #[arg(long, default_value_t = 6, value_parser = clap::value_parser!(u32).range(2..=1000))]
    folds: u32,
    /// Hidden units of the network of sides, and of the network of things.
    #[arg(long, default_values_t = [16, 8], num_args = 2, value_names = ["SIDES", "THINGS"])]
    hidden: Vec<usize>,
    /// How much their weights are kept small.
    #[arg(long, default_values_t = [5.0, 10.0], num_args = 2, value_names = ["SIDES", "THINGS"])]
    ridge: Vec<f64>,
    /// Steps of their training.
    #[arg(long, default_values_t = [500, 400], num_args = 2, value_names = ["SIDES", "THINGS"])]
    steps: Vec<usize>,
    /// Write the networks as parameters here, for --params.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Write the networks as the source file `vision/src/detect/learnt.rs` here; run `cargo fmt` after.
    #[arg(long, value_name = "FILE")]
    rust: Option<PathBuf>,
    /// Rendered views, where `corridor` is among the sets.
    #[arg(long, default_value_t = 300, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    views: u32,
    /// The rendered views and the first weights follow from it.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// One JSON object instead of a table.
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

/// How well one network does.
#[derive(Debug, Serialize)]
struct Line {
    network: &'static str,
    /// Share of the sides whose first choice is as near as the best line, within 1.5 px.
    sides_right: f64,
    /// Mean distance of the first choice from the labelled side, px of the working image.
    side_off_px: f64,
    /// Share of things that are told to be things, and false ones an image that are.
    things_kept: f64,
    false_per_image: f64,
}

#[derive(Debug, Serialize)]
struct Report {
    images: usize,
    sides: usize,
    lines: usize,
    things: usize,
    no_things: usize,
    results: Vec<Line>,
}

/// Runs it.
pub(super) fn run(args: &SearchArgs) -> anyhow::Result<()> {
    let mut params = args.parameters.parameters()?;
    let mut sets = Vec::new();
    for set in &args.sets {
        let views = ViewsParams { seed: args.seed, views: args.views as usize, ..ViewsParams::default() };
        let (folder, keep) = rendered::folder(set, None, &views)?;
        let truth = Truth::read(&folder)?;
        let weight =
            args.weight.iter().find(|(name, _)| *name == truth.name).map_or(1.0, |(_, times)| *times);
        sets.push((truth, weight, keep));
    }
    let each = |i: usize| TrainParams {
        hidden: args.hidden[i],
        ridge: args.ridge[i],
        steps: args.steps[i],
        seed: args.seed,
        ..TrainParams::default()
    };
    let (for_sides, for_things) = (each(0), each(1));
    let present = [params.quads.side_network().clone(), params.quads.thing_network().clone()];
    let gather = |params: &DetectParams| {
        let mut data = data::Data::default();
        for (truth, weight, _) in &sets {
            data.add(truth, *weight, params, args.min_side_px)?;
        }
        anyhow::Ok(data)
    };
    let data = gather(&params)?;
    let progress = screen::progress(4, "training");
    let side_model = to_choose(&data.sides, &for_sides).context("the network of sides")?;
    progress.inc(1);
    let train = |r: &[Rivals]| to_choose(r, &for_sides);
    let sides_out = held_out(&data.sides, args.folds as usize, |r| r.group, train, off)?;
    progress.inc(1);
    // Things are told by their sides as the new network places them.
    params.quads.side_model = Some(side_model.clone());
    let things = gather(&params)?.things;
    let thing_model = to_tell(&things, &for_things).context("the network of things")?;
    progress.inc(1);
    let tell = |e: &[Example]| to_tell(e, &for_things);
    let things_out = held_out(&things, args.folds as usize, |e| e.group, tell, |n, e| n.output(&e.features))?;
    progress.finish_and_clear();
    let judged = |name, side: Vec<[f64; 2]>, things: &[Example], odds: Vec<f64>| {
        line(name, &side, things, &odds, params.quads.min_probability, data.images)
    };
    let by = |net: &Network, things: &[Example]| things.iter().map(|e| net.output(&e.features)).collect();
    let sides_by = |net: &Network| data.sides.iter().map(|r| off(net, r)).collect();
    let results = vec![
        judged("in use", sides_by(&present[0]), &data.things, by(&present[1], &data.things)),
        judged("new, held out", sides_out, &things, things_out),
        judged("new, same images", sides_by(&side_model), &things, by(&thing_model, &things)),
    ];
    let report = Report {
        images: data.images,
        sides: data.sides.len(),
        lines: data.sides.iter().map(|r| r.off.len()).sum(),
        things: things.iter().filter(|e| e.is_one).count(),
        no_things: things.iter().filter(|e| !e.is_one).count(),
        results,
    };
    keep(args, [side_model, thing_model])?;
    screen::say(&if args.json { serde_json::to_string(&report)? } else { table(&report, args.folds) });
    Ok(())
}

/// Writes the networks where they are wanted.
fn keep(args: &SearchArgs, [side, thing]: [Network; 2]) -> anyhow::Result<()> {
    let models = [("side_model", source::rounded(side)), ("thing_model", source::rounded(thing))];
    if let Some(path) = &args.out {
        let [side, thing] = &models;
        write(
            path,
            &serde_json::to_string(&json!({"quads": {"side_model": side.1, "thing_model": thing.1}}))?,
        )?;
    }
    if let Some(path) = &args.rust {
        write(path, &source::source(&models))?;
    }
    Ok(())
}

fn write(path: &Path, text: &str) -> anyhow::Result<()> {
    std::fs::write(path, text).with_context(|| format!("cannot write {}", path.display()))
}

/// How far the first choice is off, and the best rival; of equal outputs the earlier.
fn off(net: &Network, r: &Rivals) -> [f64; 2] {
    let outputs: Vec<f64> = r.features.iter().map(|f| net.output(f)).collect();
    let first = (0..outputs.len()).reduce(|a, b| if outputs[b] > outputs[a] { b } else { a });
    [first.map_or(f64::INFINITY, |i| r.off[i]), r.off.iter().copied().fold(f64::INFINITY, f64::min)]
}

fn line(
    network: &'static str,
    sides: &[[f64; 2]],
    things: &[Example],
    odds: &[f64],
    min_probability: f64,
    images: usize,
) -> Line {
    let n = sides.len().max(1) as f64;
    let told = |is_one: bool| {
        let yes =
            |(e, o): &(&Example, &f64)| e.is_one == is_one && 1.0 / (1.0 + (-**o).exp()) >= min_probability;
        things.iter().zip(odds).filter(yes).count() as f64
    };
    let ones = things.iter().filter(|e| e.is_one).count().max(1) as f64;
    Line {
        network,
        sides_right: sides.iter().filter(|[first, best]| first - best < RIGHT_PX).count() as f64 / n,
        side_off_px: sides.iter().map(|s| s[0]).sum::<f64>() / n,
        things_kept: told(true) / ones,
        false_per_image: told(false) / images.max(1) as f64,
    }
}

fn table(r: &Report, folds: u32) -> String {
    let mut lines = vec![
        format!(
            "{} images: {} sides with {} lines beside them; {} quads that are things, {} that are not",
            r.images, r.sides, r.lines, r.things, r.no_things
        ),
        format!(
            "  {:<18} sides right    off, px   things kept   false an image   ({folds} folds)",
            "networks"
        ),
    ];
    lines.extend(r.results.iter().map(|l| {
        format!(
            "  {:<18} {:11.3} {:10.2} {:13.3} {:16.3}",
            l.network, l.sides_right, l.side_off_px, l.things_kept, l.false_per_image
        )
    }));
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_by_hand() {
        let one = |is_one| Example { group: 0, weight: 1.0, features: vec![], is_one };
        let things = [one(true), one(true), one(false), one(false)];
        // Odds of even are a half: kept.
        let l = line("x", &[[2.0, 1.0], [4.0, 1.0]], &things, &[0.0, -1.0, 3.0, -3.0], 0.5, 4);
        assert!((l.sides_right - 0.5).abs() < 1e-12 && (l.side_off_px - 3.0).abs() < 1e-12);
        assert!((l.things_kept - 0.5).abs() < 1e-12 && (l.false_per_image - 0.25).abs() < 1e-12);
    }

    #[test]
    fn weights_are_checked() {
        assert_eq!(named_weight("museum=3"), Ok(("museum".into(), 3.0)));
        for wrong in ["museum", "museum=", "museum=0", "museum=inf"] {
            assert!(named_weight(wrong).is_err(), "{wrong}");
        }
    }
}
