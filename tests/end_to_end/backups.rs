//! Claim: a backup of a running server is a state that existed, and restores to it; a changed byte
//! is refused and named; a running server is not replaced, and what is replaced stays.

use client::{
    ClientError, LandmarkRegion, MapClient,
    api::{BackupState, NewMap},
};
use std::{
    fs,
    path::Path,
    time::{Duration, SystemTime, UNIX_EPOCH},
};
use tempfile::TempDir;
use tests::{
    Child, SOON,
    command::{Run, waymark},
    eventually, pictures,
};

const LONGEST: Duration = Duration::from_mins(3);
const MAP: &str = "hall";

fn run(line: &[&str]) -> Run {
    waymark(line, LONGEST)
}

fn text(path: &Path) -> &str {
    path.to_str().expect("text")
}

/// Makes landmarks `l00000`, `l00001` ... until the server is gone. Gives the map's version after
/// each.
async fn make_landmarks(maps: MapClient) -> Vec<u64> {
    let mut versions = Vec::new();
    for number in 0.. {
        let made = async {
            maps.add_landmark(MAP, &format!("l{number:05}"), None, None).await?;
            Ok::<_, ClientError>(maps.map(MAP).await?.version)
        };
        match made.await {
            Ok(version) => versions.push(version),
            Err(_gone) => break,
        }
    }
    versions
}

async fn names(maps: &MapClient) -> Vec<String> {
    maps.landmarks(MAP).await.expect("landmarks").into_iter().map(|landmark| landmark.name).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_backup_of_a_server_at_work_restores_to_a_state_that_existed() {
    let folder = TempDir::new().expect("a temporary directory");
    let (data, file) = (folder.path().join("data"), folder.path().join("hall.waymark"));
    let server = Child::start(&data);
    let maps = server.maps();
    maps.create_map(&NewMap::new(MAP)).await.expect("map");
    maps.add_landmark(MAP, "taught", None, None).await.expect("landmark");
    let photograph = pictures::picture(1);
    let view = maps.upload_view(MAP, "taught", photograph.clone(), LandmarkRegion::WholeImage).await;
    let view = view.expect("view").id;
    let writer = tokio::spawn(make_landmarks(server.maps()));
    eventually("some landmarks are made", || async { (names(&maps).await.len() > 5).then_some(()) }).await;
    let before = names(&maps).await.len();
    let url = server.url.clone();
    let to = file.clone();
    let backup = tokio::task::spawn_blocking(move || run(&["backup", text(&to), "--server", &url]));
    let backup = backup.await.expect("it runs");
    assert_eq!(backup.status, 0, "{backup:?}");
    assert!(backup.stdout.contains("1 map and 1 picture"), "{backup:?}");
    let refused = run(&["restore", text(&file), "--data", text(&data), "--yes"]);
    assert_eq!(refused.status, 4, "a server runs there: {refused:?}");
    server.kill();
    let versions = writer.await.expect("the writer does not panic");

    // Over the killed server's own data, which has more by now.
    let asked = run(&["restore", text(&file), "--data", text(&data)]);
    assert_eq!(asked.status, 2, "nobody said yes: {asked:?}");
    let restored = run(&["restore", text(&file), "--data", text(&data), "--yes"]);
    assert!(restored.status == 0 && restored.stdout.contains("what was there is in"), "{restored:?}");
    let server = Child::start(&data);
    let (maps, made) = (server.maps(), names(&server.maps()).await.len() - 1);
    assert!(made >= before - 1, "{made} landmarks are restored of {before}");
    let wanted: Vec<String> = (0..made).map(|n| format!("l{n:05}")).chain(["taught".into()]).collect();
    assert_eq!(names(&maps).await, wanted, "not a state that existed");
    let version = maps.map(MAP).await.expect("map").version;
    // The last write may not have been acknowledged before the kill.
    assert!(versions.get(made - 1).is_none_or(|then| *then == version), "version {version} of {versions:?}");
    assert_eq!(maps.view_image(MAP, "taught", view).await.expect("picture"), photograph);
    server.kill();

    // What was replaced is a database of its own.
    let replaced = fs::read_dir(&data).expect("the data directory").filter_map(|entry| {
        let path = entry.expect("an entry").path();
        text(&path).contains("replaced-").then_some(path)
    });
    let server = Child::start(&replaced.last().expect("the folder of what was replaced"));
    assert!(names(&server.maps()).await.len() >= versions.len());
    server.kill();
}

#[tokio::test(flavor = "multi_thread")]
async fn a_changed_byte_of_a_backup_is_refused_and_nothing_is_restored() {
    let folder = TempDir::new().expect("a temporary directory");
    let (data, file) = (folder.path().join("data"), folder.path().join("hall.waymark"));
    let server = Child::start(&data);
    let maps = server.maps();
    maps.create_map(&NewMap::new(MAP)).await.expect("map");
    maps.add_landmark(MAP, "poster", None, None).await.expect("landmark");
    let photograph = pictures::picture(1);
    maps.upload_view(MAP, "poster", photograph.clone(), LandmarkRegion::WholeImage).await.expect("view");
    let backup = run(&["backup", text(&file), "--server", &server.url]);
    assert_eq!(backup.status, 0, "{backup:?}");
    let again = run(&["backup", text(&file), "--server", &server.url]);
    assert_eq!(again.status, 4, "no file is overwritten: {again:?}");
    server.kill();

    let empty = folder.path().join("empty");
    let sound = run(&["restore", text(&file), "--data", text(&empty), "--dry-run"]);
    assert!(sound.status == 0 && sound.stdout.contains("is sound"), "{sound:?}");
    assert!(!empty.exists(), "a dry run makes nothing");
    let mut bytes = fs::read(&file).expect("the backup");
    let part = &photograph[40..60];
    let at = bytes.windows(part.len()).position(|window| window == part).expect("the picture is in the file");
    bytes[at] ^= 1;
    fs::write(&file, bytes).expect("the changed backup");
    let refused = run(&["restore", text(&file), "--data", text(&empty), "--yes", "--json"]);
    assert_eq!((refused.status, refused.stdout.as_str()), (5, ""), "{refused:?}");
    assert!(refused.stderr.contains("the picture of view 1 of landmark poster, map hall"), "{refused:?}");
    assert!(!empty.join("waymark.sqlite").exists(), "nothing is restored");
}

#[tokio::test(flavor = "multi_thread")]
async fn backups_are_made_by_the_timetable_listed_and_deleted() {
    let data = TempDir::new().expect("a temporary directory");
    let settings = [("WAYMARK_BACKUP__EVERY_HOURS", "24"), ("WAYMARK_BACKUP__KEEP", "2")];
    let server = Child::start_with(data.path(), &settings);
    let maps = server.maps();
    let first = eventually("the first backup, right after the start", || async {
        let all = maps.backups().await.expect("backups");
        all.into_iter().find(|backup| backup.state == BackupState::Complete)
    })
    .await;
    let health = maps.readiness().await.expect("readiness").backup;
    assert_eq!((health.every_hours, health.newest.as_deref()), (24, Some(first.name.as_str())));
    let now_ms = SystemTime::now().duration_since(UNIX_EPOCH).expect("a time").as_millis() as i64;
    assert!((0..600_000).contains(&(now_ms - health.newest_ms.expect("a time"))), "{health:?}");
    for _ in 0..2 {
        let begun = maps.make_backup().await.expect("begun");
        let ended = maps.wait_for_backup(begun, SOON).await.expect("made");
        assert!(ended.state == BackupState::Complete && ended.manifest.is_some(), "{ended:?}");
    }
    let all = maps.backups().await.expect("backups");
    assert!(all.len() == 2 && all.iter().all(|backup| backup.name > first.name), "{all:?}");
    let mut download = maps.backup_file(&all[0].name).await.expect("the file");
    let mut length = 0;
    while let Some(part) = download.next().await.expect("a part") {
        length += part.len() as u64;
    }
    assert_eq!((Some(length), length), (download.length(), all[0].bytes));
    for backup in &all {
        maps.delete_backup(&backup.name).await.expect("deleted");
    }
    assert!(maps.backups().await.expect("backups").is_empty());
    let status = run(&["server", "status", "--server", &server.url]);
    assert!(status.status == 0 && status.stdout.contains("no backup yet"), "{status:?}");
    server.kill();
}
