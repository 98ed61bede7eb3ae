//! What differs between a map at one commit and at a later one. A row that was changed and changed
//! back does not differ. Distractors are left out: nobody edits them.

use super::{before, oldest};
use crate::store::{
    StoreError,
    db::{self, Conn, Row},
    landmarks::{LandmarkGeometry, geometry, geometry_columns},
    statements::statements,
    walls::StoredWall,
};
use protos::api::{ChangeSummary, SizeAndPlace, WallsDifference};
use std::collections::{BTreeMap, BTreeSet};

/// How much of a row there is at $3: as the oldest later commit has stored it, or as it is.
macro_rules! is_present {
    ($table:literal) => {
        concat!(
            "coalesce((SELECT l.present FROM past_",
            $table,
            " l WHERE l.id = f.id AND l.commit_id > $3 \
             ORDER BY l.commit_id LIMIT 1), (SELECT count(*) FROM ",
            $table,
            " t WHERE t.id = f.id))"
        )
    };
}

/// The columns of a row before, and of the same row at $3.
macro_rules! with_later {
    ($table:literal, $key:literal, $columns:expr) => {
        concat!(
            "WITH f AS ",
            before!($table, $key),
            ", later AS ",
            oldest!($table, $key, concat!("commit_id > $3 AND ", $key, " IN (SELECT ", $key, " FROM f)")),
            ", n AS (SELECT ",
            $key,
            ", present, ",
            $columns,
            " FROM later UNION ALL SELECT ",
            $key,
            ", 1, ",
            $columns,
            " FROM ",
            $table,
            " WHERE ",
            $key,
            " IN (SELECT ",
            $key,
            " FROM f) AND ",
            $key,
            " NOT IN (SELECT ",
            $key,
            " FROM later)) "
        )
    };
}

statements! {
    // The row before and the row at $3, as far as they are there, under each other.
    LANDMARKS = concat!(with_later!("landmarks", "id", concat!("name, ", geometry_columns!(""))),
                "SELECT id, 0 AS side, present, name, ", geometry_columns!(""), " FROM f \
                UNION ALL SELECT id, 1, present, name, ", geometry_columns!(""), " FROM n ORDER BY id");
    VIEWS = concat!("SELECT landmark_id, sum(CASE WHEN was < is_now THEN 1 ELSE 0 END) AS added, \
            sum(CASE WHEN was > is_now THEN 1 ELSE 0 END) AS removed FROM \
            (SELECT f.landmark_id, f.present AS was, ", is_present!("views"), " AS is_now FROM ",
            before!("views", "id"), " AS f) AS c WHERE was <> is_now GROUP BY landmark_id");
    MODELS = concat!(with_later!("models", "landmark_id", "sha256, active"),
             "SELECT f.landmark_id FROM f LEFT JOIN n ON n.landmark_id = f.landmark_id \
             WHERE f.sha256 IS DISTINCT FROM n.sha256 OR f.active IS DISTINCT FROM n.active");
    LEARNING = concat!(with_later!("landmarks", "id", "learning"),
               "SELECT f.id FROM f JOIN n ON n.id = f.id WHERE f.present = 1 AND n.present = 1 \
               AND f.learning IS DISTINCT FROM n.learning");
    RUNS = concat!("SELECT coalesce(sum(CASE WHEN was < is_now THEN 1 ELSE 0 END), 0) AS added, \
           coalesce(sum(CASE WHEN was > is_now THEN 1 ELSE 0 END), 0) AS removed \
           FROM (SELECT f.present AS was, ", is_present!("runs"), " AS is_now FROM ",
           before!("runs", "id"), " AS f) AS c");
    UNDERLAY = concat!(with_later!("underlays", "map_id", "image_sha256, metres_per_pixel, x_m, y_m, \
               theta_rad"),
               "SELECT count(*) FROM f LEFT JOIN n ON n.map_id = f.map_id WHERE f.image_sha256 IS DISTINCT FROM n.image_sha256 \
               OR f.metres_per_pixel IS DISTINCT FROM n.metres_per_pixel OR f.x_m IS DISTINCT FROM n.x_m OR f.y_m IS DISTINCT FROM n.y_m \
               OR f.theta_rad IS DISTINCT FROM n.theta_rad");
    SETTINGS = concat!(with_later!("maps", "id", "name, site, building, floor, parent_id, parent_from_map, \
               preset, distance, learning, fusion, areas, sight"),
               "SELECT f.name IS DISTINCT FROM n.name AS name, f.site IS DISTINCT FROM n.site AS site, f.building IS DISTINCT FROM n.building AS building, \
               f.floor IS DISTINCT FROM n.floor AS floor, f.parent_id IS DISTINCT FROM n.parent_id OR f.parent_from_map IS DISTINCT FROM \
               n.parent_from_map AS parent, f.preset IS DISTINCT FROM n.preset OR f.distance IS DISTINCT FROM n.distance AS pipeline, f.learning IS DISTINCT FROM n.learning AS learning, f.fusion IS DISTINCT FROM n.fusion AS fusion_mode, f.areas IS DISTINCT FROM n.areas AS areas, \
               f.sight IS DISTINCT FROM n.sight AS visibility_settings FROM f JOIN n ON n.id = f.id");
    WALLS_BEFORE = "SELECT min(id) FROM commits WHERE map_id = $1 AND walls = 1 AND id > $2 AND id <= $3";
    WALLS_AFTER = "SELECT min(id) FROM commits WHERE map_id = $1 AND walls = 1 AND id > $2";
    PAST_WALLS = "SELECT ax_m, ay_m, bx_m, by_m, covariance FROM past_walls WHERE commit_id = $1";
    NOW_WALLS = "SELECT ax_m, ay_m, bx_m, by_m, covariance FROM laser_segments WHERE map_id = $1";
    ROW_AT = concat!("SELECT * FROM (SELECT commit_id, name, ", geometry_columns!(""), " FROM past_landmarks \
             WHERE id = $1 AND commit_id > $2 AND present = 1 UNION ALL SELECT 9223372036854775807, name, ",
             geometry_columns!(""), " FROM landmarks WHERE id = $1) AS r ORDER BY commit_id LIMIT 1");
}

/// Words for settings; also the columns of `SETTINGS`.
pub(in crate::store) const SETTINGS_OF_MAP: [&str; 10] = [
    "name",
    "site",
    "building",
    "floor",
    "parent",
    "pipeline",
    "learning",
    "fusion_mode",
    "areas",
    "visibility_settings",
];
/// Landmarks that a summary names.
const MAX_NAMED: usize = 8;

/// Name, size and place of a landmark.
type NamedGeometry = (String, LandmarkGeometry);

/// What changed of a landmark.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct LandmarkChange {
    /// It was there before, it is there after.
    pub(crate) present: [bool; 2],
    /// Name before and after, where they are known from its row.
    pub(crate) names: [Option<String>; 2],
    /// Size and place before and after; of one whose row has not changed, absent until
    /// [`fill_unchanged`].
    pub(crate) geometry: [Option<SizeAndPlace>; 2],
    /// Of a landmark that stays: which of `name`, `size`, `place` and `learning` differ.
    pub(crate) fields: Vec<&'static str>,
    /// Views added, views removed.
    pub(crate) views: [u64; 2],
    /// Its model or the thresholds in it differ.
    pub(crate) model: bool,
}

impl LandmarkChange {
    /// Of a landmark with this name and geometry before and after, as far as it is there.
    pub(in crate::store) fn of(old: Option<&NamedGeometry>, new: Option<&NamedGeometry>) -> Self {
        let sides = [old, new];
        let mut fields = Vec::new();
        if let Some(((old_name, old), (new_name, new))) = old.zip(new) {
            fields.extend((old_name != new_name).then_some("name"));
            fields.extend(old.differences(new));
        }
        Self {
            present: sides.map(|side| side.is_some()),
            names: sides.map(|side| side.map(|(name, _)| name.clone())),
            geometry: sides.map(|side| side.map(|(_, geometry)| geometry.shown())),
            fields,
            ..Self::default()
        }
    }

    /// Its name after the change, or before it if it is gone; empty where it is not known.
    pub(crate) fn name(&self) -> &str {
        let [before, after] = &self.names;
        after.as_deref().or(before.as_deref()).unwrap_or_default()
    }
}

impl Default for LandmarkChange {
    /// A landmark whose row has not changed is there all the time.
    fn default() -> Self {
        Self {
            present: [true; 2],
            names: [None, None],
            geometry: [None; 2],
            fields: Vec::new(),
            views: [0; 2],
            model: false,
        }
    }
}

/// What differs between two states of a map.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Difference {
    /// By number.
    pub(crate) landmarks: BTreeMap<i64, LandmarkChange>,
    pub(crate) walls: Option<WallsDifference>,
    /// Which of [`SETTINGS_OF_MAP`].
    pub(crate) settings: Vec<&'static str>,
    pub(crate) underlay: bool,
    /// Reference runs added, removed.
    pub(crate) runs: [u64; 2],
}

/// What differs between the states after the commits `from` and `to` of a map; `from` is less than
/// `to`.
pub(crate) async fn between(
    conn: &mut Conn,
    map: i64,
    (from, to): (i64, i64),
) -> Result<Difference, StoreError> {
    let at = || StoreError::during("compare versions");
    let mut made = Difference::default();
    let mut landmarks: BTreeMap<i64, [Option<NamedGeometry>; 2]> = BTreeMap::new();
    for row in rows(conn, LANDMARKS, map, (from, to)).await? {
        let (id, side, landmark) = landmark_at(&row).map_err(at())?;
        landmarks.entry(id).or_default()[side] = landmark;
    }
    for (id, [old, new]) in landmarks {
        let change = LandmarkChange::of(old.as_ref(), new.as_ref());
        if change.present[0] != change.present[1] || !change.fields.is_empty() {
            made.landmarks.insert(id, change);
        }
    }
    for row in rows(conn, VIEWS, map, (from, to)).await? {
        let count = |column: &str| row.try_get::<i64, _>(column).map(|n| n as u64).map_err(at());
        let change = made.landmarks.entry(row.try_get("landmark_id").map_err(at())?).or_default();
        change.views = [count("added")?, count("removed")?];
    }
    for row in rows(conn, MODELS, map, (from, to)).await? {
        made.landmarks.entry(row.try_get(0).map_err(at())?).or_default().model = true;
    }
    for row in rows(conn, LEARNING, map, (from, to)).await? {
        made.landmarks.entry(row.try_get(0).map_err(at())?).or_default().fields.push("learning");
    }
    for row in rows(conn, SETTINGS, map, (from, to)).await? {
        for word in SETTINGS_OF_MAP {
            if row.try_get(word).map_err(at())? {
                made.settings.push(word);
            }
        }
    }
    for row in rows(conn, RUNS, map, (from, to)).await? {
        let count = |column: &str| row.try_get::<i64, _>(column).map(|n| n as u64).map_err(at());
        made.runs = [count("added")?, count("removed")?];
    }
    for row in rows(conn, UNDERLAY, map, (from, to)).await? {
        made.underlay = row.try_get::<i64, _>(0).map_err(at())? > 0;
    }
    made.walls = walls(conn, map, (from, to)).await?;
    Ok(made)
}

async fn rows(
    conn: &mut Conn,
    sql: &'static str,
    map: i64,
    (from, to): (i64, i64),
) -> Result<Vec<Row>, StoreError> {
    let rows = db::query(sql).bind(map).bind(from).bind(to).fetch_all(conn).await;
    rows.map_err(StoreError::during("compare versions"))
}

/// Number, side (before or after), and name and geometry where it is there.
fn landmark_at(row: &Row) -> Result<(i64, usize, Option<NamedGeometry>), db::Error> {
    let is_present: bool = row.try_get("present")?;
    let landmark = is_present.then(|| Ok::<_, db::Error>((row.try_get("name")?, geometry(row)?)));
    Ok((row.try_get("id")?, usize::from(row.try_get::<bool, _>("side")?), landmark.transpose()?))
}

async fn walls(
    conn: &mut Conn,
    map: i64,
    (from, to): (i64, i64),
) -> Result<Option<WallsDifference>, StoreError> {
    let at = || StoreError::during("compare walls");
    let first: Option<i64> = db::query_scalar(WALLS_BEFORE)
        .bind(map)
        .bind(from)
        .bind(to)
        .fetch_one(&mut *conn)
        .await
        .map_err(at())?;
    let Some(first) = first else { return Ok(None) };
    let later: Option<i64> =
        db::query_scalar(WALLS_AFTER).bind(map).bind(to).fetch_one(&mut *conn).await.map_err(at())?;
    let before = segments(&mut *conn, PAST_WALLS, first).await?;
    let after = match later {
        Some(later) => segments(&mut *conn, PAST_WALLS, later).await?,
        None => segments(&mut *conn, NOW_WALLS, map).await?,
    };
    Ok(walls_difference(&before, &after))
}

async fn segments(conn: &mut Conn, sql: &'static str, of: i64) -> Result<Vec<StoredWall>, StoreError> {
    let at = || StoreError::during("compare walls");
    let rows = db::query(sql).bind(of).fetch_all(conn).await.map_err(at())?;
    rows.iter().map(StoredWall::of).collect::<Result<_, _>>().map_err(at())
}

/// `None` where both have the same segments, in any order.
pub(in crate::store) fn walls_difference(
    before: &[StoredWall],
    after: &[StoredWall],
) -> Option<WallsDifference> {
    let of = |wall: &StoredWall| (wall.ends.map(f64::to_bits), wall.covariance.map(|c| c.map(f64::to_bits)));
    let bits = |segments: &[StoredWall]| -> BTreeSet<_> { segments.iter().map(of).collect() };
    let (old, new) = (bits(before), bits(after));
    let (added, removed) = (new.difference(&old).count(), old.difference(&new).count());
    if added + removed == 0 && before.len() == after.len() {
        return None;
    }
    let mut bounds_m = None::<[f64; 4]>;
    for [ax, ay, bx, by] in old.symmetric_difference(&new).map(|(ends, _)| ends.map(f64::from_bits)) {
        let one = [ax.min(bx), ay.min(by), ax.max(bx), ay.max(by)];
        let all = bounds_m.unwrap_or(one);
        let wider = [all[0].min(one[0]), all[1].min(one[1]), all[2].max(one[2]), all[3].max(one[3])];
        bounds_m = Some(wider);
    }
    let count = |n: usize| n as u64;
    Some(WallsDifference {
        before: count(before.len()),
        after: count(after.len()),
        added: count(added),
        removed: count(removed),
        bounds_m,
    })
}

/// Counts of a difference, with the names of its first landmarks, as they are at commit `to`.
pub(crate) async fn summary(conn: &mut Conn, of: &Difference, to: i64) -> Result<ChangeSummary, StoreError> {
    let count =
        |test: &dyn Fn(&LandmarkChange) -> bool| of.landmarks.values().filter(|c| test(c)).count() as u64;
    let mut named: Vec<(i64, LandmarkChange)> =
        of.landmarks.iter().take(MAX_NAMED).map(|(id, change)| (*id, change.clone())).collect();
    fill_unchanged(conn, &mut named, to).await?;
    Ok(ChangeSummary {
        landmarks_added: count(&|c| c.present == [false, true]),
        landmarks_removed: count(&|c| c.present == [true, false]),
        landmarks_changed: count(&|c| c.present == [true, true]),
        views_added: of.landmarks.values().map(|c| c.views[0]).sum(),
        views_removed: of.landmarks.values().map(|c| c.views[1]).sum(),
        models_changed: count(&|c| c.model),
        walls_changed: of.walls.is_some(),
        underlay_changed: of.underlay,
        reference_runs_added: of.runs[0],
        reference_runs_removed: of.runs[1],
        settings: of.settings.iter().map(ToString::to_string).collect(),
        landmarks: named.iter().map(|(_, change)| change.name().to_owned()).collect(),
    })
}

/// Fills in name, size and place of landmarks of which only views or the model have changed.
pub(crate) async fn fill_unchanged(
    conn: &mut Conn,
    changes: &mut [(i64, LandmarkChange)],
    to: i64,
) -> Result<(), StoreError> {
    let at = || StoreError::during("read a landmark");
    for (id, change) in changes.iter_mut().filter(|(_, change)| change.names == [None, None]) {
        let row = db::query(ROW_AT).bind(*id).bind(to).fetch_optional(&mut *conn).await.map_err(at())?;
        let Some(row) = row else { continue };
        let name: String = row.try_get("name").map_err(at())?;
        change.names = [Some(name.clone()), Some(name)];
        change.geometry = [Some(geometry(&row).map_err(at())?.shown()); 2];
    }
    Ok(())
}
