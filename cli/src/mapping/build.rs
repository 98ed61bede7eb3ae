//! `waymark map build`: builds a map from a scan log.

use super::LaserArgs;
use crate::{clock::Clock, screen};
use anyhow::Context as _;
use client::{MapClient, api::WallsBody};
use formats::{
    map_svg,
    scan_log::{self, LogEntry},
    walls::MapFile,
};
use map::slam::{Slam, SlamMap, SlamParams};
use serde_json::json;
use std::path::PathBuf;

/// Where walls go on a server.
#[derive(Debug, Clone, clap::Args)]
pub(crate) struct Upload {
    /// Replace the walls of --map on the server at this address.
    #[arg(long, value_name = "URL", requires = "map")]
    pub(crate) server: Option<String>,
    /// The map on the server; made with `waymark map create`.
    #[arg(long, value_name = "NAME")]
    pub(crate) map: Option<String>,
}

impl Upload {
    /// Sends the walls, if a server is named.
    pub(crate) async fn send(&self, map: &MapFile) -> anyhow::Result<()> {
        let (Some(server), Some(name)) = (&self.server, &self.map) else { return Ok(()) };
        let walls: WallsBody = map.segments.iter().map(|s| [s.a, s.b]).collect();
        MapClient::new(server)?.set_walls(name, &walls).await.context("upload")?;
        screen::complain(&format!("{} segments are the walls of {name} now", walls.segments.len()));
        Ok(())
    }
}

/// `waymark map build`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// The scan log: a CARMEN log (FLASER or ROBOTLASER1 lines), numbered scans (`i dx dy dtheta r0 r1 ..`), or a
    /// Waymark recording; `.gz` is unpacked.
    #[arg(value_name = "LOG")]
    recording: PathBuf,
    #[command(flatten)]
    laser: LaserArgs,
    /// Write the map (walls with covariance, path, loops) as JSON.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Draw the map as SVG.
    #[arg(long, value_name = "FILE")]
    draw: Option<PathBuf>,
    /// Parameters as a JSON file; what it does not name keeps its default.
    #[arg(long, value_name = "FILE")]
    params: Option<PathBuf>,
    /// Print the summary as JSON.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    upload: Upload,
}

/// A map and the time that it took.
#[derive(Debug)]
pub struct Built {
    /// The map.
    pub map: SlamMap,
    /// Processor time of the mapping alone, seconds.
    pub seconds: f64,
}

/// Maps a log, with `odometry(i)` (`odom_from_robot`) in place of that of entry `i`.
pub fn build(
    records: &[LogEntry],
    odometry: impl Fn(usize) -> map::pose2::Pose2,
    params: SlamParams,
) -> anyhow::Result<Built> {
    let bar = screen::progress(records.len(), "mapping");
    let clock = Clock::start();
    let mut slam = Slam::new(params);
    for (i, record) in records.iter().enumerate() {
        slam.add(&odometry(i), &record.scan).with_context(|| format!("scan {i}"))?;
        bar.inc(1);
    }
    bar.set_message("fitting");
    let map = slam.finish()?;
    bar.finish_and_clear();
    Ok(Built { map, seconds: clock.ms() * 1e-3 })
}

/// The parameters of a file, or the defaults.
pub fn params(path: Option<&PathBuf>) -> anyhow::Result<SlamParams> {
    let Some(path) = path else { return Ok(SlamParams::default()) };
    let name = || path.display().to_string();
    let text = std::fs::read_to_string(path).with_context(name)?;
    let mut json = serde_json::Deserializer::from_str(&text);
    serde_path_to_error::deserialize(&mut json).with_context(name)
}

/// Runs the command.
pub(crate) async fn run(args: &Args) -> anyhow::Result<()> {
    let recording = scan_log::read(&args.recording, &args.laser.defaults())
        .with_context(|| args.recording.display().to_string())?;
    let Built { map, seconds } =
        build(&recording.records, |i| recording.records[i].odom, params(args.params.as_ref())?)?;
    let file = MapFile::of(&map);
    if let Some(out) = &args.out {
        file.write(out).with_context(|| out.display().to_string())?;
    }
    if let Some(picture) = &args.draw {
        std::fs::write(picture, map_svg::draw(&file, &recording.records))
            .with_context(|| picture.display().to_string())?;
    }
    let distance_m: f64 = map.path.windows(2).map(|p| p[0].between(&p[1]).position().norm()).sum();
    let faster = recording.duration_s().map(|d| d / seconds.max(1e-9));
    if args.json {
        let summary = json!({
            "scans": map.path.len(), "keyframes": map.keys.len(), "distance_m": distance_m, "segments": map.walls.len(),
            "loop_closures": map.loops.len(), "loop_closures_refused": map.refused, "seconds": seconds,
            "times_faster_than_recorded": faster,
        });
        screen::say(&summary.to_string());
    } else {
        screen::say(&format!(
            "{} scans over {distance_m:.0} m: {} keyframes, {} loop closures, {} refused, {} wall segments; {seconds:.1} s{}",
            map.path.len(),
            map.keys.len(),
            map.loops.len(),
            map.refused,
            map.walls.len(),
            faster.map_or_else(String::new, |f| format!(", {f:.0} times faster than recorded")),
        ));
    }
    args.upload.send(&file).await
}
