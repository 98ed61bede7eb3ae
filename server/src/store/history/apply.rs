//! Goes back: a map as it was at a kept commit, or without one commit. The change is a commit of its own. Numbers of restored
//! rows are those that they had, so models, thresholds and views are what they were, byte for byte.
//!
//! A map keeps its name. What robots found out about a landmark that stays where it is (its health) stays too.

use super::{before, get, newest};
use crate::store::{
    CommittedChange, StoreError, Tx, map_locations,
    maps::{self, MapRow},
    now_ms,
    statements::statements,
};
use map::map_links;
use sqlx::Row;

/// `a, b` with a prefix for each.
macro_rules! list {
    ($prefix:literal, $first:ident $(, $column:ident)*) => {
        concat!($prefix, stringify!($first) $(, ", ", $prefix, stringify!($column))*)
    };
}

/// `a = f.a, b = f.b`.
macro_rules! assign {
    ($first:ident $(, $column:ident)*) => {
        concat!(stringify!($first), " = f.", stringify!($first)
            $(, ", ", stringify!($column), " = f.", stringify!($column))*)
    };
}

/// Deletes the rows that were not there.
macro_rules! remove {
    ($table:literal, $past:literal, $key:literal) => {
        concat!(
            "DELETE FROM ",
            $table,
            " WHERE ",
            $key,
            " IN (SELECT ",
            $key,
            " FROM ",
            before!($past, $key),
            " WHERE present = 0)"
        )
    };
}

/// Gives rows that are there the values that they had.
macro_rules! change {
    ($table:literal, $past:literal, $key:literal, $($column:ident),+) => {
        concat!(
            "UPDATE ", $table, " SET ", assign!($($column),+), " FROM ", before!($past, $key), " f WHERE f.", $key, " = ",
            $table, ".", $key, " AND f.present = 1"
        )
    };
}

/// Inserts the rows that are gone; `$more` are further columns and their values.
macro_rules! restore {
    ($table:literal, $past:literal, $key:literal, $more:literal = $values:literal, $($column:ident),+) => {
        concat!(
            "INSERT INTO ", $table, " (", $key, $more, ", ", list!("", $($column),+), ") SELECT f.", $key, $values, ", ",
            list!("f.", $($column),+), " FROM ", before!($past, $key), " f WHERE f.present = 1 AND f.", $key,
            " NOT IN (SELECT ", $key, " FROM ", $table, ") ORDER BY f.", $key
        )
    };
}

statements! {
    REMOVE_LANDMARKS = remove!("landmarks", "past_landmarks", "id");
    // Names may have been exchanged; no name begins so.
    SET_ASIDE = concat!("UPDATE landmarks SET name = '~' || landmarks.id FROM ", before!("past_landmarks", "id"),
                " f WHERE f.id = landmarks.id AND f.present = 1 AND f.name <> landmarks.name");
    // A finding stays with the place that it is about.
    HEALTH = concat!("UPDATE landmarks SET health = f.health, finding = f.finding FROM ", before!("past_landmarks", "id"),
             " f WHERE f.id = landmarks.id AND f.present = 1 AND (f.x_m IS NOT landmarks.x_m OR f.y_m IS NOT landmarks.y_m \
             OR f.z_m IS NOT landmarks.z_m OR f.theta_rad IS NOT landmarks.theta_rad OR f.width_m IS NOT landmarks.width_m \
             OR f.height_m IS NOT landmarks.height_m)");
    CHANGE_LANDMARKS = change!("landmarks", "past_landmarks", "id", name, width_m, height_m, x_m, y_m, z_m, theta_rad,
                       roll_rad, tilt_rad, place_covariance, size_from_views);
    // Beyond every revision that it ever had.
    RESTORE_LANDMARKS = restore!("landmarks", "past_landmarks", "id", ", map_id, revision, changed_ms" =
                        ", ?1, (SELECT max(p.revision) + 1 FROM past_landmarks p WHERE p.id = f.id), ?4",
                        name, width_m, height_m, x_m, y_m, z_m, theta_rad, roll_rad, tilt_rad, place_covariance,
                        size_from_views, health, finding, created_ms);
    REMOVE_VIEWS = remove!("views", "past_views", "id");
    CHANGE_VIEWS = change!("views", "past_views", "id", landmark_id, image_sha256, image_kind, width_px, height_px,
                   corners_px, created_ms, icon_side, icon_scale, capture, icon);
    RESTORE_VIEWS = restore!("views", "past_views", "id", "" = "", landmark_id, image_sha256, image_kind, width_px,
                    height_px, corners_px, created_ms, icon_side, icon_scale, capture, icon);
    REMOVE_MODELS = remove!("models", "past_models", "landmark_id");
    CHANGE_MODELS = change!("models", "past_models", "landmark_id", sha256, params_hash, active, reasons, facts, views,
                    generated_views, learnt_ms, points_asked, looks_like);
    RESTORE_MODELS = restore!("models", "past_models", "landmark_id", "" = "", sha256, params_hash, active, reasons, facts,
                     views, generated_views, learnt_ms, points_asked, looks_like);
    REMOVE_DISTRACTORS = remove!("strangers", "past_strangers", "id");
    CHANGE_DISTRACTORS = change!("strangers", "past_strangers", "id", image_sha256, corners_px, icon_side, icon_scale, icon);
    RESTORE_DISTRACTORS = restore!("strangers", "past_strangers", "id", ", map_id" = ", ?1", image_sha256, corners_px,
                          icon_side, icon_scale, icon);
    REMOVE_RUNS = remove!("runs", "past_runs", "id");
    CHANGE_RUNS = change!("runs", "past_runs", "id", robot, created_ms, way_m, cells);
    RESTORE_RUNS = restore!("runs", "past_runs", "id", ", map_id" = ", ?1", robot, created_ms, way_m, cells);
    REMOVE_UNDERLAY = remove!("underlays", "past_underlays", "map_id");
    CHANGE_UNDERLAY = change!("underlays", "past_underlays", "map_id", image_sha256, image_kind, width_px, height_px,
                      metres_per_pixel, x_m, y_m, theta_rad, created_ms);
    RESTORE_UNDERLAY = restore!("underlays", "past_underlays", "map_id", "" = "", image_sha256, image_kind, width_px,
                       height_px, metres_per_pixel, x_m, y_m, theta_rad, created_ms);
    CHANGE_SETTINGS = change!("maps", "past_maps", "id", site, building, floor, parent_id, parent_from_map, fusion, areas,
                      sight);
    LOST_PARENT = concat!("SELECT count(*) FROM ", before!("past_maps", "id"),
                  " f WHERE f.parent_id IS NOT NULL AND f.parent_id NOT IN (SELECT id FROM maps)");
    OLDEST_WALLS = "SELECT min(id) FROM commits WHERE map_id = ?1 AND id > ?2 AND id <= ?3 AND walls = 1";
    CLEAR_WALLS = "DELETE FROM laser_segments WHERE map_id = ?1";
    RESTORE_WALLS = "INSERT INTO laser_segments (map_id, ordinal, ax_m, ay_m, bx_m, by_m, covariance) \
                     SELECT ?1, ordinal, ax_m, ay_m, bx_m, by_m, covariance FROM past_walls WHERE commit_id = ?2";
    COUNT_WALLS = "UPDATE maps SET walls_version = walls_version + 1 WHERE id = ?1";
    IS_OPEN = "SELECT count(*) FROM commits WHERE map_id = ?1 AND open = 1";
    OPEN_JOB = "SELECT id FROM jobs WHERE map = ?1 AND state IN ('queued', 'running') LIMIT 1";
    // What is in the way of taking back commit ?1 of map ?2: a row that it changed was changed since, or others hang on it.
    LATER = "SELECT what, by FROM ( \
             SELECT 'landmark ' || coalesce(l.name, p.name, n.name, '') AS what, n.commit_id AS by FROM past_landmarks p \
             JOIN past_landmarks n ON n.id = p.id AND n.commit_id > ?1 LEFT JOIN landmarks l ON l.id = p.id \
             WHERE p.commit_id = ?1 \
             UNION ALL SELECT 'a view of landmark ' || coalesce(l.name, ''), n.commit_id FROM past_views p \
             JOIN past_views n ON n.id = p.id AND n.commit_id > ?1 LEFT JOIN landmarks l ON l.id = p.landmark_id \
             WHERE p.commit_id = ?1 \
             UNION ALL SELECT 'the landmark of a view', n.commit_id FROM past_views p \
             JOIN past_landmarks n ON n.id = p.landmark_id AND n.commit_id > ?1 \
             WHERE p.commit_id = ?1 AND NOT EXISTS (SELECT 1 FROM landmarks WHERE id = p.landmark_id) \
             UNION ALL SELECT 'the model of landmark ' || coalesce(l.name, ''), n.commit_id FROM past_models p \
             JOIN past_models n ON n.landmark_id = p.landmark_id AND n.commit_id > ?1 \
             LEFT JOIN landmarks l ON l.id = p.landmark_id WHERE p.commit_id = ?1 \
             UNION ALL SELECT 'landmark ' || coalesce(l.name, ''), n.commit_id FROM past_landmarks p \
             JOIN past_views n ON n.landmark_id = p.id AND n.commit_id > ?1 JOIN landmarks l ON l.id = p.id \
             WHERE p.commit_id = ?1 AND p.present = 0 \
             UNION ALL SELECT 'landmark ' || coalesce(l.name, ''), n.commit_id FROM past_landmarks p \
             JOIN past_models n ON n.landmark_id = p.id AND n.commit_id > ?1 JOIN landmarks l ON l.id = p.id \
             WHERE p.commit_id = ?1 AND p.present = 0 \
             UNION ALL SELECT 'a reference run', n.commit_id FROM past_runs p \
             JOIN past_runs n ON n.id = p.id AND n.commit_id > ?1 WHERE p.commit_id = ?1 \
             UNION ALL SELECT 'the underlay', n.commit_id FROM past_underlays p \
             JOIN past_underlays n ON n.map_id = p.map_id AND n.commit_id > ?1 WHERE p.commit_id = ?1 \
             UNION ALL SELECT 'the settings', n.commit_id FROM past_maps p \
             JOIN past_maps n ON n.id = p.id AND n.commit_id > ?1 WHERE p.commit_id = ?1 \
             UNION ALL SELECT 'the walls', n.id FROM commits p \
             JOIN commits n ON n.map_id = p.map_id AND n.id > p.id AND n.walls = 1 WHERE p.id = ?1 AND p.walls = 1 \
             ) ORDER BY by DESC LIMIT 1";
}

/// In order: what is removed or set aside comes first, so that nothing restored meets it.
const STEPS: [(&str, &str); 20] = [
    ("remove landmarks", REMOVE_LANDMARKS),
    ("set names aside", SET_ASIDE),
    ("restore health", HEALTH),
    ("change landmarks", CHANGE_LANDMARKS),
    ("restore landmarks", RESTORE_LANDMARKS),
    ("remove views", REMOVE_VIEWS),
    ("change views", CHANGE_VIEWS),
    ("restore views", RESTORE_VIEWS),
    ("remove models", REMOVE_MODELS),
    ("change models", CHANGE_MODELS),
    ("restore models", RESTORE_MODELS),
    ("remove distractors", REMOVE_DISTRACTORS),
    ("change distractors", CHANGE_DISTRACTORS),
    ("restore distractors", RESTORE_DISTRACTORS),
    ("remove runs", REMOVE_RUNS),
    ("change runs", CHANGE_RUNS),
    ("restore runs", RESTORE_RUNS),
    ("remove underlay", REMOVE_UNDERLAY),
    ("change underlay", CHANGE_UNDERLAY),
    ("restore underlay", RESTORE_UNDERLAY),
];

/// Makes a map what it was at a kept commit; says whether that changed anything. Errors: `NotFound`; `InUse` while a job works
/// on the map, or if the map that it lay in is gone.
pub(crate) async fn roll_back(tx: &mut Tx, map: &str, to: i64) -> Result<bool, StoreError> {
    let map = maps::of(tx, map).await?;
    get(&mut tx.conn, map.id, to).await?;
    no_job_on(tx, &map).await?;
    let newest = newest(&mut tx.conn, map.id).await?;
    apply(tx, &map, (to, newest)).await
}

/// Takes one commit back. Errors: `NotFound`; `InUse` as for [`roll_back`], or where the commit has nothing that can be taken
/// back; `ChangedSince` where later commits have changed the same rows; `Exists` where a name is taken.
pub(crate) async fn undo(tx: &mut Tx, map: &str, commit: i64) -> Result<(), StoreError> {
    let map = maps::of(tx, map).await?;
    get(&mut tx.conn, map.id, commit).await?;
    no_job_on(tx, &map).await?;
    let at = || StoreError::during("look for later changes");
    let later = sqlx::query(LATER).bind(commit).fetch_optional(&mut tx.conn).await.map_err(at())?;
    if let Some(row) = later {
        let (what, by) = (row.try_get("what").map_err(at())?, row.try_get("by").map_err(at())?);
        return Err(StoreError::ChangedSince { what, by });
    }
    if apply(tx, &map, (commit - 1, commit)).await? {
        return Ok(());
    }
    Err(StoreError::InUse(format!(
        "commit {commit} has nothing that can be taken back; a map is renamed or deleted instead"
    )))
}

/// A lesson rests on the models that it began with: what it stores would bring them back.
pub(in crate::store) async fn no_job_on(tx: &mut Tx, map: &MapRow) -> Result<(), StoreError> {
    let job: Option<i64> = sqlx::query_scalar(OPEN_JOB)
        .bind(&map.name)
        .fetch_optional(&mut tx.conn)
        .await
        .map_err(StoreError::during("look for jobs"))?;
    match job {
        Some(job) => {
            let why = format!("job {job} works on map `{}`: wait until it has ended, or cancel it", map.name);
            Err(StoreError::InUse(why))
        }
        None => Ok(()),
    }
}

/// Restores the rows before the commits after `from`, up to `to`; says whether that changed anything.
async fn apply(tx: &mut Tx, map: &MapRow, (from, to): (i64, i64)) -> Result<bool, StoreError> {
    for (operation, sql) in STEPS {
        let done = sqlx::query(sql).bind(map.id).bind(from).bind(to);
        let done = if sql == RESTORE_LANDMARKS { done.bind(now_ms()) } else { done };
        done.execute(&mut tx.conn).await.map_err(|error| in_the_way(operation, error))?;
    }
    settings(tx, map, (from, to)).await?;
    walls(tx, map, (from, to)).await?;
    let open: i64 = sqlx::query_scalar(IS_OPEN)
        .bind(map.id)
        .fetch_one(&mut tx.conn)
        .await
        .map_err(StoreError::during("look for changes"))?;
    if open > 0 {
        maps::bump(tx, map.id).await?;
        tx.changed(CommittedChange::Links);
    }
    Ok(open > 0)
}

/// What of today is in the way of an old row.
fn in_the_way(operation: &'static str, error: sqlx::Error) -> StoreError {
    match &error {
        sqlx::Error::Database(e) if e.is_unique_violation() => StoreError::InUse(format!(
            "cannot {operation}: a name or a view of it is taken by something newer; rename or delete that first"
        )),
        _ => StoreError::during(operation)(error),
    }
}

async fn settings(tx: &mut Tx, map: &MapRow, (from, to): (i64, i64)) -> Result<(), StoreError> {
    let lost: i64 = sqlx::query_scalar(LOST_PARENT)
        .bind(map.id)
        .bind(from)
        .bind(to)
        .fetch_one(&mut tx.conn)
        .await
        .map_err(StoreError::during("look for the outer map"))?;
    if lost > 0 {
        let why = format!("the map that map `{}` lay in then is deleted", map.name);
        return Err(StoreError::InUse(why));
    }
    let changed = sqlx::query(CHANGE_SETTINGS).bind(map.id).bind(from).bind(to).execute(&mut tx.conn).await;
    if changed.map_err(StoreError::during("restore settings"))?.rows_affected() > 0 {
        let locations = map_locations::all(&mut tx.conn).await?;
        map_links::check_all(&map_locations::links(&locations))?;
    }
    Ok(())
}

async fn walls(tx: &mut Tx, map: &MapRow, (from, to): (i64, i64)) -> Result<(), StoreError> {
    let at = || StoreError::during("restore walls");
    let oldest: Option<i64> = sqlx::query_scalar(OLDEST_WALLS)
        .bind(map.id)
        .bind(from)
        .bind(to)
        .fetch_one(&mut tx.conn)
        .await
        .map_err(at())?;
    let Some(oldest) = oldest else { return Ok(()) };
    sqlx::query(CLEAR_WALLS).bind(map.id).execute(&mut tx.conn).await.map_err(at())?;
    sqlx::query(RESTORE_WALLS).bind(map.id).bind(oldest).execute(&mut tx.conn).await.map_err(at())?;
    sqlx::query(COUNT_WALLS).bind(map.id).execute(&mut tx.conn).await.map_err(at()).map(drop)
}
