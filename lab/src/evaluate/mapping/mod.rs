//! `waymark-lab evaluate mapping`: maps built from scan logs, and their paths compared with the
//! known relations of the truth.

mod joint;
mod localise;
mod odometry;
mod score;

use crate::evaluate::chart;
use anyhow::Context as _;
use cli::{
    map::{LaserArgs, build},
    screen,
};
use formats::{
    map_svg,
    scan_log::{self, LogEntry, ScanLog},
    walls::MapFile,
};
use map::pose2::Pose2;
use odometry::Noise;
use score::{Errors, Relations};
use serde_json::{Value, json};
use sim::{
    building::Building,
    drive::{Drive, DriveParams},
    laser,
};
use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

/// Figures of others on the same recordings: mean and standard deviation of the relative poses'
/// translation error, by scan matching and by graph mapping (Kuemmerle et al. 2009, "On measuring
/// the accuracy of SLAM algorithms", table of translational errors; their relations were picked by
/// hand, ours are those of the log's corrected poses).
const PUBLISHED: [(&str, [f64; 2], [f64; 2]); 5] = [
    ("intel", [0.220, 0.296], [0.031, 0.026]),
    ("aces", [0.173, 0.614], [0.044, 0.044]),
    ("infinite-corridor", [1.651, 4.138], [0.050, 0.056]),
    ("csail", [0.106, 0.325], [0.004, 0.009]),
    ("freiburg-079", [0.258, 0.427], [0.056, 0.042]),
];
/// The files of the set with the robot's own odometry.
const NUMBERED: [&str; 2] = ["intel-scans.txt.gz", "reference-poses.txt"];

/// `waymark-lab evaluate mapping`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Scan logs as for `waymark map build`, or folders of them. Poses in a log are taken as the
    /// truth, and odometry is made from them with noise. Numbered scans keep their odometry; the
    /// truth is `reference-poses.txt` beside them (lines `scan x y theta`). Without any: a
    /// simulated corridor with exact truth.
    logs: Vec<PathBuf>,
    #[command(flatten)]
    laser: LaserArgs,
    /// Errors of the odometry made for a log, times this: by default 5 % of the way, 1.1 deg per
    /// root metre, 5 % of the turn, and 0.23 deg per metre to one side.
    #[arg(long, default_value_t = 1.0)]
    odometry_noise: f64,
    /// Seed of that noise.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Seconds of recording, for a log without times.
    #[arg(long)]
    duration_s: Option<f64>,
    /// Parameters as a JSON file, as for `waymark map build`.
    #[arg(long, value_name = "FILE")]
    params: Option<PathBuf>,
    /// Solve for walls and path together besides, as a survey does.
    #[arg(long)]
    joint: bool,
    /// Draw every map into this folder, as SVG.
    #[arg(long, value_name = "DIR")]
    draw: Option<PathBuf>,
    /// Write an SVG picture: distribution of the errors of relations, by log.
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
    /// Print one JSON object per log instead of the table.
    #[arg(long)]
    json: bool,
}

/// One log's result.
struct Row {
    name: String,
    map: MapFile,
    found: Errors,
    joint: Option<Errors>,
    odometry: Errors,
    relations: usize,
    seconds: f64,
    duration_s: Option<f64>,
    complete: f64,
    residual_m: f64,
    localised: localise::Localised,
}

/// Runs the evaluation.
pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    anyhow::ensure!((0.0..=10.0).contains(&args.odometry_noise), "--odometry-noise: 0 to 10");
    let mut rows = Vec::new();
    if args.logs.is_empty() {
        rows.push(row(args, "corridor", &simulated(args.seed))?);
    }
    for path in &args.logs {
        for log in logs(path)? {
            let name = name(&log);
            rows.push(row(args, &name, &recording(args, &log)?)?);
        }
    }
    if let Some(plot) = &args.plot {
        std::fs::write(plot, picture(&rows)).with_context(|| plot.display().to_string())?;
    }
    for line in if args.json { rows.iter().map(|r| r.json().to_string()).collect() } else { table(&rows) } {
        screen::say(&line);
    }
    Ok(())
}

/// The logs of a path: itself, or those of a folder.
fn logs(path: &Path) -> anyhow::Result<Vec<PathBuf>> {
    if !path.is_dir() {
        return Ok(vec![path.to_owned()]);
    }
    let name = || path.display().to_string();
    let is_log = |p: &PathBuf| {
        let n = p.file_name().unwrap_or_default().to_string_lossy().into_owned();
        [".log", ".log.gz", ".jsonl", ".jsonl.gz"].iter().any(|e| n.ends_with(e)) || n == NUMBERED[0]
    };
    let entries: Result<Vec<PathBuf>, _> =
        std::fs::read_dir(path).with_context(name)?.map(|e| e.map(|e| e.path())).collect();
    let mut found: Vec<PathBuf> = entries.with_context(name)?.into_iter().filter(is_log).collect();
    anyhow::ensure!(!found.is_empty(), "{}: no scan logs", name());
    found.sort();
    Ok(found)
}

fn name(log: &Path) -> String {
    let file = log.file_name().unwrap_or_default().to_string_lossy().into_owned();
    if file == NUMBERED[0] {
        return "intel, raw odometry".to_owned();
    }
    file.split('.').next().unwrap_or_default().trim_end_matches("-corrected").to_owned()
}

/// A log with truth and odometry apart.
fn recording(args: &Args, log: &Path) -> anyhow::Result<ScanLog> {
    let mut recording =
        scan_log::read(log, &args.laser.defaults()).with_context(|| log.display().to_string())?;
    let reference = log.with_file_name(NUMBERED[1]);
    if recording.records.iter().all(|r| r.truth.is_none()) && reference.exists() {
        score::reference(&reference, &mut recording.records)
            .with_context(|| reference.display().to_string())?;
    } else {
        odometry::make(&mut recording.records, Noise::times(args.odometry_noise), args.seed);
    }
    Ok(recording)
}

/// There and back along the simulated corridor.
fn simulated(seed: u64) -> ScanLog {
    let building = Arc::new(Building::corridor(seed));
    let params = DriveParams { legs: 2, seed, ..DriveParams::default() };
    let record = |s: sim::drive::Step| LogEntry {
        odom: s.odom_from_robot,
        truth: Some(s.map_from_robot),
        time_s: Some(s.time_s),
        scan: laser::scan(
            &building,
            &s.map_from_robot,
            &laser::LaserParams::default(),
            seed ^ (s.index << 8),
        ),
    };
    ScanLog { records: Drive::new(building.clone(), &params).map(record).collect(), ..ScanLog::default() }
}

fn row(args: &Args, name: &str, recording: &ScanLog) -> anyhow::Result<Row> {
    let records = &recording.records;
    let relations = Relations::of(records);
    anyhow::ensure!(!relations.is_empty(), "{name}: no known relations to compare with");
    let built = build::build(records, |i| records[i].odom, build::params(args.params.as_ref())?)?;
    let odometry: Vec<Pose2> = records.iter().map(|r| r.odom).collect();
    let map = MapFile::of(&built.map);
    let joint = args.joint.then(|| joint::path(&built.map)).transpose()?;
    if let Some(folder) = &args.draw {
        std::fs::create_dir_all(folder)?;
        let file = folder.join(format!("{}.svg", name.replace([' ', ','], "-")));
        std::fs::write(&file, map_svg::draw(&map, records)).with_context(|| file.display().to_string())?;
    }
    let (complete, residual_m) = score::on_walls(&built.map, records);
    Ok(Row {
        name: name.to_owned(),
        found: relations.errors(records, &built.map.path),
        joint: joint.map(|path| relations.errors(records, &path)),
        odometry: relations.errors(records, &odometry),
        relations: relations.len(),
        seconds: built.seconds,
        duration_s: args.duration_s.or_else(|| recording.duration_s()).filter(|d| *d > 0.0),
        complete,
        residual_m,
        localised: localise::localise(&built.map, records)?,
        map,
    })
}

impl Row {
    fn published(&self) -> Option<&'static (&'static str, [f64; 2], [f64; 2])> {
        PUBLISHED.iter().find(|(name, ..)| self.name.starts_with(name))
    }

    fn faster(&self) -> Option<f64> {
        self.duration_s.map(|d| d / self.seconds.max(1e-9))
    }

    fn json(&self) -> Value {
        let errors = |e: &Errors| {
            let ([m, ms], [deg, degs]) = (e.translation_m(), e.rotation_deg());
            json!({ "translation_m": m, "translation_std_m": ms, "rotation_deg": deg, "rotation_std_deg": degs })
        };
        json!({
            "log": self.name, "scans": self.map.path.len(), "keyframes": self.map.key_scans.len(),
            "relations": self.relations, "error": errors(&self.found), "odometry_error": errors(&self.odometry),
            "joint_error": self.joint.as_ref().map(errors),
            "published_scan_matching_m": self.published().map(|p| p.1),
            "published_graph_mapping_m": self.published().map(|p| p.2),
            "loop_closures": self.map.loops.len(), "loop_closures_refused": self.map.refused,
            "segments": self.map.segments.len(), "complete": self.complete, "residual_m": self.residual_m,
            "localise_us": self.localised.us, "localised": self.localised.fixed,
            "localised_off_m": self.localised.off_m, "seconds": self.seconds, "recorded_s": self.duration_s, "times_faster_than_recorded": self.faster(),
        })
    }
}

fn table(rows: &[Row]) -> Vec<String> {
    let mut lines = vec![
        "Error of relative poses, mean and standard deviation; published: scan matching, graph mapping (Kuemmerle et al. 2009)"
            .to_owned(),
        format!(
            "{:<20} {:>9} {:>16} {:>14} {:>16} {:>9} {:>16} {:>16} {:>6} {:>8} {:>9} {:>9} {:>8} {:>8} {:>7} {:>6}",
            "log", "relations", "error m", "error deg", "joint m", "odometry", "published sm", "published gm", "loops",
            "segments", "complete", "residual", "seconds", "faster", "fix us", "fixed"
        ),
    ];
    let pair = |[m, s]: [f64; 2]| format!("{m:.3} +/- {s:.3}");
    for r in rows {
        let published =
            |k: usize| r.published().map_or("-".to_owned(), |p| pair(if k == 0 { p.1 } else { p.2 }));
        let [deg, degs] = r.found.rotation_deg();
        lines.push(format!(
            "{:<20} {:>9} {:>16} {:>14} {:>16} {:>9.2} {:>16} {:>16} {:>6} {:>8} {:>8.1}% {:>7.1}cm {:>8.2} {:>8} {:>7.0} {:>5.0}%",
            r.name,
            r.relations,
            pair(r.found.translation_m()),
            format!("{deg:.2} +/- {degs:.2}"),
            r.joint.as_ref().map_or("-".to_owned(), |e| pair(e.translation_m())),
            r.odometry.translation_m()[0],
            published(0),
            published(1),
            r.map.loops.len(),
            r.map.segments.len(),
            100.0 * r.complete,
            100.0 * r.residual_m,
            r.seconds,
            r.faster().map_or("-".to_owned(), |f| format!("{f:.0}x")),
            r.localised.us,
            100.0 * r.localised.fixed,
        ));
    }
    lines
}

/// Share of the relations below an error, one curve per log.
fn picture(rows: &[Row]) -> String {
    let panel = |i, title: &str, x: &str, high| chart::Panel::of_shares(i, title, x, [0.0, high], false);
    let (metres, degrees) =
        (panel(0, "relations nearer than", "m", 0.2), panel(1, "relations turned less than", "deg", 2.0));
    let words: Vec<(&str, String)> = rows
        .iter()
        .enumerate()
        .map(|(i, r)| (chart::COLOURS[i % chart::COLOURS.len()], r.name.clone()))
        .collect();
    chart::picture(2, &words, |svg| {
        metres.axes(svg, &[0.0, 0.05, 0.1, 0.15, 0.2]);
        degrees.axes(svg, &[0.0, 0.5, 1.0, 1.5, 2.0]);
        for (i, r) in rows.iter().enumerate() {
            let colour = chart::COLOURS[i % chart::COLOURS.len()];
            metres.curve(svg, &r.found.curve(|e| e.0, 0.2), colour);
            degrees.curve(svg, &r.found.curve(|e| e.1, 2.0), colour);
        }
    })
}

#[cfg(test)]
mod tests;
