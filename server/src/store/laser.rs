//! The walls of a map as laser segments: replaced as a whole, read as a whole.

use super::{StoreError, Tx, maps, statements::statements};
use sqlx::{Row, SqliteExecutor};

statements! {
    CLEAR = "DELETE FROM laser_segments WHERE map_id = ?1";
    INSERT = "INSERT INTO laser_segments (map_id, ordinal, ax_m, ay_m, bx_m, by_m) VALUES (?1, ?2, ?3, ?4, ?5, ?6)";
    ALL_OF = "SELECT ax_m, ay_m, bx_m, by_m FROM laser_segments WHERE map_id = ?1 ORDER BY ordinal";
}

/// Ends of a segment, metres: a.x, a.y, b.x, b.y.
pub(crate) type Ends = [f64; 4];

/// Replaces the walls of a map.
pub(crate) async fn replace(tx: &mut Tx, map: &str, segments: &[Ends]) -> Result<(), StoreError> {
    let map = maps::get(&mut tx.conn, map).await?;
    sqlx::query(CLEAR).bind(map.id).execute(&mut tx.conn).await.map_err(StoreError::at("clear walls"))?;
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
            .map_err(StoreError::at("store wall"))?;
    }
    maps::bump(tx, map.id).await
}

/// The walls of a map, in the order they were given.
pub(crate) async fn all_of(db: impl SqliteExecutor<'_>, map_id: i64) -> Result<Vec<Ends>, StoreError> {
    let rows = sqlx::query(ALL_OF).bind(map_id).fetch_all(db).await.map_err(StoreError::at("read walls"))?;
    let ends = |row: &sqlx::sqlite::SqliteRow| {
        Ok([row.try_get("ax_m")?, row.try_get("ay_m")?, row.try_get("bx_m")?, row.try_get("by_m")?])
    };
    rows.iter().map(ends).collect::<Result<_, _>>().map_err(StoreError::at("read walls"))
}
