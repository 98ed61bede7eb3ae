//! Landmarks of a map: name, size, place, and a summary of what was learnt.

use super::{StoreError, Tx, db, jobs, kind::Kind, maps, now_ms, statements::statements, within};
use map::{
    landmark_health::LandmarkHealth,
    place::{LandmarkPlace, PlaceSigmas},
};
use nalgebra::{Matrix6, Vector3};
use protos::api::{Place, Size, SizeAndPlace};
use vision::{model::LandmarkId, pose::LandmarkSize};

/// The columns that [`geometry`] reads, with what names their table.
macro_rules! geometry_columns {
    ($of:literal) => {
        geometry_columns!(@ $of, "width_m" "height_m" "x_m" "y_m" "z_m" "theta_rad" "roll_rad" "tilt_rad"
            "place_covariance" "size_from_views")
    };
    (@ $of:literal, $first:literal $($column:literal)*) => {
        concat!($of, $first $(, ", ", $of, $column)*)
    };
}
pub(super) use geometry_columns;

/// Columns of [`LandmarkRow`]; views and model are joined so that a list is one query.
macro_rules! select {
    ($tail:literal) => {
        concat!(
            "SELECT l.id, l.name, l.id || '.' || l.revision AS revision, l.changed_ms, l.health, l.finding, \
             l.learning, ",
            geometry_columns!("l."),
            ", (SELECT count(*) FROM views v WHERE v.landmark_id = l.id) AS views, \
             m.active, m.looks_like, m.reasons, m.facts, m.views AS model_views, m.generated_views, m.learnt_ms \
             FROM landmarks l LEFT JOIN models m ON m.landmark_id = l.id ",
            $tail
        )
    };
}

statements! {
    COUNT = "SELECT count(*) FROM landmarks WHERE map_id = $1";
    INSERT = "INSERT INTO landmarks (map_id, name, created_ms) VALUES ($1, $2, $3) RETURNING id";
    GET = select!("JOIN maps ON maps.id = l.map_id WHERE maps.name = $1 AND l.name = $2");
    PAGE = select!("WHERE l.map_id = $1 AND l.name > $2 ORDER BY l.name LIMIT $3");
    SET_HEALTH = "UPDATE landmarks SET health = $2, finding = $3 WHERE id = $1";
    UPDATE = "UPDATE landmarks SET width_m = $2, height_m = $3, x_m = $4, y_m = $5, z_m = $6, theta_rad = $7, \
              roll_rad = $8, tilt_rad = $9, place_covariance = $10, size_from_views = $11 WHERE id = $1";
    DELETE = "DELETE FROM landmarks WHERE id = $1";
    RENAME = "UPDATE landmarks SET name = $2 WHERE id = $1";
    NAME = "SELECT l.name FROM landmarks l JOIN maps m ON m.id = l.map_id WHERE m.name = $1 AND l.id = $2";
}

/// The place of a landmark, as it is stored: centre (map frame, m) and direction of the outward
/// normal (rad).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct StoredPlace {
    pub(crate) x_m: f64,
    pub(crate) y_m: f64,
    pub(crate) z_m: f64,
    pub(crate) theta_rad: f64,
    /// Turn about the normal, rad.
    pub(crate) roll_rad: f64,
    /// Turn of the normal downwards, rad.
    pub(crate) tilt_rad: f64,
    /// Over (x, y, theta, z, width, height), m and rad; `None` for a place by hand.
    pub(crate) covariance: Option<Matrix6<f64>>,
}

/// Size and place of a landmark, set by hand or found from its views.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct LandmarkGeometry {
    pub(crate) size: Option<LandmarkSize>,
    pub(crate) place: Option<StoredPlace>,
    /// The size was found with the place, from views.
    pub(crate) size_from_views: bool,
}

impl LandmarkGeometry {
    /// The size, if it was set by hand.
    pub(crate) fn size_by_hand(&self) -> Option<LandmarkSize> {
        self.size.filter(|_| !self.size_from_views)
    }

    /// With the size and the place of `by_hand`, if a person sets them.
    pub(crate) fn edited(self, by_hand: &Self, (size, place): (bool, bool)) -> Self {
        Self {
            size: if size { by_hand.size } else { self.size },
            place: if place { by_hand.place } else { self.place },
            size_from_views: self.size_from_views && !size,
        }
    }

    /// With the size and place of `other` where it has none.
    pub(crate) fn or(self, other: &Self) -> Self {
        let sized = if self.size.is_some() { &self } else { other };
        Self { place: self.place.or(other.place), ..*sized }
    }

    /// In what another one differs: `size`, `place`.
    pub(crate) fn differences(&self, other: &Self) -> impl Iterator<Item = &'static str> {
        let size = (self.size, self.size_from_views) != (other.size, other.size_from_views);
        size.then_some("size").into_iter().chain((self.place != other.place).then_some("place"))
    }

    /// Size and place as they are shown.
    pub(crate) fn shown(&self) -> SizeAndPlace {
        let size = self.size.map(|s| Size { width_m: s.width_m, height_m: s.height_m });
        let place = self.place.map(|p| Place {
            x_m: p.x_m,
            y_m: p.y_m,
            z_m: p.z_m,
            theta_rad: p.theta_rad,
            roll_rad: p.roll_rad,
            tilt_rad: p.tilt_rad,
        });
        SizeAndPlace { size, place }
    }

    /// The place with its covariance. `None` without a size, or where stored numbers are out of
    /// range.
    pub(crate) fn landmark_place(&self) -> Option<LandmarkPlace> {
        let (size, place) = self.size.zip(self.place)?;
        let centre = Vector3::new(place.x_m, place.y_m, place.z_m);
        let by_hand = LandmarkPlace::by_hand(centre, place.theta_rad, size, PlaceSigmas::default()).ok()?;
        let (roll_rad, tilt_rad) = (place.roll_rad, place.tilt_rad);
        let covariance = place.covariance.unwrap_or(by_hand.covariance);
        let made = LandmarkPlace { roll_rad, tilt_rad, covariance, ..by_hand };
        made.check().is_ok().then_some(made)
    }
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct ModelSummary {
    /// The model passed all quality gates of its lesson.
    pub(crate) active: bool,
    /// Refused: JSON of the landmark in use that it looks like.
    pub(crate) looks_like: Option<String>,
    /// JSON list of the failed quality gates.
    pub(crate) reasons: String,
    /// JSON object: thresholds and figures of the model.
    pub(crate) facts: String,
    pub(crate) views: u64,
    pub(crate) generated_views: u64,
    pub(crate) learnt_ms: i64,
}

#[derive(Debug, Clone, PartialEq)]
pub(crate) struct LandmarkRow {
    pub(crate) id: i64,
    pub(crate) name: String,
    /// See [`super::revisions`].
    pub(crate) revision: String,
    /// When the revision changed last.
    pub(crate) changed_ms: i64,
    pub(crate) geometry: LandmarkGeometry,
    pub(crate) views: u64,
    pub(crate) model: Option<ModelSummary>,
    pub(crate) health: LandmarkHealth,
    /// JSON: the finding that led to this health.
    pub(crate) finding: Option<String>,
    /// JSON of `LearningSettings`: weights and gates of its own.
    pub(crate) learning: Option<String>,
}

/// The word for a landmark's health in the database.
pub(super) fn health_word(health: LandmarkHealth) -> &'static str {
    match health {
        LandmarkHealth::Sound => "sound",
        LandmarkHealth::Flagged => "flagged",
        LandmarkHealth::Quarantined => "quarantined",
    }
}

/// The health for a word; an unknown word (a file of another program) means quarantined.
pub(super) fn health_of(word: &str) -> LandmarkHealth {
    match word {
        "sound" => LandmarkHealth::Sound,
        "flagged" => LandmarkHealth::Flagged,
        _ => LandmarkHealth::Quarantined,
    }
}

pub(super) fn geometry(row: &db::Row) -> Result<LandmarkGeometry, db::Error> {
    let real = |column: &str| row.try_get::<Option<f64>, _>(column);
    let size = real("width_m")?.zip(real("height_m")?);
    let (xy, zt) = (real("x_m")?.zip(real("y_m")?), real("z_m")?.zip(real("theta_rad")?));
    let (roll_rad, tilt_rad) = (real("roll_rad")?.unwrap_or(0.0), real("tilt_rad")?.unwrap_or(0.0));
    let covariance = row.try_get::<Option<&[u8]>, _>("place_covariance")?.and_then(covariance_of);
    Ok(LandmarkGeometry {
        size: size.map(|(width_m, height_m)| LandmarkSize { width_m, height_m }),
        place: xy.zip(zt).map(|((x_m, y_m), (z_m, theta_rad))| StoredPlace {
            x_m,
            y_m,
            z_m,
            theta_rad,
            roll_rad,
            tilt_rad,
            covariance,
        }),
        size_from_views: row.try_get::<Option<bool>, _>("size_from_views")?.unwrap_or(false),
    })
}

/// 36 numbers, row by row; a matrix of places is symmetric, so the order within is no matter.
fn covariance_of(bytes: &[u8]) -> Option<Matrix6<f64>> {
    let numbers: Vec<f64> = bytes.as_chunks::<8>().0.iter().map(|b| f64::from_le_bytes(*b)).collect();
    (numbers.len() == 36).then(|| Matrix6::from_row_slice(&numbers))
}

fn covariance_bytes(covariance: &Matrix6<f64>) -> Vec<u8> {
    covariance.transpose().iter().flat_map(|v| v.to_le_bytes()).collect()
}

pub(super) async fn set_geometry(
    tx: &mut Tx,
    id: i64,
    geometry: &LandmarkGeometry,
) -> Result<(), StoreError> {
    let (size, place) = (geometry.size, geometry.place);
    db::query(UPDATE)
        .bind(id)
        .bind(size.map(|s| s.width_m))
        .bind(size.map(|s| s.height_m))
        .bind(place.map(|p| p.x_m))
        .bind(place.map(|p| p.y_m))
        .bind(place.map(|p| p.z_m))
        .bind(place.map(|p| p.theta_rad))
        .bind(place.map(|p| p.roll_rad))
        .bind(place.map(|p| p.tilt_rad))
        .bind(place.and_then(|p| p.covariance).map(|c| covariance_bytes(&c)))
        .bind(size.map(|_| geometry.size_from_views))
        .execute(&mut tx.conn)
        .await
        .map(drop)
        .map_err(StoreError::during("measure landmark"))
}

fn landmark_row(row: &db::Row) -> Result<LandmarkRow, db::Error> {
    let active: Option<bool> = row.try_get("active")?;
    let model = match active {
        None => None,
        Some(active) => Some(ModelSummary {
            active,
            looks_like: row.try_get("looks_like")?,
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
        revision: row.try_get("revision")?,
        changed_ms: row.try_get("changed_ms")?,
        geometry: geometry(row)?,
        views: row.try_get::<i64, _>("views")? as u64,
        model,
        health: health_of(&row.try_get::<String, _>("health")?),
        finding: row.try_get("finding")?,
        learning: row.try_get("learning")?,
    })
}

/// A new landmark without views.
#[expect(clippy::large_types_passed_by_value, reason = "moved into a write, once")]
pub(crate) async fn create(
    tx: &mut Tx,
    map: &str,
    name: &str,
    geometry: LandmarkGeometry,
    max: usize,
) -> Result<LandmarkRow, StoreError> {
    let map = maps::get(&mut tx.conn, map).await?;
    let id = db::query_scalar(INSERT)
        .bind(map.id)
        .bind(name)
        .bind(now_ms())
        .fetch_one(&mut tx.conn)
        .await
        .map_err(StoreError::inserting("create landmark", Kind::Landmark, name))?;
    let count = db::query_scalar(COUNT)
        .bind(map.id)
        .fetch_one(&mut tx.conn)
        .await
        .map_err(StoreError::during("count landmarks"))?;
    within(count, max, "landmarks in a map")?;
    set_geometry(tx, id, &geometry).await?;
    maps::bump(tx, map.id).await?;
    get(&mut tx.conn, &map.name, name).await
}

/// One landmark by the names of its map and itself. A missing map is not told from a missing
/// landmark.
pub(crate) async fn get(db: impl db::Executor<'_>, map: &str, name: &str) -> Result<LandmarkRow, StoreError> {
    let row = db::query(GET)
        .bind(map)
        .bind(name)
        .fetch_optional(db)
        .await
        .map_err(StoreError::during("read landmark"))?;
    let row = row.ok_or_else(|| StoreError::NotFound { what: Kind::Landmark, name: name.to_owned() })?;
    landmark_row(&row).map_err(StoreError::during("read landmark"))
}

/// Landmarks of a map with names after `after`, in order.
pub(crate) async fn page(
    db: impl db::Executor<'_>,
    map_id: i64,
    after: &str,
    limit: usize,
) -> Result<Vec<LandmarkRow>, StoreError> {
    let rows = db::query(PAGE).bind(map_id).bind(after).bind(limit as i64).fetch_all(db).await;
    let rows = rows.map_err(StoreError::during("list landmarks"))?;
    rows.iter().map(landmark_row).collect::<Result<_, _>>().map_err(StoreError::during("list landmarks"))
}

/// Sets a landmark's health and its finding, by a person or by robots. A new place or size makes it
/// sound again ([`update`]).
pub(crate) async fn set_health(
    tx: &mut Tx,
    map: &str,
    name: &str,
    health: LandmarkHealth,
    finding: Option<&str>,
) -> Result<LandmarkRow, StoreError> {
    let map = maps::get(&mut tx.conn, map).await?;
    let landmark = get(&mut tx.conn, &map.name, name).await?;
    db::query(SET_HEALTH)
        .bind(landmark.id)
        .bind(health_word(health))
        .bind(finding)
        .execute(&mut tx.conn)
        .await
        .map_err(StoreError::during("set landmark health"))?;
    maps::bump(tx, map.id).await?;
    get(&mut tx.conn, &map.name, name).await
}

/// Sets size and place. `change` gets the present geometry and returns the new one.
pub(crate) async fn update(
    tx: &mut Tx,
    map: &str,
    name: &str,
    change: impl FnOnce(LandmarkGeometry) -> LandmarkGeometry + Send,
) -> Result<LandmarkRow, StoreError> {
    let map = maps::get(&mut tx.conn, map).await?;
    let old = get(&mut tx.conn, &map.name, name).await?;
    let geometry = change(old.geometry);
    // First, so that the history has the health that belongs to the old place.
    set_geometry(tx, old.id, &geometry).await?;
    if geometry != old.geometry && old.health != LandmarkHealth::Sound {
        // The finding was about another place.
        set_health(tx, &map.name, name, LandmarkHealth::Sound, None).await?;
    }
    maps::bump(tx, map.id).await?;
    get(&mut tx.conn, &map.name, name).await
}

/// Gives a landmark another name, also in the jobs that wait for it; returns that name. Errors:
/// `Exists`.
pub(crate) async fn rename(tx: &mut Tx, map: &str, name: &str, new: &str) -> Result<String, StoreError> {
    let map = maps::get(&mut tx.conn, map).await?;
    let landmark = get(&mut tx.conn, &map.name, name).await?;
    db::query(RENAME)
        .bind(landmark.id)
        .bind(new)
        .execute(&mut tx.conn)
        .await
        .map_err(StoreError::inserting("rename landmark", Kind::Landmark, new))?;
    jobs::rename_landmark(tx, &map.name, name, new).await?;
    maps::bump(tx, map.id).await?;
    Ok(new.to_owned())
}

/// The present name of a landmark by its number.
pub(crate) async fn name_of(tx: &mut Tx, map: &str, id: LandmarkId) -> Result<String, StoreError> {
    let name = db::query_scalar(NAME).bind(map).bind(id.0 as i64).fetch_optional(&mut tx.conn).await;
    let name = name.map_err(StoreError::during("read the name of a landmark"))?;
    name.ok_or_else(|| StoreError::NotFound { what: Kind::Landmark, name: id.0.to_string() })
}

/// Deletes a landmark with its views and model.
pub(crate) async fn delete(tx: &mut Tx, map: &str, name: &str) -> Result<(), StoreError> {
    let map = maps::get(&mut tx.conn, map).await?;
    let landmark = get(&mut tx.conn, &map.name, name).await?;
    db::query(DELETE)
        .bind(landmark.id)
        .execute(&mut tx.conn)
        .await
        .map_err(StoreError::during("delete landmark"))?;
    maps::bump(tx, map.id).await
}
