//! `waymark run`: records a robot's run and gives its reference trajectory, so that the map learns
//! which modality to trust where.

mod trajectory;

use super::{
    failure::{Class, Failure},
    screen::{Table, counted},
    session::{Consent, MapArgs, Session},
};
use anyhow::Context as _;
use client::api::{RecordingStatusBody, ReferenceRunBody, ReferenceTrajectoryBody};
use std::path::{Path, PathBuf};

/// `waymark run`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(subcommand)]
    verb: Verb,
    #[command(flatten)]
    map: MapArgs,
}

#[derive(Debug, clap::Subcommand)]
enum Verb {
    /// Start a recording of odometry and of fixes by landmarks and laser, in the server's memory.
    Start {
        /// The robot.
        robot: String,
    },
    /// Show the recording's status.
    Status {
        /// The robot.
        robot: String,
    },
    /// Cancel the recording.
    Cancel {
        /// The robot.
        robot: String,
    },
    /// End the recording with the robot's reference trajectory: the map learns from it.
    Learn {
        /// The robot.
        robot: String,
        /// A pose a line, on the map and by the robot's clock: `seconds x y z qx qy qz qw` (TUM),
        /// or `seconds x y theta`; metres, radians, `#` begins a remark.
        trajectory: PathBuf,
        /// Standard deviation of its positions, metres [default: 0.01].
        #[arg(long)]
        sigma_m: Option<f64>,
        /// Standard deviation of its headings, radians [default: 0.005].
        #[arg(long)]
        sigma_rad: Option<f64>,
    },
    /// List the reference runs of a map.
    List,
    /// Show a reference run: how well each modality did.
    Show {
        /// Number of the run.
        run: i64,
    },
    /// Delete a reference run with its statistics. This cannot be undone.
    Delete {
        /// Number of the run.
        run: i64,
        #[command(flatten)]
        consent: Consent,
    },
}

/// Runs the command.
pub(crate) async fn run(args: &Args) -> anyhow::Result<()> {
    let session = args.map.session()?;
    let done = on_server(&session, &args.verb).await;
    session.explained(done).await
}

async fn on_server(session: &Session, verb: &Verb) -> anyhow::Result<()> {
    let maps = session.maps();
    match verb {
        Verb::Start { robot } => {
            let begun = maps.start_recording(robot).await?;
            session.show(&begun, &format!("a run of {robot} on {} is being recorded", begun.map))?;
            session.note(&format!("  When it has driven: waymark run learn {robot} TRAJECTORY"));
            Ok(())
        }
        Verb::Status { robot } => {
            let recorded = maps.recording(robot).await?;
            session.show(&recorded, &recorded_line(&recorded))
        }
        Verb::Cancel { robot } => {
            maps.cancel_recording(robot).await?;
            session.show(robot, &format!("recording of {robot} cancelled"))
        }
        Verb::Learn { robot, trajectory, sigma_m, sigma_rad } => {
            let known = reference(trajectory, *sigma_m, *sigma_rad)?;
            let learnt = maps.finish_recording(robot, &known).await?;
            session.show(&learnt, &run_lines(&learnt))
        }
        Verb::List => {
            let all = maps.reference_runs(session.map().await?).await?;
            let table = |all: &[ReferenceRunBody]| {
                Table::of(["run", "robot", "length", "pose cells"], all, |r| {
                    [r.id.to_string(), r.robot.clone(), format!("{:.1} m", r.distance_m), r.cells.to_string()]
                })
            };
            session.list(
                &all,
                table,
                "The map has learnt from no run yet. Record one: waymark run start ROBOT",
            )
        }
        Verb::Show { run } => {
            let all = maps.reference_runs(session.map().await?).await?;
            let found = all.iter().find(|r| r.id == *run).ok_or_else(|| {
                Failure::new(Class::NotFound, "unknown_reference_run", format!("There is no run {run}."))
            })?;
            session.show(found, &run_lines(found))
        }
        Verb::Delete { run, consent } => {
            let map = session.map().await?;
            consent.ask(&format!(
                "Delete run {run} of {map} and what was learnt from it? This cannot be undone."
            ))?;
            maps.delete_reference_run(map, *run).await?;
            session.show(run, &format!("run {run} deleted"))
        }
    }
}

fn reference(
    path: &Path,
    sigma_m: Option<f64>,
    sigma_rad: Option<f64>,
) -> anyhow::Result<ReferenceTrajectoryBody> {
    let text = std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    let poses = trajectory::poses(&text).with_context(|| path.display().to_string())?;
    Ok(ReferenceTrajectoryBody { poses, sigma_m, sigma_rad })
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

fn run_lines(run: &ReferenceRunBody) -> String {
    let cells = counted(run.cells as u64, "pose cell");
    let mut lines = vec![format!("run {} of {}: {:.1} m, {cells}", run.id, run.robot, run.distance_m)];
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_recording_is_shown_with_its_state() {
        let recording = RecordingStatusBody {
            map: "office".into(),
            robot: "r1".into(),
            active: true,
            reason: None,
            distance_m: 12.34,
            span_ns: None,
            odometry: 9,
            landmarks: 1,
            laser: 2,
        };
        assert_eq!(recorded_line(&recording), "r1 on office: active, 12.3 m, fixes by 1 landmark, 2 scans");
        let ended = RecordingStatusBody { reason: Some("full".into()), ..recording };
        assert!(recorded_line(&ended).contains("ended (full)"));
    }

    #[test]
    fn a_run_without_statistics_is_one_line() {
        let robot = "r1".to_owned();
        let run =
            ReferenceRunBody { id: 3, robot, created_ms: 0, distance_m: 40.0, cells: 1, statistics: vec![] };
        assert_eq!(run_lines(&run), "run 3 of r1: 40.0 m, 1 pose cell");
    }

    #[test]
    fn a_trajectory_that_cannot_be_read_names_its_file() {
        let error = reference(Path::new("none.tum"), None, None).unwrap_err();
        assert!(format!("{error:#}").contains("none.tum"));
    }
}
