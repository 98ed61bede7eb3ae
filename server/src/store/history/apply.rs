//! Goes back: a map as it was at a kept commit, or without one commit. The change is a commit of
//! its own. Numbers of restored rows are those that they had, so models, thresholds and views are
//! what they were, byte for byte.
//!
//! A map keeps its name. What robots found out about a landmark that stays where it is (its health)
//! stays too.

use super::{
    before, get,
    kept_tables::{KeptColumn, KeptTable, LANDMARKS, MAPS, PARTS},
    newest,
};
use crate::store::{
    CommittedChange, StoreError, Tx,
    db::{self, AssertSqlSafe},
    map_locations,
    maps::{self, MapRow},
    statements::statements,
};
use map::map_links;

statements! {
    // Names may have been exchanged; no name begins so.
    SET_ASIDE = concat!("UPDATE landmarks SET name = '~' || landmarks.id FROM ", before!("landmarks", "id"),
                " f WHERE f.id = landmarks.id AND f.present = 1 AND f.name <> landmarks.name");
    LOST_PARENT = concat!("SELECT count(*) FROM ", before!("maps", "id"),
                  " f WHERE f.parent_id IS NOT NULL AND f.parent_id NOT IN (SELECT id FROM maps)");
    OLDEST_WALLS = "SELECT min(id) FROM commits WHERE map_id = $1 AND id > $2 AND id <= $3 AND walls = 1";
    CLEAR_WALLS = "DELETE FROM laser_segments WHERE map_id = $1";
    RESTORE_WALLS = "INSERT INTO laser_segments (map_id, ordinal, ax_m, ay_m, bx_m, by_m, covariance) \
                     SELECT $1, ordinal, ax_m, ay_m, bx_m, by_m, covariance FROM past_walls WHERE commit_id = $2";
    COUNT_WALLS = "UPDATE maps SET walls_version = walls_version + 1 WHERE id = $1";
    IS_OPEN = "SELECT count(*) FROM commits WHERE map_id = $1 AND open = 1";
    OPEN_JOB = "SELECT id FROM jobs WHERE map = $1 AND state IN ('queued', 'running') LIMIT 1";
    // What is in the way of taking back commit $1 of map $2: a row that it changed was changed
    // since, or others hang on it.
    LATER = "SELECT what, by FROM ( \
             SELECT 'landmark ' || coalesce(l.name, p.name, n.name, '') AS what, n.commit_id AS by FROM past_landmarks p \
             JOIN past_landmarks n ON n.id = p.id AND n.commit_id > $1 LEFT JOIN landmarks l ON l.id = p.id \
             WHERE p.commit_id = $1 \
             UNION ALL SELECT 'a view of landmark ' || coalesce(l.name, ''), n.commit_id FROM past_views p \
             JOIN past_views n ON n.id = p.id AND n.commit_id > $1 LEFT JOIN landmarks l ON l.id = p.landmark_id \
             WHERE p.commit_id = $1 \
             UNION ALL SELECT 'the landmark of a view', n.commit_id FROM past_views p \
             JOIN past_landmarks n ON n.id = p.landmark_id AND n.commit_id > $1 \
             WHERE p.commit_id = $1 AND NOT EXISTS (SELECT 1 FROM landmarks WHERE id = p.landmark_id) \
             UNION ALL SELECT 'the model of landmark ' || coalesce(l.name, ''), n.commit_id FROM past_models p \
             JOIN past_models n ON n.landmark_id = p.landmark_id AND n.commit_id > $1 \
             LEFT JOIN landmarks l ON l.id = p.landmark_id WHERE p.commit_id = $1 \
             UNION ALL SELECT 'landmark ' || coalesce(l.name, ''), n.commit_id FROM past_landmarks p \
             JOIN past_views n ON n.landmark_id = p.id AND n.commit_id > $1 JOIN landmarks l ON l.id = p.id \
             WHERE p.commit_id = $1 AND p.present = 0 \
             UNION ALL SELECT 'landmark ' || coalesce(l.name, ''), n.commit_id FROM past_landmarks p \
             JOIN past_models n ON n.landmark_id = p.id AND n.commit_id > $1 JOIN landmarks l ON l.id = p.id \
             WHERE p.commit_id = $1 AND p.present = 0 \
             UNION ALL SELECT 'a reference run', n.commit_id FROM past_runs p \
             JOIN past_runs n ON n.id = p.id AND n.commit_id > $1 WHERE p.commit_id = $1 \
             UNION ALL SELECT 'the underlay', n.commit_id FROM past_underlays p \
             JOIN past_underlays n ON n.map_id = p.map_id AND n.commit_id > $1 WHERE p.commit_id = $1 \
             UNION ALL SELECT 'the settings', n.commit_id FROM past_maps p \
             JOIN past_maps n ON n.id = p.id AND n.commit_id > $1 WHERE p.commit_id = $1 \
             UNION ALL SELECT 'the walls', n.id FROM commits p \
             JOIN commits n ON n.map_id = p.map_id AND n.id > p.id AND n.walls = 1 WHERE p.id = $1 AND p.walls = 1 \
             ) AS r ORDER BY by DESC LIMIT 1";
}

/// Gives rows that are there the values that they had.
fn change(KeptTable { name, key, before, .. }: &KeptTable, columns: &[&str]) -> String {
    let values: Vec<String> = columns.iter().map(|column| format!("{column} = f.{column}")).collect();
    let values = values.join(", ");
    format!("UPDATE {name} SET {values} FROM {before} f WHERE f.{key} = {name}.{key} AND f.present = 1")
}

/// Inserts the rows that are gone.
fn restore(KeptTable { name, key, before, restored_as, .. }: &KeptTable, columns: &[KeptColumn]) -> String {
    let is_as_it_was = |column: &&KeptColumn| restored_as.iter().all(|(other, _)| *other != column.name);
    let columns = columns.iter().filter(is_as_it_was).map(|c| (c.name.clone(), format!("f.{}", c.name)));
    let others = restored_as.iter().map(|(column, value)| ((*column).to_owned(), (*value).to_owned()));
    let (into, values): (Vec<String>, Vec<String>) = others.chain(columns).unzip();
    format!(
        "INSERT INTO {name} ({key}, {}) SELECT f.{key}, {} FROM {before} f WHERE f.present = 1 \
         AND f.{key} NOT IN (SELECT {key} FROM {name}) ORDER BY f.{key}",
        into.join(", "),
        values.join(", ")
    )
}

/// What makes the rows of a table what they were. In order: what is removed or set aside comes
/// first, so that nothing restored meets it.
fn steps(table: &KeptTable, columns: &[KeptColumn]) -> Vec<String> {
    let KeptTable { name, key, before, .. } = table;
    let gone = format!("SELECT f.{key} FROM {before} f WHERE f.present = 0");
    let mut steps = vec![format!("DELETE FROM {name} WHERE {key} IN ({gone})")];
    let versioned: Vec<&str> =
        columns.iter().filter(|column| column.is_versioned).map(|column| column.name.as_str()).collect();
    if *name == LANDMARKS.name {
        steps.push(SET_ASIDE.to_owned());
        // A finding stays with the place that it is about.
        let place = versioned.iter().filter(|column| !["name", "learning"].contains(*column));
        let differs: Vec<String> = place.map(|c| format!("f.{c} IS DISTINCT FROM landmarks.{c}")).collect();
        let health = change(table, &["health", "finding"]);
        steps.push(format!("{health} AND ({})", differs.join(" OR ")));
    }
    steps.extend([change(table, &versioned), restore(table, columns)]);
    steps
}

/// What is made of the columns of the tables: every text of the way back.
#[cfg(test)]
pub(in crate::store) async fn every_step(conn: &mut db::Conn) -> Vec<String> {
    let mut every = Vec::new();
    for table in &PARTS {
        every.extend(steps(table, &table.columns(conn).await.unwrap()));
    }
    let columns = MAPS.columns(conn).await.unwrap();
    every.push(change(&MAPS, &columns.iter().map(|column| column.name.as_str()).collect::<Vec<_>>()));
    every
}

/// Makes a map what it was at a kept commit; says whether that changed anything. Errors:
/// `NotFound`; `InUse` while a job works on the map, or if the map that it lay in is gone.
pub(crate) async fn roll_back(tx: &mut Tx, map: &str, to: i64) -> Result<bool, StoreError> {
    let map = maps::of(tx, map).await?;
    get(&mut tx.conn, map.id, to).await?;
    no_job_on(tx, &map).await?;
    let newest = newest(&mut tx.conn, map.id).await?;
    apply(tx, &map, (to, newest)).await
}

/// Takes one commit back. Errors: `NotFound`; `InUse` as for [`roll_back`], or where the commit has
/// nothing that can be taken back; `ChangedSince` where later commits have changed the same rows;
/// `Exists` where a name is taken.
pub(crate) async fn undo(tx: &mut Tx, map: &str, commit: i64) -> Result<(), StoreError> {
    let map = maps::of(tx, map).await?;
    get(&mut tx.conn, map.id, commit).await?;
    no_job_on(tx, &map).await?;
    let at = || StoreError::during("look for later changes");
    let later = db::query(LATER).bind(commit).fetch_optional(&mut tx.conn).await.map_err(at())?;
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
    let job: Option<i64> = db::query_scalar(OPEN_JOB)
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

/// Restores the rows before the commits after `from`, up to `to`; says whether that changed
/// anything.
async fn apply(tx: &mut Tx, map: &MapRow, (from, to): (i64, i64)) -> Result<bool, StoreError> {
    for table in &PARTS {
        let columns = table.columns(&mut tx.conn).await.map_err(StoreError::during("read the schema"))?;
        for sql in steps(table, &columns) {
            let done = db::query(AssertSqlSafe(sql)).bind(map.id).bind(from).bind(to);
            done.execute(&mut tx.conn).await.map_err(|error| in_the_way(table.name, error))?;
        }
    }
    settings(tx, map, (from, to)).await?;
    walls(tx, map, (from, to)).await?;
    let open: i64 = db::query_scalar(IS_OPEN)
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
fn in_the_way(table: &str, error: db::Error) -> StoreError {
    match db::class(&error) {
        db::ErrorClass::Taken => StoreError::InUse(format!(
            "cannot restore {table}: a name or a view of it is taken by something newer; rename or delete that first"
        )),
        _ => StoreError::during("restore rows")(error),
    }
}

async fn settings(tx: &mut Tx, map: &MapRow, (from, to): (i64, i64)) -> Result<(), StoreError> {
    let lost: i64 = db::query_scalar(LOST_PARENT)
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
    let at = || StoreError::during("restore settings");
    let columns = MAPS.columns(&mut tx.conn).await.map_err(at())?;
    let columns: Vec<&str> = columns.iter().map(|c| c.name.as_str()).filter(|name| *name != "name").collect();
    let changed = db::query(AssertSqlSafe(change(&MAPS, &columns))).bind(map.id).bind(from).bind(to);
    if changed.execute(&mut tx.conn).await.map_err(at())?.rows_affected() > 0 {
        let locations = map_locations::all(&mut tx.conn).await?;
        map_links::check_all(&map_locations::links(&locations))?;
    }
    Ok(())
}

async fn walls(tx: &mut Tx, map: &MapRow, (from, to): (i64, i64)) -> Result<(), StoreError> {
    let at = || StoreError::during("restore walls");
    let oldest: Option<i64> = db::query_scalar(OLDEST_WALLS)
        .bind(map.id)
        .bind(from)
        .bind(to)
        .fetch_one(&mut tx.conn)
        .await
        .map_err(at())?;
    let Some(oldest) = oldest else { return Ok(()) };
    db::query(CLEAR_WALLS).bind(map.id).execute(&mut tx.conn).await.map_err(at())?;
    db::query(RESTORE_WALLS).bind(map.id).bind(oldest).execute(&mut tx.conn).await.map_err(at())?;
    db::query(COUNT_WALLS).bind(map.id).execute(&mut tx.conn).await.map_err(at()).map(drop)
}
