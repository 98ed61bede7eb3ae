//! Reads the contents of a map, in one state of the database.

use super::{
    CropContents, DistractorContents, LandmarkContents, MAX_CONTENTS_BYTES, MapContents, MapSettings,
    ModelContents, RunContents, ViewContents,
};
use crate::store::{
    StoreError,
    db::{self, Conn, Row},
    landmarks::{self, ModelSummary, geometry_columns},
    map_locations, maps,
    maps::MapRow,
    modality_stats,
    statements::statements,
    underlays, views, walls, within,
};
use futures::TryStreamExt as _;
use std::collections::BTreeMap;
use vision::model::LandmarkId;

statements! {
    SETTINGS = "SELECT fusion, areas, sight FROM maps WHERE id = $1";
    LANDMARKS = concat!("SELECT id, name, health, finding, learning, created_ms, ", geometry_columns!(""), " FROM landmarks \
                WHERE map_id = $1 ORDER BY id");
    VIEWS = "SELECT v.landmark_id, v.image_sha256, v.image_kind, v.width_px, v.height_px, v.corners_px, v.created_ms, \
             v.icon_side, v.icon_scale, v.capture, v.icon FROM views v JOIN landmarks l ON l.id = v.landmark_id \
             WHERE l.map_id = $1 ORDER BY v.id";
    MODELS = "SELECT m.landmark_id, m.params_hash, m.active, m.reasons, m.facts, m.views, m.generated_views, \
              m.learnt_ms, m.looks_like, c.bytes FROM models m \
              JOIN model_contents c ON c.sha256 = m.sha256 JOIN landmarks l ON l.id = m.landmark_id WHERE l.map_id = $1";
    DISTRACTORS = "SELECT image_sha256, corners_px, icon_side, icon, icon_scale FROM strangers WHERE map_id = $1 ORDER BY id";
    RUNS = "SELECT robot, created_ms, way_m, cells FROM runs WHERE map_id = $1 ORDER BY id";
    BYTES = "SELECT (SELECT coalesce(sum(length(v.icon)), 0) FROM views v JOIN landmarks l ON l.id = v.landmark_id \
             WHERE l.map_id = $1) + (SELECT coalesce(sum(length(c.bytes)), 0) FROM models m \
             JOIN model_contents c ON c.sha256 = m.sha256 JOIN landmarks l ON l.id = m.landmark_id WHERE l.map_id = $1) \
             + (SELECT coalesce(sum(length(icon)), 0) FROM strangers WHERE map_id = $1) \
             + (SELECT coalesce(sum(length(cells)), 0) FROM runs WHERE map_id = $1)";
}

/// A map and its contents. The connection is inside of a transaction, so that all is of one state.
/// Errors: `NotFound`; `Limit` beyond [`MAX_CONTENTS_BYTES`].
pub(crate) async fn read(conn: &mut Conn, map: &str) -> Result<(MapRow, MapContents), StoreError> {
    let row = maps::get(&mut *conn, map).await?;
    let bytes: i64 = db::query_scalar(BYTES)
        .bind(row.id)
        .fetch_one(&mut *conn)
        .await
        .map_err(StoreError::during("measure a map"))?;
    within(bytes, MAX_CONTENTS_BYTES, "bytes of icons and models in a map that is read whole")?;
    let contents = MapContents {
        settings: settings(&mut *conn, &row).await?,
        landmarks: landmarks(&mut *conn, row.id).await?,
        distractors: distractors(&mut *conn, row.id).await?,
        walls: walls::all_of(&mut *conn, row.id).await?,
        underlay: match underlays::get(&mut *conn, (row.id, map)).await {
            Ok(underlay) => Some(underlay),
            Err(StoreError::NotFound { .. }) => None,
            Err(error) => return Err(error),
        },
        reference_runs: reference_runs(&mut *conn, row.id).await?,
    };
    Ok((row, contents))
}

async fn settings(conn: &mut Conn, map: &MapRow) -> Result<MapSettings, StoreError> {
    let at = || StoreError::during("read the settings of a map");
    let location = map_locations::all(&mut *conn).await?.remove(&map.name).unwrap_or_default();
    let row = db::query(SETTINGS).bind(map.id).fetch_one(conn).await.map_err(at())?;
    Ok(MapSettings {
        pipeline: map.pipeline,
        learning: map.learning.clone(),
        location,
        fusion_mode: modality_stats::mode_of(row.try_get("fusion").map_err(at())?),
        areas: row.try_get("areas").map_err(at())?,
        visibility: row.try_get("sight").map_err(at())?,
    })
}

async fn landmarks(conn: &mut Conn, map: i64) -> Result<Vec<LandmarkContents>, StoreError> {
    let at = || StoreError::during("read the landmarks of a map");
    let mut all = BTreeMap::new();
    let mut rows = db::query(LANDMARKS).bind(map).fetch(&mut *conn);
    while let Some(row) = rows.try_next().await.map_err(at())? {
        let (number, landmark) = landmark(&row).map_err(at())?;
        all.insert(number, landmark);
    }
    drop(rows);
    let mut rows = db::query(VIEWS).bind(map).fetch(&mut *conn);
    while let Some(row) = rows.try_next().await.map_err(at())? {
        let of: i64 = row.try_get("landmark_id").map_err(at())?;
        let view = view(&row)?;
        if let Some(landmark) = all.get_mut(&of) {
            landmark.views.push(view);
        }
    }
    drop(rows);
    let mut rows = db::query(MODELS).bind(map).fetch(&mut *conn);
    while let Some(row) = rows.try_next().await.map_err(at())? {
        let of: i64 = row.try_get("landmark_id").map_err(at())?;
        let model = model(&row).map_err(at())?;
        if let Some(landmark) = all.get_mut(&of) {
            landmark.model = Some(model);
        }
    }
    drop(rows);
    Ok(all.into_values().collect())
}

fn landmark(row: &Row) -> Result<(i64, LandmarkContents), db::Error> {
    let number: i64 = row.try_get("id")?;
    Ok((
        number,
        LandmarkContents {
            number: LandmarkId(number as u64),
            name: row.try_get("name")?,
            geometry: landmarks::geometry(row)?,
            health: landmarks::health_of(row.try_get("health")?),
            finding: row.try_get("finding")?,
            learning: row.try_get("learning")?,
            created_ms: row.try_get("created_ms")?,
            views: Vec::new(),
            model: None,
        },
    ))
}

fn view(row: &Row) -> Result<ViewContents, StoreError> {
    let at = || StoreError::during("read a view");
    Ok(ViewContents {
        crop: crop(row)?,
        image_kind: row.try_get("image_kind").map_err(at())?,
        size_px: [row.try_get("width_px").map_err(at())?, row.try_get("height_px").map_err(at())?],
        created_ms: row.try_get("created_ms").map_err(at())?,
        capture: row.try_get("capture").map_err(at())?,
    })
}

fn crop(row: &Row) -> Result<CropContents, StoreError> {
    let at = || StoreError::during("read an icon");
    Ok(CropContents {
        image_sha256: views::digest_of(row)?,
        corners_px: views::corners_in(row)?.into(),
        icon_side: row.try_get("icon_side").map_err(at())?,
        icon: row.try_get("icon").map_err(at())?,
        icon_scale: row.try_get("icon_scale").map_err(at())?,
    })
}

fn model(row: &Row) -> Result<ModelContents, db::Error> {
    let params_hash: &[u8] = row.try_get("params_hash")?;
    Ok(ModelContents {
        bytes: row.try_get("bytes")?,
        // The schema says 8 bytes; were it otherwise, no parameters would have this hash.
        params_hash: params_hash.try_into().unwrap_or_default(),
        summary: ModelSummary {
            active: row.try_get("active")?,
            looks_like: row.try_get("looks_like")?,
            reasons: row.try_get("reasons")?,
            facts: row.try_get("facts")?,
            views: row.try_get::<i64, _>("views")? as u64,
            generated_views: row.try_get::<i64, _>("generated_views")? as u64,
            learnt_ms: row.try_get("learnt_ms")?,
        },
    })
}

async fn distractors(conn: &mut Conn, map: i64) -> Result<Vec<DistractorContents>, StoreError> {
    let rows = db::query(DISTRACTORS).bind(map).fetch_all(conn).await;
    let rows = rows.map_err(StoreError::during("read distractors"))?;
    rows.iter().map(|row| Ok(DistractorContents { crop: crop(row)? })).collect()
}

async fn reference_runs(conn: &mut Conn, map: i64) -> Result<Vec<RunContents>, StoreError> {
    let at = || StoreError::during("read runs");
    let rows = db::query(RUNS).bind(map).fetch_all(conn).await.map_err(at())?;
    let run = |row: &Row| {
        Ok::<_, db::Error>(RunContents {
            robot: row.try_get("robot")?,
            created_ms: row.try_get("created_ms")?,
            way_m: row.try_get("way_m")?,
            cells: row.try_get("cells")?,
        })
    };
    rows.iter().map(run).collect::<Result<_, _>>().map_err(at())
}
