//! `waymark camera`: what the server knows of robots' cameras, and calibration from pictures.

mod calibrate;

use super::{
    failure::{Class, Failure},
    screen::{Table, counted},
    session::{ServerArgs, Session},
};
use anyhow::Context as _;
use client::api::{Camera, IntrinsicsMonitorBody, IntrinsicsSuspicionBody};
use std::path::PathBuf;

/// `waymark camera`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, clap::Subcommand)]
enum Verb {
    /// Focal length, principal point and distortion from pictures of a flat object; no server
    ///
    /// Five to ten pictures of one poster or board from different sides, each of which shows it as
    /// its largest quad; at least three of the sides must differ by more than 15 degrees. Pictures
    /// that do not fit the others are left out and named. For example:
    ///   waymark camera calibrate pictures/ --size 0.60x0.84
    ///   waymark camera calibrate --corners corners.json --size 1x1 --radial 0 --json
    #[command(verbatim_doc_comment)]
    Calibrate(calibrate::Args),
    /// List the cameras of a robot: intrinsics, frames, and whether fixes say that the intrinsics
    /// are wrong.
    List {
        /// The robot.
        robot: String,
        #[command(flatten)]
        server: ServerArgs,
    },
    /// Write the last frame of a camera to a file.
    Frame {
        /// The robot.
        robot: String,
        /// The camera; left out, the only one of the robot.
        camera: Option<String>,
        /// Where to.
        #[arg(long, value_name = "FILE")]
        out: PathBuf,
        #[command(flatten)]
        server: ServerArgs,
    },
}

/// Runs the command.
pub(crate) async fn run(args: &Args) -> anyhow::Result<()> {
    match &args.verb {
        Verb::Calibrate(args) => calibrate::run(args),
        Verb::List { robot, server } => {
            let session = server.session()?;
            let done = list(&session, robot).await;
            session.explained(done).await
        }
        Verb::Frame { robot, camera, out, server } => {
            let session = server.session()?;
            let done = frame(&session, robot, camera.as_deref(), out).await;
            session.explained(done).await
        }
    }
}

async fn list(session: &Session, robot: &str) -> anyhow::Result<()> {
    let all = session.maps().cameras(robot).await?;
    let table = |all: &[Camera]| {
        Table::of(["camera", "image", "focal length", "frames", "intrinsics"], all, |c| {
            [
                c.name.clone(),
                format!("{} x {} px", c.width_px, c.height_px),
                format!("{:.1} px", c.intrinsics.fx_px),
                c.frames.to_string(),
                monitor_text(&c.intrinsics_monitor),
            ]
        })
    };
    session.list(&all, table, &format!("{robot} has sent no frame with intrinsics yet."))
}

/// Whether the intrinsics fit what was seen.
fn monitor_text(monitor: &IntrinsicsMonitorBody) -> String {
    match monitor.suspicion {
        None => format!("no doubt, by {}", counted(u64::from(monitor.tries), "frame")),
        Some(IntrinsicsSuspicionBody::Focal { error, sigma }) => {
            format!("focal length off by {:+.1} +- {:.1} %: calibrate", 100.0 * error, 100.0 * sigma)
        }
        Some(IntrinsicsSuspicionBody::Misfit { reduced_chi2 }) => {
            format!("corners fit {:.1} times worse than they should: calibrate", reduced_chi2.sqrt())
        }
        Some(IntrinsicsSuspicionBody::Refused { share }) => {
            format!(
                "{:.0} % of the frames fit no robot on the floor: check camera and mounting",
                100.0 * share
            )
        }
    }
}

async fn frame(session: &Session, robot: &str, camera: Option<&str>, out: &PathBuf) -> anyhow::Result<()> {
    let camera = match camera {
        Some(camera) => camera.to_owned(),
        None => only(session, robot).await?,
    };
    let frame = session.maps().camera_frame(robot, &camera).await?;
    std::fs::write(out, &frame.image).with_context(|| out.display().to_string())?;
    let shown = serde_json::json!({ "seq": frame.seq, "media_type": frame.media_type, "file": out });
    session.show(&shown, &format!("frame {} of {robot}/{camera} in {}", frame.seq, out.display()))
}

async fn only(session: &Session, robot: &str) -> anyhow::Result<String> {
    let mut names: Vec<String> = session.maps().cameras(robot).await?.into_iter().map(|c| c.name).collect();
    match names.len() {
        1 => Ok(names.remove(0)),
        0 => {
            Err(Failure::new(Class::NotFound, "no_camera", format!("{robot} has sent no frame yet.")).into())
        }
        _ => Err(Failure::usage(format!("Which camera? {robot} has {}.", names.join(", "))).into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_suspicion_is_shown_with_its_number() {
        let monitor = IntrinsicsMonitorBody {
            tries: 12,
            refused: 0,
            landmarks: 2,
            reduced_chi2: None,
            focal_error: None,
            focal_sigma: None,
            suspicion: None,
        };
        assert_eq!(monitor_text(&monitor), "no doubt, by 12 frames");
        let with = |suspicion| monitor_text(&IntrinsicsMonitorBody { suspicion: Some(suspicion), ..monitor });
        let focal = with(IntrinsicsSuspicionBody::Focal { error: -0.05, sigma: 0.01 });
        assert_eq!(focal, "focal length off by -5.0 +- 1.0 %: calibrate");
        assert!(with(IntrinsicsSuspicionBody::Misfit { reduced_chi2: 9.0 }).contains("3.0 times"));
        assert!(with(IntrinsicsSuspicionBody::Refused { share: 0.9 }).contains("90 %"));
    }
}
