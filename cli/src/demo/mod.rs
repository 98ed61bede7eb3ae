//! `waymark demo`: a server, a simulated corridor, a first drive that teaches, then robots that are
//! localised. Everything works as with real robots: lessons over HTTP, frames over zenoh. Only the
//! building is simulated.

mod drive;
mod summary;
mod surveying;
mod teaching;

use super::{
    recording::recorder::{RecordReport, Recorder, RecorderOptions},
    scratch, screen,
};
use anyhow::Context as _;
use client::MapClient;
use protos::Name;
use server::{
    RunningServer, Server,
    config::{Config, RawConfig},
};
use sim::building::Building;
use std::{
    net::TcpListener,
    path::{Path, PathBuf},
    process::ExitCode,
    sync::Arc,
};
use tokio::{sync::oneshot, task::JoinHandle};

/// Name of the demo's map.
const MAP: &str = "corridor";
/// As the settings have it.
const FLEET: &str = "default";
/// Where the page is when nobody else listens there.
const HTTP: &str = "127.0.0.1:8080";

/// `waymark demo`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Robots that drive at the same time.
    #[arg(long, default_value_t = 2, value_parser = clap::value_parser!(u32).range(1..=8))]
    robots: u32,
    /// Frames a second of each robot.
    #[arg(long, default_value_t = 4.0, value_parser = rate)]
    rate_hz: f64,
    /// Times that each robot drives the length of the corridor.
    #[arg(long, default_value_t = 2, value_parser = clap::value_parser!(u32).range(1..=100))]
    legs: u32,
    /// The building, its pictures and all noise follow from it.
    #[arg(long, default_value_t = 2)]
    seed: u64,
    /// The first robot knows neither its pose nor what hangs where: it surveys the building in one
    /// drive, as `waymark survey` does. Otherwise it knows its pose and is told the names.
    #[arg(long)]
    survey: bool,
    /// Where the page listens [default: 127.0.0.1:8080, or a free port if that is taken].
    #[arg(long)]
    http: Option<String>,
    /// Keep the server and its map in this folder afterwards [default: a temporary folder,
    /// removed].
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// Keep serving the page after the summary, until Ctrl-C.
    #[arg(long)]
    stay: bool,
    /// Record the robots' drives to this MCAP file, which must not exist; they send the scans of
    /// their lasers, too.
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,
    /// End with the summary as one JSON object.
    #[arg(long)]
    json: bool,
}

fn rate(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(hz) if (0.2..=30.0).contains(&hz) => Ok(hz),
        _ => Err("a number from 0.2 to 30".to_owned()),
    }
}

/// Runs the demo.
pub(crate) async fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let scratch = scratch::Folder::new("demo").context("a temporary folder")?;
    let data = args.data.clone().unwrap_or_else(|| scratch.path().to_owned());
    let server = Server::start(settings(args, data)?).await?;
    screen::complain(&format!("Waymark demo. Watch it at {}", page(&server)));

    let building = Arc::new(Building::corridor(args.seed));
    let taught = if args.survey {
        surveying::survey(&building, &server, (args.seed, args.rate_hz)).await?
    } else {
        teaching::teach(&building, &server, args.seed).await?
    };
    screen::complain(&format!(
        "First drive: {} walls, {} of {} landmarks in use, learnt from {} views; in {} frames the poster was not found, \
         {} views did not agree with the others.",
        taught.walls,
        taught.active,
        taught.landmarks,
        taught.views,
        taught.views_missed,
        taught.views_left_out
    ));
    let recording = recording(args, &server).await?;
    let record = drive::drive(&building, &server, args).await?;
    if let Some((end, recording)) = recording {
        drop(end);
        let report = recording.await.context("the recorder's task")??;
        screen::complain(&report.sentence(args.record.as_deref().unwrap_or(Path::new(""))));
    }
    let summary = summary::summarise(&taught, &record);
    if args.json {
        screen::say(&serde_json::to_string(&summary)?);
    } else {
        screen::say(&summary.table());
    }
    if args.stay {
        screen::complain(&format!("The page stays until Ctrl-C. A new link to it: {}", page(&server)));
        tokio::signal::ctrl_c().await.context("Ctrl-C")?;
    }
    server.stop().await;
    Ok(if summary.false_matches + summary.false_guided == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// A link to the page that opens it once.
fn page(server: &RunningServer) -> String {
    server.page_link().unwrap_or_else(|| format!("http://{}/", server.http_addr))
}

/// A recording of the demo that ends when the sender is dropped.
async fn recording(
    args: &Args,
    server: &RunningServer,
) -> anyhow::Result<Option<(oneshot::Sender<()>, JoinHandle<anyhow::Result<RecordReport>>)>> {
    let Some(file) = &args.record else { return Ok(None) };
    let options = RecorderOptions {
        file: file.clone(),
        server: MapClient::new(&format!("http://{}", server.http_addr))?,
        zenoh: server.zenoh_endpoint.clone(),
        fleet: Name::new(FLEET)?,
        maps: vec![MAP.to_owned()],
        robots: Vec::new(),
    };
    let (end, ended) = oneshot::channel();
    let recorder = Recorder::start(&options).await?;
    Ok(Some((end, tokio::spawn(recorder.run(async move { drop(ended.await) })))))
}

fn settings(args: &Args, data: PathBuf) -> anyhow::Result<Config> {
    let http = args.http.clone().unwrap_or_else(|| {
        // Somebody else may serve there: then any free port will do, it is printed.
        if TcpListener::bind(HTTP).is_ok() { HTTP.to_owned() } else { "127.0.0.1:0".to_owned() }
    });
    let raw = RawConfig { data, http, zenoh: "tcp/127.0.0.1:0".to_owned(), ..RawConfig::default() };
    Ok(Config::try_from(raw)?)
}
