//! Adds training views to landmarks. Novelty and placement of a view are computed before the write,
//! from what is stored. The transaction compares a stamp of all that they rest on; if that has
//! changed, everything is computed once more. Writes are prepared one at a time
//! ([`Store::preparing`]), so only another kind of edit of the map causes a repetition.

use super::{
    Store, StoreError, Tx,
    db::{self, Executor},
    kind::Kind,
    landmark_placement::{self, PlacementOutcome, PlacementReport},
    landmarks::{self, LandmarkGeometry, geometry_columns},
    maps, pictures,
    statements::statements,
    views::{self, NewView, QuadCrop, UploadOutcome, ViewRow},
    walls,
};
use engine::{
    panics::Edge,
    threads::{self, Class},
};
use map::segments::LaserSegment;
use std::sync::Arc;
use vision::{
    learn::near_duplicates::{NoveltyParams, ViewSummary, most_alike},
    pose::LandmarkSize,
};

statements! {
    STAMP = concat!("SELECT m.id AS map, m.walls_version, l.id AS landmark, l.revision, ", geometry_columns!("l."),
            " FROM maps m JOIN landmarks l ON l.map_id = m.id WHERE m.name = $1 AND l.name = $2");
}

/// Two sizes are the same up to the rounding of their text.
const SAME_SIZE_M: f64 = 1e-6;

/// How often a write is prepared before its caller is told to try again.
pub(crate) const ATTEMPTS: usize = 5;

/// What a landmark's place and the novelty of its views rest on (optimistic locking). The revision
/// changes with the views, and never comes back.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Stamp {
    map: i64,
    walls_version: i64,
    landmark: i64,
    revision: i64,
    pub(super) geometry: LandmarkGeometry,
}

impl Stamp {
    /// Number of the landmark.
    pub(super) fn landmark(&self) -> i64 {
        self.landmark
    }
}

/// The stamp of a landmark; `None` if there is none of that name.
pub(super) async fn stamp(
    db: impl Executor<'_>,
    map: &str,
    landmark: &str,
) -> Result<Option<Stamp>, StoreError> {
    let at = || StoreError::during("read what a view rests on");
    let Some(row) = db::query(STAMP).bind(map).bind(landmark).fetch_optional(db).await.map_err(at())? else {
        return Ok(None);
    };
    let number = |column: &str| row.try_get::<i64, _>(column).map_err(at());
    Ok(Some(Stamp {
        map: number("map")?,
        walls_version: number("walls_version")?,
        landmark: number("landmark")?,
        revision: number("revision")?,
        geometry: landmarks::geometry(&row).map_err(at())?,
    }))
}

/// The walls of a map (map frame).
pub(super) async fn wall_segments(store: &Store, map: i64) -> Result<Vec<LaserSegment>, StoreError> {
    Ok(walls::all_of(store.reads(), map).await?.iter().filter_map(|wall| wall.segment().ok()).collect())
}

/// Computes off the runtime. A panic is caught, counted and answered.
pub(super) async fn computed<T: Send + 'static>(
    store: &Store,
    what: &'static str,
    work: impl FnOnce() -> T + Send + 'static,
) -> Result<T, StoreError> {
    let done = threads::run(Class::Requests, work).await;
    let done = store.vitals().panics().ended(Edge::Write, what, "nothing is written", done);
    done.map_err(|_ended| StoreError::Panicked)
}

/// A view to be added to a landmark.
#[derive(Debug)]
pub(crate) struct Teaching {
    /// Name of the map.
    pub(crate) map: String,
    /// Name of the landmark.
    pub(crate) landmark: String,
    /// The view. With a capture it places the landmark.
    pub(crate) view: NewView,
    /// Most views of a landmark.
    pub(crate) max: usize,
    /// What counts as a near-duplicate; without it every view is stored.
    pub(crate) novelty: Option<NoveltyParams>,
    /// Size of the landmark by hand. It is set where there is none by hand, and has to be the same
    /// else.
    pub(crate) size: Option<LandmarkSize>,
    /// Makes the landmark if there is none: the most that a map may have.
    pub(crate) create: Option<usize>,
}

impl Teaching {
    /// The geometry of the landmark with the size that is given. Errors: `SizeDiffers`.
    fn sized(&self, now: &LandmarkGeometry) -> Result<LandmarkGeometry, StoreError> {
        let Some(given) = self.size else { return Ok(*now) };
        if let Some(stored) = now.size_by_hand() {
            let off_m = (stored.width_m - given.width_m).abs().max((stored.height_m - given.height_m).abs());
            if off_m > SAME_SIZE_M {
                return Err(StoreError::SizeDiffers { landmark: self.landmark.clone(), stored, given });
            }
            return Ok(*now);
        }
        Ok(now.edited(&LandmarkGeometry { size: Some(given), place: None, ..*now }, (true, false)))
    }
}

/// What a prepared view rests on.
enum Basis {
    /// A landmark that exists.
    Landmark(Box<Stamp>),
    /// There is none yet: the map and the version of its walls.
    NewLandmark { map: i64, walls_version: i64 },
}

/// What was computed for a view, and what it rests on.
struct Prepared {
    basis: Basis,
    /// The landmark's geometry with the size that was given.
    geometry: LandmarkGeometry,
    /// Number of the stored view that the new one is a near-duplicate of.
    near_duplicate: Option<i64>,
    /// The landmark's placement with the new view, if that has a capture.
    placement: Option<PlacementOutcome>,
}

/// What came of a view: its row or that of the one it repeats, and the placement of its landmark.
pub(crate) type Added = (ViewRow, UploadOutcome, Option<PlacementReport>);

/// Stores a view, unless it is there already or is a near-duplicate of one; then gives that one. A
/// view with a capture places its landmark in the same transaction.
pub(crate) async fn add(store: &Store, teaching: Teaching) -> Result<Added, StoreError> {
    let teaching = Arc::new(teaching);
    let _turn = store.preparing().await;
    for _ in 0..ATTEMPTS {
        let (prepared, new) = (prepare(store, &teaching).await?, teaching.clone());
        let added = store.write(move |tx| Box::pin(async move { write(tx, &new, prepared).await }));
        match added.await {
            Err(StoreError::Changed) => {}
            done => return done,
        }
    }
    Err(StoreError::Busy)
}

/// The landmark as it is, or that it is to be made.
async fn basis(
    store: &Store,
    Teaching { map, landmark, create, .. }: &Teaching,
) -> Result<Basis, StoreError> {
    if let Some(stamp) = stamp(store.reads(), map, landmark).await? {
        return Ok(Basis::Landmark(Box::new(stamp)));
    }
    let map = maps::get(store.reads(), map).await?.id;
    if create.is_none() {
        return Err(StoreError::NotFound { what: Kind::Landmark, name: landmark.clone() });
    }
    Ok(Basis::NewLandmark { map, walls_version: walls::version(store.reads(), map).await? })
}

/// The landmark that gets the view: its number and that of its map. A new one is made, and one
/// without a size gets it.
async fn landmark_for(tx: &mut Tx, new: &Teaching, prepared: &Prepared) -> Result<(i64, i64), StoreError> {
    let (Teaching { map, landmark, create, .. }, geometry) = (new, prepared.geometry);
    let now = stamp(&mut tx.conn, map, landmark).await?;
    match (&prepared.basis, now) {
        (Basis::Landmark(was), Some(now)) if **was == now => {
            if now.geometry != geometry {
                landmarks::update(tx, map, landmark, |_| geometry).await?;
            }
            Ok((now.map, now.landmark))
        }
        (Basis::NewLandmark { map: was, walls_version }, None) => {
            let row = maps::get(&mut tx.conn, map).await?;
            if row.id != *was || walls::version(&mut tx.conn, row.id).await? != *walls_version {
                return Err(StoreError::Changed);
            }
            let made = landmarks::create(tx, map, landmark, geometry, create.unwrap_or_default()).await?;
            Ok((row.id, made.id))
        }
        _ => Err(StoreError::Changed),
    }
}

async fn prepare(store: &Store, teaching: &Arc<Teaching>) -> Result<Prepared, StoreError> {
    let Teaching { view, novelty, .. } = &**teaching;
    // It is read first, so that the write notices whatever changes after it.
    let basis = basis(store, teaching).await?;
    let (map, landmark, now) = match &basis {
        Basis::Landmark(stamp) => (stamp.map, Some(stamp.landmark), stamp.geometry),
        Basis::NewLandmark { map, .. } => (*map, None, LandmarkGeometry::default()),
    };
    let geometry = teaching.sized(&now)?;
    let stored = match (novelty, landmark) {
        (Some(_), Some(landmark)) => views::crops(store.reads(), landmark).await?,
        _ => Vec::new(),
    };
    let (mut captures, mut on) = (Vec::new(), Vec::new());
    if let Some(capture) = &view.capture {
        if let Some(landmark) = landmark {
            captures = landmark_placement::captures(store.reads(), landmark).await?;
        }
        captures.insert(0, (view.crop.corners_px, capture.clone()));
        on = wall_segments(store, map).await?;
    }
    let teaching = teaching.clone();
    let work = move || Prepared {
        near_duplicate: teaching
            .novelty
            .as_ref()
            .and_then(|p| near_duplicate(&teaching.view.crop, &stored, p)),
        placement: teaching
            .view
            .capture
            .is_some()
            .then(|| landmark_placement::place_landmark(&captures, &on, &geometry)),
        basis,
        geometry,
    };
    computed(store, "a view", work).await
}

/// Number of the stored view that the new one is a near-duplicate of.
fn near_duplicate(new: &QuadCrop, stored: &[(i64, QuadCrop)], p: &NoveltyParams) -> Option<i64> {
    let summary = |crop: &QuadCrop| ViewSummary::new(&crop.corners_px, &crop.icon);
    let summaries: Vec<ViewSummary> = stored.iter().map(|(_, crop)| summary(crop)).collect();
    let (index, novelty) = most_alike(&summary(new), &summaries, p)?;
    (novelty < 1.0).then(|| stored[index].0)
}

async fn write(tx: &mut Tx, new: &Teaching, prepared: Prepared) -> Result<Added, StoreError> {
    let Teaching { map, landmark, view, max, .. } = new;
    let (of_map, number) = landmark_for(tx, new, &prepared).await?;
    if let Some(row) = views::same(tx, number, view).await? {
        pictures::mend(tx, &view.image_sha256, &view.image).await?;
        return Ok((row, UploadOutcome::Duplicate, None));
    }
    if let Some(id) = prepared.near_duplicate {
        return Ok((views::get(&mut tx.conn, id).await?, UploadOutcome::NearDuplicate, None));
    }
    let row = views::add(tx, (of_map, number), view, *max).await?;
    let placement = match prepared.placement {
        Some(outcome) => Some(landmark_placement::put(tx, map, landmark, outcome).await?),
        None => None,
    };
    Ok((row, UploadOutcome::New, placement))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        publication::{Catalogue, tests::config},
        store::{
            landmark_placement::tests::seen_from,
            track_acceptance::tests::{decision, gathered},
        },
    };
    use vision::recognise::DistanceKind;

    crate::store::tests::cluster::on_each_store! {
        a_view_is_written_only_on_what_it_was_prepared_from,
        an_accepted_track_is_placed_as_its_views_place_it,
        a_panic_of_the_computation_ends_nothing,
    }

    async fn store(dir: &std::path::Path) -> (Catalogue, crate::publication::CatalogueTasks) {
        let (store, task) = Catalogue::open(&config(dir)).await.unwrap();
        store.write(|tx| Box::pin(maps::create(tx, "a", DistanceKind::Both, 2))).await.unwrap();
        let none = LandmarkGeometry::default();
        store.write(move |tx| Box::pin(landmarks::create(tx, "a", "p1", none, 5))).await.unwrap();
        wall(&store).await;
        (store, task)
    }

    async fn wall(store: &Catalogue) {
        store.write(|tx| Box::pin(walls::replace(tx, "a", &[[0.0, 0.0, 6.0, 0.0]]))).await.unwrap();
    }

    fn teaching(number: u8) -> Teaching {
        let (map, landmark) = ("a".to_owned(), "p1".to_owned());
        let view = seen_from(1.0 + f64::from(number) * 0.4, number, 0.0);
        Teaching { map, landmark, view, max: 9, novelty: None, size: None, create: None }
    }

    /// Prepares a view, lets `meanwhile` happen, and writes: was it refused, so that it is prepared
    /// again?
    async fn refused(store: &Catalogue, number: u8, meanwhile: impl AsyncFnOnce()) -> bool {
        let teaching = Arc::new(teaching(number));
        let prepared = prepare(store, &teaching).await.unwrap();
        meanwhile().await;
        let written = store.write(move |tx| Box::pin(async move { write(tx, &teaching, prepared).await }));
        match written.await {
            Ok((_, outcome, placement)) => {
                assert!(outcome == UploadOutcome::New && placement.unwrap().placed);
                false
            }
            Err(StoreError::Changed) => true,
            Err(error) => panic!("{error}"),
        }
    }

    async fn a_view_is_written_only_on_what_it_was_prepared_from() {
        let dir = tempfile::tempdir().unwrap();
        let (store, _task) = store(dir.path()).await;
        assert!(!refused(&store, 1, async || ()).await);
        assert!(refused(&store, 2, async || wall(&store).await).await, "other walls");
        let another = async || drop(add(&store, teaching(3)).await.unwrap());
        assert!(refused(&store, 2, another).await, "another view, and another place");
        let deleted = async || {
            let landmark = landmarks::get(store.reads(), "a", "p1").await.unwrap().id;
            let last = views::page(store.reads(), landmark, views::ViewFilter::default(), (None, false), 9)
                .await
                .unwrap()
                .last()
                .unwrap()
                .id;
            store.write(move |tx| Box::pin(views::delete(tx, "a", "p1", last))).await.unwrap();
        };
        assert!(refused(&store, 2, deleted).await, "a view less");
        // Another landmark is no matter.
        let beside = async || {
            let none = LandmarkGeometry::default();
            store.write(move |tx| Box::pin(landmarks::create(tx, "a", "p2", none, 5))).await.unwrap();
        };
        assert!(!refused(&store, 2, beside).await);
    }

    async fn an_accepted_track_is_placed_as_its_views_place_it() {
        let dir = tempfile::tempdir().unwrap();
        let (store, _task) = store(dir.path()).await;
        let id = gathered(&store, "a", (1..=3).map(|n| teaching(n).view)).await;
        // It has one of these views already, and one of its own.
        for view in [2, 5] {
            add(&store, teaching(view)).await.unwrap();
        }
        let accepted =
            crate::store::track_acceptance::accept(&store, decision("a", id, "new")).await.unwrap();
        let placement = &accepted.landmarks["new"].1;
        assert_eq!((placement.placed, placement.views_used), (true, 3), "{placement:?}");
        let row = landmarks::get(store.reads(), "a", "new").await.unwrap();
        let on = wall_segments(&store, 1).await.unwrap();
        let captures = landmark_placement::captures(store.reads(), row.id).await.unwrap();
        let again = landmark_placement::place_landmark(&captures, &on, &LandmarkGeometry::default());
        assert_eq!(again, PlacementOutcome::Placed(Box::new(row.geometry), 3));
    }

    async fn a_panic_of_the_computation_ends_nothing() {
        let dir = tempfile::tempdir().unwrap();
        let (store, _task) = store(dir.path()).await;
        let planted = computed(&store, "planted", || -> u8 { panic!("planted") }).await;
        assert!(matches!(planted, Err(StoreError::Panicked)));
        assert_eq!(store.vitals().panics().at(Edge::Write), 1);
        assert!(!refused(&store, 1, async || ()).await);
    }
}
