//! The walls of a map (laser segments in the map frame): replaced as a whole, read as a whole.

use super::{StoreError, Tx, kind::Kind, maps, statements::statements};
use sqlx::{Row, SqliteExecutor};

statements! {
    CLEAR = "DELETE FROM laser_segments WHERE map_id = ?1";
    INSERT = "INSERT INTO laser_segments (map_id, ordinal, ax_m, ay_m, bx_m, by_m) VALUES (?1, ?2, ?3, ?4, ?5, ?6)";
    WALLS = "UPDATE maps SET walls_version = walls_version + 1 WHERE id = ?1";
    VERSION = "SELECT walls_version FROM maps WHERE id = ?1";
    ALL_OF = "SELECT ax_m, ay_m, bx_m, by_m FROM laser_segments WHERE map_id = ?1 ORDER BY ordinal";
}

/// Ends of a wall: a.x, a.y, b.x, b.y (map frame, m), free side on the left.
pub(crate) type Ends = [f64; 4];

/// Replaces the walls of a map.
pub(crate) async fn replace(tx: &mut Tx, map: &str, segments: &[Ends]) -> Result<(), StoreError> {
    let map = maps::get(&mut tx.conn, map).await?;
    sqlx::query(CLEAR).bind(map.id).execute(&mut tx.conn).await.map_err(StoreError::during("clear walls"))?;
    for (ordinal, [ax, ay, bx, by]) in segments.iter().enumerate() {
        sqlx::query(INSERT)
            .bind(map.id)
            .bind(ordinal as i64)
            .bind(ax)
            .bind(ay)
            .bind(bx)
            .bind(by)
            .execute(&mut tx.conn)
            .await
            .map_err(StoreError::during("store wall"))?;
    }
    sqlx::query(WALLS).bind(map.id).execute(&mut tx.conn).await.map_err(StoreError::during("count walls"))?;
    maps::bump(tx, map.id).await
}

/// Version of a map's walls: it counts up with every replacement.
pub(super) async fn version(db: impl SqliteExecutor<'_>, map_id: i64) -> Result<i64, StoreError> {
    let version = sqlx::query_scalar(VERSION).bind(map_id).fetch_optional(db).await;
    let version = version.map_err(StoreError::during("read the version of walls"))?;
    version.ok_or_else(|| StoreError::NotFound { what: Kind::Map, name: map_id.to_string() })
}

/// The walls of a map, in the order they were given.
pub(crate) async fn all_of(db: impl SqliteExecutor<'_>, map_id: i64) -> Result<Vec<Ends>, StoreError> {
    let rows =
        sqlx::query(ALL_OF).bind(map_id).fetch_all(db).await.map_err(StoreError::during("read walls"))?;
    let ends = |row: &sqlx::sqlite::SqliteRow| {
        Ok([row.try_get("ax_m")?, row.try_get("ay_m")?, row.try_get("bx_m")?, row.try_get("by_m")?])
    };
    rows.iter().map(ends).collect::<Result<_, _>>().map_err(StoreError::during("read walls"))
}
