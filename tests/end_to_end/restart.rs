//! Claim: killing and restarting the server at any time, also during a backup and while the
//! write-ahead log is moved into the file, loses no acknowledged change, makes none that nobody
//! asked for, and makes none twice under its key. The database stays whole (the server checks it at
//! each start), the audit log's chain holds, and robots are answered soon.

use client::{
    Capture, ClientError, LandmarkRegion, MapClient, NewView, RobotClient, RobotOptions,
    api::{BackupState, JobState, NewMap, UnderlayPlace},
};
use std::{
    collections::{BTreeMap, BTreeSet},
    sync::{Arc, Mutex, MutexGuard},
    time::{Duration, Instant, SystemTime, UNIX_EPOCH},
};
use tempfile::TempDir;
use tests::{Child, SOON, eventually, pictures};
use tokio::task::JoinHandle;
use vision::frame::GrayImage;

/// Kills in a run of all tests; `WAYMARK_KILLS` asks for another number.
const KILLS: u64 = 40;
/// A map has so many landmarks at most that its list stays short.
const KILLS_A_MAP: u64 = 10;
const TEACHERS: usize = 3;
const ROBOT: &str = "r1";
/// Far more than a start takes: how long it takes is printed, and measured elsewhere.
const LONGEST_START: Duration = Duration::from_secs(30);
/// Side of the floor plans that fill the write-ahead log: a picture of noise has as many bytes as
/// pixels.
const NOISE_PX: usize = 900;

/// What a client asks for, once under one key.
#[derive(Debug, Clone)]
enum What {
    Landmark,
    View { seed: u64 },
    Lesson,
}

/// A change that was asked for. Its key is its place in the journal.
#[derive(Debug, Clone)]
struct Asked {
    map: String,
    landmark: String,
    what: What,
    /// The number of what was made, once that was acknowledged; 0 where things have names.
    made: Option<i64>,
}

/// What clients have asked for and were told.
#[derive(Debug, Default)]
struct Journal {
    asked: Mutex<Vec<Asked>>,
    /// Newest acknowledged version of each map.
    versions: Mutex<BTreeMap<String, u64>>,
    seed: u64,
}

impl Journal {
    fn all(&self) -> MutexGuard<'_, Vec<Asked>> {
        self.asked.lock().expect("not poisoned")
    }

    /// What was asked for of this map: all of it, and what was not acknowledged.
    fn of(&self, map: &str) -> (Vec<Asked>, Vec<usize>) {
        let all = self.all();
        let of_map = || all.iter().enumerate().filter(|(_, asked)| asked.map == map);
        let open = of_map().filter(|(_, asked)| asked.made.is_none()).map(|(i, _)| i);
        (of_map().map(|(_, asked)| asked.clone()).collect(), open.collect())
    }

    /// Asks for it, under its key, and notes the answer.
    async fn send(&self, maps: &MapClient, index: usize) -> Result<(), ClientError> {
        let asked = self.all()[index].clone();
        let maps = maps.with_idempotency_key(&format!("{}-{index}", self.seed));
        let (map, name) = (&asked.map, &asked.landmark);
        let made = match asked.what {
            What::Landmark => maps.add_landmark(map, name, None, None).await.map(|_| 0)?,
            What::View { seed } => {
                let view = NewView::new(pictures::picture(seed), LandmarkRegion::WholeImage);
                maps.upload_view_with(map, name, view).await?.id
            }
            What::Lesson => maps.learn(map, Some(std::slice::from_ref(name)), Some(3)).await?.id,
        };
        self.all()[index].made = Some(made);
        Ok(())
    }

    async fn ask(&self, maps: &MapClient, map: &str, landmark: &str, what: What) -> Result<(), ClientError> {
        let index = {
            let mut all = self.all();
            all.push(Asked { map: map.to_owned(), landmark: landmark.to_owned(), what, made: None });
            all.len() - 1
        };
        self.send(maps, index).await
    }
}

/// Teaches one new landmark after another until the server is gone. The first of each teacher gets
/// a lesson.
async fn teach(
    maps: MapClient,
    (map, prefix): (String, String),
    journal: Arc<Journal>,
) -> Result<(), ClientError> {
    for number in 0_u64.. {
        let name = format!("{prefix}-{number}");
        journal.ask(&maps, &map, &name, What::Landmark).await?;
        for view in 0..2 {
            let seed = journal.all().len() as u64 * 2 + view;
            journal.ask(&maps, &map, &name, What::View { seed }).await?;
        }
        if number == 0 {
            journal.ask(&maps, &map, &name, What::Lesson).await?;
        }
        let version = maps.map(&map).await?.version;
        let mut versions = journal.versions.lock().expect("not poisoned");
        let newest = versions.entry(map.clone()).or_default();
        *newest = version.max(*newest);
    }
    Ok(())
}

/// Makes backups, one after another, until the server is gone.
async fn back_up(maps: MapClient) -> Result<(), ClientError> {
    loop {
        let made = maps.make_backup().await?;
        while maps.backup(&made.name).await?.state == BackupState::Running {
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
        maps.delete_backup(&made.name).await?;
    }
}

/// Writes so much that the write-ahead log is moved into the file all the time, until the server is
/// gone.
async fn fill(maps: MapClient, map: String) -> Result<(), ClientError> {
    for seed in 0.. {
        let noise = pictures::blocks(seed, NOISE_PX, NOISE_PX);
        let mut random = Random(seed);
        let noise: Vec<u8> = noise.iter().map(|grey| grey ^ random.next() as u8).collect();
        let place = UnderlayPlace { metres_per_pixel: 0.05, x_m: 0.0, y_m: 0.0, theta_rad: 0.0 };
        maps.set_underlay(&map, pictures::png(NOISE_PX, NOISE_PX, &noise), &place).await?;
    }
    Ok(())
}

/// `SplitMix64`.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^ (mixed >> 31)
    }
}

/// Names of the landmarks of a map, with the number of their views.
async fn stored(maps: &MapClient, map: &str) -> BTreeMap<String, u64> {
    let all = maps.landmarks(map).await.expect("landmarks");
    let there: BTreeMap<String, u64> = all.iter().map(|l| (l.name.clone(), l.views)).collect();
    assert_eq!(there.len(), all.len(), "a landmark is there twice");
    there
}

/// What a journal says of a map: landmarks with the numbers of asked and of acknowledged views.
fn expected(asked: &[Asked]) -> BTreeMap<&str, (bool, u64, u64)> {
    let mut all = BTreeMap::<&str, (bool, u64, u64)>::new();
    for Asked { landmark, what, made, .. } in asked {
        let (is_made, views, made_views) = all.entry(landmark).or_default();
        match what {
            What::Landmark => *is_made = made.is_some(),
            What::View { .. } => {
                (*views, *made_views) = (*views + 1, *made_views + u64::from(made.is_some()));
            }
            What::Lesson => {}
        }
    }
    all
}

/// Nothing acknowledged is lost and nothing is there that nobody asked for; then asks again for
/// what was not acknowledged, and everything is there once. How much of that had been made before.
async fn check(maps: &MapClient, map: &str, journal: &Journal) -> u64 {
    let (asked, open) = journal.of(map);
    let (there, said) = (stored(maps, map).await, expected(&asked));
    for (name, views) in &there {
        let (_, asked, _) = said.get(name.as_str()).unwrap_or_else(|| panic!("{name}: nobody asked for it"));
        assert!(views <= asked, "{name}: {views} views of {asked} that were asked for");
    }
    for (name, (is_made, _, made_views)) in &said {
        let views = there.get(*name);
        assert!(views.is_some() || !is_made, "{name} was acknowledged and is lost");
        assert!(views.unwrap_or(&0) >= made_views, "{name}: {views:?} of {made_views} acknowledged views");
    }
    let sum = |all: &BTreeMap<String, u64>| all.len() as u64 + all.values().sum::<u64>();
    let before = sum(&there);
    let acknowledged: u64 = said.values().map(|(is_made, _, views)| u64::from(*is_made) + views).sum();
    for index in open {
        journal.send(maps, index).await.expect("made once, under its key");
    }
    let (asked, _) = journal.of(map);
    let wanted: BTreeMap<String, u64> =
        expected(&asked).into_iter().map(|(name, (_, views, _))| (name.to_owned(), views)).collect();
    assert_eq!(stored(maps, map).await, wanted, "each once");
    let newest = journal.versions.lock().expect("not poisoned").get(map).copied().unwrap_or_default();
    assert!(maps.map(map).await.expect("map").version >= newest, "the version went back");
    before - acknowledged
}

/// Views and lessons have the numbers that were acknowledged, and there is no lesson beside those
/// that were asked for.
async fn check_numbers(maps: &MapClient, asked: &[Asked]) {
    let mut views = BTreeMap::<(&str, &str), BTreeSet<i64>>::new();
    let mut lessons = BTreeSet::new();
    for Asked { map, landmark, what, made } in asked {
        let made = made.expect("acknowledged by now");
        let is_new = match what {
            What::Landmark => true,
            What::View { .. } => views.entry((map, landmark)).or_default().insert(made),
            What::Lesson => lessons.insert(made),
        };
        assert!(is_new, "{landmark}: {made} was acknowledged for two changes");
    }
    for ((map, landmark), numbers) in views {
        let stored: BTreeSet<i64> =
            maps.views(map, landmark).await.expect("views").into_iter().map(|view| view.id).collect();
        assert_eq!(stored, numbers, "{landmark}");
    }
    let last = lessons.len() as i64;
    assert_eq!(lessons, (1..=last).collect(), "the numbers of jobs have no gap");
    assert!(maps.job(last + 1).await.is_err(), "a lesson that nobody asked for");
}

/// Starts the server, and asks for an answer to a frame. The time from the start to that.
async fn start(data: &TempDir, is_first: bool) -> (Child, Duration) {
    let started = Instant::now();
    // Lessons that kills interrupt wait.
    let server = Child::start_with(data.path(), &[("WAYMARK_LIMITS__JOBS", "1000")]);
    if is_first {
        return (server, Duration::ZERO);
    }
    let options = RobotOptions { timeout: SOON, ..RobotOptions::new(server.zenoh.clone(), "default", ROBOT) };
    let robot = RobotClient::connect(&options).await.expect("connected");
    let picture = || Capture::gray(&GrayImage::from_fn(64, 48, |u, _| u as u8));
    let answered = || async { robot.recognise("front", picture(), Duration::from_secs(1)).await.ok() };
    eventually("the first answer", answered).await;
    let took = started.elapsed();
    robot.close().await.expect("closed");
    (server, took)
}

fn kills() -> u64 {
    std::env::var("WAYMARK_KILLS").map_or(KILLS, |text| text.parse().expect("a number of kills"))
}

type Work = JoinHandle<Result<(), ClientError>>;

/// Teachers, and beside them, by the number of the kill, nobody, backups, or writes that fill the
/// write-ahead log.
fn work(server: &Child, map: &str, kill: u64, journal: &Arc<Journal>) -> Vec<Work> {
    let teach = |i: usize| {
        let place = (map.to_owned(), format!("l{kill}-{i}"));
        tokio::spawn(teach(server.maps(), place, journal.clone()))
    };
    let mut all: Vec<Work> = (0..TEACHERS).map(teach).collect();
    match kill % 3 {
        1 => all.push(tokio::spawn(back_up(server.maps()))),
        2 => all.push(tokio::spawn(fill(server.maps(), map.to_owned()))),
        _ => {}
    }
    all
}

#[tokio::test(flavor = "multi_thread")]
async fn nothing_acknowledged_is_lost_by_a_kill() {
    let (data, kills) = (TempDir::new().expect("a temporary directory"), kills());
    let now = SystemTime::now().duration_since(UNIX_EPOCH).expect("after 1970");
    let journal = Arc::new(Journal { seed: now.as_nanos() as u64, ..Journal::default() });
    let mut random = Random(journal.seed);
    println!("seed {}", journal.seed);
    let (mut longest, mut unacknowledged, mut repeated) = (Duration::ZERO, 0, 0);
    let (mut maps_made, mut map) = (Vec::new(), String::new());
    for kill in 0..=kills {
        let (server, took) = start(&data, kill == 0).await;
        longest = longest.max(took);
        let maps = server.maps();
        if kill > 0 {
            repeated += journal.of(&map).1.len();
            unacknowledged += check(&maps, &map, &journal).await;
            for left in maps.backups().await.expect("backups") {
                maps.delete_backup(&left.name).await.expect("deleted");
            }
        }
        if kill == kills {
            finish(&server, &maps_made, &journal).await;
            break;
        }
        if kill % KILLS_A_MAP == 0 {
            map = format!("hall-{}", kill / KILLS_A_MAP);
            maps.create_map(&NewMap::new(&map)).await.expect("map");
            maps.put_robot(ROBOT, &map).await.expect("robot");
            maps_made.push(map.clone());
        }
        let work = work(&server, &map, kill, &journal);
        tokio::time::sleep(Duration::from_millis(100 + random.next() % 1400)).await;
        server.kill();
        for work in work {
            let ended = work.await.expect("no panic").expect_err("the server was killed");
            assert!(!matches!(ended, ClientError::Refused { .. }), "refused instead of gone: {ended}");
        }
    }
    let changes = journal.all().len();
    // Rule of three: what was not seen in n trials is at 95 % rarer than 3 of n.
    let bound = 300.0 / kills as f64;
    println!(
        "{kills} kills, {changes} changes, {repeated} asked for again, of which {unacknowledged} had been made: none lost, \
         none twice, none beside them; with 95 % confidence, fewer than {bound:.1} % of kills lose one. First answer to a \
         frame at most {:.2} s after the start",
        longest.as_secs_f64()
    );
    assert!(changes as u64 > kills, "too little was taught: {changes} changes");
    assert!(longest < LONGEST_START, "the first answer came {longest:?} after the start");
}

/// Everything at once, at the end: all maps, numbers, lessons, the audit log, and the file as a
/// backup sees it.
async fn finish(server: &Child, all: &[String], journal: &Journal) {
    let maps = server.maps();
    for map in all {
        assert_eq!(check(&maps, map, journal).await, 0, "{map} has changed since");
    }
    let asked = journal.all().clone();
    check_numbers(&maps, &asked).await;
    // Interrupted jobs were resumed: every accepted lesson ends, and its landmark has a model.
    for Asked { map, landmark, made, .. } in asked.iter().filter(|asked| matches!(asked.what, What::Lesson)) {
        let job = maps.job(made.expect("acknowledged")).await.expect("job");
        let job = maps.wait_for_job(job, 3 * SOON, |_| {}).await.expect("the job ends");
        assert_eq!(job.state, JobState::Done, "{job:?}");
        assert!(maps.landmark(map, landmark).await.expect("landmark").model.is_some(), "{landmark}");
    }
    let audit = maps.check_audit(None).await.expect("the audit log");
    assert!(audit.fault.is_none(), "{audit:?}");
    // A backup is made of a file that is examined as a whole.
    let made = maps.make_backup().await.expect("a backup");
    let done = || async {
        let backup = maps.backup(&made.name).await.expect("the backup");
        (backup.state != BackupState::Running).then_some(backup)
    };
    let backup = eventually("the backup", done).await;
    assert_eq!(backup.state, BackupState::Complete, "{backup:?}");
    let manifest = backup.manifest.expect("its manifest");
    assert!(manifest.faults.is_empty(), "{manifest:?}");
}
