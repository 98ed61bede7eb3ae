//! Maps: named, versioned, with the distance that decides.

use super::{
    CommittedChange, StoreError, Tx,
    db::{self, Executor, Row},
    kind::Kind,
    now_ms,
    statements::statements,
    within,
};
use vision::{params::preset::Preset, recognise::DistanceKind};

statements! {
    // Drafts are no further maps.
    COUNT = "SELECT count(*) FROM maps WHERE draft_of IS NULL";
    INSERT = "INSERT INTO maps (name, preset, distance, created_ms) VALUES ($1, $2, $3, $4) RETURNING id";
    SET_LEARNING = "UPDATE maps SET learning = $2 WHERE id = $1";
    SET_PIPELINE = "UPDATE maps SET preset = $2, distance = $3, version = version + 1 WHERE id = $1";
    GET = "SELECT id, name, version, id || '.' || revision AS revision, changed_ms, preset, distance, learning, \
           (SELECT o.name FROM maps o WHERE o.id = maps.draft_of) AS draft_of, (SELECT count(*) FROM landmarks WHERE map_id = maps.id) AS landmarks, \
           EXISTS (SELECT 1 FROM underlays WHERE map_id = maps.id) AS has_underlay \
           FROM maps WHERE name = $1";
    PAGE = "SELECT id, name, version, id || '.' || revision AS revision, changed_ms, preset, distance, learning, \
           (SELECT o.name FROM maps o WHERE o.id = maps.draft_of) AS draft_of, (SELECT count(*) FROM landmarks WHERE map_id = maps.id) AS landmarks, \
           EXISTS (SELECT 1 FROM underlays WHERE map_id = maps.id) AS has_underlay \
            FROM maps WHERE name > $1 ORDER BY name LIMIT $2";
    BUMP = "UPDATE maps SET version = version + 1 WHERE id = $1";
    DELETE = "DELETE FROM maps WHERE id = $1";
    RENAME = "UPDATE maps SET name = $2, version = version + 1 WHERE id = $1";
    RENAME_IN_JOBS = "UPDATE jobs SET map = $2 WHERE map = $1";
    OPEN_JOB = "SELECT id FROM jobs WHERE map = $1 AND state IN ('queued', 'running') LIMIT 1";
    OPEN_GATHERING = "SELECT id FROM gatherings WHERE map_id = $1 AND open = 1 LIMIT 1";
    LIES_IN = "SELECT name FROM maps WHERE parent_id = $1 ORDER BY name LIMIT 1";
    DRAFT_OF = "SELECT name FROM maps WHERE draft_of = $1 ORDER BY name LIMIT 1";
    ROBOT_ON = "SELECT name FROM robots WHERE map_id = $1 ORDER BY name LIMIT 1";
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
    pub(crate) pipeline: MapPipeline,
    /// JSON of its own weights and gates.
    pub(crate) learning: Option<String>,
    /// The map that it is a draft of.
    pub(crate) draft_of: Option<String>,
    /// How many landmarks it has.
    pub(crate) landmarks: u64,
    /// A picture is shown under it.
    pub(crate) has_underlay: bool,
}

/// Which detector and decision a map has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct MapPipeline {
    /// `None`: as the server's settings say.
    pub(crate) preset: Option<Preset>,
    /// The distance that decides.
    pub(crate) distance: DistanceKind,
}

impl From<DistanceKind> for MapPipeline {
    fn from(distance: DistanceKind) -> Self {
        Self { preset: None, distance }
    }
}

impl MapPipeline {
    /// From columns `preset` and `distance`; the schema admits no other words.
    pub(super) fn read(row: &Row) -> Result<Self, db::Error> {
        let preset: Option<&str> = row.try_get("preset")?;
        let distance: &str = row.try_get("distance")?;
        Ok(Self { preset: preset.and_then(|word| word.parse().ok()), distance: distance_of(distance) })
    }

    pub(super) fn words(self) -> (Option<&'static str>, &'static str) {
        (self.preset.map(Preset::word), distance_word(self.distance))
    }
}

fn map_row(row: &Row) -> Result<MapRow, db::Error> {
    Ok(MapRow {
        id: row.try_get("id")?,
        name: row.try_get("name")?,
        version: row.try_get::<i64, _>("version")? as u64,
        revision: row.try_get("revision")?,
        changed_ms: row.try_get("changed_ms")?,
        pipeline: MapPipeline::read(row)?,
        learning: row.try_get("learning")?,
        draft_of: row.try_get("draft_of")?,
        landmarks: row.try_get::<i64, _>("landmarks")? as u64,
        has_underlay: row.try_get("has_underlay")?,
    })
}

/// The word stored for a distance.
fn distance_word(distance: DistanceKind) -> &'static str {
    match distance {
        DistanceKind::Both => "both",
        DistanceKind::Correlation => "correlation",
        DistanceKind::Hausdorff => "hausdorff",
    }
}

fn distance_of(word: &str) -> DistanceKind {
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
    pipeline: impl Into<MapPipeline>,
    max: usize,
) -> Result<MapRow, StoreError> {
    let (preset, distance) = pipeline.into().words();
    let id = db::query_scalar(INSERT)
        .bind(name)
        .bind(preset)
        .bind(distance)
        .bind(now_ms())
        .fetch_one(&mut tx.conn)
        .await
        .map_err(StoreError::inserting("create map", Kind::Map, name))?;
    let count =
        db::query_scalar(COUNT).fetch_one(&mut tx.conn).await.map_err(StoreError::during("count maps"))?;
    within(count, max, "maps")?;
    tx.changed(CommittedChange::Map(id));
    get(&mut tx.conn, name).await
}

/// One map by name.
pub(crate) async fn get(db: impl Executor<'_>, name: &str) -> Result<MapRow, StoreError> {
    let row = db::query(GET).bind(name).fetch_optional(db).await.map_err(StoreError::during("read map"))?;
    let row = row.ok_or_else(|| StoreError::NotFound { what: Kind::Map, name: name.to_owned() })?;
    map_row(&row).map_err(StoreError::during("read map"))
}

/// The same inside a write.
pub(crate) async fn of(tx: &mut Tx, name: &str) -> Result<MapRow, StoreError> {
    get(&mut tx.conn, name).await
}

/// Maps with names after `after`, in order.
pub(crate) async fn page(
    db: impl Executor<'_>,
    after: &str,
    limit: usize,
) -> Result<Vec<MapRow>, StoreError> {
    let rows = db::query(PAGE).bind(after).bind(limit as i64).fetch_all(db).await;
    let rows = rows.map_err(StoreError::during("list maps"))?;
    rows.iter().map(map_row).collect::<Result<_, _>>().map_err(StoreError::during("list maps"))
}

/// Checks that a map was not deleted meanwhile, nor replaced by another of the same name; gives its
/// present row.
pub(crate) async fn recheck(tx: &mut Tx, map: MapRow) -> Result<MapRow, StoreError> {
    let now = get(&mut tx.conn, &map.name).await?;
    if now.id == map.id { Ok(now) } else { Err(StoreError::NotFound { what: Kind::Map, name: map.name }) }
}

/// The map's content has changed: a new version, published after the commit.
pub(crate) async fn bump(tx: &mut Tx, id: i64) -> Result<(), StoreError> {
    db::query(BUMP).bind(id).execute(&mut tx.conn).await.map_err(StoreError::during("count map version"))?;
    tx.changed(CommittedChange::Map(id));
    Ok(())
}

/// Gives a map another detector or decision; answers follow from the next version on.
/// `change` gets the present ones.
pub(crate) async fn set_pipeline(
    tx: &mut Tx,
    name: &str,
    change: impl FnOnce(MapPipeline) -> MapPipeline + Send,
) -> Result<(), StoreError> {
    let map = get(&mut tx.conn, name).await?;
    let pipeline = change(map.pipeline);
    if map.pipeline == pipeline {
        return Ok(());
    }
    let (preset, distance) = pipeline.words();
    db::query(SET_PIPELINE)
        .bind(map.id)
        .bind(preset)
        .bind(distance)
        .execute(&mut tx.conn)
        .await
        .map_err(StoreError::during("set the pipeline of a map"))?;
    tx.changed(CommittedChange::Map(map.id));
    Ok(())
}

/// Sets weights and gates of the landmarks that have none of their own, for the reason that the
/// history names unless the request gives another one; `None` forgets them.
pub(crate) async fn set_learning(
    tx: &mut Tx,
    name: &str,
    learning: Option<&str>,
    reason: Option<String>,
) -> Result<(), StoreError> {
    tx.author.why = tx.author.why.take().or(reason);
    let map = get(&mut tx.conn, name).await?;
    let done = db::query(SET_LEARNING).bind(map.id).bind(learning).execute(&mut tx.conn).await;
    done.map_err(StoreError::during("set weights and gates of a map"))?;
    bump(tx, map.id).await
}

/// Gives a map another name. Errors: `Exists`; `InUse` while a robot, an open job or an open
/// gathering has the present one.
pub(crate) async fn rename(tx: &mut Tx, name: &str, new: &str) -> Result<(), StoreError> {
    let map = get(&mut tx.conn, name).await?;
    if name == new {
        return Ok(());
    }
    no_robot_on(tx, &map).await?;
    let job: Option<i64> = db::query_scalar(OPEN_JOB)
        .bind(name)
        .fetch_optional(&mut tx.conn)
        .await
        .map_err(StoreError::during("look for jobs"))?;
    let gathering: Option<i64> = db::query_scalar(OPEN_GATHERING)
        .bind(map.id)
        .fetch_optional(&mut tx.conn)
        .await
        .map_err(StoreError::during("look for gatherings"))?;
    for (what, id) in [("job", job), ("gathering", gathering)] {
        if let Some(id) = id {
            return Err(StoreError::InUse(format!("{what} {id} works on map `{name}`")));
        }
    }
    let renamed = db::query(RENAME).bind(map.id).bind(new).execute(&mut tx.conn).await;
    renamed.map_err(StoreError::inserting("rename map", Kind::Map, new))?;
    let in_jobs = db::query(RENAME_IN_JOBS).bind(name).bind(new).execute(&mut tx.conn).await;
    in_jobs.map_err(StoreError::during("rename map in jobs"))?;
    tx.changed(CommittedChange::MapRemoved(map.name));
    tx.changed(CommittedChange::Map(map.id));
    tx.changed(CommittedChange::Tokens);
    tx.changed(CommittedChange::Links);
    Ok(())
}

async fn no_robot_on(tx: &mut Tx, map: &MapRow) -> Result<(), StoreError> {
    let robot: Option<String> = db::query_scalar(ROBOT_ON)
        .bind(map.id)
        .fetch_optional(&mut tx.conn)
        .await
        .map_err(StoreError::during("look for robots"))?;
    match robot {
        Some(robot) => Err(StoreError::InUse(format!("robot `{robot}` stands on map `{}`", map.name))),
        None => Ok(()),
    }
}

/// Deletes a map and all that is in it. Errors: `InUse` while a robot is on it, another map is
/// linked to it, or it has a draft.
pub(crate) async fn delete(tx: &mut Tx, name: &str) -> Result<(), StoreError> {
    let map = get(&mut tx.conn, name).await?;
    no_robot_on(tx, &map).await?;
    let inner: Option<String> = db::query_scalar(LIES_IN)
        .bind(map.id)
        .fetch_optional(&mut tx.conn)
        .await
        .map_err(StoreError::during("look for maps in it"))?;
    if let Some(inner) = inner {
        return Err(StoreError::InUse(format!("map `{inner}` lies in map `{name}`")));
    }
    let draft: Option<String> = db::query_scalar(DRAFT_OF)
        .bind(map.id)
        .fetch_optional(&mut tx.conn)
        .await
        .map_err(StoreError::during("look for drafts"))?;
    if let Some(draft) = draft {
        let why = format!("map `{name}` has the draft `{draft}`: publish or discard it first");
        return Err(StoreError::InUse(why));
    }
    db::query(DELETE).bind(map.id).execute(&mut tx.conn).await.map_err(StoreError::during("delete map"))?;
    // A token that was for this map alone is for none.
    tx.changed(CommittedChange::Tokens);
    tx.changed(CommittedChange::MapRemoved(map.name));
    tx.changed(CommittedChange::Links);
    Ok(())
}
