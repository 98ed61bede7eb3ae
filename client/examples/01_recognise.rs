//! A robot in thirty lines: send photographs over zenoh, print the quads and names of each answer.
//!
//! ```text
//! waymark serve                                      # in another terminal, with a map that has been taught
//! cargo run -p client --example 01_recognise -- --robot r1 photo1.jpg photo2.jpg
//! ```
#![expect(clippy::print_stdout, reason = "an example shows its results")]

use clap::Parser;
use client::{Capture, ClientError, Delivery, RobotClient, RobotOptions, named_landmarks, v1};
use std::{path::PathBuf, time::Duration};

/// Send photographs to a running Waymark server as robot ROBOT and print the answers.
#[derive(Parser)]
struct Arguments {
    /// The server's zenoh endpoint.
    #[arg(long, default_value = "tcp/127.0.0.1:7447")]
    endpoint: String,
    /// Fleet, as in the server's settings.
    #[arg(long, default_value = "default")]
    fleet: String,
    /// The robot's name; `PUT /api/v1/robots/ROBOT {"map": ...}` makes it known.
    #[arg(long, default_value = "r1")]
    robot: String,
    /// The file robot.json of `waymark robot enrol`, for an encrypted server: in place of the other
    /// three.
    #[arg(long)]
    robot_file: Option<PathBuf>,
    /// JPEG or PNG files.
    #[arg(required = true)]
    images: Vec<PathBuf>,
}

#[tokio::main]
async fn main() -> Result<(), anyhow::Error> {
    let arguments = Arguments::parse();
    // Every photograph counts here, so wait for a full link. A driving robot keeps
    // `Delivery::Latest`.
    let options = match &arguments.robot_file {
        Some(file) => RobotOptions::from_file(file)?,
        None => RobotOptions::new(&arguments.endpoint, &arguments.fleet, &arguments.robot),
    };
    let options = RobotOptions { delivery: Delivery::Every, ..options };
    let robot = RobotClient::connect(&options).await?;
    let count = arguments.images.len();
    for (i, path) in arguments.images.iter().enumerate() {
        let image = std::fs::read(path)
            .map_err(|error| ClientError::File { path: path.display().to_string(), error })?;
        // `Capture::raw(..)` takes pixels of a camera. `.with_intrinsics(..)` gives poses of
        // landmarks, `.with_mounting(..)` also the robot's own.
        let capture = Capture::encoded(image)?;
        let answer = robot.recognise("camera", capture, Duration::from_secs(30)).await?;
        println!("[{}/{count}] {}: {}", i + 1, path.display(), sentence(&answer));
        for named in named_landmarks(&answer) {
            let at = named.quad.corners.iter().map(|c| format!("({:.0}, {:.0})", c.u_px, c.v_px));
            let at = at.collect::<Vec<_>>().join(" ");
            // A guided name starts no pose: `answer.map_from_robot` rests on global names alone.
            let how = match named.sighting {
                v1::Sighting::Guided => ", named by the pose known before,".to_owned(),
                _ => format!(" with confidence {:.2}", named.quad.confidence),
            };
            println!("    {}{how} at {at}", named.name);
        }
    }
    robot.close().await?;
    Ok(())
}

/// The answer in words. "Nothing recognised" is an answer; a refusal names the field at fault.
fn sentence(answer: &v1::Answer) -> String {
    match &answer.rejection {
        Some(r) => format!("refused, {} in {}: {}", r.code, r.field, r.detail),
        None => format!(
            "{} with {} quads against map {} version {} in {:.0} ms",
            v1::Status::as_str_name(&answer.status()).trim_start_matches("STATUS_").to_lowercase(),
            answer.quads.len(),
            answer.map,
            answer.map_version,
            answer.latency_ms
        ),
    }
}
