//! Latency of one change of a large map over HTTP, until the server acknowledges it, while a
//! robot's frames are answered: a landmark moved, a landmark quarantined, a lesson. Derived data
//! that follows later is timed apart. Then how long it takes to make as many landmarks once more,
//! one request at a time and in one request, and what a backup of the map costs.

mod backup_cost;
mod large_map;

use crate::evaluate::statistics::quantile;
use anyhow::Context as _;
use backup_cost::{BackupCost, download_backup, measure_restore};
use cli::{pictures, scratch, screen};
use client::{
    Capture, LandmarkRegion, MapClient, RobotClient, RobotOptions,
    api::{NewLandmark, NewMap},
};
use large_map::{FIRST_POSTER, fill, picture, place, settings, walls};
use reqwest::header::{AUTHORIZATION, HeaderMap};
use serde::Serialize;
use serde_json::{Value, json};
use server::Server;
use std::{
    sync::atomic::{AtomicBool, Ordering},
    time::{Duration, Instant},
};
use vision::frame::GrayImage;

const MAP: &str = "large";
/// Maps on which landmarks are made.
const ONE_BY_ONE: &str = "one-by-one";
const AT_ONCE: &str = "at-once";
/// Most landmarks of one request.
const BULK: usize = 2000;
const ROBOT: &str = "bench";
/// Size of the robot's frames and time between them.
const FRAME_PX: [usize; 2] = [640, 480];
const FRAME_EVERY: Duration = Duration::from_millis(250);
const ANSWER_WAIT: Duration = Duration::from_secs(10);
/// Longest wait for a lesson.
const LESSON_TIMEOUT: Duration = Duration::from_hours(1);

/// `waymark-lab bench edits`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Landmarks of the map, all learnt and placed.
    #[arg(long, default_value_t = 2000, value_parser = clap::value_parser!(u32).range(10..=20_000))]
    landmarks: u32,
    /// Wall segments of the map.
    #[arg(long, default_value_t = 20_000, value_parser = clap::value_parser!(u32).range(0..=100_000))]
    walls: u32,
    /// Changes of each kind; lessons are a 25th of it.
    #[arg(long, default_value_t = 200, value_parser = clap::value_parser!(u32).range(3..=1000))]
    changes: u32,
    /// Print one JSON object instead of the table.
    #[arg(long)]
    json: bool,
}

/// Milliseconds of several changes of one kind.
#[expect(clippy::struct_field_names, reason = "units come last")]
#[derive(Debug, Serialize)]
struct Cost {
    median_ms: f64,
    p90_ms: f64,
    p99_ms: f64,
    worst_ms: f64,
}

impl Cost {
    fn of(ms: &mut [f64]) -> Self {
        let worst_ms = ms.iter().copied().fold(0.0, f64::max);
        let [median_ms, p90_ms, p99_ms] =
            [0.5, 0.9, 0.99].map(|share| quantile(ms, share).unwrap_or(worst_ms));
        Self { median_ms, p90_ms, p99_ms, worst_ms }
    }
}

/// A server with a large map.
struct Large {
    maps: MapClient,
    base: String,
    http: reqwest::Client,
}

/// What was measured.
#[derive(Debug, Serialize)]
struct Measured {
    landmarks: u32,
    walls: u32,
    filled_s: f64,
    start_ms: f64,
    /// Frames that were answered meanwhile, and until their answer.
    frames: usize,
    costs: Vec<(&'static str, Cost)>,
    one_by_one_s: f64,
    at_once_s: f64,
    backup: BackupCost,
}

/// Runs the benchmark.
pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    let measured =
        tokio::runtime::Builder::new_multi_thread().enable_all().build()?.block_on(measured(args))?;
    if args.json {
        screen::say(&serde_json::to_string(&measured)?);
    } else {
        show(&measured);
    }
    Ok(())
}

fn show(measured: &Measured) {
    let Measured { landmarks, walls, filled_s, start_ms, frames, costs, one_by_one_s, at_once_s, backup } =
        measured;
    screen::say(&format!(
        "{landmarks} landmarks, {walls} wall segments (made in {filled_s:.0} s, server ready after {start_ms:.0} ms), \
         {frames} frames answered meanwhile"
    ));
    screen::say("| change | median | 90 % | 99 % | worst |\n|---|---|---|---|---|");
    for (name, Cost { median_ms, p90_ms, p99_ms, worst_ms }) in costs {
        screen::say(&format!("| {name} | {median_ms:.1} | {p90_ms:.1} | {p99_ms:.1} | {worst_ms:.1} |"));
    }
    screen::say(&format!("{landmarks} landmarks made one request at a time: {one_by_one_s:.1} s"));
    screen::say(&format!("{landmarks} landmarks made in requests of {BULK}: {at_once_s:.2} s"));
    screen::say(&backup.sentence());
}

/// A client for requests that the SDK does not make, with its token.
async fn with_token(maps: &MapClient) -> anyhow::Result<reqwest::Client> {
    let token = maps.token_in_use().await?.context("the server asks for no token")?;
    let mut headers = HeaderMap::new();
    headers.insert(AUTHORIZATION, format!("Bearer {token}").parse()?);
    Ok(reqwest::Client::builder().tls_certs_only([]).default_headers(headers).build()?)
}

async fn measured(args: &Args) -> anyhow::Result<Measured> {
    let folder = scratch::Folder::new("edits")?;
    let started = Instant::now();
    fill(folder.path(), args).await?;
    let filled_s = started.elapsed().as_secs_f64();
    let started = Instant::now();
    let server = Server::start(settings(folder.path(), args)?).await?;
    let start_ms = ms(started);
    let base = format!("http://{}", server.http_addr);
    let maps = MapClient::new(&base)?;
    let http = with_token(&maps).await?;
    maps.put_robot(ROBOT, MAP).await?;
    let robot = RobotClient::connect(&RobotOptions::new(&server.zenoh_endpoint, "default", ROBOT)).await?;
    let large = Large { maps, base, http };
    let (is_done, mut answered) = (AtomicBool::new(false), Vec::new());
    let (changed, sent) = tokio::join!(
        async {
            let changed = large.changes(args).await;
            is_done.store(true, Ordering::Relaxed);
            changed
        },
        send_frames(&robot, &is_done, &mut answered)
    );
    sent?;
    let mut costs = changed?;
    let frames = answered.len();
    costs.push(("a frame answered meanwhile", Cost::of(&mut answered)));
    let backups = scratch::Folder::new("backup")?;
    let backup_file = backups.path().join("all.waymark");
    let backup_s = download_backup(&large.maps, &backup_file).await?;
    let (one_by_one_s, at_once_s) = large.creations(args).await?;
    robot.close().await?;
    server.stop().await;
    let backup = measure_restore(args, &backup_file, backup_s).await?;
    let (landmarks, walls) = (args.landmarks, args.walls);
    Ok(Measured { landmarks, walls, filled_s, start_ms, frames, costs, one_by_one_s, at_once_s, backup })
}

/// Sends frames until told to end; `answered` gets the time until each answer, ms.
async fn send_frames(
    robot: &RobotClient,
    is_done: &AtomicBool,
    answered: &mut Vec<f64>,
) -> anyhow::Result<()> {
    let [width, height] = FRAME_PX;
    let poster = picture(FIRST_POSTER as usize);
    let (left, top) = ((width - poster.width()) / 2, (height.saturating_sub(poster.height())) / 2);
    let frame = GrayImage::from_fn(width, height, |u, v| match (u.checked_sub(left), v.checked_sub(top)) {
        (Some(u), Some(v)) if u < poster.width() && v < poster.height() => {
            poster.data()[v * poster.width() + u]
        }
        _ => 200,
    });
    let jpeg = pictures::jpeg(&frame)?;
    let mut due = tokio::time::interval(FRAME_EVERY);
    while !is_done.load(Ordering::Relaxed) {
        due.tick().await;
        let started = Instant::now();
        let answer = robot.recognise("front", Capture::encoded(jpeg.clone())?, ANSWER_WAIT).await?;
        anyhow::ensure!(answer.rejection.is_none(), "a frame was refused: {:?}", answer.rejection);
        answered.push(ms(started));
    }
    Ok(())
}

fn ms(started: Instant) -> f64 {
    started.elapsed().as_secs_f64() * 1e3
}

impl Large {
    /// Moves, quarantines and teaches landmarks.
    async fn changes(&self, args: &Args) -> anyhow::Result<Vec<(&'static str, Cost)>> {
        let (mut moved, mut settled, mut trusted, mut lessons) = (vec![], vec![], vec![], vec![]);
        let bar = screen::progress(args.changes as usize, "changing");
        for i in 0..args.changes as usize {
            let name = format!("l{}", i * 7 % args.landmarks as usize);
            let started = Instant::now();
            let place = json!(place(i * 7 % args.landmarks as usize, 0.3));
            self.change(&name, &json!({ "place": place })).await?;
            moved.push(ms(started));
            self.visible(&name).await?;
            settled.push(ms(started));
            let started = Instant::now();
            self.change(&name, &json!({ "health": if i % 2 == 0 { "quarantined" } else { "sound" } }))
                .await?;
            trusted.push(ms(started));
            bar.inc(1);
        }
        bar.finish_and_clear();
        for i in 0..(args.changes as usize).div_ceil(25) {
            let name = format!("l{}", i * 11 % args.landmarks as usize);
            let image = picture(1_000_000 + i);
            self.maps.upload_view(MAP, &name, pictures::jpeg(&image)?, LandmarkRegion::WholeImage).await?;
            let started = Instant::now();
            let job = self.maps.learn(MAP, Some(&[name]), Some(4)).await?;
            self.maps.wait_for_job(job, LESSON_TIMEOUT, |_| ()).await?;
            lessons.push(ms(started));
        }
        Ok(vec![
            ("landmark moved", Cost::of(&mut moved)),
            ("moved, and its visibility area known", Cost::of(&mut settled)),
            ("landmark quarantined", Cost::of(&mut trusted)),
            ("lesson of one landmark", Cost::of(&mut lessons)),
        ])
    }

    /// Makes as many landmarks on new maps: seconds one by one, and seconds in large requests.
    async fn creations(&self, args: &Args) -> anyhow::Result<(f64, f64)> {
        let new = |i: usize| NewLandmark { name: format!("n{i}"), size: None, place: Some(place(i, 0.0)) };
        let count = args.landmarks as usize;
        for map in [ONE_BY_ONE, AT_ONCE] {
            self.maps.create_map(&NewMap::new(map)).await?;
            self.maps.set_walls(map, &walls(args)).await?;
        }
        let bar = screen::progress(count, "making landmarks");
        let started = Instant::now();
        for i in 0..count {
            let NewLandmark { name, size, place } = new(i);
            self.maps.add_landmark(ONE_BY_ONE, &name, size, place).await?;
            bar.inc(1);
        }
        let one_by_one_s = started.elapsed().as_secs_f64();
        bar.finish_and_clear();
        let all: Vec<_> = (0..count).map(new).collect();
        let started = Instant::now();
        for part in all.chunks(BULK) {
            self.maps.add_landmarks(AT_ONCE, part).await?;
        }
        Ok((one_by_one_s, started.elapsed().as_secs_f64()))
    }

    async fn change(&self, landmark: &str, changes: &Value) -> anyhow::Result<()> {
        let url = format!("{}/api/v1/maps/{MAP}/landmarks/{landmark}", self.base);
        let answer = self.http.patch(&url).header("if-match", "*").json(changes).send().await?;
        anyhow::ensure!(answer.status().is_success(), "{url}: {}", answer.text().await?);
        Ok(())
    }

    /// Waits until the server has the landmark's visibility area.
    async fn visible(&self, landmark: &str) -> anyhow::Result<()> {
        let url = format!("{}/api/v1/maps/{MAP}/landmarks/{landmark}/visibility", self.base);
        let answer = self.http.get(&url).send().await?;
        anyhow::ensure!(answer.status().is_success(), "{url}: {}", answer.text().await.context("an answer")?);
        Ok(())
    }
}
