//! `waymark survey`: the map of a building from one drive.
//!
//! ```text
//! drive_log (a file) -> engine::survey (walls, objects and camera in one estimate) -> upload, report
//! ```

mod drive_log;
pub(crate) mod upload;
pub(crate) mod report;
mod simulated;

pub use drive_log::DriveLog;
pub use simulated::{SimulatedDrive, UNEVEN_M, simulated_drive};

use crate::{arg_parsers::numbers, recording::drive_args::DriveArgs, screen, session::ServerArgs};
use anyhow::Context as _;
use client::protos::Name;
use engine::survey::{self, Effort, SurveyedBuilding};
use indicatif::ProgressBar;
use map::pose2::Pose2;
use map::slam::{Slam, SlamMap, SlamParams};
use report::SurveyReport;
use std::{num::NonZeroUsize, path::PathBuf, sync::Mutex};
use vision::params::Params;

/// `waymark survey`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// A recording (`waymark record`), or a bag of ROS 2 with MCAP storage: scans, odometry, and
    /// frames with intrinsics and the camera's mounting.
    #[arg(value_name = "RECORDING")]
    recording: PathBuf,
    /// Make this map on the server, with walls and landmarks, and learn them. Without it, nothing
    /// is sent.
    #[arg(long, value_name = "MAP")]
    into: Option<Name>,
    /// Where the drive begins, if that is known in the frame of the map: x and y in metres, heading
    /// in radians. Without it, the drive makes the frame, and errors are against it as a whole.
    #[arg(long, value_name = "X,Y,THETA", value_parser = origin, allow_hyphen_values = true)]
    origin: Option<Pose2>,
    /// The camera whose frames are used, if there are several.
    #[arg(long, value_name = "NAME")]
    camera: Option<Name>,
    #[command(flatten)]
    drive: DriveArgs,
    #[command(flatten)]
    server: ServerArgs,
}

fn origin(text: &str) -> Result<Pose2, String> {
    let wrong = || "three numbers with commas between, as 1.5,-2,0.3".to_owned();
    let [x_m, y_m, theta_rad] = numbers(text, ',').ok_or_else(wrong)?;
    let pose = Pose2::new(x_m, y_m, theta_rad);
    pose.check().map_err(|error| error.to_string())?;
    Ok(pose)
}

/// Makes the laser map of a drive, then surveys it, with progress.
pub fn surveyed(log: &DriveLog, params: &Params) -> anyhow::Result<SurveyedBuilding> {
    let slam = laser_map(log)?;
    let bars: Mutex<Option<(&'static str, ProgressBar)>> = Mutex::new(None);
    let told = |what: &'static str, done: usize, of: usize| {
        let mut bar = bars.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        if bar.as_ref().is_none_or(|(before, _)| *before != what)
            && let Some((_, before)) = bar.replace((what, screen::progress(of, what)))
        {
            before.finish_and_clear();
        }
        if let Some((_, bar)) = bar.as_ref() {
            bar.set_position(done as u64);
        }
    };
    let threads = std::thread::available_parallelism().unwrap_or(NonZeroUsize::MIN);
    let made =
        survey::surveyed(&log.drive, slam, log.origin.as_ref(), (params, Effort { threads, told: &told }));
    if let Some((_, bar)) = bars.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner) {
        bar.finish_and_clear();
    }
    Ok(made?)
}

fn laser_map(log: &DriveLog) -> anyhow::Result<SlamMap> {
    let bar = screen::progress(log.scans.len(), "mapping");
    let mut slam = Slam::new(SlamParams::default());
    for (i, (stamp, scan)) in log.drive.scans.iter().zip(&log.scans).enumerate() {
        slam.add(&stamp.odom, scan).with_context(|| format!("scan {i}"))?;
        bar.inc(1);
    }
    bar.set_message("fitting");
    let map = slam.finish()?;
    bar.finish_and_clear();
    Ok(map)
}

/// Runs the command.
pub(crate) async fn run(args: &Args) -> anyhow::Result<()> {
    let session = args.server.session()?;
    let (read, building) = tokio::task::block_in_place(|| {
        let mut read = drive_log::read(&args.recording, &args.drive, args.camera.as_ref())?;
        read.log.origin = args.origin;
        let building = surveyed(&read.log, &Params::default())?;
        anyhow::Ok((read, building))
    })?;
    let landmarks = match &args.into {
        None => None,
        Some(map) => {
            let sent = upload::upload(session.maps(), map.as_str(), &read.log, &building).await;
            Some(session.explained(sent).await?)
        }
    };
    let sent = args.into.as_ref().zip(landmarks.as_deref()).map(|(map, all)| (map.as_str(), all));
    let report = SurveyReport::new(&read.log, &building, sent, read.problems);
    if args.into.is_none() {
        screen::complain("Nothing was sent: --into MAP makes the map on a server.");
    }
    session.show(&report, &report.text())
}
