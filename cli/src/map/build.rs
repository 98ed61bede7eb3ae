//! `waymark map build`: builds a map from a scan log.

use super::{LaserArgs, import};
use crate::{
    clock::Clock,
    failure::{Class, Failure},
    recording::scans::{self, FileScans, ScanArgs},
    screen,
    session::{Consent, ServerArgs},
};
use anyhow::Context as _;
use formats::{
    map_svg,
    scan_log::{self, LogEntry, ScanLog},
    walls::MapFile,
};
use map::slam::{Slam, SlamMap, SlamParams};
use serde_json::json;
use std::path::PathBuf;

/// Where the walls go on a server.
#[derive(Debug, Clone, clap::Args)]
struct Upload {
    /// Replace the walls of this map of the server; made with `waymark map create`.
    #[arg(long, value_name = "MAP")]
    into: Option<String>,
    #[command(flatten)]
    consent: Consent,
    #[command(flatten)]
    server: ServerArgs,
}

/// `waymark map build`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// The scan log: a CARMEN log (FLASER or ROBOTLASER1 lines), numbered scans
    /// (`i dx dy dtheta r0 r1 ..`), or a Waymark scan log, `.gz` is unpacked. Or a file of
    /// messages: a recording (`waymark record`, `demo --record`), or a bag of ROS 2 with laser
    /// scans and odometry (MCAP, or the bag's folder).
    #[arg(value_name = "LOG")]
    recording: PathBuf,
    #[command(flatten)]
    laser: LaserArgs,
    #[command(flatten)]
    scans: ScanArgs,
    /// Write the map (walls with covariance, path, loops) as JSON.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Draw the map as SVG.
    #[arg(long, value_name = "FILE")]
    draw: Option<PathBuf>,
    /// Parameters as a JSON file; what it does not name keeps its default.
    #[arg(long, value_name = "FILE")]
    params: Option<PathBuf>,
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

/// Reads the scans of a log, or of a file of messages, and says what of them is not used.
fn read(args: &Args) -> anyhow::Result<ScanLog> {
    let path = &args.recording;
    let said = |line: String| screen::complain(&format!("{}: {line}", path.display()));
    if !scans::has_messages(path) {
        let log = scan_log::read(path, &args.laser.defaults()).with_context(|| path.display().to_string())?;
        if let Some(cut) = &log.cut {
            said(format!("{cut}: the log ends there; {} scans before are used.", log.records.len()));
        }
        return Ok(log);
    }
    let FileScans { log, cut_off_at, problems } = scans::scans(path, &args.scans)?;
    if let Some(at) = cut_off_at {
        said(format!("it ends inside a record at byte {at}; {} scans before are used.", log.records.len()));
    }
    for (count, first) in problems.values() {
        said(format!("{count} times {first}"));
    }
    Ok(log)
}

/// Scans without a wall: nothing is written, and no walls of a map are replaced by none.
fn no_walls(args: &Args, scans: usize) -> Failure {
    let sentence = format!("{}: {scans} scans give no wall; nothing is changed.", args.recording.display());
    let advice = "Drive along the walls: a wall is where several scans from different places agree.";
    Failure::new(Class::Refused, "no_walls", sentence).advise(advice)
}

/// Runs the command.
pub(crate) async fn run(args: &Args) -> anyhow::Result<()> {
    let recording = read(args)?;
    let Built { map, seconds } =
        build(&recording.records, |i| recording.records[i].odom, params(args.params.as_ref())?)?;
    if map.walls.is_empty() {
        return Err(no_walls(args, map.path.len()).into());
    }
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
    let session = args.upload.server.session()?;
    let difference = match &args.upload.into {
        None => None,
        Some(name) => {
            let replacing = import::Replacing::With { consent: args.upload.consent, also_underlay: false };
            let done = import::replace(&session, name, &import::body(&file), replacing).await;
            Some(session.explained(done).await?)
        }
    };
    let summary = json!({
        "scans": map.path.len(), "keyframes": map.keys.len(), "distance_m": distance_m, "segments": map.walls.len(),
        "loops": map.loops.len(), "loops_refused": map.refused, "seconds": seconds,
        "times_faster_than_recorded": faster, "map": args.upload.into, "difference": difference,
    });
    let uploaded = args.upload.into.as_ref().zip(difference);
    let uploaded = uploaded.map_or_else(String::new, |(name, difference)| format!("\n{name}: {difference}"));
    let text = format!(
        "{} scans over {distance_m:.0} m: {} keyframes, {} loop closures, {} refused, {} wall segments; {seconds:.1} s{}{uploaded}",
        map.path.len(),
        map.keys.len(),
        map.loops.len(),
        map.refused,
        map.walls.len(),
        faster.map_or_else(String::new, |f| format!(", {f:.0} times faster than recorded")),
    );
    session.show(&summary, &text)
}
