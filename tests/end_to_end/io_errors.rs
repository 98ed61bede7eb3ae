//! Claim: after an error of the disk nothing more is acknowledged, the process ends with an error that names it, and the next
//! start has everything that was acknowledged. The errors are planted into system calls by strace.

use client::{MapClient, api::NewMap};
use std::{
    fs,
    io::Read as _,
    path::Path,
    process::{Command, Stdio},
};
use tempfile::TempDir;
use tests::{Child, eventually, skipped};

const MAP: &str = "hall";
/// System calls that fail, and which of them, from the first to this: in each run of the tests, and in the long one
/// (`WAYMARK_LONG=1`). So many syncs come before the log is moved into the file, whose errors SQLite does not report: what was
/// not moved stays in the log.
const CALLS: [(&str, u64, u64); 2] = [("pwrite64", 10, 60), ("fsync,fdatasync", 10, 40)];

/// Whether this machine lets one process trace another.
fn may_trace() -> bool {
    let traced =
        Command::new("strace").args(["-f", "-o", "/dev/null", "true"]).stderr(Stdio::null()).status();
    traced.is_ok_and(|status| status.success())
}

/// Lets the `number`-th of these calls of each thread of a process fail from now on. Returns once it holds for all threads.
async fn fail(process: u32, calls: &str, number: u64) -> std::process::Child {
    let (trace, inject) = (format!("trace={calls}"), format!("inject={calls}:error=EIO:when={number}"));
    let mut strace = Command::new("strace");
    strace.args(["-f", "-qq", "-e", &trace, "-e", &inject, "-o", "/dev/null"]);
    let strace = strace.args(["-p", &process.to_string()]).spawn().expect("strace starts");
    eventually("every thread is traced", || async {
        let threads = fs::read_dir(format!("/proc/{process}/task")).ok()?;
        let is_traced = |task: &Path| {
            let status = fs::read_to_string(task.join("status")).unwrap_or_default();
            status.lines().any(|line| line.strip_prefix("TracerPid:").is_some_and(|id| id.trim() != "0"))
        };
        threads.flatten().all(|task| is_traced(&task.path())).then_some(())
    })
    .await;
    strace
}

/// Adds landmarks until one is not acknowledged; returns how many there are then.
async fn taught(maps: &MapClient, mut number: u64) -> u64 {
    while maps.add_landmark(MAP, &format!("l{number:05}"), None, None).await.is_ok() {
        number += 1;
        assert!(number < 100_000, "no error");
    }
    number
}

#[tokio::test(flavor = "multi_thread")]
async fn an_error_of_the_disk_ends_the_process_and_loses_nothing_acknowledged() {
    if !may_trace() {
        return skipped("no process may be traced here (needs strace and ptrace)");
    }
    let is_long = std::env::var_os("WAYMARK_LONG").is_some();
    let last = |short: u64, long: u64| if is_long { long } else { short };
    let all =
        CALLS.iter().flat_map(|(calls, short, long)| (1..=last(*short, *long)).map(move |n| (*calls, n)));
    let all: Vec<(&str, u64)> = all.collect();
    let data = TempDir::new().expect("a temporary directory");
    let server = Child::start(data.path());
    server.maps().create_map(&NewMap::new(MAP)).await.expect("map");
    server.kill();
    let mut acknowledged = 0;
    for (calls, number) in &all {
        let call = format!("{calls} {number}");
        let mut command = Child::command(data.path(), &[]);
        let mut server = Child::start_from(command.stderr(Stdio::piped()));
        let maps = server.maps();
        let there = maps.landmarks(MAP).await.expect("landmarks").len() as u64;
        assert!((acknowledged..=acknowledged + 1).contains(&there), "call {call}: {there} of {acknowledged}");
        let mut stderr = server.stderr();
        let said = std::thread::spawn(move || {
            let mut text = String::new();
            stderr.read_to_string(&mut text).map(|_| text)
        });
        let mut strace = fail(server.id(), calls, *number).await;
        acknowledged = taught(&maps, there).await;
        // It ends by itself, within the time that its other parts have to end.
        let status = eventually("the process ends", || {
            let ended = server.ended();
            async move { ended }
        })
        .await;
        strace.wait().expect("strace ends with it");
        let said = said.join().expect("no panic").expect("text");
        assert_eq!(status.code(), Some(1), "call {call}: {said}");
        for word in ["the writer of the store has ended", "disk I/O error", "start the server again"] {
            assert!(said.contains(word), "call {call}: no `{word}` in {said}");
        }
        assert!(!said.contains("panicked"), "call {call}: {said}");
    }
    let server = Child::start(data.path());
    let there = server.maps().landmarks(MAP).await.expect("landmarks").len() as u64;
    assert!((acknowledged..=acknowledged + 1).contains(&there), "{there} of {acknowledged}");
    let count = all.len();
    let bound = 300.0 / count as f64;
    eprintln!(
        "{count} errors of the disk: {acknowledged} acknowledged, none lost; at most {bound:.0} % lose something at 95 %"
    );
}
