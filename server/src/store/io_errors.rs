//! Claim: an error of the disk ends the store. No change is acknowledged that a power cut could
//! take back, and the next start finds all that was acknowledged, and nothing beside it. The writer
//! runs over a layer below SQLite whose calls fail (`power_cut`): writes, syncs and truncations of
//! the database and of its log, once or from then on.

use super::{
    db, landmarks,
    open::{FILE, OpenError},
    power_cuts::{self, StoredState, folder, found, name, template},
    writer,
};
use crate::{
    config::Config,
    publication::{Catalogue, CatalogueTasks, tests::config},
};
use futures::FutureExt as _;
use power_cut::{Call, Disk, IoError, OfFile, Random};
use sqlx::{ConnectOptions as _, Connection as _, sqlite::SqliteConnectOptions};
use std::{fs, path::Path, time::Duration};

/// Numbers of calls that fail, of each kind, in each run of the tests and in the long one
/// (`WAYMARK_LONG=1`).
const NUMBERS: u64 = 10;
const LONG_NUMBERS: u64 = 60;
/// Calls at the start of a server, or at its stop, that fail.
const START_NUMBERS: u64 = 8;
/// Writes in which the call comes.
const MOST_WRITES: u64 = 2_000;
/// Writes after the first error, and after the next start.
const MORE_WRITES: u64 = 10;
/// For busy machines.
const SOON: Duration = Duration::from_mins(1);

const KINDS: [(Call, OfFile); 5] = [
    (Call::Write, OfFile::Log),
    (Call::Sync, OfFile::Log),
    (Call::Write, OfFile::Database),
    (Call::Sync, OfFile::Database),
    (Call::Truncate, OfFile::Database),
];

/// Errors of all kinds. Writes are many in a commit: squares of the numbers fall into more commits.
fn errors(numbers: u64) -> impl Iterator<Item = IoError> {
    let of = move |(call, file)| {
        (1..=numbers).flat_map(move |number| {
            let number = if call == Call::Write { number * number } else { number };
            [false, true].map(|is_lasting| IoError { call, file, number, is_lasting })
        })
    };
    KINDS.into_iter().flat_map(of)
}

async fn open(disk: &Path) -> Result<(Catalogue, CatalogueTasks), OpenError> {
    let over = Config { vfs: Some(power_cut::NAME), ..config(&disk.canonicalize().unwrap()) };
    let over = Config { log_pages: Some(power_cuts::LOG_PAGES), ..over };
    Catalogue::open(&over).await
}

/// Makes the next landmark.
async fn write(store: &Catalogue, number: u64) -> Result<(), super::StoreError> {
    let (name, new) = (name(number), landmarks::LandmarkGeometry::default());
    let create =
        store.write(move |tx| async move { landmarks::create(tx, "hall", &name, new, 9_000).await }.boxed());
    create.await.map(drop)
}

/// What the disk holds if the power is cut now.
async fn found_after_cut(disk: &Disk, seed: u64, what: &str) -> StoredState {
    let dir = folder();
    disk.after_cut(dir.path(), &mut Random::new(seed)).unwrap();
    found(dir.path(), what).await
}

/// One error while the store works. How many writes were acknowledged.
async fn fail(template: &Path, error: IoError, seed: u64) -> u64 {
    let (what, dir) = (format!("{error:?}"), folder());
    fs::copy(template.join(FILE), dir.path().join(FILE)).unwrap();
    let disk = Disk::of(dir.path()).unwrap();
    let (store, task) = open(dir.path()).await.unwrap();
    disk.set_error(Some(error));
    let mut acknowledged = 0;
    while acknowledged < MOST_WRITES {
        if let Err(error) = write(&store, acknowledged).await {
            assert!(disk.failed_calls() > 0, "{what}: {error} without an error of the disk");
            break;
        }
        acknowledged += 1;
    }
    assert!(disk.failed_calls() > 0, "{what}: it did not come");
    // The store has ended, and says why.
    let failure = tokio::time::timeout(SOON, store.vitals().failed()).await;
    let failure = failure.unwrap_or_else(|_| panic!("{what}: the store goes on"));
    assert_eq!(failure.part, writer::PART, "{what}");
    assert!(failure.reason.contains("disk I/O error"), "{what}: {failure}");
    assert!(write(&store, acknowledged).await.is_err(), "{what}: acknowledged after the error");

    let published = store.snapshots().get("hall").unwrap().version;
    let is_in = |found: &StoredState, when: &str| {
        let range = acknowledged..=acknowledged + 1;
        assert!(range.contains(&found.landmarks), "{what}: {} of {acknowledged} {when}", found.landmarks);
        assert!(found.version >= published, "{what}: version {} of {published} {when}", found.version);
    };
    is_in(&found_after_cut(&disk, seed, &what).await, "after a power cut");
    let killed = folder();
    let left = disk.after_kill(killed.path()).unwrap();
    tokio::time::timeout(SOON, task.close()).await.unwrap_or_else(|_| panic!("{what}: no end"));
    drop(disk);
    is_in(&found(dir.path(), &what).await, "after a clean end");
    restart(&left, killed.path(), error, (seed, &is_in)).await;
    acknowledged
}

/// The start after a kill. What it finds is on the disk for certain, for it is matched, and what is
/// written next rests on it.
async fn restart(
    left: &Disk,
    dir: &Path,
    error: IoError,
    (seed, is_in): (u64, &impl Fn(&StoredState, &str)),
) {
    let what = format!("{error:?}, started again");
    if error.is_lasting {
        left.set_error(Some(IoError { number: 1, ..error }));
        // With an error or without one, but in good order.
        if let Ok((_, task)) = open(dir).await {
            task.close().await;
        }
        left.set_error(None);
    }
    let (store, task) = open(dir).await.unwrap_or_else(|e| panic!("{what}: {e}"));
    let names = db::query_scalar::<i64>("SELECT count(*) FROM landmarks");
    let landmarks = names.fetch_one(store.reads()).await.unwrap() as u64;
    let version = store.snapshots().get("hall").unwrap().version;
    is_in(&StoredState { landmarks, version }, "after a kill");
    let cut = found_after_cut(left, seed, &what).await;
    assert!(cut.landmarks >= landmarks, "{what}: {} of {landmarks} that are matched", cut.landmarks);
    for more in 0..MORE_WRITES {
        write(&store, landmarks + more).await.unwrap_or_else(|e| panic!("{what}: {e}"));
    }
    let cut = found_after_cut(left, seed, &what).await;
    assert_eq!(cut.landmarks, landmarks + MORE_WRITES, "{what}: after a power cut");
    task.close().await;
}

#[tokio::test]
async fn no_change_is_acknowledged_after_an_error_of_the_disk_and_the_next_start_finds_all() {
    power_cut::install();
    let is_long = std::env::var_os("WAYMARK_LONG").is_some();
    let (template, mut count, mut acknowledged) = (template().await, 0, 0);
    for (seed, error) in errors(if is_long { LONG_NUMBERS } else { NUMBERS }).enumerate() {
        acknowledged += fail(template.path(), error, seed as u64).await;
        count += 1;
    }
    eprintln!("{count} errors of the disk: {acknowledged} acknowledged, none lost, none beside them");
}

/// A change by another program: the next start writes a commit of the history for it.
async fn change_from_outside(data: &Path) {
    let file = SqliteConnectOptions::new().filename(data.canonicalize().unwrap().join(FILE));
    let mut other = file.vfs(power_cut::NAME).connect().await.unwrap();
    let measure = sqlx::query("UPDATE landmarks SET width_m = 0.5, height_m = 0.5 WHERE name = ?");
    assert_eq!(measure.bind(name(0)).execute(&mut other).await.unwrap().rows_affected(), 1);
    other.close().await.unwrap();
}

#[tokio::test]
async fn an_error_of_the_disk_at_start_or_stop_loses_nothing() {
    power_cut::install();
    let (template, dir) = (template().await, folder());
    fs::copy(template.path().join(FILE), dir.path().join(FILE)).unwrap();
    let disk = Disk::of(dir.path()).unwrap();
    let (store, task) = open(dir.path()).await.unwrap();
    for number in 0..MORE_WRITES {
        write(&store, number).await.unwrap();
    }
    change_from_outside(dir.path()).await;
    let (mut came, mut refused, mut count) = (0, 0, 0);
    for (seed, error) in errors(START_NUMBERS).enumerate() {
        let (what, killed) = (format!("{error:?} at start or stop"), folder());
        let left = disk.after_kill(killed.path()).unwrap();
        left.set_error(Some(error));
        match open(killed.path()).await {
            Ok((_, task)) => task.close().await,
            Err(error) => {
                assert!(!error.to_string().is_empty(), "{what}");
                refused += 1;
            }
        }
        came += u64::from(left.failed_calls() > 0);
        assert_eq!(found_after_cut(&left, seed as u64, &what).await.landmarks, MORE_WRITES, "{what}");
        left.set_error(None);
        let (_, task) = open(killed.path()).await.unwrap_or_else(|e| panic!("{what}, and again: {e}"));
        task.close().await;
        assert_eq!(found(killed.path(), &what).await.landmarks, MORE_WRITES, "{what}");
        count += 1;
    }
    eprintln!("{count} errors at start or stop, {came} came, {refused} starts were refused: nothing is lost");
    assert!(refused > 0 && came > refused, "{came} came, {refused} starts were refused");
    task.close().await;
}
