//! The rows that a version of a map is made of: the map itself and its landmarks.

use super::{StoreError, landmarks, maps, statements::statements, visibility_settings};
use map::{landmark_health::LandmarkHealth, visibility::VisibilitySettings};
use sqlx::{Row, SqliteConnection};
use vision::{model::LandmarkId, recognise::DistanceKind};

statements! {
    MAP = "SELECT name, version, distance, sight, walls_version FROM maps WHERE id = ?1";
    NAME = "SELECT name FROM maps WHERE id = ?1";
    MAP_IDS = "SELECT id FROM maps ORDER BY id";
    LANDMARKS = "SELECT id, name, width_m, height_m, x_m, y_m, z_m, theta_rad, roll_rad, tilt_rad, place_covariance, \
                 size_from_views, health FROM landmarks WHERE map_id = ?1 ORDER BY id";
}

/// A map without what belongs to it.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct MapHead {
    pub(crate) name: String,
    pub(crate) version: u64,
    pub(crate) distance: DistanceKind,
    /// Camera and limits of its visibility areas.
    pub(crate) visibility_settings: VisibilitySettings,
    /// Counts up whenever the walls are replaced.
    pub(crate) walls_version: i64,
}

/// A landmark without its views and its model.
#[derive(Debug, Clone)]
pub(crate) struct LandmarkHead {
    pub(crate) id: LandmarkId,
    pub(crate) name: String,
    pub(crate) geometry: landmarks::LandmarkGeometry,
    pub(crate) health: LandmarkHealth,
}

/// Numbers of all maps.
pub(crate) async fn ids(conn: &mut SqliteConnection) -> Result<Vec<i64>, StoreError> {
    sqlx::query_scalar(MAP_IDS).fetch_all(conn).await.map_err(StoreError::during("list maps"))
}

/// The name of a map.
pub(crate) async fn name(conn: &mut SqliteConnection, id: i64) -> Result<String, StoreError> {
    sqlx::query_scalar(NAME)
        .bind(id)
        .fetch_one(conn)
        .await
        .map_err(StoreError::during("read the name of a map"))
}

/// The map with this number; `None` if it is gone.
pub(crate) async fn head(conn: &mut SqliteConnection, id: i64) -> Result<Option<MapHead>, StoreError> {
    let at = || StoreError::during("read map");
    let row = sqlx::query(MAP).bind(id).fetch_optional(conn).await.map_err(at())?;
    let Some(row) = row else { return Ok(None) };
    let name: String = row.try_get("name").map_err(at())?;
    Ok(Some(MapHead {
        version: row.try_get::<i64, _>("version").map_err(at())? as u64,
        distance: maps::distance_of(&row.try_get::<String, _>("distance").map_err(at())?),
        visibility_settings: visibility_settings::read(
            &name,
            row.try_get::<Option<&str>, _>("sight").map_err(at())?,
        ),
        walls_version: row.try_get("walls_version").map_err(at())?,
        name,
    }))
}

/// Its landmarks by rising number.
pub(crate) async fn landmarks(conn: &mut SqliteConnection, id: i64) -> Result<Vec<LandmarkHead>, StoreError> {
    let at = || StoreError::during("read landmarks of a map");
    let rows = sqlx::query(LANDMARKS).bind(id).fetch_all(conn).await.map_err(at())?;
    let head = |row: &sqlx::sqlite::SqliteRow| {
        Ok(LandmarkHead {
            id: LandmarkId(row.try_get::<i64, _>("id")? as u64),
            name: row.try_get("name")?,
            geometry: landmarks::geometry(row)?,
            health: landmarks::health_of(row.try_get("health")?),
        })
    };
    rows.iter().map(head).collect::<Result<_, _>>().map_err(at())
}
