//! `waymark map import` and `export`: walls from and to other programs' files.

use super::build::Upload;
use crate::cli::screen;
use anyhow::Context as _;
use client::MapClient;
use formats::{
    map_svg,
    walls::{self, MapFile, Wall},
};
use serde_json::json;
use std::path::PathBuf;

/// `waymark map import`.
#[derive(Debug, clap::Args)]
pub(crate) struct ImportArgs {
    /// A `map_server` YAML file (its PGM or PNG beside it), a vector map (`x1, y1, x2, y2` in metres, one segment a line;
    /// or `.geojson` in map metres: lines are walls with the free side on their left, polygons are rooms with columns for
    /// holes), or a map of `waymark map build`.
    file: PathBuf,
    /// Leave out pieces of a grid's walls shorter than this, metres.
    #[arg(long, default_value_t = 0.3)]
    min_length_m: f64,
    /// Write the map as JSON.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Draw the map as SVG.
    #[arg(long, value_name = "FILE")]
    draw: Option<PathBuf>,
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
    /// Where to: NAME.yaml (and NAME.pgm beside it) for `map_server`, NAME.txt for a vector map, NAME.json for a map file.
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
    let map = walls::read(&args.file, args.min_length_m).with_context(|| args.file.display().to_string())?;
    if let Some(out) = &args.out {
        map.write(out).with_context(|| out.display().to_string())?;
    }
    if let Some(picture) = &args.draw {
        std::fs::write(picture, map_svg::draw(&map, &[])).with_context(|| picture.display().to_string())?;
    }
    let metres: f64 = map.segments.iter().map(Wall::length_m).sum();
    if args.json {
        screen::say(&json!({ "segments": map.segments.len(), "length_m": metres }).to_string());
    } else {
        screen::say(&format!("{} segments, {metres:.1} m of walls", map.segments.len()));
    }
    args.upload.send(&map).await
}

/// Runs `export`.
pub(crate) async fn export(args: &ExportArgs) -> anyhow::Result<()> {
    let map: MapFile = match (&args.file, &args.upload.server, &args.upload.map) {
        (Some(file), _, _) => walls::read(file, 0.0).with_context(|| file.display().to_string())?,
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
