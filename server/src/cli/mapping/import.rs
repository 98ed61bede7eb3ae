//! `waymark map import` and `export`: walls from and to other programs' files.

use super::{
    Words,
    build::Upload,
    draw,
    file::{MapFile, Wall},
    geojson,
    grid::Grid,
    lines,
};
use crate::cli::screen;
use anyhow::Context as _;
use client::MapClient;
use serde_json::json;
use std::{
    fmt::Write as _,
    path::{Path, PathBuf},
};

/// Most walls read from a file.
pub(crate) const MAX_WALLS: usize = 1 << 20;

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

fn extension(path: &Path) -> String {
    path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default()
}

/// The walls of a file of any kind.
fn read(path: &Path, min_length_m: f64) -> anyhow::Result<MapFile> {
    let name = || path.display().to_string();
    let map = match extension(path).as_str() {
        "yaml" | "yml" => {
            let segments = Grid::read(path).with_context(name)?.walls(min_length_m);
            MapFile { segments, ..MapFile::default() }
        }
        "json" => MapFile::read(path)?,
        "geojson" => {
            let bytes = std::fs::metadata(path).with_context(name)?.len();
            anyhow::ensure!(
                bytes <= geojson::MAX_BYTES,
                "{}: more than {} bytes",
                name(),
                geojson::MAX_BYTES
            );
            let text = std::fs::read_to_string(path).with_context(name)?;
            MapFile { segments: geojson::walls(&text).with_context(name)?, ..MapFile::default() }
        }
        _ => MapFile { segments: vectors(path).with_context(name)?, ..MapFile::default() },
    };
    anyhow::ensure!(map.segments.len() <= MAX_WALLS, "{}: more than {MAX_WALLS} segments", name());
    for (i, wall) in map.segments.iter().enumerate() {
        wall.segment().with_context(|| format!("{}: segment {i}", name()))?;
    }
    Ok(map)
}

/// Lines of `x1, y1, x2, y2`. Pieces shorter than a segment may be are left out.
fn vectors(path: &Path) -> Result<Vec<Wall>, super::ReadError> {
    let mut walls = Vec::new();
    lines(path, |line, text| {
        if text.is_empty() || text.starts_with('#') {
            return Ok(());
        }
        let text = text.replace(',', " ");
        let mut words = Words::new(line, &text);
        let mut number = |field| words.number(field);
        let wall = Wall::between([number("x1")?, number("y1")?], [number("x2")?, number("y2")?]);
        if walls.len() >= MAX_WALLS {
            return Err(words.bad("segments", format!("more than {MAX_WALLS}")).into());
        }
        let long = (wall.b[0] - wall.a[0]).hypot(wall.b[1] - wall.a[1]) >= map::segments::MIN_SEGMENT_M;
        walls.extend(long.then_some(wall));
        Ok(())
    })?;
    Ok(walls)
}

/// Runs `import`.
pub(crate) async fn import(args: &ImportArgs) -> anyhow::Result<()> {
    let map = read(&args.file, args.min_length_m)?;
    if let Some(out) = &args.out {
        map.write(out)?;
    }
    if let Some(picture) = &args.draw {
        std::fs::write(picture, draw::svg(&map, &[])).with_context(|| picture.display().to_string())?;
    }
    let length = |w: &Wall| (w.b[0] - w.a[0]).hypot(w.b[1] - w.a[1]);
    let metres: f64 = map.segments.iter().map(length).sum();
    if args.json {
        screen::say(&json!({ "segments": map.segments.len(), "length_m": metres }).to_string());
    } else {
        screen::say(&format!("{} segments, {metres:.1} m of walls", map.segments.len()));
    }
    args.upload.send(&map).await
}

/// Runs `export`.
pub(crate) async fn export(args: &ExportArgs) -> anyhow::Result<()> {
    let map = match (&args.file, &args.upload.server, &args.upload.map) {
        (Some(file), _, _) => read(file, 0.0)?,
        (None, Some(server), Some(name)) => {
            let stored = MapClient::new(server)?.laser(name).await?;
            serde_json::from_value(stored).context("the server's walls")?
        }
        _ => anyhow::bail!("name a file, or --server and --map"),
    };
    match extension(&args.out).as_str() {
        "yaml" | "yml" => {
            anyhow::ensure!((0.005..=1.0).contains(&args.resolution_m), "--resolution-m: 0.005 to 1");
            Grid::of_walls(&map.segments, args.resolution_m)?.write(&args.out)?;
        }
        "json" => map.write(&args.out)?,
        "txt" => {
            let mut text = String::new();
            for w in &map.segments {
                // Writing to a String cannot fail.
                writeln!(text, "{:.6}, {:.6}, {:.6}, {:.6}", w.a[0], w.a[1], w.b[0], w.b[1]).ok();
            }
            std::fs::write(&args.out, text)?;
        }
        other => anyhow::bail!("--out: `.{other}` is none of .yaml, .txt, .json"),
    }
    screen::say(&format!("{} segments in {}", map.segments.len(), args.out.display()));
    Ok(())
}
