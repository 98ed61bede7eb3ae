//! The cost of the server's own layers where everything is encrypted: a frame and its answer beside
//! an echo of zenoh, and a `GET` beside a bare handler of axum. Both peers run in this process with
//! certificates of the same authority.

mod bare_http;
mod echo;

use crate::evaluate::statistics::quantile;
use anyhow::Context as _;
use cli::{pictures, scratch, screen};
use client::{
    Capture, Delivery, LandmarkRegion, MapClient, RobotClient, RobotOptions, RobotTls,
    api::{CertificateRequest, NewMap, Size},
};
use rcgen::{CertificateParams, Issuer, KeyPair};
use serde::Serialize;
use server::{
    RunningServer, Server,
    config::{Config, RawConfig, RawTls},
};
use sim::posters::poster_of_size;
use std::{
    fs,
    path::{Path, PathBuf},
    time::{Duration, Instant},
};
use vision::frame::GrayImage;

const MAP: &str = "hall";
const ROBOT: &str = "bench";
const FRAME_PX: [usize; 2] = [640, 480];
/// Width of the poster in the frame, px.
const POSTER_PX: usize = 240;
/// Rounds before any is counted.
const WARM_UP: usize = 20;
const WAIT: Duration = Duration::from_secs(10);

/// `waymark-lab bench encrypted`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Frames, each in turn with an echo of the same bytes.
    #[arg(long, default_value_t = 300, value_parser = clap::value_parser!(u32).range(3..=100_000))]
    frames: u32,
    /// Requests of each kind and connection in a round; five rounds in turn.
    #[arg(long, default_value_t = 2000, value_parser = clap::value_parser!(u32).range(10..=100_000))]
    requests: u32,
    /// Print one JSON object instead of the tables.
    #[arg(long)]
    json: bool,
}

/// Medians.
#[derive(Debug, Serialize)]
struct Measured {
    /// A frame and its answer, ms.
    round_trip_ms: f64,
    /// The stages of vision of it, by the answer.
    vision_ms: f64,
    /// The same bytes through zenoh, and an answer of the same size back, ms.
    echo_ms: f64,
    /// Of the sum of echo and vision.
    round_trip_ratio: f64,
    /// Bytes of the frame and of the answer.
    bytes: [usize; 2],
    /// Requests a second, and of which path.
    http: Vec<bare_http::Rates>,
}

/// Runs the benchmark.
pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build()?;
    let measured = runtime.block_on(measured(args))?;
    if args.json {
        screen::say(&serde_json::to_string(&measured)?);
        return Ok(());
    }
    let Measured { round_trip_ms, vision_ms, echo_ms, round_trip_ratio, bytes: [frame, answer], http } =
        measured;
    screen::say(&format!(
        "a frame of {frame} bytes and its answer of {answer} bytes over TLS, medians in ms"
    ));
    screen::say(
        "| round trip | stages of vision | echo of zenoh | round trip / (vision + echo) |\n|---|---|---|---|",
    );
    screen::say(&format!("| {round_trip_ms:.2} | {vision_ms:.2} | {echo_ms:.2} | {round_trip_ratio:.2} |"));
    screen::say(
        "\n| GET over TLS, requests a second | connections | Waymark | bare axum | ratio |\n|---|---|---|---|---|",
    );
    for bare_http::Rates { path, connections, waymark, bare, ratio } in http {
        screen::say(&format!("| {path} | {connections} | {waymark:.0} | {bare:.0} | {ratio:.2} |"));
    }
    Ok(())
}

async fn measured(args: &Args) -> anyhow::Result<Measured> {
    let folder = scratch::Folder::new("encrypted")?;
    let server = Server::start(settings(folder.path())?).await?;
    let maps = MapClient::new(&format!("http://{}", server.http_addr))?;
    maps.create_map(&NewMap::new(MAP)).await?;
    let poster = poster_of_size(40_000, POSTER_PX, 1.4);
    let poster =
        GrayImage::from_fn(poster.width(), poster.height(), |u, v| poster.data()[v * poster.width() + u]);
    maps.add_landmark(MAP, "poster", Some(Size { width_m: 0.6, height_m: 0.84 }), None).await?;
    maps.upload_view(MAP, "poster", pictures::jpeg(&poster)?, LandmarkRegion::WholeImage).await?;
    let job = maps.learn(MAP, None, None).await?;
    maps.wait_for_job(job, Duration::from_mins(5), |_| ()).await?;
    maps.put_robot(ROBOT, MAP).await?;
    let (options, served) = certified(&maps, &server, folder.path()).await?;
    let robot = RobotClient::connect(&options).await?;
    let tls = options.tls.as_ref().context("a robot with a certificate")?;
    let jpeg = pictures::jpeg(&frame(&poster))?;
    let (mut round_trips, mut visions, mut echoes) = (vec![], vec![], vec![]);
    let mut peer = None;
    let mut answer_bytes = 0;
    let bar = screen::progress(args.frames as usize, "frames and echoes");
    for i in 0..WARM_UP + args.frames as usize {
        let started = Instant::now();
        let capture = Capture::encoded(jpeg.clone())?.with_deadline_ms(60_000);
        let answer = robot.recognise("front", capture, WAIT).await?;
        let round_trip_ms = 1e3 * started.elapsed().as_secs_f64();
        anyhow::ensure!(answer.rejection.is_none(), "a frame was refused: {:?}", answer.rejection);
        let echo = if let Some(echo) = &peer {
            echo
        } else {
            answer_bytes = client::protos::prost::Message::encoded_len(&answer);
            peer.insert(echo::Echo::open(tls, &served, answer_bytes).await?)
        };
        let echo_ms = echo.round_trip_ms(&jpeg).await?;
        if i >= WARM_UP {
            round_trips.push(round_trip_ms);
            visions.push(answer.timings.iter().map(|stage| stage.ms).sum());
            echoes.push(echo_ms);
            bar.inc(1);
        }
    }
    bar.finish_and_clear();
    robot.close().await?;
    let http = bare_http::rates(&maps, server.http_addr, &served, args.requests as usize).await?;
    server.stop().await;
    let [round_trip_ms, vision_ms, echo_ms] =
        [&mut round_trips, &mut visions, &mut echoes].map(|ms| quantile(ms, 0.5).unwrap_or(f64::NAN));
    let round_trip_ratio = round_trip_ms / (vision_ms + echo_ms);
    Ok(Measured {
        round_trip_ms,
        vision_ms,
        echo_ms,
        round_trip_ratio,
        bytes: [jpeg.len(), answer_bytes],
        http,
    })
}

fn settings(data: &Path) -> anyhow::Result<Config> {
    let raw = RawConfig {
        data: data.to_owned(),
        http: "127.0.0.1:0".to_owned(),
        zenoh: "tls/127.0.0.1:0".to_owned(),
        tls: RawTls { enabled: true, ..RawTls::default() },
        ..RawConfig::default()
    };
    Ok(Config::try_from(raw)?)
}

/// A frame with the poster in its middle.
fn frame(poster: &GrayImage) -> GrayImage {
    let [width, height] = FRAME_PX;
    let (left, top) = ((width - poster.width()) / 2, height.saturating_sub(poster.height()) / 2);
    GrayImage::from_fn(width, height, |u, v| match (u.checked_sub(left), v.checked_sub(top)) {
        (Some(u), Some(v)) if u < poster.width() && v < poster.height() => {
            poster.data()[v * poster.width() + u]
        }
        _ => 200,
    })
}

/// What a peer of the server shows: PEM files signed by the server's authority.
pub(super) struct Served {
    pub(super) certificate: PathBuf,
    pub(super) key: PathBuf,
    pub(super) authority: PathBuf,
}

/// The robot's options with a certificate, and the files of a peer.
async fn certified(
    maps: &MapClient,
    server: &RunningServer,
    data: &Path,
) -> anyhow::Result<(RobotOptions, Served)> {
    let folder = data.join("tls");
    let authority = folder.join("authority.pem");
    let pair = KeyPair::generate()?;
    let request = CertificateParams::default().serialize_request(&pair)?.pem()?;
    let enrolled = maps.enrol_robot(ROBOT, &CertificateRequest { request, valid_s: None }).await?;
    let robot = (folder.join("robot.pem"), folder.join("robot.key"));
    fs::write(&robot.0, &enrolled.certificate_pem)?;
    fs::write(&robot.1, pair.serialize_pem())?;
    let tls =
        RobotTls { certificate: robot.0, key: robot.1, authority: Some(authority.clone()), expires_ms: None };
    let mut options = RobotOptions::new(&server.zenoh_endpoint, enrolled.fleet, ROBOT);
    options.tls = Some(tls);
    options.delivery = Delivery::Every;
    let key = KeyPair::from_pem(&fs::read_to_string(folder.join("authority.key"))?)?;
    let issuer = Issuer::from_ca_cert_pem(&fs::read_to_string(&authority)?, key)?;
    let pair = KeyPair::generate()?;
    let names = ["localhost".to_owned(), "127.0.0.1".to_owned()];
    let signed = CertificateParams::new(names)?.signed_by(&pair, &issuer)?;
    let served = Served { certificate: folder.join("peer.pem"), key: folder.join("peer.key"), authority };
    fs::write(&served.certificate, signed.pem())?;
    fs::write(&served.key, pair.serialize_pem())?;
    Ok((options, served))
}
