//! Claim: an error of the disk in a commit ends the program with an error and a cause in its log,
//! and the next start has all that was acknowledged. The disk's error is the system's: a file that
//! may not grow any more (EFBIG). Errors of each kind of call are planted below SQLite
//! (`server/src/store/io_errors.rs`).

use client::api::NewMap;
use std::{collections::BTreeSet, fs, io::Read as _, path::Path, process::Command, process::Stdio};
use tempfile::TempDir;
use tests::{Child, eventually, skipped};

/// By how much a file may grow: less than the log does before it is moved into the file.
const ROOM_BYTES: u64 = 1 << 20;
/// More landmarks than fit into that.
const MOST: usize = 2_000;

/// The same program, whose files end at `bytes`: a write beyond is an error, and not the signal
/// that would kill it.
fn limited(command: &Command, bytes: u64) -> Command {
    let mut limited = Command::new("sh");
    // `ulimit -f` counts 512 bytes; 25 is SIGXFSZ.
    limited.args(["-c", &format!("trap '' 25; ulimit -f {} && exec \"$0\" \"$@\"", bytes / 512)]);
    limited.arg(command.get_program()).args(command.get_args());
    for (name, value) in command.get_envs() {
        match value {
            Some(value) => limited.env(name, value),
            None => limited.env_remove(name),
        };
    }
    limited
}

async fn landmarks(data: &Path) -> BTreeSet<String> {
    let server = Child::start(data);
    let stored = server.maps().landmarks("hall").await.expect("landmarks");
    server.stop();
    stored.into_iter().map(|landmark| landmark.name).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn an_error_of_the_disk_ends_the_program_with_its_cause_and_loses_nothing() {
    if !cfg!(target_os = "linux") {
        return skipped("sizes of files are limited on Linux");
    }
    let data = TempDir::new().expect("a temporary directory");
    let server = Child::start(data.path());
    server.maps().create_map(&NewMap::new("hall")).await.expect("map");
    server.stop();
    let size = fs::metadata(data.path().join("waymark.sqlite")).expect("the database").len();

    let mut command = limited(&Child::command(data.path(), &[]), size + ROOM_BYTES);
    let mut server = Child::start_from(command.stderr(Stdio::piped()));
    let (maps, mut acknowledged) = (server.maps(), BTreeSet::new());
    for number in 0..MOST {
        let name = format!("poster-{number}");
        if maps.add_landmark("hall", &name, None, None).await.is_err() {
            break;
        }
        acknowledged.insert(name);
    }
    let ended = eventually("it ends", || std::future::ready(server.ended())).await;
    assert!(ended.code().is_some_and(|code| code != 0), "{ended}");
    let mut log = String::new();
    server.stderr().read_to_string(&mut log).expect("its log");
    assert!(log.contains("store_failed") && log.contains("disk I/O error"), "{log}");

    let stored = landmarks(data.path()).await;
    assert!(stored.is_superset(&acknowledged), "lost: {:?}", acknowledged.difference(&stored));
    assert!(stored.len() <= acknowledged.len() + 1, "{} of {}", stored.len(), acknowledged.len());
    assert!(!acknowledged.is_empty() && acknowledged.len() < MOST, "{} landmarks", acknowledged.len());
}
