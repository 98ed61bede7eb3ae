//! Claim: on a full disk nothing more is learnt, robots are served, and learning goes on when there
//! is room again, without a restart. A start on a full disk or a read-only one serves robots, too.
//! The disks are small file systems in memory, in a mount namespace of the test's own.

use client::{
    Capture, ClientError, Delivery, LandmarkRegion, MapClient, RobotClient, RobotOptions,
    api::{JobState, NewMap, NewToken, Readiness, Role},
    v1::Verdict,
};
use sim::{building::Building, lesson::LessonParams};
use std::{fs, io::Write as _, path::Path, process::Command, sync::Arc};
use tempfile::TempDir;
use tests::{Child, SOON, eventually, pictures, robots::jpeg, scenes, skipped};

const MAP: &str = "hall";
/// Frames that a server answers while its disk is full.
const FRAMES: usize = 1_000;

/// Runs an ignored test of this file where it may mount.
fn where_mounts_are_private(test: &str) {
    let own = |command: &mut Command| command.status().is_ok_and(|status| status.success());
    if !own(Command::new("unshare").args(["--mount", "true"])) {
        return skipped("no mount namespace of its own (needs root and `unshare`)");
    }
    let mut run = Command::new("unshare");
    run.arg("--mount").arg(std::env::current_exe().expect("own path"));
    run.args(["--exact", &format!("full_disk::{test}"), "--ignored", "--nocapture"]);
    assert!(own(&mut run), "{test} failed");
}

#[test]
fn a_nearly_full_disk_refuses_additions_until_there_is_room() {
    where_mounts_are_private("nearly_full");
}

#[test]
fn a_full_disk_stops_learning_and_nothing_else_also_after_a_restart() {
    where_mounts_are_private("full");
}

#[test]
fn a_read_only_disk_serves_robots() {
    where_mounts_are_private("read_only");
}

fn mount(arguments: &[&str], at: &Path) {
    let status = Command::new("mount").args(arguments).arg(at).status().expect("mount");
    assert!(status.success(), "mount {arguments:?}");
}

/// A small disk.
fn disk(size: &str) -> TempDir {
    let at = TempDir::new().expect("a temporary directory");
    mount(&["-t", "tmpfs", "-o", &format!("size={size}"), "tmpfs"], at.path());
    at
}

/// Fills the disk but for so many bytes.
fn fill(disk: &Path, but_for: usize) {
    let mut file = fs::File::options().create(true).append(true).open(disk.join("filler")).expect("a file");
    let page = [1_u8; 4096];
    while file.write_all(&page).is_ok() {}
    let len = file.metadata().expect("its size").len();
    file.set_len(len.saturating_sub(but_for as u64)).expect("room");
}

fn free(disk: &Path) {
    fs::remove_file(disk.join("filler")).expect("the filler");
}

/// Status and code of a refusal.
fn refusal<T: std::fmt::Debug>(result: Result<T, ClientError>) -> (u16, String) {
    match result {
        Err(ClientError::Refused { status, code, .. }) => (status, code),
        other => panic!("not refused: {other:?}"),
    }
}

/// A frame that shows a taught poster, as a file.
async fn taught(maps: &MapClient) -> Vec<u8> {
    let building = Arc::new(Building::corridor(11));
    let params = LessonParams { seed: 1, views: 6, ..LessonParams::default() };
    let views = scenes::views(&building, &params);
    let poster = building.posters().next().expect("a poster").name.clone();
    maps.create_map(&NewMap::new(MAP)).await.expect("map");
    maps.add_landmark(MAP, &poster, None, None).await.expect("landmark");
    let mut frame = None;
    for (_, readings) in views.iter().filter(|(name, _)| *name == poster) {
        let Some(view) = readings.frame.truth.landmark(&poster) else { continue };
        let image = jpeg(&readings.frame.image);
        let corners = LandmarkRegion::Corners(view.corners_px.into());
        if maps.upload_view(MAP, &poster, image.clone(), corners).await.is_ok() {
            frame = Some(image);
        }
    }
    let job = maps.learn(MAP, None, None).await.expect("job");
    maps.wait_for_job(job, 3 * SOON, |_| {}).await.expect("the lesson ends");
    maps.put_robot("r1", MAP).await.expect("robot");
    frame.expect("a photograph of the poster")
}

async fn robot(server: &Child) -> RobotClient {
    let options = RobotOptions {
        delivery: Delivery::Every,
        timeout: SOON,
        ..RobotOptions::new(&server.zenoh, "default", "r1")
    };
    RobotClient::connect(&options).await.expect("a connection")
}

/// Sends the frame so often; each answer names the poster.
async fn recognised(server: &Child, frame: &[u8], times: usize) {
    let robot = robot(server).await;
    for number in 0..times {
        let capture = Capture::encoded(frame.to_vec()).expect("a picture").with_deadline_ms(60_000);
        let answer = robot.recognise("front", capture, SOON).await.expect("an answer");
        let names = answer.quads.iter().filter(|quad| quad.verdict() == Verdict::Unique).count();
        assert!(names > 0, "frame {number}: {answer:?}");
    }
    robot.close().await.expect("closed");
}

async fn readiness(maps: &MapClient) -> Readiness {
    maps.readiness().await.expect("it answers")
}

/// Adds a landmark until the disk has room for it.
async fn added(maps: &MapClient, name: &str) {
    let added = || async {
        let added = maps.add_landmark(MAP, name, None, None).await;
        added.inspect_err(|error| eprintln!("{name}: {error}")).ok()
    };
    eventually("additions go on", added).await;
}

#[tokio::test(flavor = "multi_thread")]
#[ignore = "needs a mount namespace of its own: run by a_nearly_full_disk_refuses_additions_until_there_is_room"]
async fn nearly_full() {
    let disk = disk("64m");
    let server = Child::start(disk.path());
    let maps = server.maps();
    let frame = taught(&maps).await;
    added(&maps, "spare").await;
    maps.create_map(&NewMap::new("yard")).await.expect("a map without robots");
    assert_eq!(readiness(&maps).await.storage.expect("the disk").refused, None);
    // 6 of 64 MB are less than a tenth.
    fill(disk.path(), 6 << 20);
    let storage = eventually("it is noticed", || async {
        readiness(&maps).await.storage.filter(|storage| storage.refused.is_some())
    })
    .await;
    assert!((90..100).contains(&storage.used_percent) && storage.limit_percent == 90, "{storage:?}");
    assert_eq!(readiness(&maps).await.status, "degraded");
    let nearly_full = (507, "storage_nearly_full".to_owned());
    assert_eq!(refusal(maps.add_landmark(MAP, "late", None, None).await), nearly_full);
    assert_eq!(refusal(maps.create_map(&NewMap::new("late")).await), nearly_full);
    let view = maps.upload_view(MAP, "spare", pictures::picture(1), LandmarkRegion::WholeImage).await;
    assert_eq!(refusal(view), nearly_full);
    assert_eq!(refusal(maps.learn(MAP, None, None).await), nearly_full);
    assert_eq!(refusal(maps.make_backup().await), nearly_full);
    // What takes away, mends or is small goes on.
    recognised(&server, &frame, 5).await;
    let token = NewToken { name: "t".into(), role: Role::Viewer, maps: None, valid_s: None };
    let token = maps.create_token(&token).await.expect("a token");
    maps.revoke_token(token.token.id).await.expect("revoked");
    maps.rename_map("yard", "garden").await.expect("renamed");
    maps.delete_landmark(MAP, "spare").await.expect("deleted");
    free(disk.path());
    added(&maps, "late").await;
    assert_eq!(readiness(&maps).await.status, "ready");
}

/// Settings with which only a full disk refuses.
const NO_GUARD: [(&str, &str); 2] =
    [("WAYMARK_LIMITS__DISK_PERCENT", "100"), ("WAYMARK_LIMITS__DISK_FREE_BYTES", "0")];

/// Adds landmarks with pictures until the disk is full; returns the refusal. The log may have some
/// room inside.
async fn taught_to_the_end(maps: &MapClient, prefix: &str) -> (u16, String) {
    for number in 0..10_000 {
        let name = format!("{prefix}{number:05}");
        let added = maps.add_landmark(MAP, &name, None, None).await;
        if let Err(error) = added {
            return refusal::<()>(Err(error));
        }
        let image = pictures::png(400, 400, &noise(number));
        if let Err(error) = maps.upload_view(MAP, &name, image, LandmarkRegion::WholeImage).await {
            return refusal::<()>(Err(error));
        }
    }
    panic!("the disk is not full")
}

/// Refused for want of room, by SQLite or by the guard, whichever sees it first.
fn assert_full((status, code): &(u16, String)) {
    assert!(
        *status == 507 && ["storage_full", "storage_nearly_full"].contains(&code.as_str()),
        "{status} {code}"
    );
}

/// Grey levels that cannot be packed.
fn noise(seed: u64) -> Vec<u8> {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    let mut next = || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 32) as u8
    };
    (0..400 * 400).map(|_| next()).collect()
}

#[tokio::test(flavor = "multi_thread")]
#[ignore = "needs a mount namespace of its own: run by a_full_disk_stops_learning_and_nothing_else_also_after_a_restart"]
async fn full() {
    let disk = disk("12m");
    let server = Child::start_with(disk.path(), &NO_GUARD);
    let maps = server.maps();
    let frame = taught(&maps).await;
    // What another program has, and gives back.
    fill(disk.path(), 3 << 20);
    assert_full(&taught_to_the_end(&maps, "a").await);
    fill(disk.path(), 0);
    assert_full(&taught_to_the_end(&maps, "b").await);
    recognised(&server, &frame, FRAMES).await;
    let landmarks = maps.landmarks(MAP).await.expect("landmarks").len();
    free(disk.path());
    added(&maps, "after").await;
    // Again full, and killed: the log stays, and the index of the log is made anew at the start.
    fill(disk.path(), 0);
    server.kill();
    let index = disk.path().join("waymark.sqlite-shm");
    fs::remove_file(&index).expect("the index of a killed server");
    fill(disk.path(), 0);
    let server = Child::start_with(disk.path(), &NO_GUARD);
    let maps = server.maps();
    fill(disk.path(), 0);
    assert!(fs::metadata(&index).map_or(0, |index| index.len()) < 32_768, "there was room for the index");
    assert_eq!(maps.landmarks(MAP).await.expect("landmarks").len(), landmarks + 1);
    recognised(&server, &frame, 20).await;
    assert_full(&taught_to_the_end(&maps, "c").await);
    assert!(maps.readiness().await.is_ok(), "it is no failure");
    free(disk.path());
    added(&maps, "again").await;
    maps.upload_view(MAP, "again", pictures::picture(7), LandmarkRegion::WholeImage).await.expect("view");
    let job = maps.learn(MAP, Some(&["again".to_owned()]), None).await.expect("job");
    let job = maps.wait_for_job(job, 3 * SOON, |_| {}).await.expect("the lesson ends");
    assert_eq!(job.state, JobState::Done, "{job:?}");
    recognised(&server, &frame, 5).await;
    server.kill();
    let server = Child::start(disk.path());
    assert!(server.maps().landmark(MAP, "again").await.is_ok(), "stored");
}

#[tokio::test(flavor = "multi_thread")]
#[ignore = "needs a mount namespace of its own: run by a_read_only_disk_serves_robots"]
async fn read_only() {
    let disk = disk("64m");
    let server = Child::start(disk.path());
    let maps = server.maps();
    let frame = taught(&maps).await;
    let token = NewToken { name: "t".into(), role: Role::Admin, maps: None, valid_s: None };
    let token = maps.create_token(&token).await.expect("a token");
    let read_only = (507, "storage_read_only".to_owned());
    server.kill();
    // After a kill with a log, and after a clean stop with none.
    for is_clean in [false, true] {
        if is_clean {
            mount(&["-o", "remount,rw"], disk.path());
            Child::start(disk.path()).stop();
            assert!(!disk.path().join("waymark.sqlite-wal").exists(), "a clean stop leaves no log");
        }
        mount(&["-o", "remount,ro"], disk.path());
        let server = Child::start(disk.path());
        let maps = MapClient::new(&server.url).expect("a client").with_token(&token.text);
        recognised(&server, &frame, 5).await;
        assert_eq!(refusal(maps.create_map(&NewMap::new("late")).await), read_only);
        assert_eq!(refusal(maps.rename_map(MAP, "other").await), read_only);
        let ready = readiness(&maps).await;
        assert_eq!(ready.status, "degraded");
        assert!(
            ready.storage.and_then(|storage| storage.refused).is_some_and(|why| why.contains("read-only"))
        );
        assert!(maps.landmarks(MAP).await.is_ok_and(|all| all.len() == 1));
        server.kill();
    }
}
