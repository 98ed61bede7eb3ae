//! `waymark run`: records a robot's drive and gives its reference trajectory, so that the map learns which modality to trust
//! where.

use super::teach::{ServerArgs, counted, show};
use anyhow::{Context as _, bail};
use clap::builder::{PossibleValuesParser, TypedValueParser as _};
use client::{
    MapClient,
    api::{
        FusionModeBody, ModalityBody, ModalityMapBody, ModalityMapPatch, RecordingStatusBody,
        ReferenceRunBody, ReferenceTrajectoryBody,
    },
};
use std::path::PathBuf;

/// `waymark run`.
#[derive(Debug, clap::Subcommand)]
pub(crate) enum Command {
    /// Start a recording of odometry and of fixes by landmarks and laser, in the server's memory.
    Start {
        /// The robot.
        robot: String,
        #[command(flatten)]
        server: ServerArgs,
    },
    /// Show the recording's status.
    Status {
        /// The robot.
        robot: String,
        #[command(flatten)]
        server: ServerArgs,
    },
    /// Cancel the recording.
    Cancel {
        /// The robot.
        robot: String,
        #[command(flatten)]
        server: ServerArgs,
    },
    /// End the recording with the robot's reference trajectory: the map learns from it.
    Learn {
        /// The robot.
        robot: String,
        /// A pose a line, on the map and by the robot's clock: `seconds x y z qx qy qz qw` (TUM), or `seconds x y theta`;
        /// metres, radians, `#` begins a remark.
        #[arg(long, value_name = "FILE")]
        path: PathBuf,
        /// Standard deviation of its positions, metres [default: 0.01].
        #[arg(long)]
        sigma_m: Option<f64>,
        /// Standard deviation of its headings, radians [default: 0.005].
        #[arg(long)]
        sigma_rad: Option<f64>,
        #[command(flatten)]
        server: ServerArgs,
    },
    /// List the reference runs of a map.
    List {
        /// The map.
        #[arg(long)]
        map: String,
        #[command(flatten)]
        server: ServerArgs,
    },
    /// Delete a reference run with its statistics.
    Forget {
        /// Number of the run.
        run: i64,
        /// The map.
        #[arg(long)]
        map: String,
        #[command(flatten)]
        server: ServerArgs,
    },
    /// Show or set the fusion mode of a map.
    Mode {
        /// The map.
        #[arg(long)]
        map: String,
        /// `all`: everything, each as sure as it proved to be; `near_best`: those nearly as good as the best; `best`: the
        /// best alone. Odometry carries the pose in any case.
        #[arg(value_parser = PossibleValuesParser::new(["all", "near_best", "best"]).map(|word| mode(&word)))]
        mode: Option<FusionModeBody>,
        #[command(flatten)]
        server: ServerArgs,
    },
}

/// Runs the command.
pub(crate) async fn run(command: &Command) -> anyhow::Result<()> {
    match command {
        Command::Start { robot, server } => {
            let begun = MapClient::new(server.address())?.start_recording(robot).await?;
            show(server, &begun, &format!("a run of {robot} on {} is being recorded", begun.map))
        }
        Command::Status { robot, server } => {
            let recorded = MapClient::new(server.address())?.recording(robot).await?;
            show(server, &recorded, &recorded_line(&recorded))
        }
        Command::Cancel { robot, server } => {
            MapClient::new(server.address())?.cancel_recording(robot).await?;
            show(server, robot, "cancelled")
        }
        Command::Learn { robot, path, sigma_m, sigma_rad, server } => {
            let text =
                std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
            let poses = poses(&text).with_context(|| path.display().to_string())?;
            let reference = ReferenceTrajectoryBody { poses, sigma_m: *sigma_m, sigma_rad: *sigma_rad };
            let learnt = MapClient::new(server.address())?.finish_recording(robot, &reference).await?;
            show(server, &learnt, &learnt_lines(&learnt))
        }
        Command::List { map, server } => {
            let runs = MapClient::new(server.address())?.reference_runs(map).await?;
            show(server, &runs, &runs.iter().map(learnt_lines).collect::<Vec<_>>().join("\n"))
        }
        Command::Forget { run, map, server } => {
            MapClient::new(server.address())?.delete_reference_run(map, *run).await?;
            show(server, run, "deleted")
        }
        Command::Mode { map, mode, server } => {
            let maps = MapClient::new(server.address())?;
            let known = match mode {
                Some(mode) => {
                    maps.set_modalities(map, &ModalityMapPatch { fusion_mode: Some(*mode), areas: None })
                        .await?
                }
                None => maps.modalities(map).await?,
            };
            show(server, &known, &mode_line(&known))
        }
    }
}

fn recorded_line(r: &RecordingStatusBody) -> String {
    let state = match &r.reason {
        Some(reason) => format!("ended ({reason})"),
        None => "active".to_owned(),
    };
    let [landmarks, laser] =
        [(r.landmarks, "landmark"), (r.laser, "scan")].map(|(n, what)| counted(n as u64, what));
    format!("{} on {}: {state}, {:.1} m, fixes by {landmarks}, {laser}", r.robot, r.map, r.distance_m)
}

fn learnt_lines(run: &ReferenceRunBody) -> String {
    let mut lines = vec![format!(
        "{}  {}: {:.1} m, {}",
        run.id,
        run.robot,
        run.distance_m,
        counted(run.cells as u64, "cell")
    )];
    lines.extend(run.statistics.iter().map(|m| {
        let [along, across, heading] = [0, 1, 2].map(|k| m.mean[k].hypot(m.sigma[k]));
        format!(
            "   {:9} off by {along:.3} m along, {across:.3} m across, {heading:.4} rad (RMS); available on {:.0} %",
            m.modality,
            100.0 * m.availability
        )
    }));
    lines.join("\n")
}

/// A mode by its word, one of the three that the argument may have.
fn mode(word: &str) -> FusionModeBody {
    match word {
        "all" => FusionModeBody::All,
        "near_best" => FusionModeBody::NearBest,
        _ => FusionModeBody::Best,
    }
}

/// How much of the map each is best on.
fn mode_line(known: &ModalityMapBody) -> String {
    let best = |modality| known.cells.iter().filter(|cell| cell.best == Some(modality)).count();
    let each = [ModalityBody::Odometry, ModalityBody::Laser, ModalityBody::Landmarks];
    let each = each.map(|modality| format!("{modality} {}", best(modality)));
    format!(
        "{}; best in {}: {}",
        known.fusion_mode,
        counted(known.cells.len() as u64, "cell"),
        each.join(", ")
    )
}

/// Poses of a file.
fn poses(text: &str) -> anyhow::Result<Vec<(i64, f64, f64, f64)>> {
    let lines =
        text.lines().enumerate().map(|(n, line)| (n + 1, line.split('#').next().unwrap_or_default().trim()));
    let mut poses = Vec::new();
    for (number, line) in lines.filter(|(_, line)| !line.is_empty()) {
        poses.push(pose(line).with_context(|| format!("line {number}"))?);
    }
    if poses.is_empty() {
        bail!("no poses in it");
    }
    Ok(poses)
}

fn pose(line: &str) -> anyhow::Result<(i64, f64, f64, f64)> {
    let mut words = line.split([' ', '\t', ',', ';']).filter(|word| !word.is_empty());
    let at_ns = nanoseconds(words.next().unwrap_or_default())?;
    let numbers: Vec<f64> = words
        .map(|word| {
            word.parse::<f64>()
                .ok()
                .filter(|v| v.is_finite())
                .with_context(|| format!("`{word}` is no number"))
        })
        .collect::<Result<_, _>>()?;
    match numbers[..] {
        [x, y, theta] => Ok((at_ns, x, y, theta)),
        [x, y, _z, qx, qy, qz, qw] => {
            let theta = (2.0 * (qw * qz + qx * qy)).atan2(1.0 - 2.0 * (qy * qy + qz * qz));
            Ok((at_ns, x, y, theta))
        }
        _ => bail!("4 or 8 numbers a line, not {}", numbers.len() + 1),
    }
}

/// Seconds to nanoseconds without the rounding of a floating-point number.
fn nanoseconds(word: &str) -> anyhow::Result<i64> {
    let (whole, fraction) = word.split_once('.').unwrap_or((word, ""));
    let digits = fraction.bytes().all(|b| b.is_ascii_digit());
    let seconds: i64 = whole.parse().with_context(|| format!("`{word}` is no time in seconds"))?;
    let nanos = format!("{fraction:0<9}");
    let nanos: i64 =
        nanos.get(..9).filter(|_| digits).and_then(|n| n.parse().ok()).context("no time in seconds")?;
    let sign = if whole.starts_with('-') { -1 } else { 1 };
    seconds
        .checked_mul(1_000_000_000)
        .and_then(|s| s.checked_add(sign * nanos))
        .context("a time beyond all clocks")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_forms_are_read_to_the_nanosecond() {
        let text = "# a path\n1700000000.123456789 1 2 0.5\n\n1700000000.2\t1.5,2.5,0,0,0,0.7071067811865476,0.7071067811865476 # turned\n-1.5 0 0 0\n";
        let read = poses(text).unwrap();
        assert_eq!(read[0], (1_700_000_000_123_456_789, 1.0, 2.0, 0.5));
        assert_eq!((read[1].0, read[1].1), (1_700_000_000_200_000_000, 1.5));
        assert!((read[1].3 - std::f64::consts::FRAC_PI_2).abs() < 1e-12);
        assert_eq!(read[2].0, -1_500_000_000);
    }

    #[test]
    fn what_is_wrong_is_named_by_its_line() {
        for (text, said) in [
            ("", "no poses"),
            ("1 2 3 4\n2 3 x 4\n", "line 2"),
            ("1 2 3\n", "line 1"),
            ("one 2 3 4\n", "seconds"),
            ("1.5e3 2 3 4\n", "seconds"),
            ("99999999999 2 3 4\n", "clocks"),
            ("1 nan 3 4\n", "`nan`"),
        ] {
            let error = format!("{:#}", poses(text).unwrap_err());
            assert!(error.contains(said), "{text:?}: {error}");
        }
    }
}
