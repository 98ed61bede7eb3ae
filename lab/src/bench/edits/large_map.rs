//! A large map for the benchmark of edits: through the server what is small, the models and places
//! straight into its database.

use super::{Args, MAP};
use crate::bench::recognise::landmarks::models;
use client::{
    MapClient,
    api::{NewMap, Place, WallsBody},
};
use server::{
    Server,
    config::{Config, RawConfig},
};
use sha2::{Digest as _, Sha256};
use sim::posters::poster_of_size;
use sqlx::{Connection as _, SqliteConnection, sqlite::SqliteConnectOptions};
use std::path::Path;
use vision::{frame::GrayImage, model::LandmarkModel, params::Params};

/// Width of a taught poster, in pixels; latencies do not depend on it.
const POSTER_PX: usize = 240;
/// One poster in so many is on the map twice, so that the map has look-alikes.
const LOOK_ALIKE_EVERY: usize = 20;
/// Posters with a lesson of their own; the others use their thresholds.
const TAUGHT: usize = 20;
/// Number of the first poster.
pub(super) const FIRST_POSTER: u64 = 40_000;
/// The server's database in its data directory.
const DATABASE: &str = "waymark.sqlite";
const LANDMARK: &str = "INSERT INTO landmarks (id, map_id, name, width_m, height_m, x_m, y_m, z_m, theta_rad, created_ms) \
                        SELECT $1, id, $3, 0.6, 0.84, $4, $5, $6, $7, 0 FROM maps WHERE name = $2";
const MODEL_BYTES: &str = "INSERT INTO model_contents (sha256, bytes) VALUES ($1, $2)";
const MODEL: &str = "INSERT INTO models (landmark_id, sha256, params_hash, active, reasons, facts, views, generated_views, \
                     learnt_ms) VALUES ($1, $2, $3, 1, '[]', '{}', 3, 0, 0)";
/// Distance of landmarks along their wall, and of one wall from the next, metres.
const SPACING_M: f64 = 2.0;
const ROW_M: f64 = 4.0;
const ROW_LANDMARKS: usize = 50;

/// Settings of a server that takes maps of this size.
pub(super) fn settings(data: &Path, args: &Args) -> anyhow::Result<Config> {
    let mut raw = RawConfig {
        data: data.to_owned(),
        http: "127.0.0.1:0".to_owned(),
        zenoh: "tcp/127.0.0.1:0".to_owned(),
        ..RawConfig::default()
    };
    raw.limits.landmarks = raw.limits.landmarks.max(2 * args.landmarks as usize + 1);
    raw.limits.laser_segments = raw.limits.laser_segments.max(args.walls as usize);
    Ok(Config::try_from(raw)?)
}

/// Makes the map: through the server what is small, the models and places straight into its
/// database.
pub(super) async fn fill(data: &Path, args: &Args) -> anyhow::Result<()> {
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
        let sha256 = Sha256::digest(&bytes);
        sqlx::query(MODEL_BYTES).bind(&sha256[..]).bind(bytes).execute(&mut *tx).await?;
        sqlx::query(MODEL)
            .bind(model.id.0 as i64)
            .bind(&sha256[..])
            .bind(&params.distance_hash().to_le_bytes()[..])
            .execute(&mut *tx)
            .await?;
    }
    tx.commit().await?;
    Ok(db.close().await?)
}

/// A poster that the map does not have yet.
pub(super) fn picture(number: usize) -> GrayImage {
    let texture = poster_of_size(number as u64, POSTER_PX, 1.4);
    GrayImage::from_fn(texture.width(), texture.height(), |u, v| texture.data()[v * texture.width() + u])
}

/// Place of landmark `i`: rows of walls along x, all facing y.
pub(super) fn place(i: usize, shift_m: f64) -> Place {
    let (row, column) = (i / ROW_LANDMARKS, i % ROW_LANDMARKS);
    let (x_m, y_m) = (SPACING_M * column as f64 + shift_m, ROW_M * row as f64);
    Place { x_m, y_m, z_m: 1.5, theta_rad: std::f64::consts::FRAC_PI_2, ..Place::default() }
}

/// Walls behind the landmarks, cut into as many segments.
pub(super) fn walls(args: &Args) -> WallsBody {
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
