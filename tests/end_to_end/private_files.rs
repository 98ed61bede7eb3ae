//! Claim: whatever the umask, nobody but the server's user can read the data directory, of a
//! program or of a server inside one, after a restore, and where an earlier program left it open.

use client::{
    LandmarkRegion, MapClient,
    api::{BackupState, NewMap},
};
use reqwest::StatusCode;
use serde_json::json;
use server::config::RawConfig;
use std::{
    collections::BTreeMap,
    fs,
    io::Read as _,
    os::unix::fs::PermissionsExt as _,
    path::Path,
    process::{Command, Stdio},
};
use tempfile::TempDir;
use tests::{Child, Inside, SOON, command::program, http, pictures};

const MAP: &str = "hall";

/// The mode of everything below a folder, and its own.
fn modes(folder: &Path, found: &mut BTreeMap<String, u32>) {
    let mode = |path: &Path| fs::symlink_metadata(path).expect("its metadata").permissions().mode() & 0o777;
    found.insert(folder.display().to_string(), mode(folder));
    for entry in fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            modes(&path, found);
        } else {
            found.insert(path.display().to_string(), mode(&path));
        }
    }
}

/// Everything there is private; `wanted` are parts of names that have to be among it.
fn check(data: &Path, wanted: &[&str], what: &str) {
    let mut found = BTreeMap::new();
    modes(data, &mut found);
    for name in wanted {
        assert!(found.keys().any(|path| path.contains(name)), "{what}: no {name} in {found:#?}");
    }
    for (path, mode) in &found {
        let right = if Path::new(path).is_dir() { 0o700 } else { 0o600 };
        assert_eq!(*mode, right, "{what}: {path} has mode {mode:o}");
    }
}

/// The same command under a umask.
fn under(umask: &str, command: &Command) -> Command {
    let mut shell = Command::new("sh");
    shell.arg("-c").arg(format!("umask {umask} && exec \"$0\" \"$@\"")).arg(command.get_program());
    shell.args(command.get_args());
    for (name, value) in command.get_envs() {
        match value {
            Some(value) => shell.env(name, value),
            None => shell.env_remove(name),
        };
    }
    shell
}

/// A picture, a robot whose drive is being mapped, and a backup.
async fn used(url: &str, maps: &MapClient) {
    maps.create_map(&NewMap::new(MAP)).await.expect("map");
    maps.add_landmark(MAP, "poster", None, None).await.expect("landmark");
    maps.upload_view(MAP, "poster", pictures::picture(1), LandmarkRegion::WholeImage).await.expect("view");
    maps.put_robot("r1", MAP).await.expect("robot");
    let mapping = http(url).await.post(format!("{url}/api/v1/maps/{MAP}/mapping"));
    let begun = mapping.json(&json!({ "robot": "r1" })).send().await.expect("an answer").status();
    assert_eq!(begun, StatusCode::CREATED);
    let backup = maps.make_backup().await.expect("begun");
    assert_eq!(maps.wait_for_backup(backup, SOON).await.expect("made").state, BackupState::Complete);
}

const MADE: [&str; 8] = [
    "waymark.sqlite",
    "waymark.sqlite-wal",
    "waymark.sqlite-shm",
    "local-token",
    "server-name",
    "/lock",
    ".waymark",
    "mapping/hall",
];

#[tokio::test(flavor = "multi_thread")]
async fn the_data_directory_is_private_whatever_the_umask() {
    for umask in ["000", "022"] {
        let folder = TempDir::new().expect("a temporary directory");
        let (data, copy) = (folder.path().join("data"), folder.path().join("copy"));
        let settings = [("WAYMARK_TLS__ENABLED", "true")];
        let command = Child::command(&data, &settings);
        let server = Child::start_from(&mut under(umask, &command));
        used(&server.url, &server.maps()).await;
        check(&data, &[&MADE[..], &["tls/"]].concat(), &format!("umask {umask}"));
        server.kill();
        let backup = fs::read_dir(data.join("backups")).expect("backups").next().expect("one").expect("it");
        // Twice: the second one puts the first aside.
        for _ in 0..2 {
            let mut restore = Command::new(program());
            restore.arg("restore").arg(backup.path()).arg("--data").arg(&copy).arg("--yes");
            let done = under(umask, &restore).stdout(Stdio::null()).status().expect("it runs");
            assert!(done.success());
        }
        check(&copy, &["waymark.sqlite", "replaced-"], &format!("restored under umask {umask}"));
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn the_data_directory_of_a_server_inside_a_program_is_private() {
    let inside = Inside::start_with(RawConfig::default()).await;
    used(&inside.url(), &inside.maps()).await;
    check(inside.data(), &MADE, "inside a program");
    inside.server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn what_an_earlier_program_left_open_is_closed_at_the_start_and_told_once() {
    let data = TempDir::new().expect("a temporary directory");
    let server = Child::start(data.path());
    used(&server.url, &server.maps()).await;
    server.kill();
    let mut found = BTreeMap::new();
    modes(data.path(), &mut found);
    let files = found.keys().filter(|path| !Path::new(path).is_dir()).count();
    for path in found.keys() {
        let mode = if Path::new(path).is_dir() { 0o755 } else { 0o644 };
        fs::set_permissions(path, fs::Permissions::from_mode(mode)).expect("its mode");
    }
    for is_first in [true, false] {
        let mut command = Child::command(data.path(), &[("WAYMARK_LOG_FORMAT", "json")]);
        let mut server = Child::start_from(command.stderr(Stdio::piped()));
        let mut stderr = server.stderr();
        check(data.path(), &MADE, "after the start");
        server.kill();
        let mut log = String::new();
        stderr.read_to_string(&mut log).expect("UTF-8");
        let told: Vec<&str> =
            log.lines().filter(|line| line.contains("data_directory_closed_to_others")).collect();
        assert_eq!(told.len(), usize::from(is_first), "{log}");
        let numbers = format!("\"files\":{files},\"folders\":3");
        assert!(told.iter().all(|line| line.contains(&numbers)), "{numbers}: {told:?}");
    }
}
