//! Claim: what was acknowledged survives a power cut. The writer runs over a layer below SQLite
//! that loses what was not synced (`power_cut`); the cut falls into commits and into checkpoints. A
//! self-check shows that the same test finds a setting that loses commits.

use super::{db, landmarks, maps};
use crate::{config::Config, publication::Catalogue, publication::tests::config};
use futures::FutureExt as _;
use power_cut::{Disk, Random};
use std::{fs, path::Path};
use tempfile::TempDir;
use vision::recognise::DistanceKind;

/// Cuts in each run of the tests, and in the long one (`WAYMARK_LONG=1`).
const CUTS: u64 = 300;
const LONG_CUTS: u64 = 5_000;
/// Cuts of the self-check.
const CHECKS: u64 = 60;
/// Pages after which the log is moved into the file: often, so that cuts fall into it.
pub(super) const LOG_PAGES: i64 = 40;
/// Latest call that is cut.
const LATEST: u64 = 600;

/// What one cut has shown.
#[derive(Debug, Default, Clone, Copy)]
struct Outcome {
    acknowledged: u64,
    lost: u64,
    /// Versions of the map that were published, and are not on the disk.
    unpublished: u64,
    in_checkpoint: bool,
}

/// A directory in memory where the system has one: the layer below decides what is on the disk, and
/// nothing is synced.
pub(super) fn folder() -> TempDir {
    let memory = Path::new("/dev/shm");
    if memory.is_dir() { TempDir::new_in(memory).unwrap() } else { TempDir::new().unwrap() }
}

/// A database with one map.
pub(super) async fn template() -> TempDir {
    let dir = folder();
    let (store, task) = Catalogue::open(&config(dir.path())).await.unwrap();
    store.write(|tx| Box::pin(maps::create(tx, "hall", DistanceKind::Both, 2))).await.unwrap();
    task.close().await;
    dir
}

pub(super) fn name(number: u64) -> String {
    format!("l{number:05}")
}

/// Statements outside of a transaction, on the writer's connection.
async fn set(store: &Catalogue, sql: String) {
    let set = store.write(move |tx| {
        Box::pin(async move {
            let sql = format!("COMMIT; {sql}; BEGIN IMMEDIATE");
            db::raw_sql(db::AssertSqlSafe(sql)).execute(tx.conn()).await.expect("settings");
            Ok(())
        })
    });
    set.await.unwrap();
}

/// One cut: writes until the power is gone, then looks at what a disk may hold.
async fn cut(template: &Path, seed: u64, synchronous: Option<&str>) -> Outcome {
    let mut random = Random::new(seed);
    let (before, after) = (folder(), folder());
    fs::copy(template.join(super::open::FILE), before.path().join(super::open::FILE)).unwrap();
    let disk = Disk::of(before.path()).unwrap();
    let over = Config { vfs: Some(power_cut::NAME), ..config(&before.path().canonicalize().unwrap()) };
    let over = Config { log_pages: Some(LOG_PAGES), ..over };
    let (store, task) = Catalogue::open(&over).await.unwrap();
    if let Some(level) = synchronous {
        set(&store, format!("PRAGMA synchronous = {level}")).await;
    }
    disk.cut_after(random.below(LATEST));
    let mut acknowledged = 0;
    loop {
        let name = name(acknowledged);
        let new = landmarks::LandmarkGeometry::default();
        let write = store
            .write(move |tx| async move { landmarks::create(tx, "hall", &name, new, 2_000).await }.boxed());
        match write.await {
            Ok(_) => acknowledged += 1,
            Err(error) => {
                assert!(disk.cut_in().is_some(), "seed {seed}: {error} without a cut");
                break;
            }
        }
    }
    let published = store.snapshots().get("hall").unwrap().version;
    task.close().await;
    disk.after_cut(after.path(), &mut random).unwrap();
    let in_checkpoint = disk.cut_in().is_some_and(|file| file == super::open::FILE);
    let found = found(after.path(), &format!("seed {seed}")).await;
    assert!(found.landmarks <= acknowledged + 1, "seed {seed}: more than was asked for");
    Outcome {
        acknowledged,
        lost: acknowledged.saturating_sub(found.landmarks),
        unpublished: published.saturating_sub(found.version),
        in_checkpoint,
    }
}

/// What the next start finds.
#[derive(Debug, Clone, Copy)]
pub(super) struct StoredState {
    pub(super) landmarks: u64,
    pub(super) version: u64,
}

/// Starts on what the disk holds: everything is whole, and numbers have no gap.
pub(super) async fn found(data: &Path, what: &str) -> StoredState {
    let (store, task) = Catalogue::open(&config(data)).await.unwrap_or_else(|e| panic!("{what}: {e}"));
    let version = store.snapshots().get("hall").unwrap_or_else(|| panic!("{what}: no map")).version;
    let rows = db::query_as::<(i64, String)>("SELECT id, name FROM landmarks ORDER BY name");
    let rows = rows.fetch_all(store.reads()).await.unwrap();
    let names: Vec<String> = rows.iter().map(|(_, name)| name.clone()).collect();
    assert_eq!(names, (0..names.len() as u64).map(name).collect::<Vec<_>>(), "{what}: a gap");
    let ids: Vec<i64> = rows.iter().map(|(id, _)| *id).collect();
    assert!(
        ids.iter().zip(ids.first().copied().unwrap_or_default()..).all(|(id, wanted)| *id == wanted),
        "{what}: {ids:?}"
    );
    task.close().await;
    let mut conn = super::copies::open_live(&data.join(super::open::FILE)).await.unwrap();
    let said: String = db::query_scalar("PRAGMA integrity_check").fetch_one(&mut conn).await.unwrap();
    assert_eq!(said, "ok", "{what}");
    conn.close().await.unwrap();
    StoredState { landmarks: names.len() as u64, version }
}

async fn cuts(count: u64, synchronous: Option<&str>) -> Vec<Outcome> {
    power_cut::install();
    let template = template().await;
    let mut outcomes = Vec::new();
    for seed in 0..count {
        outcomes.push(cut(template.path(), seed, synchronous).await);
    }
    outcomes
}

#[tokio::test]
async fn what_is_acknowledged_survives_a_power_cut() {
    let is_long = std::env::var_os("WAYMARK_LONG").is_some();
    let count = if is_long { LONG_CUTS } else { CUTS };
    let outcomes = cuts(count, None).await;
    let sum = |of: fn(&Outcome) -> u64| outcomes.iter().map(of).sum::<u64>();
    let (acknowledged, lost) = (sum(|o| o.acknowledged), sum(|o| o.lost));
    let in_checkpoint = outcomes.iter().filter(|o| o.in_checkpoint).count() as u64;
    // Rule of three: with no loss in n cuts, fewer than 3 / n of all cuts lose something, at 95 %
    // confidence.
    eprintln!(
        "{count} power cuts (seeds 0 to {}), {in_checkpoint} in a checkpoint: {acknowledged} acknowledged, {lost} lost; at most \
         {:.2} % of cuts at 95 %",
        count - 1,
        300.0 / count as f64
    );
    let of = |seed: usize| (seed, outcomes[seed]);
    let bad: Vec<_> = (0..outcomes.len()).map(of).filter(|(_, o)| o.lost > 0 || o.unpublished > 0).collect();
    assert!(bad.is_empty(), "by seed: {bad:?}");
    assert!(acknowledged > 3 * count, "too little was written: {acknowledged}");
    assert!(in_checkpoint > count / 20, "too few cuts fell into a checkpoint: {in_checkpoint}");
}

/// The test of the test: a process that is killed loses nothing with this setting, a power cut
/// does.
#[tokio::test]
async fn the_power_cuts_find_a_setting_that_loses_commits() {
    let outcomes = cuts(CHECKS, Some("NORMAL")).await;
    let losing = outcomes.iter().filter(|o| o.lost > 0).count() as u64;
    eprintln!("synchronous = NORMAL: {losing} of {CHECKS} cuts lose what was acknowledged");
    assert!(losing > CHECKS / 2, "{losing} of {CHECKS}");
}
