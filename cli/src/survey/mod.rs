//! `waymark survey`: the map of a building from drives of a robot.
//!
//! ```text
//! drive_log (each file) -> engine::survey (walls, objects and camera in one estimate) -> upload, report
//! ```

mod drive_log;
pub(crate) mod upload;
pub(crate) mod report;
mod simulated;

pub use drive_log::DriveLog;
pub use simulated::{SimulatedDrive, UNEVEN_M, believed_odometry, simulated_drive};

use crate::{arg_parsers::numbers, recording::drive_args::DriveArgs, screen, session::ServerArgs};
use anyhow::Context as _;
use client::protos::Name;
use engine::survey::{self, Drive, Effort, SurveyedBuilding};
use indicatif::ProgressBar;
use map::pose2::Pose2;
use map::slam::{Slam, SlamMap, SlamParams};
use report::SurveyReport;
use std::{collections::BTreeMap, num::NonZeroUsize, path::PathBuf, sync::Mutex};
use vision::params::Params;

/// Most drives of one survey.
const MAX_DRIVES: usize = 8;

/// `waymark survey`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Recordings (`waymark record`), or bags of ROS 2 with MCAP storage: scans, odometry, and
    /// frames with intrinsics and the camera's mounting. Several drives of one robot make one map;
    /// each but the first must see two objects of those before it.
    #[arg(value_name = "RECORDING", required = true, num_args = 1..=MAX_DRIVES)]
    recordings: Vec<PathBuf>,
    /// Make this map on the server, with walls and landmarks, and learn them. Without it, nothing
    /// is sent.
    #[arg(long, value_name = "MAP")]
    into: Option<Name>,
    /// Where the first drive begins, if that is known in the frame of the map: x and y in metres,
    /// heading in radians. Without it, the drives make the frame, and errors are against them as a
    /// whole.
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

/// Makes the laser map of each drive, then surveys all, with progress. `origin`: the first pose of
/// the first drive, where it is known in the frame of the map.
pub fn surveyed(
    logs: &[DriveLog],
    origin: Option<&Pose2>,
    params: &Params,
) -> anyhow::Result<SurveyedBuilding> {
    let slams = logs.iter().map(laser_map).collect::<Result<_, _>>()?;
    let drives: Vec<Drive> = logs.iter().map(|log| log.drive.clone()).collect();
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
    let made = survey::surveyed(&drives, slams, origin, (params, Effort { threads, told: &told }));
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
    let (logs, problems, building) = tokio::task::block_in_place(|| {
        let (mut logs, mut problems) = (Vec::new(), BTreeMap::new());
        for recording in &args.recordings {
            let read = drive_log::read(recording, &args.drive, args.camera.as_ref())?;
            logs.push(read.log);
            for (word, (count, first)) in read.problems {
                problems.entry(word).or_insert((0, first)).0 += count;
            }
        }
        let building = surveyed(&logs, args.origin.as_ref(), &Params::default())?;
        anyhow::Ok((logs, problems, building))
    })?;
    let landmarks = match &args.into {
        None => None,
        Some(map) => {
            let sent = upload::upload(session.maps(), map.as_str(), &logs, &building).await;
            Some(session.explained(sent).await?)
        }
    };
    let sent = args.into.as_ref().zip(landmarks.as_deref()).map(|(map, all)| (map.as_str(), all));
    let report = SurveyReport::new(&logs, &building, sent, problems);
    if args.into.is_none() {
        screen::complain("Nothing was sent: --into MAP makes the map on a server.");
    }
    session.show(&report, &report.text())
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Args as _;

    #[test]
    fn a_survey_has_one_drive_or_up_to_eight() {
        let survey = Args::augment_args(clap::Command::new("survey"));
        let takes = |drives: usize| {
            let words = (0..drives).map(|n| format!("{n}.mcap"));
            survey.clone().try_get_matches_from(std::iter::once("survey".to_owned()).chain(words)).is_ok()
        };
        assert_eq!([0, 1, MAX_DRIVES, MAX_DRIVES + 1].map(takes), [false, true, true, false]);
    }
}
