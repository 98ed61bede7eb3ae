//! The store and its publication as a whole, on fresh databases.

mod incremental;
mod readers;
mod simulation;

use super::{build::tests as planting, *};
use crate::store::db;
use crate::store::kind::Kind;
use crate::{
    config::RawConfig,
    store::{StoreError, WRITER, jobs, landmarks, maps, models, robots, tests::cluster::store_of, walls},
};
use engine::panics::Edge;
use tokio::sync::oneshot;
use vision::recognise::DistanceKind;

/// The settings of a server with this data directory.
pub(crate) fn raw_config(dir: &std::path::Path) -> RawConfig {
    RawConfig { data: dir.to_owned(), store: store_of(dir), ..RawConfig::default() }
}

pub(crate) fn config(dir: &std::path::Path) -> Config {
    Config::try_from(raw_config(dir)).unwrap()
}

#[tokio::test]
async fn what_is_acknowledged_is_published_and_survives() {
    let dir = tempfile::tempdir().unwrap();
    let config = config(dir.path());
    let (store, task) = Catalogue::open(&config).await.unwrap();
    store.write(|tx| Box::pin(maps::create(tx, "a", DistanceKind::Both, 2))).await.unwrap();
    assert_eq!(store.snapshots().get("a").unwrap().version, 1);
    let new = landmarks::LandmarkGeometry {
        size: Some(vision::pose::LandmarkSize { width_m: 0.5, height_m: 0.7 }),
        place: Some(landmarks::StoredPlace {
            x_m: 1.0,
            y_m: 2.0,
            z_m: 1.5,
            theta_rad: 0.5,
            roll_rad: 0.0,
            tilt_rad: 0.0,
            covariance: None,
        }),
        size_from_views: false,
    };
    let made = store.write(move |tx| Box::pin(landmarks::create(tx, "a", "p1", new, 5))).await.unwrap();
    store.write(|tx| Box::pin(walls::replace(tx, "a", &[[0.0, 0.0, 4.0, 0.0]]))).await.unwrap();
    store.write(|tx| Box::pin(robots::put(tx, "r1", "a", 5))).await.unwrap();
    let snapshot = store.snapshots().get("a").unwrap();
    assert_eq!((snapshot.version, snapshot.landmarks.len(), snapshot.walls.len()), (3, 1, 1));
    assert!(snapshot.landmarks[&vision::model::LandmarkId(made.id as u64)].place.is_some());
    task.close().await;
    assert!(matches!(
        store.write(|tx| Box::pin(maps::create(tx, "late", DistanceKind::Both, 2))).await,
        Err(StoreError::Closed)
    ));
    assert!(!dir.path().join("waymark.sqlite-wal").exists());

    let (store, _task) = Catalogue::open(&config).await.unwrap();
    assert_eq!(store.snapshots().get("a").unwrap().version, 3);
    assert_eq!(store.snapshots().robot_map("r1").as_deref(), Some("a"));
    assert_eq!(landmarks::get(store.reads(), "a", "p1").await.unwrap().geometry, new);
}

/// Another connection, such as that of a backup program, keeps SQLite from emptying the log when
/// the writer's closes.
#[tokio::test]
async fn after_a_clean_stop_the_file_alone_holds_everything() {
    use sqlx::{ConnectOptions as _, sqlite::SqliteConnectOptions};
    let (dir, copied) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let (store, task) = Catalogue::open(&config(dir.path())).await.unwrap();
    store.write(|tx| Box::pin(maps::create(tx, "a", DistanceKind::Both, 2))).await.unwrap();
    let file = dir.path().join("waymark.sqlite");
    let mut other = SqliteConnectOptions::new().filename(&file).read_only(true).connect().await.unwrap();
    sqlx::query("SELECT name FROM maps").fetch_all(&mut other).await.unwrap();
    store.write(|tx| Box::pin(walls::replace(tx, "a", &[[0.0, 0.0, 4.0, 0.0]]))).await.unwrap();
    task.close().await;
    let log = std::fs::metadata(dir.path().join("waymark.sqlite-wal"));
    assert!(log.is_err() || log.is_ok_and(|log| log.len() == 0), "the log holds data");
    std::fs::copy(&file, copied.path().join("waymark.sqlite")).unwrap();
    let (store, _task) = Catalogue::open(&config(copied.path())).await.unwrap();
    let map = store.snapshots().get("a").unwrap();
    assert_eq!((map.version, map.walls.len()), (2, 1));
    drop(other);
}

#[tokio::test]
async fn a_failed_write_changes_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let (store, _task) = Catalogue::open(&config(dir.path())).await.unwrap();
    store.write(|tx| Box::pin(maps::create(tx, "a", DistanceKind::Both, 2))).await.unwrap();
    let half = store
        .write(|tx| {
            Box::pin(async move {
                landmarks::create(tx, "a", "p1", landmarks::LandmarkGeometry::default(), 5).await?;
                Err::<(), _>(StoreError::InUse("on purpose".into()))
            })
        })
        .await;
    assert!(matches!(half, Err(StoreError::InUse(_))));
    assert_eq!(store.snapshots().get("a").unwrap().version, 1);
    assert!(matches!(landmarks::get(store.reads(), "a", "p1").await, Err(StoreError::NotFound { .. })));
}

#[tokio::test]
async fn names_are_unique_and_bounds_hold() {
    let dir = tempfile::tempdir().unwrap();
    let (store, _task) = Catalogue::open(&config(dir.path())).await.unwrap();
    let create =
        |name: &'static str| store.write(move |tx| Box::pin(maps::create(tx, name, DistanceKind::Both, 2)));
    create("a").await.unwrap();
    assert!(matches!(create("a").await, Err(StoreError::Exists { what: Kind::Map, .. })));
    create("b").await.unwrap();
    assert!(matches!(create("c").await, Err(StoreError::Limit { max: 2, .. })));
    store.write(|tx| Box::pin(robots::put(tx, "r1", "b", 1))).await.unwrap();
    // The same robot again is no new one.
    store.write(|tx| Box::pin(robots::put(tx, "r1", "a", 1))).await.unwrap();
    assert!(matches!(
        store.write(|tx| Box::pin(robots::put(tx, "r2", "a", 1))).await,
        Err(StoreError::Limit { what: "robots", max: 1 })
    ));
    assert!(matches!(store.write(|tx| Box::pin(maps::delete(tx, "a"))).await, Err(StoreError::InUse(_))));
    store.write(|tx| Box::pin(maps::delete(tx, "b"))).await.unwrap();
    assert!(store.snapshots().get("b").is_none());
}

#[tokio::test]
async fn a_job_ends_once() {
    let dir = tempfile::tempdir().unwrap();
    let (store, _task) = Catalogue::open(&config(dir.path())).await.unwrap();
    store.write(|tx| Box::pin(maps::create(tx, "a", DistanceKind::Both, 2))).await.unwrap();
    let job = store.write(|tx| Box::pin(jobs::create(tx, "learn", "a", "{}", (1, 9)))).await.unwrap();
    assert!(matches!(
        store.write(|tx| Box::pin(jobs::create(tx, "learn", "a", "{}", (1, 9)))).await,
        Err(StoreError::Limit { .. })
    ));
    assert_eq!(jobs::open(store.reads()).await.unwrap().len(), 1);
    let end = |state: &'static str| {
        let ended = jobs::Ended { state, message: String::new(), result: None };
        store.write(move |tx| Box::pin(async move { jobs::end(tx, job.id, &ended).await }))
    };
    assert!(end("done").await.unwrap());
    assert!(!end("failed").await.unwrap());
    assert_eq!(jobs::get(store.reads(), job.id).await.unwrap().state, "done");
    assert!(jobs::open(store.reads()).await.unwrap().is_empty());
}

/// A model of one view of random grey levels, stored.
pub(crate) async fn store_model(store: &Catalogue, landmark: i64, params: &vision::params::Params) {
    use vision::{geometry::Corners, icon::Icon, learn, model::LandmarkId};
    let side = params.icon.size;
    let pixels = (0..side * side).map(|i| ((i * i * 31 + i * 7) % 251) as f32).collect();
    let view = learn::TrainingView {
        icon: Icon::new(side, pixels, 1.0).unwrap(),
        corners_px: Corners::try_from([[0.0, 0.0], [90.0, 0.0], [90.0, 90.0], [0.0, 90.0]]).unwrap(),
        image_size_px: [91, 91],
        exact: None,
        generated: false,
    };
    let id = LandmarkId(landmark as u64);
    let model = learn::learn(id, &[view.clone(), view], &[], params).unwrap();
    let new = models::NewModel {
        landmark: id,
        bytes: model.to_bytes(),
        params_hash: model.params_hash,
        summary: landmarks::ModelSummary {
            active: false,
            looks_like: None,
            reasons: "[]".into(),
            facts: "{}".into(),
            views: 2,
            generated_views: 0,
            learnt_ms: 0,
        },
    };
    let write = store.write(move |tx| {
        Box::pin(async move {
            assert!(models::put(tx, 1, &new).await?);
            maps::bump(tx, 1).await
        })
    });
    write.await.unwrap();
}

#[tokio::test]
async fn damaged_and_outdated_models_are_named_and_not_used() {
    use vision::model::LandmarkId;
    let dir = tempfile::tempdir().unwrap();
    let config = config(dir.path());
    let (store, task) = Catalogue::open(&config).await.unwrap();
    store.write(|tx| Box::pin(maps::create(tx, "a", DistanceKind::Both, 2))).await.unwrap();
    for name in ["sound", "damaged"] {
        let none = landmarks::LandmarkGeometry::default();
        let made = store.write(move |tx| Box::pin(landmarks::create(tx, "a", name, none, 5))).await.unwrap();
        store_model(&store, made.id, &config.params).await;
    }
    assert_eq!(store.snapshots().get("a").unwrap().learnt.len(), 2);
    // One byte in the middle of the blob, and the digest as it was.
    let damage = "UPDATE model_contents SET bytes = CAST(substr(bytes, 1, 500) || x'00ff' || substr(bytes, 503) AS BLOB) \
                  WHERE sha256 = (SELECT sha256 FROM models WHERE landmark_id = 2)";
    let write = store.write(move |tx| {
        Box::pin(async move {
            db::query(damage).execute(tx.conn()).await.map(drop).map_err(StoreError::during("damage"))
        })
    });
    write.await.unwrap();
    task.close().await;

    let (store, task) = Catalogue::open(&config).await.unwrap();
    let map = store.snapshots().get("a").unwrap();
    assert_eq!(map.learnt.keys().copied().collect::<Vec<_>>(), [LandmarkId(1)]);
    assert!(map.unusable_models[&LandmarkId(2)].contains("damaged"), "{:?}", map.unusable_models);
    task.close().await;

    let mut raw = RawConfig { data: dir.path().to_owned(), ..RawConfig::default() };
    raw.algorithm.icon.size += 1;
    let (store, _task) = Catalogue::open(&Config::try_from(raw).unwrap()).await.unwrap();
    let map = store.snapshots().get("a").unwrap();
    assert!(map.learnt.is_empty());
    assert!(map.unusable_models[&LandmarkId(1)].contains("parameters"), "{:?}", map.unusable_models);
}

#[tokio::test]
async fn a_write_that_panics_is_rolled_back_and_the_writer_goes_on() {
    let dir = tempfile::tempdir().unwrap();
    let (store, _task) = Catalogue::open(&config(dir.path())).await.unwrap();
    let panicked = store
        .write(|tx| {
            Box::pin(async move {
                maps::create(tx, "half", DistanceKind::Both, 9).await?;
                tx.after(|| unreachable!("nothing was committed"));
                Err::<(), _>(StoreError::InUse(String::from_utf8(vec![0xff]).expect("planted")))
            })
        })
        .await;
    assert!(matches!(panicked, Err(StoreError::Panicked)), "{panicked:?}");
    store.write(|tx| Box::pin(maps::create(tx, "a", DistanceKind::Both, 2))).await.unwrap();
    assert!(matches!(maps::get(store.reads(), "half").await, Err(StoreError::NotFound { .. })));
    assert_eq!(store.vitals().panics().at(Edge::Write), 1);
    assert_eq!(store.vitals().failure(), None);
}

#[tokio::test]
async fn an_error_after_which_nothing_may_be_written_is_a_failure_of_the_server() {
    let dir = tempfile::tempdir().unwrap();
    let (store, _task) = Catalogue::open(&config(dir.path())).await.unwrap();
    let source = || db::Error::WorkerCrashed;
    let fatal = store.write(move |_| {
        Box::pin(async move { Err::<(), _>(StoreError::Database { operation: "planted", source: source() }) })
    });
    assert!(fatal.await.is_err());
    let failed = tokio::time::timeout(std::time::Duration::from_secs(5), store.vitals().failed()).await;
    assert_eq!(failed.unwrap().part, WRITER);
    let late = store.write(|tx| Box::pin(maps::create(tx, "late", DistanceKind::Both, 2))).await;
    assert!(matches!(late, Err(StoreError::Closed)));
}

/// Whatever ends the writer's task without a word.
#[tokio::test]
async fn a_writer_that_is_gone_is_a_failure_of_the_server() {
    let dir = tempfile::tempdir().unwrap();
    let (store, task) = Catalogue::open(&config(dir.path())).await.unwrap();
    task.abort_writer();
    let failed = tokio::time::timeout(std::time::Duration::from_secs(5), store.vitals().failed()).await;
    assert_eq!(failed.unwrap().part, WRITER);
}

#[tokio::test]
async fn a_write_whose_caller_has_gone_before_it_began_is_left_out() {
    let dir = tempfile::tempdir().unwrap();
    let (store, _task) = Catalogue::open(&config(dir.path())).await.unwrap();
    let create =
        |name: &'static str| store.write(move |tx| Box::pin(maps::create(tx, name, DistanceKind::Both, 9)));
    {
        let mut gone = std::pin::pin!(create("gone"));
        // It is in the queue; the writer has had no turn on this one thread.
        assert!(futures::poll!(gone.as_mut()).is_pending());
    }
    create("next").await.unwrap();
    assert!(matches!(maps::get(store.reads(), "gone").await, Err(StoreError::NotFound { .. })));
}

#[tokio::test]
async fn what_follows_a_commit_does_not_wait_for_its_caller() {
    let dir = tempfile::tempdir().unwrap();
    let (store, _task) = Catalogue::open(&config(dir.path())).await.unwrap();
    let (begun, begins) = oneshot::channel();
    let (done, followed) = oneshot::channel();
    let (store_, go) = (store.clone(), Arc::new(tokio::sync::Notify::new()));
    let wait = go.clone();
    let caller = tokio::spawn(async move {
        let write = store_.write(move |tx| {
            Box::pin(async move {
                maps::create(tx, "a", DistanceKind::Both, 2).await?;
                begun.send(()).unwrap();
                wait.notified().await;
                tx.after(move || done.send(()).unwrap());
                Ok(())
            })
        });
        write.await
    });
    begins.await.unwrap();
    caller.abort();
    assert!(caller.await.unwrap_err().is_cancelled());
    go.notify_one();
    followed.await.unwrap();
    assert!(maps::get(store.reads(), "a").await.is_ok() && store.snapshots().get("a").is_some());
}

#[tokio::test]
async fn a_map_that_cannot_be_made_ready_keeps_its_version_and_stops_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let config = config(dir.path());
    let (store, task) = Catalogue::open(&config).await.unwrap();
    for map in ["a", "b"] {
        store.write(move |tx| Box::pin(maps::create(tx, map, DistanceKind::Both, 2))).await.unwrap();
    }
    let wall =
        |map: &'static str| store.write(move |tx| Box::pin(walls::replace(tx, map, &[[0.0, 0.0, 4.0, 0.0]])));
    planting::plant(Some("a"));
    let refused = wall("a").await;
    assert!(matches!(&refused, Err(StoreError::NotPublished { map }) if map == "a"), "{refused:?}");
    wall("b").await.unwrap();
    let versions = || ["a", "b"].map(|map| store.snapshots().get(map).map(|m| m.version));
    assert_eq!(versions(), [Some(1), Some(2)]);
    let named: Vec<_> = store.vitals().all_unpublished().into_keys().collect();
    assert_eq!((named, store.vitals().failure()), (vec!["a".to_owned()], None));
    assert_eq!(store.vitals().panics().at(Edge::Publication), 1);
    // The write stands, and the next one makes all of it visible.
    planting::plant(None);
    wall("a").await.unwrap();
    assert_eq!(versions(), [Some(3), Some(2)]);
    assert!(store.vitals().all_unpublished().is_empty());
    task.close().await;

    // A start with it is a start without that map.
    planting::plant(Some("a"));
    let (store, task) = Catalogue::open(&config).await.unwrap();
    assert!(store.snapshots().get("a").is_none() && store.snapshots().get("b").is_some());
    assert!(store.vitals().all_unpublished().contains_key("a"));
    store.write(|tx| Box::pin(maps::delete(tx, "a"))).await.unwrap();
    assert!(store.vitals().all_unpublished().is_empty());
    planting::plant(None);
    task.close().await;
}

#[tokio::test]
async fn a_model_that_cannot_be_read_is_quarantined_and_the_others_are_used() {
    use vision::model::LandmarkId;
    let dir = tempfile::tempdir().unwrap();
    let config = config(dir.path());
    let (store, task) = Catalogue::open(&config).await.unwrap();
    store.write(|tx| Box::pin(maps::create(tx, "a", DistanceKind::Both, 2))).await.unwrap();
    for name in ["sound", "bad"] {
        let none = landmarks::LandmarkGeometry::default();
        let made = store.write(move |tx| Box::pin(landmarks::create(tx, "a", name, none, 5))).await.unwrap();
        store_model(&store, made.id, &config.params).await;
    }
    task.close().await;
    planting::plant(Some("the model of landmark number 2"));
    let (store, _task) = Catalogue::open(&config).await.unwrap();
    planting::plant(None);
    let map = store.snapshots().get("a").unwrap();
    assert_eq!(map.learnt.keys().copied().collect::<Vec<_>>(), [LandmarkId(1)]);
    assert!(map.unusable_models[&LandmarkId(2)].contains("failed"), "{:?}", map.unusable_models);
    assert_eq!(store.vitals().panics().at(Edge::Publication), 1);
}

/// From now on no run can be stored.
pub(crate) async fn refuse_runs(store: &Catalogue) {
    let trigger = "CREATE TRIGGER refuse BEFORE INSERT ON runs BEGIN SELECT RAISE(ABORT, 'planted'); END";
    let write = store.write(move |tx| {
        Box::pin(async move {
            db::raw_sql(trigger).execute(tx.conn()).await.map(drop).map_err(StoreError::during("plant"))
        })
    });
    write.await.unwrap();
}
