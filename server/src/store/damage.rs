//! Claim: a damaged file is refused with the reason, or what is damaged of it is named and not
//! used. Bytes are flipped, pages zeroed and files cut off, in the database and in the write-ahead
//! log, by fixed seeds.

use super::{StoreError, landmarks, maps, open::FILE, pictures, teaching, views::NewView};
use crate::{
    backup::{Backups, StoppedServer, verify},
    publication::{
        Catalogue,
        tests::{config, store_model},
    },
    store::{copies, landmark_placement::tests::seen_from, teaching::Teaching},
};
use engine::panics::Edge;
use futures::FutureExt as _;
use power_cut::Random;
use std::{collections::BTreeMap, fs, panic::AssertUnwindSafe, path::Path};
use tempfile::TempDir;
use tokio::sync::watch;
use vision::{model::LandmarkId, recognise::DistanceKind};

/// Damages in each run of the tests, and in the long one (`WAYMARK_LONG=1`).
const DAMAGES: u64 = 30;
const LONG_DAMAGES: u64 = 200;
const LANDMARKS: usize = 12;
const PAGE: u64 = 4096;
const LOG: &str = "waymark.sqlite-wal";

/// A sound data directory, as a kill leaves it: with a log that holds the newest changes.
struct Sound {
    dir: TempDir,
    /// Digests of the models, by landmark.
    models: BTreeMap<LandmarkId, [u8; 32]>,
    pictures: BTreeMap<[u8; 32], Vec<u8>>,
    contents: copies::Contents,
    backup: std::path::PathBuf,
}

async fn sound() -> Sound {
    let (made, dir) = (TempDir::new().unwrap(), TempDir::new().unwrap());
    let settings = config(made.path());
    let (store, task) = Catalogue::open(&settings).await.unwrap();
    store.write(|tx| Box::pin(maps::create(tx, "a", DistanceKind::Both, 2))).await.unwrap();
    let mut pictures = BTreeMap::new();
    for number in 0..LANDMARKS {
        let (name, none) = (format!("l{number:02}"), landmarks::LandmarkGeometry::default());
        let create = name.clone();
        let write = store
            .write(move |tx| Box::pin(async move { landmarks::create(tx, "a", &create, none, 99).await }));
        let id = write.await.unwrap().id;
        let mut random = Random::new(number as u64);
        let image: Vec<u8> = (0..9_000).map(|_| random.next_u64() as u8).collect();
        let image_sha256 = pictures::digest(&image);
        pictures.insert(image_sha256, image.clone());
        let view = NewView { image_sha256, image, capture: None, ..seen_from(1.0, 1, 0.0) };
        let (map, landmark) = ("a".to_owned(), name);
        let teaching = Teaching { map, landmark, view, max: 9, novelty: None, size: None, create: None };
        teaching::add(&store, teaching).await.unwrap();
        store_model(&store, id, &settings.params).await;
    }
    let map = store.snapshots().get("a").unwrap();
    let models: BTreeMap<_, _> = map.learnt.iter().map(|(id, model)| (*id, model.digest)).collect();
    assert_eq!(models.len(), LANDMARKS);
    let contents = copies::contents(&mut store.reads().acquire().await.unwrap()).await.unwrap();
    let (_stop, stopping) = watch::channel(false);
    let (backups, _timetable) = Backups::start(&settings, Default::default(), stopping);
    let (begun, making) = backups.begin().unwrap();
    making.await.unwrap();
    let backup = dir.path().join("backup.waymark");
    fs::copy(backups.file(&begun.name).unwrap(), &backup).unwrap();
    for file in [FILE, LOG] {
        fs::copy(made.path().join(file), dir.path().join(file)).unwrap();
    }
    task.close().await;
    assert!(fs::metadata(dir.path().join(LOG)).unwrap().len() > 10 * PAGE);
    // The same with everything moved into the file, as after a clean stop.
    fs::copy(made.path().join(FILE), dir.path().join("clean")).unwrap();
    Sound { dir, models, pictures, contents, backup }
}

/// Damages a copy of the sound directory; says how.
fn damaged(sound: &Sound, to: &Path, random: &mut Random) -> String {
    let is_log = random.below(3) == 0;
    let source = if is_log { FILE } else { "clean" };
    fs::copy(sound.dir.path().join(source), to.join(FILE)).unwrap();
    let (file, head) = if is_log { (LOG, 32) } else { (FILE, 0) };
    if is_log {
        fs::copy(sound.dir.path().join(LOG), to.join(LOG)).unwrap();
    }
    let mut bytes = fs::read(to.join(file)).unwrap();
    let len = bytes.len() as u64;
    // A frame of the log is a page with a head of 24 bytes.
    let page_bytes = if is_log { PAGE + 24 } else { PAGE };
    let page = random.below((len - head) / page_bytes);
    let at = (head + page * page_bytes) as usize;
    let end = (at + page_bytes as usize).min(bytes.len());
    let how = match random.below(3) {
        0 => {
            let byte = at + random.below((end - at) as u64) as usize;
            bytes[byte] ^= 1 << random.below(8);
            "one bit of"
        }
        1 => {
            bytes[at..end].fill(0);
            "zeros in"
        }
        _ => {
            bytes.truncate(at + random.below((end - at) as u64) as usize);
            "cut off in"
        }
    };
    fs::write(to.join(file), bytes).unwrap();
    format!("{how} page {page} of {file}")
}

#[derive(Debug, PartialEq, Eq, Clone, Copy)]
enum Outcome {
    /// The start says why not.
    Refused,
    /// It runs, and what is damaged is named.
    Named,
    /// It runs, and nothing that is used is damaged.
    Whole,
}

/// Starts on a damaged directory. Nothing that is damaged is used without being named.
async fn started(sound: &Sound, data: &Path, what: &str) -> Outcome {
    let settings = config(data);
    let opening = AssertUnwindSafe(Catalogue::open(&settings)).catch_unwind();
    let (store, task) = match opening.await.unwrap_or_else(|_panic| panic!("{what}: a panic")) {
        Ok(opened) => opened,
        Err(error) => {
            assert!(!error.to_string().is_empty(), "{what}");
            return Outcome::Refused;
        }
    };
    let mut is_named = !store.vitals().all_unpublished().is_empty();
    for map in store.snapshots().all() {
        for (id, model) in &map.learnt {
            assert_eq!(sound.models.get(id), Some(&model.digest), "{what}: a damaged model is matched");
        }
        is_named |= !map.unusable_models.is_empty();
    }
    for (sha256, image) in &sound.pictures {
        match pictures::read(&store, sha256).await {
            Ok(bytes) => assert_eq!(bytes, *image, "{what}: a damaged picture is used"),
            Err(StoreError::NotFound { .. }) => {}
            Err(_damaged) => is_named = true,
        }
    }
    for edge in Edge::ALL {
        assert_eq!(store.vitals().panics().at(edge), 0, "{what}: a panic in {}", edge.name());
    }
    task.close().await;
    if is_named { Outcome::Named } else { Outcome::Whole }
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_damaged_of_a_file_is_refused_or_named_and_never_used() {
    let sound = sound().await;
    assert_eq!(started(&sound, &copied(&sound), "nothing").await, Outcome::Whole);
    let count = if std::env::var_os("WAYMARK_LONG").is_some() { LONG_DAMAGES } else { DAMAGES };
    let mut outcomes: Vec<Outcome> = Vec::new();
    for seed in 0..count {
        let dir = TempDir::new().unwrap();
        let what = format!("seed {seed}: {}", damaged(&sound, dir.path(), &mut Random::new(seed)));
        outcomes.push(started(&sound, dir.path(), &what).await);
        if seed % 10 == 0 {
            restored(&sound, dir.path(), &what).await;
        }
    }
    let of = |outcome| outcomes.iter().filter(|o| **o == outcome).count();
    let (refused, named, whole) = (of(Outcome::Refused), of(Outcome::Named), of(Outcome::Whole));
    eprintln!(
        "{count} damages (seeds 0 to {}): {refused} refused, {named} named, {whole} in what is not used or in the end of a log; \
         at most {:.1} % go unseen at 95 %",
        count - 1,
        300.0 / count as f64
    );
    assert!(refused > 0 && named > 0, "{outcomes:?}");
}

/// The sound directory as it is.
fn copied(sound: &Sound) -> std::path::PathBuf {
    let to = sound.dir.path().join("copied");
    fs::create_dir(&to).unwrap();
    fs::copy(sound.dir.path().join("clean"), to.join(FILE)).unwrap();
    to
}

/// The backup in the place of damaged data gives the maps as they were.
async fn restored(sound: &Sound, data: &Path, what: &str) {
    let verified = verify(&sound.backup).await.unwrap();
    StoppedServer::of(data).unwrap().restore(&verified).unwrap();
    let (store, task) = Catalogue::open(&config(data)).await.unwrap_or_else(|e| panic!("{what}: {e}"));
    let contents = copies::contents(&mut store.reads().acquire().await.unwrap()).await.unwrap();
    assert_eq!(contents.maps, sound.contents.maps, "{what}");
    task.close().await;
}
