//! Writes contents as a new map. Whoever calls this has stored the pictures that it refers to.

use super::{
    CropContents, LandmarkContents, MapContents, MapSettings, ModelContents, RunContents, ViewContents,
    numbers::{self, Numbers},
};
use crate::store::db;
use crate::{
    config::Limits,
    store::{
        StoreError, Tx, landmarks, map_locations,
        map_locations::MapLocation,
        maps::{self, MapRow},
        modality_stats::{self, MAX_RUNS},
        models,
        statements::statements,
        underlays,
        views::{self, MAX_DISTRACTORS},
        walls, within,
    },
};
use vision::model::LandmarkId;

statements! {
    SETTINGS = "UPDATE maps SET fusion = $2, areas = $3, sight = $4, preset = $5, distance = $6, learning = $7 WHERE id = $1";
    LANDMARK = "INSERT INTO landmarks (map_id, name, created_ms, health, finding, learning) \
                VALUES ($1, $2, $3, $4, $5, $6) RETURNING id";
    VIEW = "INSERT INTO views (landmark_id, image_sha256, image_kind, width_px, height_px, corners_px, created_ms, icon_side, \
            icon_scale, capture, icon) VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10, $11)";
    MODEL_BYTES = "INSERT INTO model_contents (sha256, bytes) VALUES ($1, $2) ON CONFLICT (sha256) DO NOTHING";
    MODEL = "INSERT INTO models (landmark_id, sha256, params_hash, active, reasons, facts, views, generated_views, learnt_ms, \
             looks_like) VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10) \
             ON CONFLICT (landmark_id) DO UPDATE SET sha256 = excluded.sha256, params_hash = excluded.params_hash, \
             active = excluded.active, reasons = excluded.reasons, facts = excluded.facts, views = excluded.views, \
             generated_views = excluded.generated_views, learnt_ms = excluded.learnt_ms, \
             looks_like = excluded.looks_like";
    DISTRACTOR = "INSERT INTO strangers (map_id, image_sha256, corners_px, icon_side, icon, icon_scale) \
                  VALUES ($1, $2, $3, $4, $5, $6) ON CONFLICT DO NOTHING";
    RUN = "INSERT INTO runs (map_id, robot, created_ms, way_m, cells) VALUES ($1, $2, $3, $4, $5)";
}

/// A map that was written.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Written {
    pub(crate) map: MapRow,
    pub(crate) location: MapLocation,
    /// Number of each landmark of the contents, and that of the same one in the new map.
    pub(crate) landmarks: Numbers,
}

/// Writes a new map of this name: one transaction, so one commit of its history. Errors: `Exists`;
/// `NotFound` of the map that it lies in; `Limit` where it is larger than a map may be.
pub(crate) async fn write(
    tx: &mut Tx,
    name: &str,
    contents: &MapContents,
    max: &Limits,
) -> Result<Written, StoreError> {
    check(contents, max)?;
    let map = maps::create(tx, name, contents.settings.pipeline, max.maps).await?.id;
    let location = contents.settings.location.clone();
    let location = map_locations::set(tx, name, |_| location).await?;
    settings(tx, map, &contents.settings).await?;
    let mut numbers = Numbers::new();
    for each in &contents.landmarks {
        numbers.insert(each.number, landmark(tx, map, each).await?);
    }
    for each in &contents.landmarks {
        let Some(of) = numbers.get(&each.number).copied() else { continue };
        for one in &each.views {
            view(tx, of, one).await?;
        }
        if let Some(learnt) = &each.model {
            model(tx, of, &numbers::in_other_map(learnt, of, &numbers)).await?;
        }
    }
    for each in &contents.distractors {
        distractor(tx, map, &each.crop).await?;
    }
    if !contents.walls.is_empty() {
        walls::replace(tx, name, &contents.walls).await?;
    }
    if let Some(underlay) = &contents.underlay {
        underlays::insert(tx, map, underlay).await?;
    }
    for each in &contents.reference_runs {
        run(tx, map, each).await?;
    }
    Ok(Written { map: maps::of(tx, name).await?, location, landmarks: numbers })
}

/// The bounds of a map hold for one that comes whole, too.
fn check(contents: &MapContents, max: &Limits) -> Result<(), StoreError> {
    within(contents.landmarks.len() as i64, max.landmarks, "landmarks in a map")?;
    let views = contents.landmarks.iter().map(|landmark| landmark.views.len()).max().unwrap_or_default();
    within(views as i64, max.views, "views of a landmark")?;
    within(contents.walls.len() as i64, max.laser_segments, "wall segments in a map")?;
    within(contents.distractors.len() as i64, MAX_DISTRACTORS, "distractors in a map")?;
    within(contents.reference_runs.len() as i64, MAX_RUNS, "runs")
}

/// The settings that are not of where the map lies.
pub(in crate::store) async fn settings(
    tx: &mut Tx,
    map: i64,
    settings: &MapSettings,
) -> Result<(), StoreError> {
    let (preset, distance) = settings.pipeline.words();
    let done = db::query(SETTINGS)
        .bind(map)
        .bind(modality_stats::mode_word(settings.fusion_mode))
        .bind(&settings.areas)
        .bind(&settings.visibility)
        .bind(preset)
        .bind(distance)
        .bind(&settings.learning)
        .execute(&mut tx.conn)
        .await;
    done.map_err(StoreError::during("store the settings of a map")).map(drop)
}

/// A new landmark without views and model; gives its number.
pub(in crate::store) async fn landmark(
    tx: &mut Tx,
    map: i64,
    new: &LandmarkContents,
) -> Result<LandmarkId, StoreError> {
    let id: i64 = db::query_scalar(LANDMARK)
        .bind(map)
        .bind(&new.name)
        .bind(new.created_ms)
        .bind(landmarks::health_word(new.health))
        .bind(&new.finding)
        .bind(&new.learning)
        .fetch_one(&mut tx.conn)
        .await
        .map_err(StoreError::inserting("store landmark", crate::store::kind::Kind::Landmark, &new.name))?;
    landmarks::set_geometry(tx, id, &new.geometry).await?;
    Ok(LandmarkId(id as u64))
}

pub(in crate::store) async fn view(
    tx: &mut Tx,
    of: LandmarkId,
    new: &ViewContents,
) -> Result<(), StoreError> {
    let done = db::query(VIEW)
        .bind(of.0 as i64)
        .bind(&new.crop.image_sha256[..])
        .bind(&new.image_kind)
        .bind(new.size_px[0])
        .bind(new.size_px[1])
        .bind(views::point_bytes(&new.crop.corners_px))
        .bind(new.created_ms)
        .bind(new.crop.icon_side)
        .bind(new.crop.icon_scale)
        .bind(&new.capture)
        .bind(&new.crop.icon)
        .execute(&mut tx.conn)
        .await;
    done.map_err(StoreError::during("store view")).map(drop)
}

/// Stores or replaces the model of a landmark. It carries that landmark's number.
pub(in crate::store) async fn model(
    tx: &mut Tx,
    of: LandmarkId,
    new: &ModelContents,
) -> Result<(), StoreError> {
    let at = || StoreError::during("store model");
    let sha256 = models::digest(&new.bytes);
    let bytes = db::query(MODEL_BYTES).bind(&sha256[..]).bind(&new.bytes).execute(&mut tx.conn).await;
    bytes.map_err(at())?;
    let done = db::query(MODEL)
        .bind(of.0 as i64)
        .bind(&sha256[..])
        .bind(&new.params_hash[..])
        .bind(new.summary.active)
        .bind(&new.summary.reasons)
        .bind(&new.summary.facts)
        .bind(new.summary.views as i64)
        .bind(new.summary.generated_views as i64)
        .bind(new.summary.learnt_ms)
        .bind(&new.summary.looks_like)
        .execute(&mut tx.conn)
        .await;
    done.map_err(at()).map(drop)
}

pub(in crate::store) async fn distractor(
    tx: &mut Tx,
    map: i64,
    new: &CropContents,
) -> Result<(), StoreError> {
    let done = db::query(DISTRACTOR)
        .bind(map)
        .bind(&new.image_sha256[..])
        .bind(views::point_bytes(&new.corners_px))
        .bind(new.icon_side)
        .bind(&new.icon)
        .bind(new.icon_scale)
        .execute(&mut tx.conn)
        .await;
    done.map_err(StoreError::during("store distractor")).map(drop)
}

pub(in crate::store) async fn run(tx: &mut Tx, map: i64, new: &RunContents) -> Result<(), StoreError> {
    let done = db::query(RUN)
        .bind(map)
        .bind(&new.robot)
        .bind(new.created_ms)
        .bind(new.way_m)
        .bind(&new.cells)
        .execute(&mut tx.conn)
        .await;
    done.map_err(StoreError::during("store run")).map(drop)
}
