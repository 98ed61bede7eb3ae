//! `waymark record`: what the robots of a fleet and the server send, as an MCAP file.

use super::{
    Endpoints,
    recorder::{Recorder, RecorderOptions},
};
use crate::{failure::Failure, session::Session};
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
    #[command(flatten)]
    endpoints: Endpoints,
}

/// Records until it is told to end.
pub(crate) async fn run(args: &Args) -> anyhow::Result<()> {
    let session = args.endpoints.server.session()?;
    let done = record(&session, args).await;
    session.explained(done).await
}

async fn record(session: &Session, args: &Args) -> anyhow::Result<()> {
    let longest = args.seconds.map(Duration::try_from_secs_f64).transpose();
    let longest = longest.map_err(|error| Failure::usage(format!("--seconds: {error}.")))?;
    let options = RecorderOptions {
        file: args.file.clone(),
        server: session.maps().clone(),
        zenoh: args.endpoints.zenoh.clone(),
        fleet: args.endpoints.fleet.clone(),
        robots: args.robot.clone(),
        maps: Vec::new(),
    };
    let recorder = Recorder::start(&options).await?;
    session.note(&format!("Recording to {}; end with Ctrl-C.", args.file.display()));
    let end = async {
        match longest {
            Some(longest) => tokio::time::sleep(longest).await,
            None => drop(tokio::signal::ctrl_c().await),
        }
    };
    let report = recorder.run(end).await?;
    session.show(&report, &report.sentence(&args.file))
}
