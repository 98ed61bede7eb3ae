//! Claim: an index that is not as it was written is found after the start, and told with the
//! command that restores a backup; that command mends it. Robots are served meanwhile.

use client::{
    MapClient,
    api::{BackupState, DatabaseCheckBody, DatabaseCheckState, NewMap},
};
use std::{fs, io::Read as _, path::Path, process::Stdio, time::Duration};
use tempfile::TempDir;
use tests::{Child, SOON, command::waymark, eventually};

const LONGEST: Duration = Duration::from_mins(2);
const NAME: &str = "xylophone";
const PAGE: usize = 4096;
/// First byte of a page that is the leaf of an index, as the file format of SQLite has it.
const LEAF_OF_INDEX: u8 = 10;

/// Changes the name in every index, and in no table.
fn damage(database: &Path) -> usize {
    let mut bytes = fs::read(database).expect("the database");
    let mut damaged = 0;
    for page in bytes.chunks_mut(PAGE).filter(|page| page[0] == LEAF_OF_INDEX) {
        if let Some(at) = page.windows(NAME.len()).position(|text| text == NAME.as_bytes()) {
            page[at] = b'z';
            damaged += 1;
        }
    }
    fs::write(database, bytes).expect("the damaged database");
    damaged
}

async fn checked(maps: &MapClient) -> (String, DatabaseCheckBody) {
    eventually("the database is checked", || async {
        let readiness = maps.readiness().await.expect("readiness");
        let check = readiness.database_check.expect("this build tells it");
        (check.state != DatabaseCheckState::Running).then_some((readiness.status, check))
    })
    .await
}

#[tokio::test(flavor = "multi_thread")]
async fn a_damaged_index_is_told_with_the_command_that_restores() {
    let data = TempDir::new().expect("a folder");
    let server = Child::start(data.path());
    let maps = server.maps();
    maps.create_map(&NewMap::new("hall")).await.expect("map");
    maps.add_landmark("hall", NAME, None, None).await.expect("landmark");
    let backup = maps.make_backup().await.expect("begun");
    let backup = maps.wait_for_backup(backup, SOON).await.expect("made");
    assert_eq!(backup.state, BackupState::Complete);
    let (status, check) = checked(&maps).await;
    assert_eq!((status.as_str(), check.state, check.advice), ("ready", DatabaseCheckState::Ok, None));
    server.stop();
    assert!(damage(&data.path().join("waymark.sqlite")) > 0, "no index has the name");

    let mut command = Child::command(data.path(), &[]);
    let mut server = Child::start_from(command.stderr(Stdio::piped()));
    let mut stderr = server.stderr();
    let maps = server.maps();
    let (status, check) = checked(&maps).await;
    assert_eq!((status.as_str(), check.state), ("degraded", DatabaseCheckState::Failed), "{check:?}");
    assert!(check.faults.iter().any(|fault| fault.contains("missing from index")), "{check:?}");
    let advice = check.advice.expect("an advice");
    let file = data.path().join("backups").join(format!("{}.waymark", backup.name));
    let line = format!("restore {} --data {}", file.display(), data.path().display());
    assert!(advice.ends_with(&format!("waymark {line}")), "{advice}");
    assert_eq!(maps.landmarks("hall").await.expect("it is served").len(), 1);
    let status = waymark(["server", "status", "--server", &server.url], LONGEST);
    assert_eq!(status.status, 1, "{status:?}");
    assert!(status.stdout.contains(&line) && status.stderr.contains("its database is damaged"), "{status:?}");
    server.stop();
    let mut log = String::new();
    stderr.read_to_string(&mut log).expect("UTF-8");
    assert!(log.contains("database_check_failed") && log.contains("waymark restore"), "{log}");

    let restored = waymark(line.split(' ').chain(["--yes"]), LONGEST);
    assert_eq!(restored.status, 0, "{restored:?}");
    let server = Child::start(data.path());
    let (status, check) = checked(&server.maps()).await;
    assert_eq!((status.as_str(), check.state), ("ready", DatabaseCheckState::Ok), "{check:?}");
    assert_eq!(server.maps().landmarks("hall").await.expect("landmarks")[0].name, NAME);
    server.stop();
}
