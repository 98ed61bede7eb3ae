//! `waymark-lab evaluate grids`: how much of grid maps their imported walls explain.

use anyhow::Context as _;
use cli::screen;
use formats::walls::{self, GridReport, ImportOptions, ImportReport};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Maps that constants of the import were chosen on; all others are held out.
const CHOSEN_ON: [&str; 2] = ["willow-2010-0.10", "willow-full-0.05"];

/// `waymark-lab evaluate grids`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// `map_server` YAML files, or folders of them.
    #[arg(required = true)]
    maps: Vec<PathBuf>,
    /// As for `waymark map import`.
    #[arg(long, default_value_t = 0.3)]
    min_length_m: f64,
    /// Draw every map into this folder, as SVG: its cells, its walls, and in red what they do not
    /// explain.
    #[arg(long, value_name = "DIR")]
    draw: Option<PathBuf>,
    /// One JSON object per map instead of the table.
    #[arg(long)]
    json: bool,
}

/// Runs the evaluation.
pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    let options = ImportOptions { min_length_m: args.min_length_m, ..ImportOptions::default() };
    let mut lines = Vec::new();
    if !args.json {
        lines.push(
            "| map | cells occupied, grey | explained | of all occupied | segments | m | on wall cells | |"
                .to_owned(),
        );
        lines.push("|---|---|---|---|---|---|---|---|".to_owned());
    }
    for path in args.maps.iter().map(|p| maps(p)).collect::<anyhow::Result<Vec<_>>>()?.concat() {
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let imported = walls::import(&path, &options).with_context(|| path.display().to_string())?;
        if let (Some(folder), Some(picture)) = (&args.draw, imported.picture()) {
            std::fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
            let file = folder.join(format!("{name}.svg"));
            std::fs::write(&file, picture?).with_context(|| file.display().to_string())?;
        }
        let grid = imported.report.grid.with_context(|| format!("{}: not a grid", path.display()))?;
        lines.push(if args.json {
            json(&name, &imported.report, &grid).to_string()
        } else {
            row(&name, &imported.report, &grid)
        });
    }
    for line in lines {
        screen::say(&line);
    }
    Ok(())
}

/// The maps of a path: itself, or those of a folder.
fn maps(path: &Path) -> anyhow::Result<Vec<PathBuf>> {
    if !path.is_dir() {
        return Ok(vec![path.to_owned()]);
    }
    let name = || path.display().to_string();
    let entries: Result<Vec<PathBuf>, _> =
        std::fs::read_dir(path).with_context(name)?.map(|e| e.map(|e| e.path())).collect();
    let mut found = entries.with_context(name)?;
    found.retain(|p| p.extension().is_some_and(|e| e == "yaml"));
    anyhow::ensure!(!found.is_empty(), "{}: no .yaml of a grid map", name());
    found.sort();
    Ok(found)
}

/// Share of all occupied cells that walls explain; 1 where there are none.
fn occupied_explained(grid: &GridReport) -> f64 {
    if grid.occupied == 0 { 1.0 } else { grid.occupied_explained as f64 / grid.occupied as f64 }
}

fn row(name: &str, report: &ImportReport, grid: &GridReport) -> String {
    format!(
        "| {name} | {}, {} | {:.1} % of {} | {:.1} % | {} | {:.0} | {:.1} % | {} |",
        grid.occupied,
        grid.grey,
        100.0 * grid.share_explained(),
        grid.wall_cells,
        100.0 * occupied_explained(grid),
        report.segments,
        report.length_m,
        100.0 * grid.length_on_wall_cells,
        if CHOSEN_ON.contains(&name) { "chosen on" } else { "held out" },
    )
}

fn json(name: &str, report: &ImportReport, grid: &GridReport) -> Value {
    json!({
        "map": name, "segments": report.segments, "length_m": report.length_m, "occupied": grid.occupied,
        "grey": grid.grey, "free": grid.free, "unknown": grid.unknown, "wall_cells": grid.wall_cells,
        "explained": grid.share_explained(), "occupied_explained": occupied_explained(grid),
        "length_on_wall_cells": grid.length_on_wall_cells, "held_out": !CHOSEN_ON.contains(&name),
    })
}
