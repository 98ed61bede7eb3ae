//! A person's decision on what a robot gathered: tracks become landmarks with their views, or more views of the landmarks
//! they are of; the landmarks are placed and the lesson is queued. All of it in one transaction, or nothing. Places are
//! computed before it, as for a view that is added ([`super::teaching`]).

use super::{
    Store, StoreError, Tx,
    gatherings::{self, TrackView},
    jobs::{self, JobRow},
    landmarks::{self, Measures},
    laser, maps,
    placing::{self, Made, Placing},
    statements::statements,
    teaching::{ATTEMPTS, Stamp, computed, stamp, walls},
    views::{self, Digest},
    within,
};
use map::segments::LaserSegment;
use sqlx::{Row, sqlite::SqliteRow};
use std::{collections::BTreeMap, sync::Arc};
use vision::geometry::Corners;

statements! {
    MOVE = "INSERT INTO views (landmark_id, image_sha256, image_kind, image, width_px, height_px, corners_px, icon_side, \
            icon, icon_scale, created_ms, capture) SELECT ?3, image_sha256, image_kind, image, width_px, height_px, \
            corners_px, icon_side, icon, icon_scale, created_ms, capture FROM track_views \
            WHERE gathering_id = ?1 AND track = ?2 ORDER BY id ON CONFLICT DO NOTHING";
    COUNT = "SELECT count(*) FROM views WHERE landmark_id = ?1";
    HELD = "SELECT image_sha256, corners_px, capture FROM views WHERE landmark_id = ?1 ORDER BY id";
    DROP_VIEWS = "DELETE FROM track_views WHERE gathering_id = ?1 AND track = ?2";
    DROP_VIEW = "DELETE FROM track_views WHERE id = ?1";
    ACCEPTED = "UPDATE tracks SET state = 'accepted', landmark_id = ?3 WHERE gathering_id = ?1 AND number = ?2";
}

/// One decision.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Pick {
    /// Which track.
    pub(crate) number: u32,
    /// Name of the landmark; `None` for views of one that is known: its own.
    pub(crate) name: Option<String>,
}

/// What came of it.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Accepted {
    /// By landmark: how many views it got, and whether they place it.
    pub(crate) landmarks: BTreeMap<String, (u64, Placing)>,
    /// The lesson.
    pub(crate) job: Option<JobRow>,
}

/// What an acceptance may come to.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Bounds {
    /// Landmarks of a map.
    pub(crate) landmarks: usize,
    /// Views of a landmark.
    pub(crate) views: usize,
    /// Jobs that wait or run, and finished ones that are kept.
    pub(crate) jobs: (usize, usize),
}

/// What somebody has decided, and what follows from it.
#[derive(Clone)]
pub(crate) struct Decision {
    /// Name of the map.
    pub(crate) map: String,
    /// Number of the gathering.
    pub(crate) gathering: i64,
    pub(crate) picks: Vec<Pick>,
    /// Makes the request of the lesson from the names of the landmarks; without it none is queued.
    pub(crate) lesson: Option<fn(&[String]) -> String>,
    pub(crate) bounds: Bounds,
    /// Runs once it is committed, whether or not the caller is still there.
    pub(crate) after: Arc<dyn Fn() + Send + Sync>,
}

impl std::fmt::Debug for Decision {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Decision").field("picks", &self.picks).finish_non_exhaustive()
    }
}

/// Accepts: computes first what the views say, then writes.
pub(crate) async fn accept(store: &Store, decision: Decision) -> Result<Accepted, StoreError> {
    let decision = Arc::new(decision);
    let _turn = store.preparing().await;
    for _ in 0..ATTEMPTS {
        let (prepared, decision) = (prepare(store, &decision).await?, decision.clone());
        let accepted = store.write(move |tx| Box::pin(async move { write(tx, &decision, prepared).await }));
        match accepted.await {
            Err(StoreError::Changed) => {}
            done => return done,
        }
    }
    Err(StoreError::Busy)
}

/// What was computed for a decision, and from what.
struct Prepared {
    /// By track: the views that were there, and those of them that are left out.
    tracks: BTreeMap<u32, (Vec<i64>, Vec<i64>)>,
    /// By name: the landmark as it was, if it was there, and its place with its new views.
    landmarks: BTreeMap<String, (Option<Stamp>, Made)>,
    /// The walls that all of it rests on.
    walls_version: i64,
}

/// A view of a landmark as its place rests on it. What has the same picture and corners is the same view.
struct Held {
    image_sha256: Digest,
    corners: Corners,
    capture: Option<String>,
}

/// What a decision rests on; everything that is not there is left to the write, which says so.
async fn prepare(store: &Store, decision: &Decision) -> Result<Prepared, StoreError> {
    let Decision { map, gathering, picks, .. } = decision;
    let (row, db) = (maps::get(store.reads(), map).await?, store.reads());
    // First, so that what changes after it is noticed inside the write.
    let walls_version = laser::version(db, row.id).await?;
    let tracks = gatherings::tracks(db, *gathering).await?;
    let (mut views, mut landmarks) = (BTreeMap::new(), BTreeMap::new());
    for pick in picks {
        let Some(track) = tracks.iter().find(|t| t.number == pick.number) else { continue };
        views.insert(pick.number, gatherings::track_views(db, *gathering, pick.number).await?);
        let Some(name) = track.landmark.as_ref().or(pick.name.as_ref()) else { continue };
        if !landmarks.contains_key(name) {
            let stamp = stamp(db, map, name).await?;
            let held = match &stamp {
                Some(stamp) => held(store, stamp.landmark()).await?,
                None => Vec::new(),
            };
            landmarks.insert(name.clone(), (stamp, held, Vec::new()));
        }
        if let Some((.., numbers)) = landmarks.get_mut(name) {
            numbers.push(pick.number);
        }
    }
    let walls = walls(store, row.id).await?;
    computed(store, "an acceptance", move || Prepared {
        landmarks: landmarks
            .into_iter()
            .map(|(name, (stamp, held, numbers))| {
                let made = with_tracks(held, &numbers, &views, &walls, stamp.as_ref());
                (name, (stamp, made))
            })
            .collect(),
        tracks: views
            .iter()
            .map(|(number, views)| {
                let (all, apart) = (views.iter().map(|v| v.id).collect(), apart(views, &walls));
                (*number, (all, apart.into_iter().map(|i| views[i].id).collect()))
            })
            .collect(),
        walls_version,
    })
    .await
}

/// The views that a landmark has, by number.
async fn held(store: &Store, landmark: i64) -> Result<Vec<Held>, StoreError> {
    let rows = sqlx::query(HELD).bind(landmark).fetch_all(store.reads()).await;
    let rows = rows.map_err(StoreError::at("read views"))?;
    let view = |row: &SqliteRow| {
        let capture = row.try_get("capture").map_err(StoreError::at("read views"))?;
        Ok(Held { image_sha256: views::digest_of(row)?, corners: views::corners_in(row)?, capture })
    };
    rows.iter().map(view).collect()
}

/// Views that do not agree on the thing's place would spoil its model: another border of it was found, or something else
/// (rectangle consistency, method 7.1). By their index.
fn apart(views: &[TrackView], walls: &[LaserSegment]) -> Vec<usize> {
    let looks = views.iter().map(|v| (&v.cut.corners_px, v.capture.as_deref()));
    // Without a place nothing speaks against any view.
    placing::preview(looks, walls).map(|made| made.apart).unwrap_or_default()
}

/// The place of a landmark that gets the views of these tracks to those it has.
fn with_tracks(
    mut held: Vec<Held>,
    numbers: &[u32],
    views: &BTreeMap<u32, Vec<TrackView>>,
    walls: &[LaserSegment],
    stamp: Option<&Stamp>,
) -> Made {
    for views in numbers.iter().filter_map(|number| views.get(number)) {
        let apart = apart(views, walls);
        for (_, view) in views.iter().enumerate().filter(|(i, _)| !apart.contains(i)) {
            let TrackView { image_sha256, cut, capture, .. } = view;
            let same = |h: &Held| h.image_sha256 == *image_sha256 && h.corners == cut.corners_px;
            if !held.iter().any(same) {
                let (image_sha256, corners, capture) = (*image_sha256, cut.corners_px, capture.clone());
                held.push(Held { image_sha256, corners, capture });
            }
        }
    }
    let newest_first = held.into_iter().rev();
    let captures: Vec<_> = newest_first.filter_map(|h| Some((h.corners, h.capture?))).collect();
    placing::made(&captures, walls, &stamp.map(|s| s.measures).unwrap_or_default())
}

async fn write(tx: &mut Tx, decision: &Decision, prepared: Prepared) -> Result<Accepted, StoreError> {
    let Decision { map, gathering, picks, lesson, bounds, after } = decision;
    let (map, id) = (map.as_str(), *gathering);
    let of = gatherings::get(&mut tx.conn, map, id).await?;
    let number = maps::get(&mut tx.conn, &of.map).await?.id;
    let mut unchanged = laser::version(&mut tx.conn, number).await? == prepared.walls_version;
    for (name, (was, _)) in &prepared.landmarks {
        unchanged &= stamp(&mut tx.conn, map, name).await? == *was;
    }
    for (track, (was, _)) in &prepared.tracks {
        let now = gatherings::track_views(&mut tx.conn, id, *track).await?;
        unchanged &= now.iter().map(|v| v.id).eq(was.iter().copied());
    }
    if !unchanged {
        return Err(StoreError::Changed);
    }
    // By name: the landmark's number and the views it got.
    let mut taken: BTreeMap<String, (i64, u64)> = BTreeMap::new();
    for pick in picks {
        let (name, landmark) = landmark_of(tx, (map, id), pick, &taken, bounds.landmarks).await?;
        for view in prepared.tracks.get(&pick.number).iter().flat_map(|(_, apart)| apart) {
            let dropped = sqlx::query(DROP_VIEW).bind(view).execute(&mut tx.conn).await;
            dropped.map_err(StoreError::at("leave out view"))?;
        }
        let moved = sqlx::query(MOVE).bind(id).bind(pick.number).bind(landmark).execute(&mut tx.conn).await;
        let moved = moved.map_err(StoreError::at("accept views"))?.rows_affected();
        let count = sqlx::query_scalar(COUNT).bind(landmark).fetch_one(&mut tx.conn).await;
        within(count.map_err(StoreError::at("count views"))?, bounds.views, "views of a landmark")?;
        let dropped = sqlx::query(DROP_VIEWS).bind(id).bind(pick.number).execute(&mut tx.conn).await;
        dropped.map_err(StoreError::at("accept track"))?;
        let decided = sqlx::query(ACCEPTED).bind(id).bind(pick.number).bind(landmark);
        decided.execute(&mut tx.conn).await.map_err(StoreError::at("accept track"))?;
        taken.entry(name).or_insert((landmark, 0)).1 += moved;
    }
    let (mut landmarks, mut made) = (BTreeMap::new(), prepared.landmarks);
    for (name, (_, views)) in taken {
        // It was not there when the decision was prepared, or the track was of another landmark then.
        let (_, made) = made.remove(&name).ok_or(StoreError::Changed)?;
        let placing = placing::put(tx, map, &name, made).await?;
        landmarks.insert(name, (views, placing));
    }
    let job = match lesson {
        Some(request) if !landmarks.is_empty() => {
            let names: Vec<String> = landmarks.keys().cloned().collect();
            Some(jobs::create(tx, "learn", map, &request(&names), bounds.jobs).await?)
        }
        _ => None,
    };
    let after = after.clone();
    tx.after(move || after());
    Ok(Accepted { landmarks, job })
}

/// The landmark a track's views go to: its own; or a new one; or one of that name that has no views yet, or was made by
/// this very decision.
async fn landmark_of(
    tx: &mut Tx,
    (map, id): (&str, i64),
    pick: &Pick,
    taken: &BTreeMap<String, (i64, u64)>,
    max: usize,
) -> Result<(String, i64), StoreError> {
    let track = gatherings::track(&mut tx.conn, id, pick.number).await?;
    if let Some((own, landmark)) = track.landmark.zip(track.landmark_id) {
        return match &pick.name {
            Some(name) if *name != own => {
                Err(StoreError::InUse(format!("track {} shows landmark `{own}`", track.number)))
            }
            _ => Ok((own, landmark)),
        };
    }
    let name = pick.name.clone().ok_or_else(|| {
        StoreError::InUse(format!("track {} is no landmark yet: it needs a name", track.number))
    })?;
    if let Some((landmark, _)) = taken.get(&name) {
        return Ok((name, *landmark));
    }
    match landmarks::get(&mut tx.conn, map, &name).await {
        Ok(row) if row.views == 0 => Ok((name, row.id)),
        Ok(_) => Err(StoreError::Exists { what: "landmark", name }),
        Err(StoreError::NotFound { .. }) => {
            let made = landmarks::create(tx, map, &name, Measures::default(), max).await?;
            Ok((name, made.id))
        }
        Err(error) => Err(error),
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::publication::Catalogue;
    use crate::store::{gatherings::NewGathering, robots, views::NewView};

    /// A gathering with one track of these views.
    pub(in crate::store) async fn gathered(
        store: &Catalogue,
        map: &'static str,
        views: impl Iterator<Item = NewView>,
    ) -> i64 {
        store.write(move |tx| Box::pin(robots::put(tx, "r1", map, 5))).await.unwrap();
        let new = NewGathering { robot: "r1".to_owned(), landmark: None, known: false };
        let bounds = gatherings::Bounds::SERVER;
        let begun = store
            .write(move |tx| Box::pin(async move { gatherings::create(tx, map, &new, bounds).await }))
            .await;
        let id = begun.unwrap().id;
        for view in views {
            keep(store, id, view).await;
        }
        id
    }

    async fn keep(store: &Catalogue, id: i64, view: NewView) {
        let kept =
            map::tracks::StoredTrack { number: 1, landmark: None, sightings: 3, known: 0, place: None };
        let bounds = gatherings::Bounds::SERVER;
        let write = store.write(move |tx| {
            Box::pin(async move { gatherings::add_view(tx, id, &kept, &view, bounds).await })
        });
        write.await.unwrap();
    }

    /// The first track becomes a landmark.
    pub(in crate::store) fn decision(map: &str, gathering: i64, name: &str) -> Decision {
        Decision {
            map: map.to_owned(),
            gathering,
            picks: vec![Pick { number: 1, name: Some(name.to_owned()) }],
            lesson: None,
            bounds: Bounds { landmarks: 9, views: 9, jobs: (9, 9) },
            after: Arc::new(|| ()),
        }
    }

    #[tokio::test]
    async fn a_decision_is_written_only_on_what_it_was_prepared_from() {
        use crate::store::placing::tests::seen_from;
        let dir = tempfile::tempdir().unwrap();
        let (store, _task) = Catalogue::open(&crate::publication::tests::config(dir.path())).await.unwrap();
        let both = vision::recognise::DistanceKind::Both;
        store.write(move |tx| Box::pin(maps::create(tx, "a", both, 2))).await.unwrap();
        let id = gathered(&store, "a", std::iter::once(seen_from(1.0, 1, 0.0))).await;
        let decision = decision("a", id, "new");
        let refused = async |prepared| {
            let decision = decision.clone();
            let write =
                store.write(move |tx| Box::pin(async move { write(tx, &decision, prepared).await })).await;
            matches!(write, Err(StoreError::Changed))
        };
        let prepared = prepare(&store, &decision).await.unwrap();
        store.write(|tx| Box::pin(laser::replace(tx, "a", &[[0.0, 0.0, 6.0, 0.0]]))).await.unwrap();
        assert!(refused(prepared).await, "other walls");
        let prepared = prepare(&store, &decision).await.unwrap();
        keep(&store, id, seen_from(1.4, 2, 0.0)).await;
        assert!(refused(prepared).await, "the robot has gathered one more");
        let prepared = prepare(&store, &decision).await.unwrap();
        let none = Measures::default();
        store.write(move |tx| Box::pin(landmarks::create(tx, "a", "new", none, 5))).await.unwrap();
        assert!(refused(prepared).await, "a landmark of that name");
        let accepted = accept(&store, decision.clone()).await.unwrap();
        assert_eq!(accepted.landmarks["new"].0, 2);
    }
}
