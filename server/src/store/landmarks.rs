//! Landmarks of a map: name, size, place, and a summary of what was learnt.

use super::{StoreError, Tx, maps, now_ms, statements::statements, within};
use sqlx::{Row, SqliteExecutor, sqlite::SqliteRow};
use vision::localise::pose::LandmarkSize;

/// Columns of [`LandmarkRow`]; views and model are joined so that a list is one query.
macro_rules! select {
    ($tail:literal) => {
        concat!(
            "SELECT l.id, l.name, l.width_m, l.height_m, l.x_m, l.y_m, l.z_m, l.theta_rad, \
             (SELECT count(*) FROM views v WHERE v.landmark_id = l.id) AS views, \
             m.active, m.reasons, m.facts, m.views AS model_views, m.generated_views, m.learnt_ms \
             FROM landmarks l LEFT JOIN models m ON m.landmark_id = l.id ",
            $tail
        )
    };
}

statements! {
    COUNT = "SELECT count(*) FROM landmarks WHERE map_id = ?1";
    INSERT = "INSERT INTO landmarks (map_id, name, width_m, height_m, x_m, y_m, z_m, theta_rad, created_ms) \
              VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9) RETURNING id";
    GET = select!("JOIN maps ON maps.id = l.map_id WHERE maps.name = ?1 AND l.name = ?2");
    PAGE = select!("WHERE l.map_id = ?1 AND l.name > ?2 ORDER BY l.name LIMIT ?3");
    UPDATE = "UPDATE landmarks SET width_m = ?2, height_m = ?3, x_m = ?4, y_m = ?5, z_m = ?6, theta_rad = ?7 \
              WHERE id = ?1";
    DELETE = "DELETE FROM landmarks WHERE id = ?1";
}

/// Centre of a landmark in the map and the direction of its outward normal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Place {
    pub(crate) x_m: f64,
    pub(crate) y_m: f64,
    pub(crate) z_m: f64,
    pub(crate) theta_rad: f64,
}

/// What of a landmark can be set by hand.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Measures {
    pub(crate) size: Option<LandmarkSize>,
    pub(crate) place: Option<Place>,
}

/// What was learnt, in brief.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct ModelSummary {
    /// Fit to be matched.
    pub(crate) active: bool,
    /// JSON list of what keeps it from being active.
    pub(crate) reasons: String,
    /// JSON object: thresholds and figures of the learning.
    pub(crate) facts: String,
    pub(crate) views: u64,
    pub(crate) generated_views: u64,
    pub(crate) learnt_ms: i64,
}

/// A landmark.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct LandmarkRow {
    pub(crate) id: i64,
    pub(crate) name: String,
    pub(crate) measures: Measures,
    pub(crate) views: u64,
    pub(crate) model: Option<ModelSummary>,
}

pub(super) fn measures(row: &SqliteRow) -> Result<Measures, sqlx::Error> {
    let real = |column: &str| row.try_get::<Option<f64>, _>(column);
    let size = real("width_m")?.zip(real("height_m")?);
    let (xy, zt) = (real("x_m")?.zip(real("y_m")?), real("z_m")?.zip(real("theta_rad")?));
    Ok(Measures {
        size: size.map(|(width_m, height_m)| LandmarkSize { width_m, height_m }),
        place: xy.zip(zt).map(|((x_m, y_m), (z_m, theta_rad))| Place { x_m, y_m, z_m, theta_rad }),
    })
}

fn landmark_row(row: &SqliteRow) -> Result<LandmarkRow, sqlx::Error> {
    let active: Option<bool> = row.try_get("active")?;
    let model = match active {
        None => None,
        Some(active) => Some(ModelSummary {
            active,
            reasons: row.try_get("reasons")?,
            facts: row.try_get("facts")?,
            views: row.try_get::<i64, _>("model_views")? as u64,
            generated_views: row.try_get::<i64, _>("generated_views")? as u64,
            learnt_ms: row.try_get("learnt_ms")?,
        }),
    };
    Ok(LandmarkRow {
        id: row.try_get("id")?,
        name: row.try_get("name")?,
        measures: measures(row)?,
        views: row.try_get::<i64, _>("views")? as u64,
        model,
    })
}

/// A new landmark without views.
pub(crate) async fn create(
    tx: &mut Tx,
    map: &str,
    name: &str,
    measures: Measures,
    max: usize,
) -> Result<LandmarkRow, StoreError> {
    let map = maps::get(&mut tx.conn, map).await?;
    let (size, place) = (measures.size, measures.place);
    let id = sqlx::query_scalar(INSERT)
        .bind(map.id)
        .bind(name)
        .bind(size.map(|s| s.width_m))
        .bind(size.map(|s| s.height_m))
        .bind(place.map(|p| p.x_m))
        .bind(place.map(|p| p.y_m))
        .bind(place.map(|p| p.z_m))
        .bind(place.map(|p| p.theta_rad))
        .bind(now_ms())
        .fetch_one(&mut tx.conn)
        .await
        .map_err(StoreError::inserting("create landmark", "landmark", name))?;
    let count = sqlx::query_scalar(COUNT)
        .bind(map.id)
        .fetch_one(&mut tx.conn)
        .await
        .map_err(StoreError::at("count landmarks"))?;
    within(count, max, "landmarks in a map")?;
    maps::bump(tx, map.id).await?;
    Ok(LandmarkRow { id, name: name.to_owned(), measures, views: 0, model: None })
}

/// One landmark by the names of its map and itself. A missing map is not told from a missing landmark.
pub(crate) async fn get(
    db: impl SqliteExecutor<'_>,
    map: &str,
    name: &str,
) -> Result<LandmarkRow, StoreError> {
    let row = sqlx::query(GET)
        .bind(map)
        .bind(name)
        .fetch_optional(db)
        .await
        .map_err(StoreError::at("read landmark"))?;
    let row = row.ok_or_else(|| StoreError::NotFound { what: "landmark", name: name.to_owned() })?;
    landmark_row(&row).map_err(StoreError::at("read landmark"))
}

/// Landmarks of a map with names after `after`, in order.
pub(crate) async fn page(
    db: impl SqliteExecutor<'_>,
    map_id: i64,
    after: &str,
    limit: usize,
) -> Result<Vec<LandmarkRow>, StoreError> {
    let rows = sqlx::query(PAGE).bind(map_id).bind(after).bind(limit as i64).fetch_all(db).await;
    let rows = rows.map_err(StoreError::at("list landmarks"))?;
    rows.iter().map(landmark_row).collect::<Result<_, _>>().map_err(StoreError::at("list landmarks"))
}

/// Sets size and place. `change` gets the present values and returns the new ones or why not.
pub(crate) async fn update(
    tx: &mut Tx,
    map: &str,
    name: &str,
    change: impl FnOnce(Measures) -> Measures + Send,
) -> Result<LandmarkRow, StoreError> {
    let map = maps::get(&mut tx.conn, map).await?;
    let mut landmark = get(&mut tx.conn, &map.name, name).await?;
    landmark.measures = change(landmark.measures);
    let (size, place) = (landmark.measures.size, landmark.measures.place);
    sqlx::query(UPDATE)
        .bind(landmark.id)
        .bind(size.map(|s| s.width_m))
        .bind(size.map(|s| s.height_m))
        .bind(place.map(|p| p.x_m))
        .bind(place.map(|p| p.y_m))
        .bind(place.map(|p| p.z_m))
        .bind(place.map(|p| p.theta_rad))
        .execute(&mut tx.conn)
        .await
        .map_err(StoreError::at("update landmark"))?;
    maps::bump(tx, map.id).await?;
    Ok(landmark)
}

/// Deletes a landmark with its views and model.
pub(crate) async fn delete(tx: &mut Tx, map: &str, name: &str) -> Result<(), StoreError> {
    let map = maps::get(&mut tx.conn, map).await?;
    let landmark = get(&mut tx.conn, &map.name, name).await?;
    sqlx::query(DELETE)
        .bind(landmark.id)
        .execute(&mut tx.conn)
        .await
        .map_err(StoreError::at("delete landmark"))?;
    maps::bump(tx, map.id).await
}
