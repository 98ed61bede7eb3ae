//! `waymark-lab evaluate calibration`: auto-calibration from views of one quad (method 16; E9, Fig.
//! 17). Error of the focal length over the number of views, on synthetic views and on real boards
//! with a reference calibration; and what `waymark camera calibrate` answers to rendered pictures
//! of canvases with shadows and framed pictures.

mod photoreal;
mod real;
mod sets;
mod synthetic;

use super::{
    chart::{COLOURS, Panel, picture},
    experiment::{say, write_plot},
};
use real::RealSet;
use serde::Serialize;
use std::path::PathBuf;
use synthetic::Curve;

/// Most views of a synthetic trial.
const MAX_VIEWS: usize = 200;
/// Top of the plot's error axis, percent, as the paper's.
const HIGHEST_PERCENT: f64 = 3.0;

/// `waymark-lab evaluate calibration`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Folders with real views of a board: Zhang's Model.txt and data*.txt, OpenCV's yml with
    /// corners, or photographs of a chessboard beside a yml that says its size (then python3 with
    /// OpenCV finds the corners).
    sets: Vec<PathBuf>,
    /// Folder of rendered sets, one a folder: pictures and truth.json. Nothing else is measured
    /// then.
    #[arg(long, value_name = "FOLDER", conflicts_with_all = ["sets", "plot"])]
    photoreal: Option<PathBuf>,
    /// Sets of --photoreal by the numbers of their folders, such as 21-60; all if absent.
    #[arg(long, value_name = "FROM-TO", requires = "photoreal", value_parser = numbers)]
    numbers: Option<[u64; 2]>,
    /// Numbers of views of the synthetic curves.
    #[arg(long, value_delimiter = ',', default_value = "5,10,15,20,30,40,50", value_parser = views)]
    views: Vec<usize>,
    /// Trials a point.
    #[arg(long, default_value_t = 200, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    trials: u32,
    /// Standard deviations of the corners, per coordinate.
    #[arg(long, value_name = "PX", value_delimiter = ',', default_value = "0.3,0.5", value_parser = noise)]
    corner_noise_px: Vec<f64>,
    /// Seed of views and noise.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// The Python that has OpenCV.
    #[arg(long, default_value = "python3")]
    python: PathBuf,
    /// Print one JSON object instead of tables.
    #[arg(long)]
    json: bool,
    /// Write the curves as an SVG picture.
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
}

fn views(text: &str) -> Result<usize, String> {
    let n: usize = text.trim().parse().map_err(|error| format!("{error}"))?;
    if (3..=MAX_VIEWS).contains(&n) { Ok(n) } else { Err(format!("not within 3 to {MAX_VIEWS}")) }
}

fn numbers(text: &str) -> Result<[u64; 2], String> {
    let (from, to) = text.split_once('-').unwrap_or((text, text));
    let number = |t: &str| t.trim().parse::<u64>().map_err(|error| format!("{error}"));
    Ok([number(from)?, number(to)?])
}

fn noise(text: &str) -> Result<f64, String> {
    let px: f64 = text.trim().parse().map_err(|error| format!("{error}"))?;
    if (0.0..=20.0).contains(&px) { Ok(px) } else { Err("not within 0 to 20".to_owned()) }
}

#[derive(Debug, Serialize)]
struct Report {
    seed: u64,
    curves: Vec<Curve>,
    sets: Vec<RealSet>,
    /// Folders that could not be used, and why.
    skipped: Vec<String>,
}

pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    if let Some(folder) = &args.photoreal {
        let mut folders = photoreal::folders(folder)?;
        if let Some([from, to]) = args.numbers {
            let number = |path: &PathBuf| path.file_name().and_then(|n| n.to_str()?.parse::<u64>().ok());
            folders.retain(|path| number(path).is_some_and(|n| (from..=to).contains(&n)));
        }
        let sets = photoreal::evaluated(&folders)?;
        return say(args.json, &sets, || {
            let title = "calibration: pictures of one object, against the true focal length".to_owned();
            std::iter::once(title).chain(photoreal::lines(&sets)).collect()
        });
    }
    let mut curves = vec![];
    for noise_px in &args.corner_noise_px {
        curves.extend(synthetic::curves(&args.views, args.trials as usize, *noise_px, args.seed));
    }
    let (mut sets, mut skipped) = (vec![], vec![]);
    for folder in &args.sets {
        let (found, why) = sets::read(folder, &args.python)?;
        sets.extend(found.iter().map(|set| real::evaluated(set, args.seed)));
        skipped.extend(why);
    }
    let report = Report { seed: args.seed, curves, sets, skipped };
    write_plot(args.plot.as_deref(), || svg(&report))?;
    say(args.json, &report, || table(&report))
}

fn table(report: &Report) -> Vec<String> {
    let mut lines = vec![format!(
        "calibration: error of the focal length in percent, synthetic views of a poster, seed {}",
        report.seed
    )];
    for curve in &report.curves {
        let way = if curve.refined { "refined" } else { "linear" };
        let points: Vec<String> = curve
            .points
            .iter()
            .map(|p| format!("{}: {:.2} ({:.2})", p.views, 100.0 * p.median, 100.0 * p.rms))
            .collect();
        lines.push(format!(
            "  {:.1} px {:<9} {:<8} views: median (RMS) of {}:  {}",
            curve.corner_noise_px,
            curve.constraints,
            way,
            curve.trials,
            points.join("  ")
        ));
    }
    lines.extend(report.sets.iter().flat_map(RealSet::lines));
    lines.extend(report.skipped.iter().map(|why| format!("  skipped: {why}")));
    lines
}

/// Fig. 17: a panel for each corner noise, and one for the real sets' curves.
fn svg(report: &Report) -> String {
    let mut noises: Vec<f64> = vec![];
    for curve in &report.curves {
        if noises.iter().all(|n| (n - curve.corner_noise_px).abs() > 0.0) {
            noises.push(curve.corner_noise_px);
        }
    }
    let mut words: Vec<(&str, String)> = synthetic::SETS
        .iter()
        .zip(COLOURS)
        .map(|((name, ..), colour)| (colour, format!("{name}, linear")))
        .collect();
    words.push(("#333", "C1, refined".into()));
    words.push(("none", format!("medians; seed {}", report.seed)));
    for (set, colour) in report.sets.iter().zip(COLOURS) {
        words.push((colour, format!("{}: one quad, lens fitted, against all its points", set.name)));
    }
    let panels = noises.len() + usize::from(!report.sets.is_empty());
    picture(panels.max(2), &words, |svg| {
        for (i, noise_px) in noises.iter().enumerate() {
            let panel = panel(i, &format!("synthetic, corners {noise_px} px: error of alpha, %"), 50.0);
            panel.axes(svg, &[5.0, 10.0, 20.0, 30.0, 40.0, 50.0]);
            let here = report.curves.iter().filter(|c| (c.corner_noise_px - noise_px).abs() <= 0.0);
            for curve in here.filter(|c| !c.refined || c.constraints == "C1") {
                let set =
                    synthetic::SETS.iter().position(|(name, ..)| *name == curve.constraints).unwrap_or(0);
                let colour = if curve.refined { "#333" } else { COLOURS[set] };
                let line: Vec<(f64, f64)> =
                    curve.points.iter().map(|p| (p.views as f64, 100.0 * p.median)).collect();
                panel.curve(svg, &line, colour);
            }
        }
        if !report.sets.is_empty() {
            let panel = panel(noises.len(), "real views: error of alpha, %", 20.0);
            panel.axes(svg, &[5.0, 10.0, 15.0, 20.0]);
            for (set, colour) in report.sets.iter().zip(COLOURS) {
                let line: Vec<(f64, f64)> =
                    set.by_views.iter().map(|p| (p.views as f64, 100.0 * p.median)).collect();
                panel.curve(svg, &line, colour);
            }
        }
    })
}

fn panel(i: usize, title: &str, most: f64) -> Panel {
    Panel { y: [0.0, HIGHEST_PERCENT], ..Panel::of_shares(i, title, "views", [0.0, most], false) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_figure_has_its_curves() {
        let report = Report {
            seed: 1,
            curves: synthetic::curves(&[5, 8], 4, 0.5, 1),
            sets: vec![],
            skipped: vec!["none: nothing".into()],
        };
        assert_eq!(svg(&report).matches("<polyline").count(), 5);
        assert!(table(&report).iter().any(|l| l.contains("C1+C3") && l.contains("refined")));
        assert!(views("2").is_err() && views("200").is_ok() && noise("20.1").is_err());
    }
}
