//! `waymark record`: what the robots of a fleet and the server send, as an MCAP file.

use super::{
    Endpoints,
    recorder::{Recorder, RecorderOptions},
};
use crate::screen;
use anyhow::Context as _;
use client::protos::Name;
use std::{path::PathBuf, time::Duration};

/// `waymark record`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// The file to write; it must not exist.
    file: PathBuf,
    /// Record this robot alone; may be given several times [default: all robots].
    #[arg(long, value_name = "NAME")]
    robot: Vec<Name>,
    /// End after so many seconds [default: with Ctrl-C].
    #[arg(long, value_name = "SECONDS")]
    seconds: Option<f64>,
    /// End with the counts as one JSON object.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    endpoints: Endpoints,
}

/// Records until it is told to end.
pub(crate) async fn run(args: &Args) -> anyhow::Result<()> {
    let longest = args.seconds.map(Duration::try_from_secs_f64).transpose().context("--seconds")?;
    let options = RecorderOptions {
        file: args.file.clone(),
        server: args.endpoints.server.clone(),
        zenoh: args.endpoints.zenoh.clone(),
        fleet: args.endpoints.fleet.clone(),
        robots: args.robot.clone(),
        maps: Vec::new(),
    };
    let recorder = Recorder::start(&options).await?;
    screen::complain(&format!("Recording to {}; end with Ctrl-C.", args.file.display()));
    let end = async {
        match longest {
            Some(longest) => tokio::time::sleep(longest).await,
            None => drop(tokio::signal::ctrl_c().await),
        }
    };
    let report = recorder.run(end).await?;
    if args.json {
        screen::say(&serde_json::to_string(&report)?);
    } else {
        screen::say(&report.sentence(&args.file));
    }
    Ok(())
}
