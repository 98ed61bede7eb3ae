//! Gatherings: which robot gathers views of what, its tracks, and the views of each track, until a
//! person accepts or discards them (`track_acceptance.rs`).

use super::{
    StoreError, Tx,
    db::{self, Executor, Row},
    kind::Kind,
    landmarks, maps, now_ms, pictures, robots,
    statements::statements,
    views::{self, NewView, QuadCrop},
    within,
};

/// Columns of [`GatheringRow`].
macro_rules! select {
    ($tail:literal) => {
        concat!(
            "SELECT g.id, m.name AS map, g.robot, l.name AS landmark, g.landmark_id, g.known, g.open, g.counts, \
             g.created_ms, g.ended_ms FROM gatherings g JOIN maps m ON m.id = g.map_id \
             LEFT JOIN landmarks l ON l.id = g.landmark_id ",
            $tail
        )
    };
}

statements! {
    COUNT = "SELECT count(*) FROM gatherings WHERE map_id = $1";
    COUNT_OPEN = "SELECT count(*) FROM gatherings WHERE open = 1";
    INSERT = "INSERT INTO gatherings (map_id, robot, landmark_id, known, open, created_ms) \
              VALUES ($1, $2, $3, $4, 1, $5) RETURNING id";
    GET = select!("WHERE m.name = $1 AND g.id = $2");
    PAGE = select!("WHERE g.map_id = $1 AND g.id > $2 ORDER BY g.id LIMIT $3");
    OPEN = select!("WHERE g.open = 1 ORDER BY g.id");
    IS_OPEN = "SELECT open FROM gatherings WHERE id = $1";
    END = "UPDATE gatherings SET open = 0, counts = $2, ended_ms = $3 WHERE id = $1";
    DELETE = "DELETE FROM gatherings WHERE id = $1";
    PUT_TRACK = "INSERT INTO tracks (gathering_id, number, landmark_id, sightings, known) VALUES ($1, $2, $3, $4, $5) \
                 ON CONFLICT (gathering_id, number) DO UPDATE SET sightings = excluded.sightings, known = excluded.known \
                 RETURNING state";
    COUNT_TRACKS = "SELECT count(*) FROM tracks WHERE gathering_id = $1 AND state = 'open'";
    TRACKS = "SELECT t.number, t.landmark_id, l.name AS landmark, t.state, t.sightings, t.known, \
              (SELECT count(*) FROM track_views v WHERE v.gathering_id = t.gathering_id AND v.track = t.number) AS views \
              FROM tracks t LEFT JOIN landmarks l ON l.id = t.landmark_id WHERE t.gathering_id = $1 ORDER BY t.number";
    INSERT_VIEW = "INSERT INTO track_views (gathering_id, track, image_sha256, image_kind, width_px, height_px, \
                   corners_px, icon_side, icon, icon_scale, created_ms, capture) \
                   VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10, $11, $12) ON CONFLICT DO NOTHING";
    COUNT_VIEWS = "SELECT count(*) FROM track_views WHERE gathering_id = $1 AND track = $2";
    BYTES = "SELECT coalesce(sum(length(bytes)), 0) FROM pictures WHERE sha256 IN \
             (SELECT image_sha256 FROM track_views WHERE gathering_id = $1)";
    VIEWS = "SELECT id, image_sha256, width_px, height_px, corners_px, icon_side, icon, icon_scale, capture FROM track_views \
             WHERE gathering_id = $1 AND track = $2 ORDER BY id";
    DISCARD = "UPDATE tracks SET state = 'discarded' WHERE gathering_id = $1 AND number = $2 AND state = 'open'";
    DROP_VIEWS = "DELETE FROM track_views WHERE gathering_id = $1 AND track = $2";
}

/// Bounds of gatherings.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct GatheringLimits {
    /// Robots that gather at a time.
    pub(crate) open: usize,
    /// Gatherings of one map, ended ones included.
    pub(crate) of_map: usize,
    /// Tracks of one gathering that nobody has decided on.
    pub(crate) tracks: usize,
    /// Views of one track.
    pub(crate) views: usize,
    /// Pictures of one gathering, bytes.
    pub(crate) bytes: usize,
}

impl GatheringLimits {
    /// The bounds of the server.
    pub(crate) const SERVER: Self =
        Self { open: 32, of_map: 100, tracks: 64, views: map::tracks::MAX_TRACK_VIEWS, bytes: 256 << 20 };
}

/// What to gather.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct NewGathering {
    pub(crate) robot: String,
    /// Name of the only landmark whose views are wanted.
    pub(crate) landmark: Option<String>,
    /// Views of recognised landmarks, too.
    pub(crate) known: bool,
}

/// A gathering without its tracks.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct GatheringRow {
    pub(crate) id: i64,
    pub(crate) map: String,
    pub(crate) robot: String,
    pub(crate) landmark: Option<String>,
    pub(crate) landmark_id: Option<i64>,
    pub(crate) known: bool,
    pub(crate) open: bool,
    /// JSON object.
    pub(crate) counts: String,
    pub(crate) created_ms: i64,
    pub(crate) ended_ms: Option<i64>,
}

fn gathering_row(row: &Row) -> Result<GatheringRow, db::Error> {
    Ok(GatheringRow {
        id: row.try_get("id")?,
        map: row.try_get("map")?,
        robot: row.try_get("robot")?,
        landmark: row.try_get("landmark")?,
        landmark_id: row.try_get("landmark_id")?,
        known: row.try_get("known")?,
        open: row.try_get("open")?,
        counts: row.try_get("counts")?,
        created_ms: row.try_get("created_ms")?,
        ended_ms: row.try_get("ended_ms")?,
    })
}

/// A track: an object followed across frames.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct TrackRow {
    pub(crate) number: u32,
    pub(crate) landmark_id: Option<i64>,
    /// Name of the landmark that the track shows.
    pub(crate) landmark: Option<String>,
    /// open, accepted, discarded.
    pub(crate) state: String,
    pub(crate) sightings: u32,
    pub(crate) known: u32,
    pub(crate) views: u64,
}

/// A view of a track, without its picture.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct TrackView {
    pub(crate) id: i64,
    pub(crate) image_sha256: pictures::Digest,
    pub(crate) size_px: [usize; 2],
    pub(crate) crop: QuadCrop,
    /// JSON of a `landmark_placement::StoredCapture`.
    pub(crate) capture: Option<String>,
}

fn unknown(what: Kind, number: i64) -> StoreError {
    StoreError::NotFound { what, name: number.to_string() }
}

/// How many gatherings a map has.
pub(crate) async fn count(db: impl Executor<'_>, map_id: i64) -> Result<u64, StoreError> {
    let count = db::query_scalar::<i64>(COUNT).bind(map_id).fetch_one(db).await;
    count.map(|n| n as u64).map_err(StoreError::during("count gatherings"))
}

/// Starts a gathering with a robot that is on the map.
pub(crate) async fn create(
    tx: &mut Tx,
    map: &str,
    new: &NewGathering,
    limits: GatheringLimits,
) -> Result<GatheringRow, StoreError> {
    let map = maps::get(&mut tx.conn, map).await?;
    let robot = robots::get(&mut tx.conn, &new.robot).await?;
    if robot.map != map.name {
        return Err(StoreError::InUse(format!("robot `{}` stands on map `{}`", robot.name, robot.map)));
    }
    let landmark_id = match &new.landmark {
        Some(name) => Some(landmarks::get(&mut tx.conn, &map.name, name).await?.id),
        None => None,
    };
    let id = db::query_scalar(INSERT)
        .bind(map.id)
        .bind(&robot.name)
        .bind(landmark_id)
        .bind(new.known)
        .bind(now_ms())
        .fetch_one(&mut tx.conn)
        .await
        .map_err(StoreError::inserting("begin gathering", Kind::Gathering, &robot.name))
        .map_err(|error| match error {
            StoreError::Exists { name, .. } => StoreError::InUse(format!("robot `{name}` gathers already")),
            other => other,
        })?;
    let count = |sql| db::query_scalar(sql);
    let open =
        count(COUNT_OPEN).fetch_one(&mut tx.conn).await.map_err(StoreError::during("count gatherings"))?;
    within(open, limits.open, "robots that gather at a time")?;
    let of_map = count(COUNT).bind(map.id).fetch_one(&mut tx.conn).await;
    within(of_map.map_err(StoreError::during("count gatherings"))?, limits.of_map, "gatherings of a map")?;
    get(&mut tx.conn, &map.name, id).await
}

/// One gathering of a map.
pub(crate) async fn get(db: impl Executor<'_>, map: &str, id: i64) -> Result<GatheringRow, StoreError> {
    let at = || StoreError::during("read gathering");
    let row = db::query(GET).bind(map).bind(id).fetch_optional(db).await.map_err(at())?;
    gathering_row(&row.ok_or_else(|| unknown(Kind::Gathering, id))?).map_err(at())
}

/// Gatherings of a map with numbers above `after`, in order.
pub(crate) async fn page(
    db: impl Executor<'_>,
    map_id: i64,
    after: i64,
    limit: usize,
) -> Result<Vec<GatheringRow>, StoreError> {
    let at = || StoreError::during("list gatherings");
    let rows = db::query(PAGE).bind(map_id).bind(after).bind(limit as i64).fetch_all(db).await;
    rows.map_err(at())?.iter().map(gathering_row).collect::<Result<_, _>>().map_err(at())
}

/// Open gatherings, for the start of the server.
pub(crate) async fn open(db: impl Executor<'_>) -> Result<Vec<GatheringRow>, StoreError> {
    let at = || StoreError::during("list gatherings");
    let rows = db::query(OPEN).fetch_all(db).await.map_err(at())?;
    rows.iter().map(gathering_row).collect::<Result<_, _>>().map_err(at())
}

/// Ends a gathering; its tracks wait for a decision, and later views are refused. One that has
/// ended stays as it is.
pub(crate) async fn end(tx: &mut Tx, map: &str, id: i64, counts: &str) -> Result<GatheringRow, StoreError> {
    let row = get(&mut tx.conn, map, id).await?;
    if !row.open {
        return Ok(row);
    }
    db::query(END)
        .bind(id)
        .bind(counts)
        .bind(now_ms())
        .execute(&mut tx.conn)
        .await
        .map_err(StoreError::during("end gathering"))?;
    get(&mut tx.conn, map, id).await
}

/// Deletes a gathering with all tracks that were not accepted.
pub(crate) async fn delete(tx: &mut Tx, map: &str, id: i64) -> Result<(), StoreError> {
    get(&mut tx.conn, map, id).await?;
    db::query(DELETE).bind(id).execute(&mut tx.conn).await.map_err(StoreError::during("delete gathering"))?;
    Ok(())
}

/// Stores a view of a track. Errors: `InUse` if the gathering has ended, `Limit` at a bound.
pub(crate) async fn add_view(
    tx: &mut Tx,
    id: i64,
    track: &map::tracks::StoredTrack,
    new: &NewView,
    limits: GatheringLimits,
) -> Result<(), StoreError> {
    let at = || StoreError::during("store view of a track");
    let open: Option<bool> =
        db::query_scalar(IS_OPEN).bind(id).fetch_optional(&mut tx.conn).await.map_err(at())?;
    if !open.ok_or_else(|| unknown(Kind::Gathering, id))? {
        return Err(StoreError::InUse(format!("gathering {id} has ended")));
    }
    let state: String = db::query_scalar(PUT_TRACK)
        .bind(id)
        .bind(track.number)
        .bind(track.landmark.map(|l| l.0 as i64))
        .bind(track.sightings)
        .bind(track.known)
        .fetch_one(&mut tx.conn)
        .await
        .map_err(at())?;
    if state != "open" {
        return Err(StoreError::InUse(format!("track {} is {state}", track.number)));
    }
    let tracks = db::query_scalar(COUNT_TRACKS).bind(id).fetch_one(&mut tx.conn).await.map_err(at())?;
    within(tracks, limits.tracks, "tracks of a gathering")?;
    pictures::put(tx, &new.image_sha256, &new.image).await?;
    db::query(INSERT_VIEW)
        .bind(id)
        .bind(track.number)
        .bind(&new.image_sha256[..])
        .bind(new.image_kind)
        .bind(new.size_px[0] as i64)
        .bind(new.size_px[1] as i64)
        .bind(views::corners_bytes(&new.crop.corners_px))
        .bind(new.crop.icon.size as i64)
        .bind(views::icon_bytes(&new.crop.icon))
        .bind(new.crop.icon.source_scale)
        .bind(now_ms())
        .bind(&new.capture)
        .execute(&mut tx.conn)
        .await
        .map_err(at())?;
    let count = db::query_scalar(COUNT_VIEWS).bind(id).bind(track.number).fetch_one(&mut tx.conn).await;
    within(count.map_err(at())?, limits.views, "views of a track")?;
    let bytes = db::query_scalar(BYTES).bind(id).fetch_one(&mut tx.conn).await.map_err(at())?;
    within(bytes, limits.bytes, "bytes of a gathering")
}

/// The tracks of a gathering by number, decided ones included.
pub(crate) async fn tracks(db: impl Executor<'_>, id: i64) -> Result<Vec<TrackRow>, StoreError> {
    let at = || StoreError::during("list tracks");
    let rows = db::query(TRACKS).bind(id).fetch_all(db).await.map_err(at())?;
    let track = |row: &Row| {
        Ok(TrackRow {
            number: row.try_get("number")?,
            landmark_id: row.try_get("landmark_id")?,
            landmark: row.try_get("landmark")?,
            state: row.try_get("state")?,
            sightings: row.try_get("sightings")?,
            known: row.try_get("known")?,
            views: row.try_get::<i64, _>("views")? as u64,
        })
    };
    rows.iter().map(track).collect::<Result<_, db::Error>>().map_err(at())
}

/// One track that nobody has decided on.
pub(crate) async fn track(db: impl Executor<'_>, id: i64, number: u32) -> Result<TrackRow, StoreError> {
    let mut all = tracks(db, id).await?.into_iter();
    let found = all.find(|t| t.number == number && t.state == "open");
    found.ok_or_else(|| unknown(Kind::Track, i64::from(number)))
}

/// The views of a track, oldest first.
pub(crate) async fn track_views(
    db: impl Executor<'_>,
    id: i64,
    number: u32,
) -> Result<Vec<TrackView>, StoreError> {
    let at = || StoreError::during("read views of a track");
    let rows = db::query(VIEWS).bind(id).bind(number).fetch_all(db).await.map_err(at())?;
    let view = |row: &Row| {
        let pixels = |column: &str| row.try_get::<i64, _>(column).map(|s| s as usize).map_err(at());
        Ok(TrackView {
            id: row.try_get("id").map_err(at())?,
            image_sha256: views::digest_of(row)?,
            size_px: [pixels("width_px")?, pixels("height_px")?],
            crop: views::crop_of(row)?,
            capture: row.try_get("capture").map_err(at())?,
        })
    };
    rows.iter().map(view).collect()
}

/// Discards a track: deletes its views.
pub(crate) async fn discard(tx: &mut Tx, map: &str, id: i64, number: u32) -> Result<(), StoreError> {
    get(&mut tx.conn, map, id).await?;
    let done = db::query(DISCARD).bind(id).bind(number).execute(&mut tx.conn).await;
    if done.map_err(StoreError::during("discard track"))?.rows_affected() == 0 {
        return Err(unknown(Kind::Track, i64::from(number)));
    }
    let dropped = db::query(DROP_VIEWS).bind(id).bind(number).execute(&mut tx.conn).await;
    dropped.map_err(StoreError::during("discard track")).map(drop)
}

#[cfg(test)]
mod tests;
