//! `waymark map import` and `export`: walls from and to other programs' files.

use super::build::Upload;
use crate::screen;
use anyhow::Context as _;
use client::MapClient;
use formats::{
    map_svg,
    walls::{self, GridReport, ImportOptions, ImportReport, Imported, MapFile},
};
use serde_json::json;
use std::path::PathBuf;

/// `waymark map import`.
#[derive(Debug, clap::Args)]
pub(crate) struct ImportArgs {
    /// A `map_server` YAML file (or its PGM or PNG, with the YAML of the same name beside it), a vector map (`x1, y1, x2,
    /// y2` in metres, one segment a line;
    /// or `.geojson` in map metres: lines are walls with the free side on their left, polygons are rooms with columns for
    /// holes), an SVG floor plan, or a map of `waymark map build`.
    file: PathBuf,
    /// Leave out pieces of a grid's walls shorter than this, metres, but for those that alone explain some cells.
    #[arg(long, default_value_t = 0.3)]
    min_length_m: f64,
    /// Metres of a unit of an SVG floor plan; without it the plan's width and height in mm, cm, in or pt count.
    #[arg(long, value_name = "METRES")]
    metres_per_unit: Option<f64>,
    /// Write the map as JSON.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Draw the map as SVG.
    #[arg(long, value_name = "FILE")]
    draw: Option<PathBuf>,
    /// Draw a grid with its walls as SVG; wall cells that no wall explains are red.
    #[arg(long, value_name = "FILE")]
    picture: Option<PathBuf>,
    /// Print the summary as JSON.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    upload: Upload,
}

/// `waymark map export`.
#[derive(Debug, clap::Args)]
pub(crate) struct ExportArgs {
    /// A map of `waymark map build` or `import`; without it, --map of --server.
    #[arg(required_unless_present = "server", conflicts_with = "server")]
    file: Option<PathBuf>,
    /// Where to: NAME.yaml (and NAME.pgm beside it) for `map_server`, NAME.txt for a vector map, NAME.geojson, NAME.json
    /// for a map file.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Side of a cell of the grid, metres.
    #[arg(long, default_value_t = 0.05)]
    resolution_m: f64,
    #[command(flatten)]
    upload: Upload,
}

/// Runs `import`.
pub(crate) async fn import(args: &ImportArgs) -> anyhow::Result<()> {
    let options = ImportOptions { min_length_m: args.min_length_m, metres_per_unit: args.metres_per_unit };
    let imported = walls::import(&args.file, &options).with_context(|| args.file.display().to_string())?;
    let Imported { map, report, .. } = &imported;
    if let Some(out) = &args.out {
        map.write(out).with_context(|| out.display().to_string())?;
    }
    if let Some(picture) = &args.draw {
        std::fs::write(picture, map_svg::draw(map, &[])).with_context(|| picture.display().to_string())?;
    }
    if let Some(picture) = &args.picture {
        let svg =
            imported.picture().context("--picture: only grids (.yaml) have one; --draw draws any map")??;
        std::fs::write(picture, svg).with_context(|| picture.display().to_string())?;
    }
    screen::say(&if args.json { summary(report).to_string() } else { sentence(report) });
    if let Some(warning) = report.grid.as_ref().and_then(GridReport::warning) {
        let hint = if args.picture.is_none() { " --picture FILE draws it." } else { "" };
        screen::complain(&format!("{warning}{hint}"));
    }
    args.upload.send(map).await
}

fn summary(report: &ImportReport) -> serde_json::Value {
    let grid = report.grid.as_ref().map(|g| {
        json!({
            "occupied": g.occupied, "grey": g.grey, "free": g.free, "unknown": g.unknown,
            "wall_cells": g.wall_cells, "wall_cells_explained": g.wall_cells_explained,
            "share_explained": g.share_explained(), "occupied_explained": g.occupied_explained,
            "length_on_wall_cells": g.length_on_wall_cells,
        })
    });
    json!({ "segments": report.segments, "length_m": report.length_m, "grid": grid })
}

fn sentence(report: &ImportReport) -> String {
    let grid = report.grid.as_ref().map_or_else(String::new, |g| {
        format!("; they explain {:.1} % of {} wall cells", 100.0 * g.share_explained(), g.wall_cells)
    });
    format!("{} segments, {:.1} m of walls{grid}", report.segments, report.length_m)
}

/// Runs `export`.
pub(crate) async fn export(args: &ExportArgs) -> anyhow::Result<()> {
    let map: MapFile = match (&args.file, &args.upload.server, &args.upload.map) {
        (Some(file), _, _) => walls::read(file).with_context(|| file.display().to_string())?,
        (None, Some(server), Some(name)) => {
            let stored = MapClient::new(server)?.walls(name).await?;
            serde_json::from_value(serde_json::to_value(stored)?).context("the server's walls")?
        }
        _ => anyhow::bail!("name a file, or --server and --map"),
    };
    walls::write(&map, &args.out, args.resolution_m).context("--out")?;
    screen::say(&format!("{} segments in {}", map.segments.len(), args.out.display()));
    Ok(())
}
