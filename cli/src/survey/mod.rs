//! `waymark survey`: the map of a building from one drive.
//!
//! ```text
//! drive_log (scans, frames, odometry) -> sightings (quads of frames) -> objects (quads of one
//! object) -> building (walls, objects and camera in one estimate) -> upload, report
//! ```

mod drive_log;
mod sightings;
mod objects;
mod building;
pub(crate) mod upload;
pub(crate) mod report;
mod simulated;

pub use building::{SurveyedBuilding, SurveyedObject, surveyed};
pub use drive_log::{DriveLog, LoggedFrame, LoggedScan};
pub use objects::ObjectView;
pub use simulated::{SimulatedDrive, simulated_drive};

use crate::{arg_parsers::numbers, recording::drive_args::DriveArgs, screen, session::ServerArgs};
use client::protos::Name;
use map::pose2::Pose2;
use report::SurveyReport;
use std::path::PathBuf;
use vision::params::Params;

/// `waymark survey`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// A recording (`waymark record`), or a bag of ROS 2 with MCAP storage: scans, odometry, and
    /// frames with intrinsics and the camera's mounting.
    #[arg(value_name = "RECORDING")]
    recording: PathBuf,
    /// Make this map on the server, with walls and landmarks, and learn them. Without it, nothing is
    /// sent.
    #[arg(long, value_name = "MAP")]
    into: Option<Name>,
    /// Where the drive begins in the frame of the map: x and y in metres, heading in radians.
    #[arg(long, value_name = "X,Y,THETA", value_parser = origin, allow_hyphen_values = true, default_value = "0,0,0")]
    origin: Pose2,
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
