//! Derived data: when it is there, and what is computed.

use super::super::{tests::config, *};
use crate::store::{StoreError, db, landmarks, maps, walls};
use engine::snapshot::MapSnapshot;
use vision::recognise::DistanceKind;

/// A map with a wall and two landmarks 40 m apart, so that neither's area reaches the other.
async fn two_placed(store: &Store, map: &'static str) -> [vision::model::LandmarkId; 2] {
    store.write(move |tx| Box::pin(maps::create(tx, map, DistanceKind::Both, 2))).await.unwrap();
    store
        .write(move |tx| Box::pin(async move { walls::replace(tx, map, &[[0.0, -0.1, 60.0, -0.1]]).await }))
        .await
        .unwrap();
    let mut ids = [vision::model::LandmarkId(0); 2];
    for (id, (name, x_m)) in ids.iter_mut().zip([("p1", 5.0), ("p2", 45.0)]) {
        let new = placed_at(x_m);
        let row = store.write(move |tx| Box::pin(landmarks::create(tx, map, name, new, 5))).await.unwrap();
        id.0 = row.id as u64;
    }
    ids
}

fn placed_at(x_m: f64) -> landmarks::LandmarkGeometry {
    let (z_m, theta_rad) = (1.5, std::f64::consts::FRAC_PI_2);
    landmarks::LandmarkGeometry {
        size: Some(vision::pose::LandmarkSize { width_m: 0.5, height_m: 0.7 }),
        place: Some(landmarks::StoredPlace {
            x_m,
            y_m: 0.0,
            z_m,
            theta_rad,
            roll_rad: 0.0,
            tilt_rad: 0.0,
            covariance: None,
        }),
        size_from_views: false,
    }
}

#[tokio::test]
async fn an_edit_computes_only_what_it_changed_and_not_in_the_writer() {
    let dir = tempfile::tempdir().unwrap();
    let config = config(dir.path());
    let (snapshots, vitals) = (Arc::new(Snapshots::default()), Arc::new(Vitals::default()));
    let publisher = Publisher::new(
        snapshots.clone(),
        (Arc::default(), Arc::default()),
        config.params.clone(),
        vitals.clone(),
    );
    let wake = publisher.derive.clone();
    // Nothing derives yet: what the writer publishes is all there is.
    let (store, _task) = Store::open(&config, Arc::new(publisher), vitals.clone()).await.unwrap();
    let [p1, p2] = two_placed(&store, "a").await;
    let map = snapshots.get("a").unwrap();
    assert!(map.pending.visibility && map.visibility.is_empty());

    let (stop, stopping) = watch::channel(false);
    let deriver =
        tokio::spawn(derive::run((snapshots.clone(), store.clone()), vitals.clone(), wake.clone(), stopping));
    let before = snapshots.with_visibility("a").await.unwrap();
    assert_eq!((before.version, before.visibility.len()), (map.version, 2));
    stop.send_replace(true);
    deriver.await.unwrap();

    let (moved, walls) = (placed_at(6.0), before.walls.clone());
    store
        .write(move |tx| Box::pin(async move { landmarks::update(tx, "a", "p1", |_| moved).await }))
        .await
        .unwrap();
    let after = snapshots.get("a").unwrap();
    assert!(after.version > before.version && Arc::ptr_eq(&after.walls, &walls));
    assert!(after.pending.visibility && !after.visibility.contains_key(&p1), "never one of another place");
    assert!(Arc::ptr_eq(&after.visibility[&p2], &before.visibility[&p2]), "its inputs are the same");

    let (_stop, stopping) = watch::channel(false);
    tokio::spawn(derive::run((snapshots.clone(), store.clone()), vitals, wake, stopping));
    let derived = snapshots.with_visibility("a").await.unwrap();
    assert!(derived.version == after.version && derived.visibility.contains_key(&p1));
    assert!(Arc::ptr_eq(&derived.visibility[&p2], &before.visibility[&p2]));
}

/// Adds a landmark, which makes a new version of the map.
async fn add_landmark(store: &Store, map: &'static str, name: &'static str) {
    let none = landmarks::LandmarkGeometry::default();
    store.write(move |tx| Box::pin(landmarks::create(tx, map, name, none, 9))).await.unwrap();
}

/// The present version of `map`, once `is_ready` holds of it.
async fn once(snapshots: &Snapshots, map: &str, is_ready: impl Fn(&MapSnapshot) -> bool) -> Arc<MapSnapshot> {
    let waited = async {
        loop {
            if let Some(current) = snapshots.get(map).filter(|current| is_ready(current)) {
                return current;
            }
            tokio::time::sleep(std::time::Duration::from_millis(2)).await;
        }
    };
    tokio::time::timeout(std::time::Duration::from_secs(20), waited).await.expect("derived in time")
}

#[tokio::test]
async fn look_alike_classes_that_fail_stay_pending_until_the_next_version() {
    const MAP: &str = "classes-fail";
    let dir = tempfile::tempdir().unwrap();
    derive::planting::plant(MAP, "look-alike classes");
    let (store, _task) = Catalogue::open(&config(dir.path())).await.unwrap();
    two_placed(&store, MAP).await;
    let panics = || store.vitals().panics().at(engine::panics::Edge::Publication);
    let failed = once(store.snapshots(), MAP, |map| !map.pending.visibility && panics() > 0).await;
    assert!(failed.pending.look_alikes && failed.look_alikes.classes.is_empty(), "a pose names nothing");
    assert_eq!(failed.visibility.len(), 2, "the areas do not depend on the classes");
    tokio::time::sleep(std::time::Duration::from_millis(50)).await;
    assert!(panics() <= 4, "each of the four versions is tried once: {}", panics());
    derive::planting::clear(MAP);
    add_landmark(&store, MAP, "p3").await;
    let next = once(store.snapshots(), MAP, |map| !map.pending.any()).await;
    assert!(next.version > failed.version);
    assert_eq!(store.vitals().failure(), None);
}

#[tokio::test]
async fn visibility_areas_that_fail_are_absent_until_the_next_version() {
    const MAP: &str = "areas-fail";
    let dir = tempfile::tempdir().unwrap();
    let (store, _task) = Catalogue::open(&config(dir.path())).await.unwrap();
    derive::planting::plant(MAP, "visibility areas");
    let ids = two_placed(&store, MAP).await;
    // Whoever waits for areas gets an answer, without any.
    let failed = store.snapshots().with_visibility(MAP).await.unwrap();
    assert!(failed.visibility.is_empty() && failed.version == store.snapshots().get(MAP).unwrap().version);
    derive::planting::clear(MAP);
    add_landmark(&store, MAP, "p3").await;
    let next = store.snapshots().with_visibility(MAP).await.unwrap();
    assert!(next.version > failed.version && ids.iter().all(|id| next.visibility.contains_key(id)));
    assert_eq!(store.vitals().failure(), None);
}

/// Landmarks with their stored areas.
async fn stored_areas(store: &Catalogue) -> Vec<(i64, Vec<u8>)> {
    db::query_as("SELECT landmark_id, area FROM visibility_areas ORDER BY landmark_id")
        .fetch_all(store.reads())
        .await
        .unwrap()
}

/// The stored areas, once they are as wanted: they are stored after they are published.
async fn once_stored(store: &Catalogue, is_ready: impl Fn(&[(i64, Vec<u8>)]) -> bool) -> Vec<(i64, Vec<u8>)> {
    let waited = async {
        loop {
            let rows = stored_areas(store).await;
            if is_ready(&rows) {
                return rows;
            }
            tokio::time::sleep(std::time::Duration::from_millis(2)).await;
        }
    };
    tokio::time::timeout(std::time::Duration::from_secs(20), waited).await.expect("stored in time")
}

#[tokio::test]
async fn a_start_computes_no_area_again_and_an_edit_only_what_it_changed() {
    const MAP: &str = "areas-stored";
    let dir = tempfile::tempdir().unwrap();
    let config = config(dir.path());
    let (store, tasks) = Catalogue::open(&config).await.unwrap();
    let [p1, p2] = two_placed(&store, MAP).await;
    let first = store.snapshots().with_visibility(MAP).await.unwrap();
    once_stored(&store, |rows| rows.len() == 2).await;
    assert!(derive::planting::computed_of(MAP) >= 2);
    tasks.close().await;

    let (store, tasks) = Catalogue::open(&config).await.unwrap();
    let again = store.snapshots().with_visibility(MAP).await.unwrap();
    assert_eq!(again.visibility, first.visibility, "bit for bit");
    assert_eq!(derive::planting::computed_of(MAP), 0, "areas that a start computes");
    let before = stored_areas(&store).await;
    let moved = placed_at(46.0);
    store
        .write(move |tx| Box::pin(async move { landmarks::update(tx, MAP, "p2", |_| moved).await }))
        .await
        .unwrap();
    let edited = store.snapshots().with_visibility(MAP).await.unwrap();
    assert!(
        edited.visibility[&p1] == first.visibility[&p1] && edited.visibility[&p2] != first.visibility[&p2]
    );
    assert_eq!(derive::planting::computed_of(MAP), 1, "areas that an edit computes");
    let after = once_stored(&store, |rows| rows.len() == 2 && rows[1] != before[1]).await;
    assert_eq!(after[0], before[0]);

    // A damaged row is computed again; so is one that is gone.
    store
        .write(|tx| {
            Box::pin(async move {
                let damage = "UPDATE visibility_areas SET area = x'0102'";
                db::query(damage).execute(tx.conn()).await.map_err(StoreError::during("damage"))?;
                Ok(())
            })
        })
        .await
        .unwrap();
    tasks.close().await;
    let (store, _tasks) = Catalogue::open(&config).await.unwrap();
    assert_eq!(store.snapshots().with_visibility(MAP).await.unwrap().visibility, edited.visibility);
    assert_eq!(derive::planting::computed_of(MAP), 2);
    once_stored(&store, |rows| rows == after).await;
    // They go with their landmark.
    store.write(|tx| Box::pin(landmarks::delete(tx, MAP, "p1"))).await.unwrap();
    assert_eq!(stored_areas(&store).await.iter().map(|(id, _)| *id as u64).collect::<Vec<_>>(), [p2.0]);
}
