//! `waymark map import`: the walls and the underlay of a map from another program's file, with the
//! difference before anything changes.

use super::{
    difference::Difference,
    underlay::{self, Outcome},
};
use crate::{
    screen,
    session::{Consent, ServerArgs, Session},
};
use anyhow::Context as _;
use client::{
    Revised,
    api::{WallBody, WallsBody},
};
use formats::{
    map_svg,
    walls::{self, GridReport, ImportOptions, ImportReport, Imported, MapFile, Underlay, Wall},
};
use serde_json::{Value, json};
use std::path::PathBuf;

/// `waymark map import`.
#[derive(Debug, clap::Args)]
pub(crate) struct ImportArgs {
    /// The map; made with `waymark map create`.
    map: String,
    #[command(flatten)]
    source: SourceArgs,
    /// Show what would change, and change nothing.
    #[arg(long)]
    dry_run: bool,
    /// Leave out a grid's picture, which else becomes the map's underlay.
    #[arg(long)]
    no_underlay: bool,
    #[command(flatten)]
    consent: Consent,
    #[command(flatten)]
    server: ServerArgs,
}

/// A file with walls.
#[derive(Debug, Clone, clap::Args)]
pub(super) struct SourceArgs {
    /// A `map_server` YAML file (or its picture, with the YAML of the same name beside it), a
    /// vector map (`x1, y1, x2, y2` in metres, one segment a line; or `.geojson` in map metres or
    /// degrees: lines are walls with the free side on their left, polygons are rooms with columns
    /// for holes), an SVG floor plan, or a map of `waymark map build`.
    file: PathBuf,
    /// Leave out pieces of a grid's walls shorter than this, metres, but for those that alone
    /// explain some cells.
    #[arg(long, default_value_t = ImportOptions::default().min_length_m)]
    min_length_m: f64,
    /// Metres of a unit of an SVG floor plan; without it the plan's width and height in mm, cm, in
    /// or pt count.
    #[arg(long, value_name = "METRES")]
    metres_per_unit: Option<f64>,
    /// Draw the walls as SVG.
    #[arg(long, value_name = "FILE")]
    draw: Option<PathBuf>,
    /// Draw a grid with its walls as SVG; wall cells that no wall explains are red.
    #[arg(long, value_name = "FILE")]
    picture: Option<PathBuf>,
}

impl SourceArgs {
    /// Reads the file and writes the pictures that are asked for. A warning goes to standard error.
    pub(super) fn read(&self) -> anyhow::Result<Imported> {
        let options =
            ImportOptions { min_length_m: self.min_length_m, metres_per_unit: self.metres_per_unit };
        let imported =
            walls::import(&self.file, &options).with_context(|| self.file.display().to_string())?;
        if let Some(picture) = &self.draw {
            std::fs::write(picture, map_svg::draw(&imported.map, &[]))
                .with_context(|| picture.display().to_string())?;
        }
        if let Some(picture) = &self.picture {
            let svg = imported
                .picture()
                .context("--picture: only grids (.yaml) have one; --draw draws any map")??;
            std::fs::write(picture, svg).with_context(|| picture.display().to_string())?;
        }
        if let Some(warning) = imported.report.grid.as_ref().and_then(GridReport::warning) {
            let hint = if self.picture.is_none() { " --picture FILE draws it." } else { "" };
            screen::complain(&format!("{warning}{hint}"));
        }
        if let Some(note) = &imported.report.note {
            screen::complain(&format!("{}: {note}.", self.file.display()));
        }
        Ok(imported)
    }
}

/// What was taken of a file, as JSON.
pub(super) fn summary(report: &ImportReport) -> Value {
    let grid = report.grid.as_ref().map(|g| {
        json!({
            "occupied": g.occupied, "grey": g.grey, "free": g.free, "unknown": g.unknown,
            "wall_cells": g.wall_cells, "wall_cells_explained": g.wall_cells_explained,
            "share_explained": g.share_explained(), "occupied_explained": g.occupied_explained,
            "length_on_wall_cells": g.length_on_wall_cells,
        })
    });
    json!({ "segments": report.segments, "length_m": report.length_m, "grid": grid, "note": report.note })
}

/// What was taken of a file, for people.
pub(super) fn sentence(report: &ImportReport) -> String {
    let grid = report.grid.as_ref().map_or_else(String::new, |g| {
        format!("; they explain {:.1} % of {} wall cells", 100.0 * g.share_explained(), g.wall_cells)
    });
    let segments = screen::counted(report.segments as u64, "segment");
    format!("{segments}, {:.1} m of walls{grid}", report.length_m)
}

/// The walls of a file as they are sent.
pub(super) fn body(map: &MapFile) -> WallsBody {
    let wall = |s: &Wall| WallBody { a: s.a, b: s.b, covariance: s.covariance_about_middle() };
    WallsBody { segments: map.segments.iter().map(wall).collect() }
}

pub(super) async fn run(args: &ImportArgs) -> anyhow::Result<()> {
    let imported = args.source.read()?;
    let session = args.server.session()?;
    session.note(&format!("{}: {}", args.source.file.display(), sentence(&imported.report)));
    let picture = imported.underlay.as_ref().filter(|_| !args.no_underlay);
    let done = on_server(&session, args, &body(&imported.map), picture).await;
    let (difference, outcome) = session.explained(done).await?;
    let result = json!({
        "map": args.map, "changed": !args.dry_run, "difference": difference, "file": summary(&imported.report),
        "underlay": outcome.to_json(picture),
    });
    let nothing = if args.dry_run { "\nNothing was changed (--dry-run)." } else { "" };
    let underlay = outcome.sentence(picture);
    session.show(&result, &format!("{}: {difference}{underlay}{nothing}", args.map))
}

/// Replaces walls, then the underlay if there is a picture; one consent is for both.
async fn on_server(
    session: &Session,
    args: &ImportArgs,
    walls: &WallsBody,
    picture: Option<&Underlay>,
) -> anyhow::Result<(Difference, Outcome)> {
    let underlay = match picture {
        Some(_) => underlay::revision(session, &args.map).await?,
        None => None,
    };
    let also_underlay = underlay.is_some();
    let replacing = if args.dry_run {
        Replacing::DryRun
    } else {
        Replacing::With { consent: args.consent, also_underlay }
    };
    let difference = replace(session, &args.map, walls, replacing).await?;
    let outcome = match picture {
        None => Outcome::Absent,
        Some(_) if args.dry_run => Outcome::DryRun,
        Some(picture) => underlay::upload(session, &args.map, picture, underlay.as_deref()).await?,
    };
    Ok((difference, outcome))
}

/// Whether walls are replaced.
#[derive(Debug, Clone, Copy)]
pub(super) enum Replacing {
    /// They stay; only the difference is computed.
    DryRun,
    /// They are replaced, by this consent if there are any.
    With {
        consent: Consent,
        /// Whether the consent is also to another underlay in the place of the one that is there.
        also_underlay: bool,
    },
}

/// Replaces the walls of a map; asks with the difference if there are walls already. Gives the
/// difference.
pub(super) async fn replace(
    session: &Session,
    map: &str,
    walls: &WallsBody,
    replacing: Replacing,
) -> anyhow::Result<Difference> {
    let Revised { value: old, revision } = session.maps().walls_revised(map).await?;
    let difference = Difference::of(&old, walls);
    if let Replacing::With { consent, also_underlay } = replacing {
        let old = match (difference.old_segments > 0, also_underlay) {
            (true, true) => Some("walls and its underlay"),
            (true, false) => Some("walls"),
            (false, true) => Some("underlay"),
            (false, false) => None,
        };
        if let Some(old) = old {
            consent.ask(&format!("{map}: {difference}. Replace its {old}?"))?;
        }
        session.maps().if_match(&revision).set_walls(map, walls).await?;
    }
    Ok(difference)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_summary_names_what_was_taken() {
        let report = ImportReport { segments: 1, length_m: 2.5, grid: None, note: None };
        assert_eq!(sentence(&report), "1 segment, 2.5 m of walls");
        assert_eq!(summary(&report), json!({ "segments": 1, "length_m": 2.5, "grid": null, "note": null }));
    }
}
