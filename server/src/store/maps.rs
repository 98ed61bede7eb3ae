//! Maps: named, versioned, with the distance that decides.

use super::{CommittedChange, StoreError, Tx, kind::Kind, now_ms, statements::statements, within};
use sqlx::{Row, SqliteExecutor, sqlite::SqliteRow};
use vision::recognise::DistanceKind;

statements! {
    COUNT = "SELECT count(*) FROM maps";
    INSERT = "INSERT INTO maps (name, distance, created_ms) VALUES (?1, ?2, ?3) RETURNING id";
    GET = "SELECT id, name, version, id || '.' || revision AS revision, changed_ms, distance, (SELECT count(*) FROM landmarks WHERE map_id = maps.id) AS landmarks \
           FROM maps WHERE name = ?1";
    PAGE = "SELECT id, name, version, id || '.' || revision AS revision, changed_ms, distance, (SELECT count(*) FROM landmarks WHERE map_id = maps.id) AS landmarks \
            FROM maps WHERE name > ?1 ORDER BY name LIMIT ?2";
    BUMP = "UPDATE maps SET version = version + 1 WHERE id = ?1";
    DELETE = "DELETE FROM maps WHERE id = ?1";
    LIES_IN = "SELECT name FROM maps WHERE parent_id = ?1 ORDER BY name LIMIT 1";
    ROBOT_ON = "SELECT name FROM robots WHERE map_id = ?1 ORDER BY name LIMIT 1";
}

/// A map without its content.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct MapRow {
    pub(crate) id: i64,
    pub(crate) name: String,
    pub(crate) version: u64,
    /// Of the map and all that is in it ([`super::revisions`]).
    pub(crate) revision: String,
    /// When the revision changed last.
    pub(crate) changed_ms: i64,
    pub(crate) distance: DistanceKind,
    /// How many landmarks it has.
    pub(crate) landmarks: u64,
}

fn map_row(row: &SqliteRow) -> Result<MapRow, sqlx::Error> {
    let distance: String = row.try_get("distance")?;
    Ok(MapRow {
        id: row.try_get("id")?,
        name: row.try_get("name")?,
        version: row.try_get::<i64, _>("version")? as u64,
        revision: row.try_get("revision")?,
        changed_ms: row.try_get("changed_ms")?,
        distance: distance_of(&distance),
        landmarks: row.try_get::<i64, _>("landmarks")? as u64,
    })
}

/// The word stored for a distance; the schema admits no other.
pub(super) fn distance_word(distance: DistanceKind) -> &'static str {
    match distance {
        DistanceKind::Both => "both",
        DistanceKind::Correlation => "correlation",
        DistanceKind::Hausdorff => "hausdorff",
    }
}

pub(super) fn distance_of(word: &str) -> DistanceKind {
    match word {
        "correlation" => DistanceKind::Correlation,
        "hausdorff" => DistanceKind::Hausdorff,
        _ => DistanceKind::Both,
    }
}

/// A new, empty map.
pub(crate) async fn create(
    tx: &mut Tx,
    name: &str,
    distance: DistanceKind,
    max: usize,
) -> Result<MapRow, StoreError> {
    let id = sqlx::query_scalar(INSERT)
        .bind(name)
        .bind(distance_word(distance))
        .bind(now_ms())
        .fetch_one(&mut tx.conn)
        .await
        .map_err(StoreError::inserting("create map", Kind::Map, name))?;
    let count =
        sqlx::query_scalar(COUNT).fetch_one(&mut tx.conn).await.map_err(StoreError::during("count maps"))?;
    within(count, max, "maps")?;
    tx.changed(CommittedChange::Map(id));
    get(&mut tx.conn, name).await
}

/// One map by name.
pub(crate) async fn get(db: impl SqliteExecutor<'_>, name: &str) -> Result<MapRow, StoreError> {
    let row = sqlx::query(GET).bind(name).fetch_optional(db).await.map_err(StoreError::during("read map"))?;
    let row = row.ok_or_else(|| StoreError::NotFound { what: Kind::Map, name: name.to_owned() })?;
    map_row(&row).map_err(StoreError::during("read map"))
}

/// The same inside a write.
pub(crate) async fn of(tx: &mut Tx, name: &str) -> Result<MapRow, StoreError> {
    get(&mut tx.conn, name).await
}

/// Maps with names after `after`, in order.
pub(crate) async fn page(
    db: impl SqliteExecutor<'_>,
    after: &str,
    limit: usize,
) -> Result<Vec<MapRow>, StoreError> {
    let rows = sqlx::query(PAGE).bind(after).bind(limit as i64).fetch_all(db).await;
    let rows = rows.map_err(StoreError::during("list maps"))?;
    rows.iter().map(map_row).collect::<Result<_, _>>().map_err(StoreError::during("list maps"))
}

/// Checks that a map was not deleted meanwhile, nor replaced by another of the same name; gives its present row.
pub(crate) async fn recheck(tx: &mut Tx, map: MapRow) -> Result<MapRow, StoreError> {
    let now = get(&mut tx.conn, &map.name).await?;
    if now.id == map.id { Ok(now) } else { Err(StoreError::NotFound { what: Kind::Map, name: map.name }) }
}

/// The map's content has changed: a new version, published after the commit.
pub(crate) async fn bump(tx: &mut Tx, id: i64) -> Result<(), StoreError> {
    sqlx::query(BUMP)
        .bind(id)
        .execute(&mut tx.conn)
        .await
        .map_err(StoreError::during("count map version"))?;
    tx.changed(CommittedChange::Map(id));
    Ok(())
}

/// Deletes a map and all that is in it. Errors: `InUse` while a robot is on it, or another map is linked to it.
pub(crate) async fn delete(tx: &mut Tx, name: &str) -> Result<(), StoreError> {
    let map = get(&mut tx.conn, name).await?;
    let robot: Option<String> = sqlx::query_scalar(ROBOT_ON)
        .bind(map.id)
        .fetch_optional(&mut tx.conn)
        .await
        .map_err(StoreError::during("look for robots"))?;
    if let Some(robot) = robot {
        return Err(StoreError::InUse(format!("robot `{robot}` stands on map `{name}`")));
    }
    let inner: Option<String> = sqlx::query_scalar(LIES_IN)
        .bind(map.id)
        .fetch_optional(&mut tx.conn)
        .await
        .map_err(StoreError::during("look for maps in it"))?;
    if let Some(inner) = inner {
        return Err(StoreError::InUse(format!("map `{inner}` lies in map `{name}`")));
    }
    sqlx::query(DELETE).bind(map.id).execute(&mut tx.conn).await.map_err(StoreError::during("delete map"))?;
    tx.changed(CommittedChange::MapRemoved(map.name));
    tx.changed(CommittedChange::Links);
    Ok(())
}
