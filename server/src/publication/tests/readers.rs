//! Readers beside the writer: each answer is that of one version, and no version is seen before it
//! is on the disk.

use super::{super::*, config};
use crate::store::{landmarks, maps, walls};
use engine::snapshot::MapSnapshot;
use sqlx::{ConnectOptions as _, sqlite::SqliteConnectOptions};
use std::{
    collections::BTreeMap,
    path::Path,
    sync::{
        Arc, Mutex,
        atomic::{AtomicBool, AtomicUsize, Ordering},
    },
};
use vision::{model::LandmarkId, recognise::DistanceKind};

const READERS: usize = 8;
const ANSWERS: usize = 100_000;
const WALLS: usize = 12;
/// Fewest changes while they read.
const CHANGES: i64 = 200;

/// What change `k` makes of wall `i`.
fn ends(k: i64, i: usize) -> walls::Ends {
    let (k, i) = (k as f64, i as f64);
    [i, k * 0.01, i + 0.5, k * 0.01 + 0.25]
}

fn geometry(k: i64) -> landmarks::LandmarkGeometry {
    landmarks::LandmarkGeometry {
        size: Some(vision::pose::LandmarkSize { width_m: 0.5, height_m: 0.5 }),
        place: Some(landmarks::StoredPlace {
            x_m: k as f64 * 0.01,
            y_m: 0.0,
            z_m: 1.5,
            theta_rad: 0.5,
            roll_rad: 0.0,
            tilt_rad: 0.0,
            covariance: None,
        }),
        size_from_views: false,
    }
}

/// An answer: a number that every part of the snapshot goes into.
fn answer<'a>(walls: impl Iterator<Item = walls::Ends> + 'a, landmark_x_m: f64) -> f64 {
    walls.flatten().enumerate().fold(landmark_x_m, |sum, (i, x)| sum + (i as f64 + 1.0) * x)
}

fn of_snapshot(map: &MapSnapshot, landmark: LandmarkId) -> f64 {
    let x_m = map.landmarks[&landmark].place.as_ref().map_or(f64::NAN, |place| place.x_m);
    answer(map.walls.iter().map(|w| [w.a.x, w.a.y, w.b.x, w.b.y]), x_m)
}

/// The version on the disk, by a connection that knows nothing of the server.
async fn durable_version(file: &Path) -> u64 {
    let options = SqliteConnectOptions::new().filename(file).read_only(true);
    let mut conn = options.connect().await.unwrap();
    let version: i64 =
        sqlx::query_scalar("SELECT version FROM maps WHERE name = 'a'").fetch_one(&mut conn).await.unwrap();
    version as u64
}

/// What the readers have seen.
#[derive(Default)]
struct Read {
    count: AtomicUsize,
    stop: AtomicBool,
    answers: Mutex<BTreeMap<u64, Vec<f64>>>,
}

/// Reads until it is told to stop. A version that is new to the reader is looked for on the disk at
/// once.
fn read(snapshots: &Snapshots, file: &Path, landmark: LandmarkId, to: &Read) {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
    let (mut last, mut own) = (0, BTreeMap::<u64, Vec<f64>>::new());
    while !to.stop.load(Ordering::Relaxed) {
        let map = snapshots.get("a").unwrap();
        assert!(map.version >= last, "version {} after {last}", map.version);
        if map.version > last {
            let durable = runtime.block_on(durable_version(file));
            assert!(durable >= map.version, "version {} is seen, {durable} is durable", map.version);
            last = map.version;
        }
        let seen = own.entry(map.version).or_default();
        let value = of_snapshot(&map, landmark);
        if !seen.iter().any(|known| known.to_bits() == value.to_bits()) {
            seen.push(value);
        }
        to.count.fetch_add(1, Ordering::Relaxed);
        std::thread::yield_now();
    }
    let mut all = to.answers.lock().unwrap();
    for (version, values) in own {
        all.entry(version).or_default().extend(values);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn each_of_many_answers_is_that_of_one_durable_version() {
    let dir = tempfile::tempdir().unwrap();
    let (store, _task) = Catalogue::open(&config(dir.path())).await.unwrap();
    store.write(|tx| Box::pin(maps::create(tx, "a", DistanceKind::Both, 2))).await.unwrap();
    let made = store.write(|tx| Box::pin(landmarks::create(tx, "a", "p", geometry(0), 5))).await.unwrap();
    let landmark = LandmarkId(made.id as u64);
    let mut history = BTreeMap::new();
    let told = |version: u64, k: i64, history: &mut BTreeMap<u64, f64>| {
        let walls = (0..if k == 0 { 0 } else { WALLS }).map(|i| ends(k, i));
        history.insert(version, answer(walls, k as f64 * 0.01));
    };
    told(store.snapshots().get("a").unwrap().version, 0, &mut history);
    let seen = Arc::<Read>::default();
    let readers: Vec<_> = (0..READERS)
        .map(|_| {
            let (snapshots, file, seen) =
                (store.snapshots().clone(), dir.path().join("waymark.sqlite"), seen.clone());
            std::thread::spawn(move || read(&snapshots, &file, landmark, &seen))
        })
        .collect();
    let mut k = 0;
    while (k < CHANGES || seen.count.load(Ordering::Relaxed) < ANSWERS)
        && readers.iter().all(|reader| !reader.is_finished())
    {
        k += 1;
        // Both in one transaction: no answer may have one of them alone.
        let write = store.write(move |tx| {
            Box::pin(async move {
                let all: Vec<_> = (0..WALLS).map(|i| ends(k, i)).collect();
                walls::replace(tx, "a", &all).await?;
                landmarks::update(tx, "a", "p", move |_| geometry(k)).await
            })
        });
        write.await.unwrap();
        let now = store.snapshots().get("a").unwrap();
        assert_eq!(of_snapshot(&now, landmark).to_bits(), {
            told(now.version, k, &mut history);
            history[&now.version].to_bits()
        });
    }
    seen.stop.store(true, Ordering::Relaxed);
    for reader in readers {
        reader.join().unwrap_or_else(|cause| std::panic::resume_unwind(cause));
    }
    assert!(seen.count.load(Ordering::Relaxed) >= ANSWERS);
    let answers = seen.answers.lock().unwrap();
    assert!(answers.len() > 20, "only {} versions were seen", answers.len());
    for (version, values) in &*answers {
        let right = history.get(version).unwrap_or_else(|| panic!("version {version} was never current"));
        assert!(
            values.iter().all(|value| value.to_bits() == right.to_bits()),
            "version {version}: {values:?} instead of {right}"
        );
    }
}
