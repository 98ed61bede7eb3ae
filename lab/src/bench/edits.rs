//! Latency of one change of a large map over HTTP, until the server acknowledges it: a landmark moved, a landmark
//! quarantined, a lesson. Derived data that follows later is timed apart.

use super::recognise::landmarks::models;
use crate::evaluate::statistics::quantile;
use anyhow::Context as _;
use cli::{pictures, scratch, screen};
use client::{
    LandmarkRegion, MapClient,
    api::{NewMap, Place, WallsBody},
};
use reqwest::header::{AUTHORIZATION, HeaderMap};
use serde::Serialize;
use serde_json::{Value, json};
use server::{
    Server,
    config::{Config, RawConfig},
};
use sha2::{Digest as _, Sha256};
use sim::posters::poster_of_size;
use sqlx::{Connection as _, SqliteConnection, sqlite::SqliteConnectOptions};
use std::{
    path::Path,
    time::{Duration, Instant},
};
use vision::{frame::GrayImage, model::LandmarkModel, params::Params};

const MAP: &str = "large";
/// Width of a taught poster, in pixels; latencies do not depend on it.
const POSTER_PX: usize = 240;
/// One poster in so many is on the map twice, so that the map has look-alikes.
const LOOK_ALIKE_EVERY: usize = 20;
/// Posters with a lesson of their own; the others use their thresholds.
const TAUGHT: usize = 20;
/// Number of the first poster.
const FIRST_POSTER: u64 = 40_000;
/// The server's database in its data directory.
const DATABASE: &str = "waymark.sqlite";
const LANDMARK: &str = "INSERT INTO landmarks (id, map_id, name, width_m, height_m, x_m, y_m, z_m, theta_rad, created_ms) \
                        SELECT ?1, id, ?3, 0.6, 0.84, ?4, ?5, ?6, ?7, 0 FROM maps WHERE name = ?2";
const MODEL: &str = "INSERT INTO models (landmark_id, sha256, params_hash, model, active, reasons, facts, views, \
                     generated_views, learnt_ms) VALUES (?1, ?2, ?3, ?4, 1, '[]', '{}', 3, 0, 0)";
/// Distance of landmarks along their wall, and of one wall from the next, metres.
const SPACING_M: f64 = 2.0;
const ROW_M: f64 = 4.0;
const ROW_LANDMARKS: usize = 50;
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
    /// Changes of each kind.
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u32).range(3..=1000))]
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
    worst_ms: f64,
}

impl Cost {
    fn of(ms: &mut [f64]) -> Self {
        let worst_ms = ms.iter().copied().fold(0.0, f64::max);
        let [median_ms, p90_ms] = [0.5, 0.9].map(|share| quantile(ms, share).unwrap_or(worst_ms));
        Self { median_ms, p90_ms, worst_ms }
    }
}

/// A server with a large map.
struct Large {
    maps: MapClient,
    base: String,
    http: reqwest::Client,
}

/// Runs the benchmark.
pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    tokio::runtime::Builder::new_multi_thread().enable_all().build()?.block_on(measured(args))
}

/// A client for requests that the SDK does not make, with its token.
async fn with_token(maps: &MapClient) -> anyhow::Result<reqwest::Client> {
    let token = maps.token_in_use().await?.context("the server asks for no token")?;
    let mut headers = HeaderMap::new();
    headers.insert(AUTHORIZATION, format!("Bearer {token}").parse()?);
    Ok(reqwest::Client::builder().tls_certs_only([]).default_headers(headers).build()?)
}

async fn measured(args: &Args) -> anyhow::Result<()> {
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
    let large = Large { maps, base, http };
    let (mut moved, mut settled, mut trusted, mut lessons) = (vec![], vec![], vec![], vec![]);
    let bar = screen::progress(args.changes as usize, "changing");
    for i in 0..args.changes as usize {
        let name = format!("l{}", i * 7 % args.landmarks as usize);
        let started = Instant::now();
        let place = json!(place(i * 7 % args.landmarks as usize, 0.3));
        large.change(&name, &json!({ "place": place })).await?;
        moved.push(ms(started));
        large.visible(&name).await?;
        settled.push(ms(started));
        let started = Instant::now();
        large.change(&name, &json!({ "health": if i % 2 == 0 { "quarantined" } else { "sound" } })).await?;
        trusted.push(ms(started));
        bar.inc(1);
    }
    for i in 0..(args.changes as usize).div_ceil(4) {
        let name = format!("l{}", i * 11 % args.landmarks as usize);
        let image = picture(1_000_000 + i);
        large.maps.upload_view(MAP, &name, pictures::jpeg(&image)?, LandmarkRegion::WholeImage).await?;
        let started = Instant::now();
        let job = large.maps.learn(MAP, Some(&[name]), Some(4)).await?;
        large.maps.wait_for_job(job, LESSON_TIMEOUT, |_| ()).await?;
        lessons.push(ms(started));
    }
    bar.finish_and_clear();
    server.stop().await;
    let rows = [
        ("landmark moved", Cost::of(&mut moved)),
        ("moved, and its visibility area known", Cost::of(&mut settled)),
        ("landmark quarantined", Cost::of(&mut trusted)),
        ("lesson of one landmark", Cost::of(&mut lessons)),
    ];
    if args.json {
        let costs: Value = rows.iter().map(|(name, cost)| ((*name).to_owned(), json!(cost))).collect();
        let head = json!({ "landmarks": args.landmarks, "walls": args.walls, "filled_s": filled_s, "start_ms": start_ms, "costs": costs });
        screen::say(&head.to_string());
        return Ok(());
    }
    screen::say(&format!(
        "{} landmarks, {} wall segments (made in {filled_s:.0} s, server ready after {start_ms:.0} ms)",
        args.landmarks, args.walls
    ));
    screen::say("| change | median | 90 % | worst |\n|---|---|---|---|");
    for (name, cost) in rows {
        let Cost { median_ms, p90_ms, worst_ms } = cost;
        screen::say(&format!("| {name} | {median_ms:.1} | {p90_ms:.1} | {worst_ms:.1} |"));
    }
    Ok(())
}

fn ms(started: Instant) -> f64 {
    started.elapsed().as_secs_f64() * 1e3
}

/// Settings of a server that takes maps of this size.
fn settings(data: &Path, args: &Args) -> anyhow::Result<Config> {
    let mut raw = RawConfig {
        data: data.to_owned(),
        http: "127.0.0.1:0".to_owned(),
        zenoh: "tcp/127.0.0.1:0".to_owned(),
        ..RawConfig::default()
    };
    raw.limits.landmarks = raw.limits.landmarks.max(args.landmarks as usize + 1);
    raw.limits.laser_segments = raw.limits.laser_segments.max(args.walls as usize);
    Ok(Config::try_from(raw)?)
}

/// Makes the map: through the server what is small, the models and places straight into its database.
async fn fill(data: &Path, args: &Args) -> anyhow::Result<()> {
    let server = Server::start(settings(data, args)?).await?;
    let maps = MapClient::new(&format!("http://{}", server.http_addr))?;
    maps.create_map(&NewMap::new(MAP)).await?;
    maps.set_walls(MAP, &walls(args)).await?;
    server.stop().await;
    let (count, threads) = (args.landmarks as usize, std::thread::available_parallelism()?.get());
    let params = Params::default();
    let models = models(FIRST_POSTER, count, TAUGHT.min(count), threads, &params)?;
    let options = SqliteConnectOptions::new().filename(data.join(DATABASE)).foreign_keys(true);
    let mut db = SqliteConnection::connect_with(&options).await?;
    let mut tx = db.begin().await?;
    for (i, model) in models.iter().enumerate() {
        // Of the posters taught twice, the second has the model of the first.
        let original = if i % LOOK_ALIKE_EVERY == 1 { &models[i - 1] } else { model };
        let bytes = LandmarkModel { id: model.id, ..LandmarkModel::clone(original) }.to_bytes();
        let place = place(i, 0.0);
        sqlx::query(LANDMARK)
            .bind(model.id.0 as i64)
            .bind(MAP)
            .bind(format!("l{i}"))
            .bind(place.x_m)
            .bind(place.y_m)
            .bind(place.z_m)
            .bind(place.theta_rad)
            .execute(&mut *tx)
            .await?;
        sqlx::query(MODEL)
            .bind(model.id.0 as i64)
            .bind(&Sha256::digest(&bytes)[..])
            .bind(&params.distance_hash().to_le_bytes()[..])
            .bind(bytes)
            .execute(&mut *tx)
            .await?;
    }
    tx.commit().await?;
    Ok(db.close().await?)
}

/// A poster that the map does not have yet.
fn picture(number: usize) -> GrayImage {
    let texture = poster_of_size(number as u64, POSTER_PX, 1.4);
    GrayImage::from_fn(texture.width(), texture.height(), |u, v| texture.data()[v * texture.width() + u])
}

/// Place of landmark `i`: rows of walls along x, all facing y.
fn place(i: usize, shift_m: f64) -> Place {
    let (row, column) = (i / ROW_LANDMARKS, i % ROW_LANDMARKS);
    let (x_m, y_m) = (SPACING_M * column as f64 + shift_m, ROW_M * row as f64);
    Place { x_m, y_m, z_m: 1.5, theta_rad: std::f64::consts::FRAC_PI_2, ..Place::default() }
}

impl Large {
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

/// Walls behind the landmarks, cut into as many segments.
fn walls(args: &Args) -> WallsBody {
    let rows = (args.landmarks as usize).div_ceil(ROW_LANDMARKS);
    let pieces = (args.walls as usize).div_ceil(rows);
    let piece_m = SPACING_M * ROW_LANDMARKS as f64 / pieces as f64;
    let wall = |i: usize| {
        let (row, x) = (i / pieces, piece_m * (i % pieces) as f64 - 1.0);
        let y = ROW_M * row as f64 - 0.02;
        [[x, y], [x + 0.98 * piece_m, y]]
    };
    (0..args.walls as usize).map(wall).collect()
}
