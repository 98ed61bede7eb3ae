//! `waymark robot send`: photographs as frames of a robot, over zenoh, and the answers.

use crate::{
    answers::sentence,
    camera_arg::{CameraArg, camera},
    failure::{Class, Failure},
    pictures::{self, Sent},
    session::Session,
};
use anyhow::Context as _;
use client::{Capture, Delivery, RobotClient, RobotOptions, protos::Name, v1};
use std::{
    path::{Path, PathBuf},
    time::Duration,
};

/// Longest wait for an answer.
const LONGEST: Duration = Duration::from_secs(30);
/// The camera that the frames are of.
const CAMERA: &str = "camera";

/// `waymark robot send`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// The robot: one that is known to the server, and that no other program drives.
    robot: Name,
    /// Photographs, PNG, JPEG or BMP; turned upright, and made smaller where they have more pixels
    /// than a frame may have.
    #[arg(required = true, value_name = "PHOTO")]
    photographs: Vec<PathBuf>,
    /// Camera for poses of the landmarks: the file that `waymark camera calibrate --json` wrote,
    /// ROS' ost.yaml, or fx,fy,cx,cy in pixels. A photograph that is made smaller has scaled
    /// intrinsics.
    #[arg(long, value_name = "FILE|FX,FY,CX,CY", value_parser = camera)]
    camera: Option<CameraArg>,
    /// The file robot.json of `waymark robot enrol`, for an encrypted server: in place of --zenoh
    /// and --fleet.
    #[arg(long, value_name = "FILE")]
    robot_file: Option<PathBuf>,
    /// Where the server takes messages of robots.
    #[arg(
        long,
        env = "WAYMARK_ZENOH",
        help_heading = "Server",
        default_value = "tcp/127.0.0.1:7447",
        value_name = "ENDPOINT"
    )]
    zenoh: String,
    /// The fleet of the server's settings.
    #[arg(long, help_heading = "Server", default_value = "default")]
    fleet: Name,
}

pub(super) async fn run(session: &Session, args: &Args) -> anyhow::Result<()> {
    let options = match &args.robot_file {
        Some(file) => RobotOptions::from_file(file)?,
        None => RobotOptions::new(&args.zenoh, args.fleet.as_str(), args.robot.as_str()),
    };
    if options.robot != args.robot.as_str() {
        return Err(
            Failure::usage(format!("--robot-file is of {}, not of {}.", options.robot, args.robot)).into()
        );
    }
    let robot = RobotClient::connect(&RobotOptions { delivery: Delivery::Every, ..options }).await?;
    for path in &args.photographs {
        photograph(session, &robot, args, path).await?;
    }
    Ok(robot.close().await?)
}

async fn photograph(session: &Session, robot: &RobotClient, args: &Args, path: &Path) -> anyhow::Result<()> {
    let name = path.display().to_string();
    let Sent { bytes, shrunk, lens } = pictures::frame(path).with_context(|| name.clone())?;
    if let Some([[w, h], [to_w, to_h]]) = shrunk {
        session.note(&format!("{name}: {w}x{h} px made {to_w}x{to_h}; corners are of that size."));
    }
    let camera = match &args.camera {
        Some(camera) => {
            if let Some(caution) = camera.check_lens(lens.as_ref())? {
                session.note(&format!("{name}: {caution}"));
            }
            Some(camera.of_photograph(&bytes)?)
        }
        None => None,
    };
    let mut capture = Capture::encoded(bytes).with_context(|| name.clone())?;
    if let Some(camera) = &camera {
        capture = capture.with_intrinsics(camera);
    }
    let answer = robot.recognise(CAMERA, capture, LONGEST).await?;
    if let Some(refused) = &answer.rejection {
        return Err(rejected(&name, args.robot.as_str(), refused).into());
    }
    session.show(&answer, &sentence(&name, &answer))
}

/// A frame that the server refused.
fn rejected(name: &str, robot: &str, refused: &v1::Rejection) -> Failure {
    let v1::Rejection { code, field, detail, .. } = refused;
    let at = if field.is_empty() { String::new() } else { format!("{field}: ") };
    let class = if code.starts_with("unknown_") { Class::NotFound } else { Class::Refused };
    let advice = match code.as_str() {
        "unknown_robot" => format!("Make it known: waymark robot add {robot} --map MAP"),
        "epoch_conflict" => format!("Another program is {robot}: stop it, or send as another robot."),
        _ => "docs/guides/troubleshooting.md has every code.".to_owned(),
    };
    Failure::new(class, code, format!("{name}: {at}{detail}.")).advise(advice)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_refused_frame_says_what_to_do() {
        let refused =
            |code: &str| v1::Rejection { code: code.into(), detail: "no".into(), ..Default::default() };
        let unknown = rejected("a.jpg", "r1", &refused("unknown_robot"));
        assert_eq!((unknown.class, unknown.sentence.as_str()), (Class::NotFound, "a.jpg: no."));
        assert!(unknown.advice.contains("waymark robot add r1"), "{}", unknown.advice);
        assert_eq!(rejected("a.jpg", "r1", &refused("too_large")).class, Class::Refused);
    }
}
