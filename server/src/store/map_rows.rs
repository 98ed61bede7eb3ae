//! The rows that a version of a map is made of: the map itself and its landmarks.

use super::{
    StoreError,
    db::{self, Conn},
    landmarks::{self, geometry_columns},
    maps::MapPipeline,
    statements::statements,
    visibility_settings,
};
use map::{landmark_health::LandmarkHealth, visibility::VisibilitySettings};
use std::collections::BTreeMap;
use vision::model::LandmarkId;

statements! {
    MAP = "SELECT name, version, draft_of IS NOT NULL AS is_draft, preset, distance, learning, sight, walls_version FROM maps WHERE id = $1";
    NAME = "SELECT name FROM maps WHERE id = $1";
    MAP_IDS = "SELECT id FROM maps ORDER BY id";
    ROWS = "SELECT coalesce(string_agg(id || ' ' || revision || ' ' || changed_ms || ' ' || health, ';'), '') \
            FROM landmarks WHERE map_id = $1";
    LANDMARKS = concat!("SELECT id, name, learning, ", geometry_columns!(""), " FROM landmarks WHERE map_id = $1 \
                AND id IN (SELECT CAST(value AS BIGINT) FROM json_each($2))");
}

/// A map without what belongs to it.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct MapHead {
    pub(crate) name: String,
    pub(crate) version: u64,
    pub(crate) is_draft: bool,
    pub(crate) pipeline: MapPipeline,
    /// JSON of its own weights and gates.
    pub(crate) learning: Option<String>,
    /// Camera and limits of its visibility areas.
    pub(crate) visibility_settings: VisibilitySettings,
    /// Counts up whenever the walls are replaced.
    pub(crate) walls_version: i64,
}

/// What changes whenever the row of a landmark does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct RowState {
    pub(crate) id: LandmarkId,
    /// Revision, and time of the last edit.
    pub(crate) edited: (i64, i64),
    /// Robots change it without an edit.
    pub(crate) health: LandmarkHealth,
}

/// A landmark without its views and its model.
#[derive(Debug, Clone)]
pub(crate) struct LandmarkHead {
    pub(crate) name: String,
    pub(crate) geometry: landmarks::LandmarkGeometry,
    /// JSON of its own weights and gates.
    pub(crate) learning: Option<String>,
}

/// Numbers of all maps.
pub(crate) async fn ids(conn: &mut Conn) -> Result<Vec<i64>, StoreError> {
    db::query_scalar(MAP_IDS).fetch_all(conn).await.map_err(StoreError::during("list maps"))
}

/// The name of a map.
pub(crate) async fn name(conn: &mut Conn, id: i64) -> Result<String, StoreError> {
    db::query_scalar(NAME)
        .bind(id)
        .fetch_one(conn)
        .await
        .map_err(StoreError::during("read the name of a map"))
}

/// The map with this number; `None` if it is gone.
pub(crate) async fn head(conn: &mut Conn, id: i64) -> Result<Option<MapHead>, StoreError> {
    let at = || StoreError::during("read map");
    let row = db::query(MAP).bind(id).fetch_optional(conn).await.map_err(at())?;
    let Some(row) = row else { return Ok(None) };
    let name: String = row.try_get("name").map_err(at())?;
    Ok(Some(MapHead {
        version: row.try_get::<i64, _>("version").map_err(at())? as u64,
        is_draft: row.try_get("is_draft").map_err(at())?,
        pipeline: MapPipeline::read(&row).map_err(at())?,
        learning: row.try_get("learning").map_err(at())?,
        visibility_settings: visibility_settings::read(
            &name,
            row.try_get::<Option<&str>, _>("sight").map_err(at())?,
        ),
        walls_version: row.try_get("walls_version").map_err(at())?,
        name,
    }))
}

/// The state of each of its landmarks. One row for all of them: reading a row costs more than what
/// is in it, and this is read after every change of the map.
pub(crate) async fn row_states(conn: &mut Conn, id: i64) -> Result<Vec<RowState>, StoreError> {
    let states: String = db::query_scalar(ROWS)
        .bind(id)
        .fetch_one(conn)
        .await
        .map_err(StoreError::during("read the landmarks' revisions"))?;
    let state = |text: &str| {
        let mut parts = text.split(' ');
        let mut number = || parts.next()?.parse::<i64>().ok();
        let (id, edited) = (LandmarkId(number()? as u64), (number()?, number()?));
        Some(RowState { id, edited, health: landmarks::health_of(parts.next()?) })
    };
    states.split_terminator(';').map(state).collect::<Option<_>>().ok_or_else(|| StoreError::Damaged {
        what: "the list of landmarks".to_owned(),
        reason: "it cannot be read".to_owned(),
    })
}

/// Those of its landmarks that are asked for.
pub(crate) async fn landmarks(
    conn: &mut Conn,
    id: i64,
    wanted: &[LandmarkId],
) -> Result<BTreeMap<LandmarkId, LandmarkHead>, StoreError> {
    let at = || StoreError::during("read landmarks of a map");
    let wanted: Vec<_> = wanted.iter().map(|id| id.0.to_string()).collect();
    let wanted = format!("[{}]", wanted.join(","));
    let rows = db::query(LANDMARKS).bind(id).bind(wanted).fetch_all(conn).await.map_err(at())?;
    let head = |row: &db::Row| {
        let id = LandmarkId(row.try_get::<i64, _>("id")? as u64);
        let (name, learning) = (row.try_get("name")?, row.try_get("learning")?);
        Ok((id, LandmarkHead { name, geometry: landmarks::geometry(row)?, learning }))
    };
    rows.iter().map(head).collect::<Result<_, _>>().map_err(at())
}
