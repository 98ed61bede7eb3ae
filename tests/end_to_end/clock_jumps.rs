//! Claim: when the server's clock jumps, before or during a run, nothing is lost, frames keep their
//! order, tokens follow the clock, and no timer fires again and again. By libfaketime, which
//! changes the time of day and leaves the monotonic clock.

use client::{
    Capture, LandmarkRegion,
    api::{JobState, NewMap, NewToken, Role},
};
use std::{
    fs,
    path::{Path, PathBuf},
    time::Duration,
};
use tempfile::TempDir;
use tests::{Child, SOON, eventually, pictures, robots::connect, skipped};
use vision::frame::GrayImage;

const MAP: &str = "hall";
/// How far the clock is off, one after the other: half of them while the server runs, half over a
/// restart.
const JUMPS: [&str; 6] = ["+3600s", "-1d", "+10y", "+0s", "-1d", "+3600s"];
/// Backups are due every hour, so that a jump makes one due.
const EVERY_HOURS: &str = "1";

/// The library, where Debian has it.
fn library() -> Option<PathBuf> {
    let libs = Path::new("/usr/lib");
    let places = fs::read_dir(libs).ok()?.filter_map(|entry| entry.ok().map(|entry| entry.path()));
    places.map(|place| place.join("faketime/libfaketime.so.1")).find(|path| path.exists())
}

/// The server, with the clock that the file says.
fn start(data: &Path, clock: &Path, library: &Path) -> Child {
    let mut command = Child::command(data, &[("WAYMARK_BACKUP__EVERY_HOURS", EVERY_HOURS)]);
    command
        .env("LD_PRELOAD", library)
        .env("FAKETIME_TIMESTAMP_FILE", clock)
        .env("FAKETIME_NO_CACHE", "1")
        .env("FAKETIME_DONT_FAKE_MONOTONIC", "1");
    Child::start_from(&mut command)
}

fn set(clock: &Path, to: &str) {
    // In one step: the server may read at any time.
    let new = clock.with_extension("new");
    fs::write(&new, format!("{to}\n")).expect("written");
    fs::rename(new, clock).expect("renamed");
}

/// One landmark is taught to its end.
async fn teach(server: &Child, number: u64) {
    let (maps, name) = (server.maps(), format!("l{number}"));
    maps.add_landmark(MAP, &name, None, None).await.expect("landmark");
    for seed in [2 * number, 2 * number + 1] {
        maps.upload_view(MAP, &name, pictures::picture(seed), LandmarkRegion::WholeImage)
            .await
            .expect("view");
    }
    let job = maps.learn(MAP, Some(std::slice::from_ref(&name)), Some(3)).await.expect("job");
    let state = eventually("the lesson ends", || async {
        let state = maps.job(job.id).await.expect("job").state;
        (!matches!(state, JobState::Queued | JobState::Running)).then_some(state)
    })
    .await;
    assert_eq!(state, JobState::Done);
}

/// All that was taught is there, and the version has not gone back.
async fn check(server: &Child, taught: u64, version: &mut u64) {
    let maps = server.maps();
    let mut names: Vec<String> =
        maps.landmarks(MAP).await.expect("landmarks").into_iter().map(|l| l.name).collect();
    names.sort();
    let mut expected: Vec<String> = (0..taught).map(|n| format!("l{n}")).collect();
    expected.sort();
    assert_eq!(names, expected);
    let now = maps.map(MAP).await.expect("map").version;
    assert!(now >= *version, "version {now} after {version}");
    *version = now;
    assert!(maps.check_audit(None).await.expect("audit").fault.is_none(), "the audit log has a fault");
}

#[tokio::test(flavor = "multi_thread")]
async fn jumps_of_the_servers_clock_lose_nothing_and_tokens_follow_it() {
    let Some(library) = library() else {
        skipped("libfaketime is not installed: apt-get install faketime");
        return;
    };
    let data = TempDir::new().expect("a temporary directory");
    let clock = data.path().join("clock");
    set(&clock, "+0s");
    let mut server = start(&data.path().join("data"), &clock, &library);
    server.maps().create_map(&NewMap::new(MAP)).await.expect("map");
    server.maps().put_robot("r1", MAP).await.expect("robot");
    let new = NewToken { name: "kim".into(), role: Role::Teacher, maps: None, valid_s: Some(7200) };
    let token = server.maps().create_token(&new).await.expect("token").text;
    let (mut taught, mut version) = (0, 0);
    for (number, jump) in JUMPS.into_iter().enumerate() {
        let robot = connect(&server.zenoh, "r1").await;
        let image = GrayImage::from_fn(64, 48, |u, v| (u * v % 251) as u8);
        let mut last = 0;
        for frame in 0..6 {
            if frame == 3 && number % 2 == 0 {
                set(&clock, jump);
            }
            let answer = robot.recognise("front", Capture::gray(&image), SOON).await.expect("an answer");
            assert!(answer.rejection.is_none() && answer.seq > last, "{jump}: {answer:?} after {last}");
            last = answer.seq;
        }
        robot.close().await.expect("closed");
        if number % 2 == 1 {
            server.kill();
            set(&clock, jump);
            server = start(&data.path().join("data"), &clock, &library);
        }
        // Two hours are the token's: an hour ahead and a day back it is valid, in ten years it is
        // not.
        let is_valid = server.maps().with_token(&token).maps().await.is_ok();
        assert_eq!(is_valid, jump != "+10y", "{jump}");
        teach(&server, taught).await;
        taught += 1;
        check(&server, taught, &mut version).await;
    }
    // Each jump makes one backup due at most; a timer that fires again and again would make many.
    tokio::time::sleep(Duration::from_secs(3)).await;
    let backups = server.maps().backups().await.expect("backups").len();
    assert!(backups <= JUMPS.len() + 1, "{backups} backups after {} jumps", JUMPS.len());
    let jobs = server.maps().jobs(&client::api::JobQuery::default()).await.expect("jobs").items.len();
    assert!(jobs as u64 <= 2 * taught, "{jobs} jobs of {taught} lessons");
}
