//! The store under clients that repeat, hang up and edit the same things, with a server that is
//! stopped in between: the real store and publication, steps that follow from a seed, and a model
//! that says after each step what must be stored.
//!
//! `WAYMARK_SEED=n` runs one seed, `WAYMARK_SEEDS=n` so many. When a caller hangs up between two
//! polls, or a writer is ended, the moment depends on SQLite's thread: a seed repeats the steps,
//! not these moments. So some stops come from a disk that fails at a write of the log, which a seed
//! repeats: they fall into any of the commits that a creation has. Frames are simulated in
//! `engine/tests/simulation`.

use super::{super::*, config};
use crate::{
    config::Config,
    store::{
        StoreError,
        kept_answers::{Answer, Creation, answered},
        landmarks::{self, LandmarkRow},
        maps,
        revisions::{self, Precondition, Subject},
        walls,
    },
};
use power_cut::{Call, Disk, IoError, OfFile};
use std::{
    collections::{BTreeMap, BTreeSet},
    panic::AssertUnwindSafe,
    path::{Path, PathBuf},
    time::{Duration, Instant},
};
use tempfile::TempDir;
use vision::{random::Random, recognise::DistanceKind};

/// Seeds of a run.
const SEEDS: u64 = 40;
/// Steps of a seed.
const STEPS: usize = 60;
/// Names of landmarks, and keys of their creations.
const NAMES: usize = 30;
const EDITORS: usize = 2;
/// The disk fails at one of so many writes of the log: more than a creation has.
const LOG_WRITES: usize = 80;
/// Creations that are asked for until one meets the error.
const TRIES: usize = 20;

struct World {
    random: Random,
    disk: Disk,
    data: PathBuf,
    /// Removes the data.
    _folder: TempDir,
    store: Catalogue,
    tasks: Option<CatalogueTasks>,
    /// Landmarks whose creation was acknowledged.
    created: BTreeSet<String>,
    /// Creations whose outcome the client does not know.
    unknown: BTreeSet<String>,
    /// The number that the walls say, after the last acknowledged edit, and those of edits without
    /// an answer.
    walls: i64,
    maybe: BTreeSet<i64>,
    next: i64,
    /// What each editor has read last: revision, and number of the walls.
    read: [(String, i64); EDITORS],
    version: u64,
    /// How long the last creation took.
    write: Duration,
}

fn number_of(walls: &[map::segments::LaserSegment]) -> i64 {
    walls.first().map_or(0, |wall| wall.b.x.round() as i64)
}

/// The settings of a store over a disk that can fail.
fn over(data: &Path) -> Config {
    Config { vfs: Some(power_cut::NAME), ..config(data) }
}

impl World {
    async fn new(seed: u64) -> Self {
        // In memory where there is such a place: what a disk does is another test.
        let memory = Path::new("/dev/shm");
        let folder = if memory.is_dir() { TempDir::new_in(memory) } else { TempDir::new() }.unwrap();
        let data = folder.path().canonicalize().unwrap();
        let disk = Disk::of(&data).unwrap();
        let (store, tasks) = Catalogue::open(&over(&data)).await.unwrap();
        store.write(|tx| Box::pin(maps::create(tx, "a", DistanceKind::Both, 2))).await.unwrap();
        Self {
            random: Random::new(seed),
            disk,
            data,
            _folder: folder,
            store,
            tasks: Some(tasks),
            created: BTreeSet::new(),
            unknown: BTreeSet::new(),
            walls: 0,
            maybe: BTreeSet::new(),
            next: 0,
            read: Default::default(),
            version: 1,
            write: Duration::from_millis(1),
        }
    }

    fn below(&mut self, n: usize) -> usize {
        (self.random.unit() * n as f64) as usize % n
    }

    async fn step(&mut self) {
        match self.below(12) {
            0..5 => {
                let number = self.below(NAMES);
                self.create(number).await;
            }
            5 | 6 => self.look().await,
            7..10 => self.edit().await,
            10 => drop(self.hang_up().await),
            _ => {
                // Three of four stops hit a write, and who asked for it asks again.
                let asked = match self.below(4) {
                    0 => None,
                    1 => self.hang_up().await,
                    _ => self.fail_at_a_write_of_the_log().await,
                };
                self.restart().await;
                if let Some(number) = asked {
                    self.create(number).await;
                }
            }
        }
        self.check();
    }

    /// A client creates a landmark under its key, perhaps once more.
    async fn create(&mut self, number: usize) {
        let name = format!("l{number}");
        let (was_there, asked) = (self.created.contains(&name), Instant::now());
        match created(&self.store, &name).await {
            Ok(is_repeat) => {
                self.write = if is_repeat { self.write } else { asked.elapsed() };
                assert!(is_repeat || !was_there, "{name} was made a second time under its key");
                assert!(
                    !is_repeat || was_there || self.unknown.contains(&name),
                    "{name}: an answer to what was never asked"
                );
                self.unknown.remove(&name);
                self.created.insert(name);
            }
            Err(_) if self.disk.failed_calls() > 0 => self.may_be_there(&name),
            // Still at work: the request whose client hung up.
            Err(StoreError::KeyAtWork) => assert!(self.unknown.contains(&name), "{name}: its key is at work"),
            Err(error) => panic!("{name}: {error}"),
        }
    }

    /// Its client does not know whether it was made.
    fn may_be_there(&mut self, name: &str) {
        if !self.created.contains(name) {
            self.unknown.insert(name.to_owned());
        }
    }

    /// Creations until the disk has failed, at one of the next writes of the log; the one that met
    /// it.
    async fn fail_at_a_write_of_the_log(&mut self) -> Option<usize> {
        let number = 1 + self.below(LOG_WRITES) as u64;
        let error = IoError { call: Call::Write, file: OfFile::Log, number, is_lasting: true };
        self.disk.set_error(Some(error));
        for _ in 0..TRIES {
            let landmark = self.below(NAMES);
            self.create(landmark).await;
            if self.disk.failed_calls() > 0 {
                return Some(landmark);
            }
        }
        None
    }

    /// An editor reads the walls with their revision.
    async fn look(&mut self) {
        let editor = self.below(EDITORS);
        let revision = self.store.revision("a", &Subject::Walls).await.unwrap();
        let walls = number_of(&self.store.snapshots().get("a").unwrap().walls);
        self.read[editor] = (revision, walls);
    }

    /// An editor replaces what it has read.
    async fn edit(&mut self) {
        let editor = self.below(EDITORS);
        let (revision, had_read) = self.read[editor].clone();
        if revision.is_empty() {
            return;
        }
        let (is, k) = (Precondition::OneOf(vec![revision]), self.next + 1);
        self.next = k;
        match edited(&self.store, is, k).await {
            Ok(revision) => {
                let known = had_read == self.walls || self.maybe.contains(&had_read);
                assert!(known, "an edit of {had_read} has overwritten {}", self.walls);
                (self.walls, self.read[editor]) = (k, (revision, k));
                self.maybe.clear();
            }
            Err(StoreError::ChangedMeanwhile { .. }) => {}
            Err(error) => panic!("{error}"),
        }
    }

    /// A client asks and goes before the answer; what it wanted to create.
    async fn hang_up(&mut self) -> Option<usize> {
        let after = self.write.mul_f64(1.2 * self.random.unit());
        let store = self.store.clone();
        if self.below(2) == 0 {
            let number = self.below(NAMES);
            let name = format!("l{number}");
            self.may_be_there(&name);
            abandon(created(&store, &name), after).await;
            Some(number)
        } else {
            let revision = self.store.revision("a", &Subject::Walls).await.unwrap();
            let k = self.next + 1;
            self.next = k;
            self.maybe.insert(k);
            abandon(edited(&store, Precondition::OneOf(vec![revision]), k), after).await;
            None
        }
    }

    /// The server stops, in good order or not, and starts again on what is on the disk.
    async fn restart(&mut self) {
        let tasks = self.tasks.take().expect("a server");
        if self.below(2) == 0 {
            tasks.close().await;
        } else {
            tasks.abort_writer();
            drop(tasks);
        }
        self.disk.set_error(None);
        // The lock of the data directory goes with the writer's task.
        let mut tries = 0;
        let (store, tasks) = loop {
            match Catalogue::open(&over(&self.data)).await {
                Ok(opened) => break opened,
                Err(error) => {
                    tries += 1;
                    assert!(tries < 2000, "the server does not start again: {error}");
                    tokio::time::sleep(Duration::from_millis(5)).await;
                }
            }
        };
        (self.store, self.tasks) = (store, Some(tasks));
    }

    /// What was acknowledged is in the snapshot in use and on the disk; nothing is there that was
    /// not asked for.
    fn check(&mut self) {
        let map = self.store.snapshots().get("a").unwrap();
        assert!(map.version >= self.version, "version {} after {}", map.version, self.version);
        self.version = map.version;
        let shown: BTreeMap<&str, u32> = map.landmarks.values().fold(BTreeMap::new(), |mut names, l| {
            *names.entry(l.name.as_str()).or_default() += 1;
            names
        });
        for name in &self.created {
            assert_eq!(shown.get(name.as_str()), Some(&1), "{name} was acknowledged");
        }
        for (name, count) in shown {
            assert!(self.created.contains(name) || self.unknown.contains(name), "{name} was not asked for");
            assert_eq!(count, 1, "{name} is there twice");
        }
        let walls = number_of(&map.walls);
        assert!(
            walls == self.walls || self.maybe.contains(&walls),
            "the walls say {walls}; {} was acknowledged, without an answer are {:?}",
            self.walls,
            self.maybe
        );
    }
}

/// Creates a landmark under the key of its name; whether that was done before.
async fn created(store: &Catalogue, name: &str) -> Result<bool, StoreError> {
    let digest = std::array::from_fn(|i| name.as_bytes().get(i).copied().unwrap_or_default());
    let key = match store.creation(name, digest).await? {
        Creation::Repeat(answer) => {
            assert_eq!(answer.body, format!("\"{name}\""), "the answer of another creation");
            return Ok(true);
        }
        Creation::First(key) => key,
    };
    let (answer, new) = (|made: &LandmarkRow| Answer::json(201, &made.name), name.to_owned());
    let write = store.write(move |tx| {
        Box::pin(async move {
            landmarks::create(tx, "a", &new, landmarks::LandmarkGeometry::default(), NAMES + 1).await
        })
    });
    key.scope(answered(answer, write)).await.map(|_| false)
}

/// Makes the walls say `k`, if they are what the editor has read.
async fn edited(store: &Catalogue, is: Precondition, k: i64) -> Result<String, StoreError> {
    let write = store.write(move |tx| {
        Box::pin(async move {
            revisions::check(tx, "a", &Subject::Walls, &is).await?;
            walls::replace(tx, "a", &[[0.0, 0.0, k as f64, 0.0]]).await?;
            revisions::after(tx, "a", &Subject::Walls).await
        })
    });
    write.await
}

/// Asks, and goes after this time.
async fn abandon<T>(asked: impl Future<Output = T>, after: Duration) {
    let (mut asked, begun) = (Box::pin(asked), Instant::now());
    // A timer is late by more than a write takes.
    while begun.elapsed() < after && !futures::poll!(asked.as_mut()).is_ready() {
        tokio::task::yield_now().await;
    }
}

async fn run(seed: u64) {
    let mut world = World::new(seed).await;
    for _ in 0..STEPS {
        world.step().await;
    }
    world.restart().await;
    world.check();
}

fn number(name: &str) -> Option<u64> {
    std::env::var(name).ok().and_then(|text| text.parse().ok())
}

#[tokio::test(flavor = "multi_thread")]
async fn a_key_has_one_effect_and_no_update_is_lost_whatever_clients_and_stops_do() {
    power_cut::install();
    let seeds = match number("WAYMARK_SEED") {
        Some(seed) => seed..seed + 1,
        None => 0..number("WAYMARK_SEEDS").unwrap_or(SEEDS),
    };
    for seed in seeds {
        let ended = futures::FutureExt::catch_unwind(AssertUnwindSafe(run(seed))).await;
        assert!(
            ended.is_ok(),
            "seed {seed} failed: WAYMARK_SEED={seed} cargo test -p server --lib a_key_has_one_effect"
        );
    }
}
