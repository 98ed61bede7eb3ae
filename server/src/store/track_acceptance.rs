//! Acceptance of gathered tracks. A track becomes a landmark with its views, or gives its views to
//! the landmark that it shows; the landmarks are placed and their lesson is queued. All of it
//! happens in one transaction, or nothing. Placements are computed before the transaction, as for
//! an added view ([`super::teaching`]).

use super::{
    Store, StoreError, Tx, db,
    gatherings::{self, TrackView},
    jobs::{self, JobRow},
    kind::Kind,
    landmark_placement::{self, PlacementOutcome, PlacementReport},
    landmarks::{self, LandmarkGeometry},
    maps,
    pictures::Digest,
    statements::statements,
    teaching::{ATTEMPTS, Stamp, computed, stamp, wall_segments},
    views, walls, within,
};
use map::segments::LaserSegment;
use std::{collections::BTreeMap, sync::Arc};
use vision::geometry::Corners;

statements! {
    MOVE = "INSERT INTO views (landmark_id, image_sha256, image_kind, width_px, height_px, corners_px, icon_side, \
            icon, icon_scale, created_ms, capture) SELECT $3, image_sha256, image_kind, width_px, height_px, corners_px, \
            icon_side, icon, icon_scale, created_ms, capture FROM track_views \
            WHERE gathering_id = $1 AND track = $2 ORDER BY id ON CONFLICT DO NOTHING";
    COUNT = "SELECT count(*) FROM views WHERE landmark_id = $1";
    HELD = "SELECT image_sha256, corners_px, capture FROM views WHERE landmark_id = $1 ORDER BY id";
    DROP_VIEWS = "DELETE FROM track_views WHERE gathering_id = $1 AND track = $2";
    DROP_VIEW = "DELETE FROM track_views WHERE id = $1";
    ACCEPTED = "UPDATE tracks SET state = 'accepted', landmark_id = $3 WHERE gathering_id = $1 AND number = $2";
}

/// A track that is accepted, and under which name.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct TrackAcceptance {
    /// Which track.
    pub(crate) number: u32,
    /// Name of the landmark; `None` for a track of a known landmark.
    pub(crate) name: Option<String>,
}

/// What an acceptance did.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct AcceptanceResult {
    /// By name of the landmark: the number of its new views, and its placement.
    pub(crate) landmarks: BTreeMap<String, (u64, PlacementReport)>,
    /// The lesson's job.
    pub(crate) job: Option<JobRow>,
}

/// Bounds that an acceptance must keep.
#[derive(Debug, Clone, Copy)]
pub(crate) struct AcceptanceLimits {
    /// Landmarks of a map.
    pub(crate) landmarks: usize,
    /// Views of a landmark.
    pub(crate) views: usize,
    /// Jobs that wait or run, and finished jobs that are retained.
    pub(crate) jobs: (usize, usize),
}

/// A person's decision, and what follows from it.
#[derive(Clone)]
pub(crate) struct Decision {
    /// Name of the map.
    pub(crate) map: String,
    /// Number of the gathering.
    pub(crate) gathering: i64,
    pub(crate) tracks: Vec<TrackAcceptance>,
    /// Makes the request of the lesson from the names of the landmarks; without it none is queued.
    pub(crate) lesson: Option<fn(&[String]) -> String>,
    pub(crate) limits: AcceptanceLimits,
    /// Runs after the commit, whether or not the caller still waits.
    pub(crate) after: Arc<dyn Fn() + Send + Sync>,
}

impl std::fmt::Debug for Decision {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Decision").field("tracks", &self.tracks).finish_non_exhaustive()
    }
}

/// Accepts tracks: computes the placements, then writes.
pub(crate) async fn accept(store: &Store, decision: Decision) -> Result<AcceptanceResult, StoreError> {
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

/// What was computed for a decision, and what it rests on.
struct Prepared {
    /// By track: its views, and those of them that are inconsistent and left out.
    tracks: BTreeMap<u32, (Vec<i64>, Vec<i64>)>,
    /// By name: the stamp of the landmark if it exists, and its placement with the new views.
    landmarks: BTreeMap<String, (Option<Stamp>, PlacementOutcome)>,
    /// Version of the walls that the placements rest on.
    walls_version: i64,
}

/// A view of a landmark, as its placement uses it. Equal picture and corners mean the same view.
struct PlacementView {
    image_sha256: Digest,
    corners: Corners,
    capture: Option<String>,
}

/// Computes what a decision needs. What does not exist is left to the write, which reports it.
async fn prepare(store: &Store, decision: &Decision) -> Result<Prepared, StoreError> {
    let Decision { map, gathering, tracks: accepted, .. } = decision;
    let (row, db) = (maps::get(store.reads(), map).await?, store.reads());
    // The version is read first, so that the write notices whatever changes after it.
    let walls_version = walls::version(db, row.id).await?;
    let tracks = gatherings::tracks(db, *gathering).await?;
    let (mut views, mut landmarks) = (BTreeMap::new(), BTreeMap::new());
    for chosen in accepted {
        let Some(track) = tracks.iter().find(|t| t.number == chosen.number) else { continue };
        views.insert(chosen.number, gatherings::track_views(db, *gathering, chosen.number).await?);
        let Some(name) = track.landmark.as_ref().or(chosen.name.as_ref()) else { continue };
        if !landmarks.contains_key(name) {
            let stamp = stamp(db, map, name).await?;
            let held = match &stamp {
                Some(stamp) => held(store, stamp.landmark()).await?,
                None => Vec::new(),
            };
            landmarks.insert(name.clone(), (stamp, held, Vec::new()));
        }
        if let Some((.., numbers)) = landmarks.get_mut(name) {
            numbers.push(chosen.number);
        }
    }
    let walls = wall_segments(store, row.id).await?;
    computed(store, "an acceptance", move || Prepared {
        landmarks: landmarks
            .into_iter()
            .map(|(name, (stamp, held, numbers))| {
                let outcome = with_tracks(held, &numbers, &views, &walls, stamp.as_ref());
                (name, (stamp, outcome))
            })
            .collect(),
        tracks: views
            .iter()
            .map(|(number, views)| {
                let (all, left_out) = (views.iter().map(|v| v.id).collect(), inconsistent(views, &walls));
                (*number, (all, left_out.into_iter().map(|i| views[i].id).collect()))
            })
            .collect(),
        walls_version,
    })
    .await
}

/// The stored views of a landmark, oldest first.
async fn held(store: &Store, landmark: i64) -> Result<Vec<PlacementView>, StoreError> {
    let rows = db::query(HELD).bind(landmark).fetch_all(store.reads()).await;
    let rows = rows.map_err(StoreError::during("read views"))?;
    let view = |row: &db::Row| {
        let capture = row.try_get("capture").map_err(StoreError::during("read views"))?;
        Ok(PlacementView { image_sha256: views::digest_of(row)?, corners: views::corners_in(row)?, capture })
    };
    rows.iter().map(view).collect()
}

/// Indices of views that do not agree on the object's place. They show another border of it, or
/// another object, and would spoil its model (rectangle consistency, method 7.1).
fn inconsistent(views: &[TrackView], walls: &[LaserSegment]) -> Vec<usize> {
    let captures = views.iter().map(|v| (&v.crop.corners_px, v.capture.as_deref()));
    // Without a place, no view is inconsistent.
    landmark_placement::preview(captures, walls).map(|preview| preview.inconsistent).unwrap_or_default()
}

/// The placement of a landmark with its views `held` and the views of these tracks.
fn with_tracks(
    mut held: Vec<PlacementView>,
    numbers: &[u32],
    views: &BTreeMap<u32, Vec<TrackView>>,
    walls: &[LaserSegment],
    stamp: Option<&Stamp>,
) -> PlacementOutcome {
    for views in numbers.iter().filter_map(|number| views.get(number)) {
        let left_out = inconsistent(views, walls);
        for (_, view) in views.iter().enumerate().filter(|(i, _)| !left_out.contains(i)) {
            let TrackView { image_sha256, crop, capture, .. } = view;
            let same = |h: &PlacementView| h.image_sha256 == *image_sha256 && h.corners == crop.corners_px;
            if !held.iter().any(same) {
                let (image_sha256, corners, capture) = (*image_sha256, crop.corners_px, capture.clone());
                held.push(PlacementView { image_sha256, corners, capture });
            }
        }
    }
    let newest_first = held.into_iter().rev();
    let captures: Vec<_> = newest_first.filter_map(|h| Some((h.corners, h.capture?))).collect();
    landmark_placement::place_landmark(&captures, walls, &stamp.map(|s| s.geometry).unwrap_or_default())
}

async fn write(tx: &mut Tx, decision: &Decision, prepared: Prepared) -> Result<AcceptanceResult, StoreError> {
    let Decision { map, gathering, tracks, lesson, limits, after } = decision;
    let (map, id) = (map.as_str(), *gathering);
    let of = gatherings::get(&mut tx.conn, map, id).await?;
    let number = maps::get(&mut tx.conn, &of.map).await?.id;
    let mut unchanged = walls::version(&mut tx.conn, number).await? == prepared.walls_version;
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
    // By name: the landmark's number and the count of its new views.
    let mut taken: BTreeMap<String, (i64, u64)> = BTreeMap::new();
    for chosen in tracks {
        let (name, landmark) = landmark_of(tx, (map, id), chosen, &taken, limits.landmarks).await?;
        for view in prepared.tracks.get(&chosen.number).iter().flat_map(|(_, left_out)| left_out) {
            let dropped = db::query(DROP_VIEW).bind(view).execute(&mut tx.conn).await;
            dropped.map_err(StoreError::during("leave out view"))?;
        }
        let moved = db::query(MOVE).bind(id).bind(chosen.number).bind(landmark).execute(&mut tx.conn).await;
        let moved = moved.map_err(StoreError::during("accept views"))?.rows_affected();
        let count = db::query_scalar(COUNT).bind(landmark).fetch_one(&mut tx.conn).await;
        within(count.map_err(StoreError::during("count views"))?, limits.views, "views of a landmark")?;
        let dropped = db::query(DROP_VIEWS).bind(id).bind(chosen.number).execute(&mut tx.conn).await;
        dropped.map_err(StoreError::during("accept track"))?;
        let decided = db::query(ACCEPTED).bind(id).bind(chosen.number).bind(landmark);
        decided.execute(&mut tx.conn).await.map_err(StoreError::during("accept track"))?;
        taken.entry(name).or_insert((landmark, 0)).1 += moved;
    }
    let (mut landmarks, mut placements) = (BTreeMap::new(), prepared.landmarks);
    for (name, (_, views)) in taken {
        // It is absent if the landmark or the track's landmark changed after the preparation.
        let (_, outcome) = placements.remove(&name).ok_or(StoreError::Changed)?;
        let report = landmark_placement::put(tx, map, &name, outcome).await?;
        landmarks.insert(name, (views, report));
    }
    let job = match lesson {
        Some(request) if !landmarks.is_empty() => {
            let names: Vec<String> = landmarks.keys().cloned().collect();
            Some(jobs::create(tx, "learn", map, &request(&names), limits.jobs).await?)
        }
        _ => None,
    };
    let after = after.clone();
    tx.after(move || after());
    Ok(AcceptanceResult { landmarks, job })
}

/// The landmark that gets a track's views: the track's own, a new one, or one of that name that has
/// no views yet or was made by this decision.
async fn landmark_of(
    tx: &mut Tx,
    (map, id): (&str, i64),
    chosen: &TrackAcceptance,
    taken: &BTreeMap<String, (i64, u64)>,
    max: usize,
) -> Result<(String, i64), StoreError> {
    let track = gatherings::track(&mut tx.conn, id, chosen.number).await?;
    if let Some((own, landmark)) = track.landmark.zip(track.landmark_id) {
        return match &chosen.name {
            Some(name) if *name != own => {
                Err(StoreError::InUse(format!("track {} shows landmark `{own}`", track.number)))
            }
            _ => Ok((own, landmark)),
        };
    }
    let name = chosen.name.clone().ok_or_else(|| {
        StoreError::InUse(format!("track {} is no landmark yet: it needs a name", track.number))
    })?;
    if let Some((landmark, _)) = taken.get(&name) {
        return Ok((name, *landmark));
    }
    match landmarks::get(&mut tx.conn, map, &name).await {
        Ok(row) if row.views == 0 => Ok((name, row.id)),
        Ok(_) => Err(StoreError::Exists { what: Kind::Landmark, name }),
        Err(StoreError::NotFound { .. }) => {
            let made = landmarks::create(tx, map, &name, LandmarkGeometry::default(), max).await?;
            Ok((name, made.id))
        }
        Err(error) => Err(error),
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::publication::Catalogue;
    use crate::store::{gatherings::NewGathering, robots, views::NewView};

    crate::store::tests::cluster::on_each_store! {
        a_decision_is_written_only_on_what_it_was_prepared_from,
    }

    /// A gathering with one track of these views.
    pub(crate) async fn gathered(
        store: &Catalogue,
        map: &'static str,
        views: impl Iterator<Item = NewView>,
    ) -> i64 {
        store.write(move |tx| Box::pin(robots::put(tx, "r1", map, 5))).await.unwrap();
        let new = NewGathering { robot: "r1".to_owned(), landmark: None, known: false };
        let bounds = gatherings::GatheringLimits::SERVER;
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
        let bounds = gatherings::GatheringLimits::SERVER;
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
            tracks: vec![TrackAcceptance { number: 1, name: Some(name.to_owned()) }],
            lesson: None,
            limits: AcceptanceLimits { landmarks: 9, views: 9, jobs: (9, 9) },
            after: Arc::new(|| ()),
        }
    }

    async fn a_decision_is_written_only_on_what_it_was_prepared_from() {
        use crate::store::landmark_placement::tests::seen_from;
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
        store.write(|tx| Box::pin(walls::replace(tx, "a", &[[0.0, 0.0, 6.0, 0.0]]))).await.unwrap();
        assert!(refused(prepared).await, "other walls");
        let prepared = prepare(&store, &decision).await.unwrap();
        keep(&store, id, seen_from(1.4, 2, 0.0)).await;
        assert!(refused(prepared).await, "the robot has gathered one more");
        let prepared = prepare(&store, &decision).await.unwrap();
        let none = LandmarkGeometry::default();
        store.write(move |tx| Box::pin(landmarks::create(tx, "a", "new", none, 5))).await.unwrap();
        assert!(refused(prepared).await, "a landmark of that name");
        let accepted = accept(&store, decision.clone()).await.unwrap();
        assert_eq!(accepted.landmarks["new"].0, 2);
    }
}
