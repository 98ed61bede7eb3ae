//! `waymark map export`: the walls of a map as another program's file.

use crate::{screen::counted, session::ServerArgs};
use anyhow::Context as _;
use formats::walls::{self, MapFile, Wall};
use serde_json::json;
use std::path::PathBuf;

/// `waymark map export`.
#[derive(Debug, clap::Args)]
pub(crate) struct ExportArgs {
    /// The map.
    map: String,
    #[command(flatten)]
    target: TargetArgs,
    #[command(flatten)]
    server: ServerArgs,
}

/// A file that walls are written to.
#[derive(Debug, Clone, clap::Args)]
pub(super) struct TargetArgs {
    /// Where to: NAME.yaml (and NAME.pgm beside it) for `map_server`, NAME.txt for a vector map,
    /// NAME.geojson, NAME.json for a map file.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Side of a cell of the grid, metres.
    #[arg(long, default_value_t = 0.05)]
    resolution_m: f64,
}

impl TargetArgs {
    pub(super) fn write(&self, map: &MapFile) -> anyhow::Result<()> {
        walls::write(map, &self.out, self.resolution_m).context("--out")
    }

    /// Where to, for people.
    pub(super) fn name(&self) -> String {
        self.out.display().to_string()
    }
}

pub(super) async fn run(args: &ExportArgs) -> anyhow::Result<()> {
    let session = args.server.session()?;
    let stored = session.explained(session.maps().walls(&args.map).await.map_err(Into::into)).await?;
    let segments: Result<_, _> =
        stored.segments.iter().map(|w| Wall::about_middle(w.a, w.b, w.covariance)).collect();
    let map = MapFile { segments: segments.context("the walls of the server")?, ..MapFile::default() };
    args.target.write(&map)?;
    let (count, name) = (map.segments.len(), args.target.name());
    let text = format!("{} in {name}", counted(count as u64, "segment"));
    session.show(&json!({ "segments": count, "file": name }), &text)
}
