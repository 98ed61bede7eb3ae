//! The end of the server after a panic inside zenoh. In: every panic of the process. Out: for one
//! in zenoh's code a log entry with its cause, and the exit status of a failure.
//!
//! Such a panic leaves locks of zenoh poisoned: no robot is served any more, and a destructor that
//! meets one of them would abort the process without the cause.

use super::failure::Class;
use std::{
    panic,
    path::{Component, Path},
    sync::atomic::{AtomicBool, Ordering},
    thread,
    time::Duration,
};

/// Time that the thread which panicked first has to write its log entry and to end the process.
const WHILE_IT_ENDS: Duration = Duration::from_secs(5);

/// From now on a panic inside zenoh ends the process.
pub(super) fn end_after_a_panic_of_zenoh() {
    static IS_ENDING: AtomicBool = AtomicBool::new(false);
    let before = panic::take_hook();
    panic::set_hook(Box::new(move |panicked| {
        before(panicked);
        if !panicked.location().is_some_and(|at| is_of_zenoh(at.file())) {
            return;
        }
        if IS_ENDING.swap(true, Ordering::Relaxed) {
            // Its destructors would abort the process before the first one has said why.
            thread::sleep(WHILE_IT_ENDS);
        }
        let follows = "the process ends: start it again, it goes on from what is on the disk";
        tracing::error!(cause = %panicked, follows, "zenoh_panicked");
        std::process::exit(Class::Failed as i32);
    }));
}

/// Whether a source file is of one of zenoh's crates.
fn is_of_zenoh(file: &str) -> bool {
    let is_zenoh =
        |part| matches!(part, Component::Normal(name) if name.to_string_lossy().starts_with("zenoh"));
    Path::new(file).components().any(is_zenoh)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_of_zenoh_are_known_by_their_crate() {
        let registry = "/home/a/.cargo/registry/src/index.crates.io-1949cf8c6b5b557f";
        assert!(is_of_zenoh(&format!("{registry}/zenoh-transport-1.10.2/src/common/pipeline.rs")));
        assert!(is_of_zenoh(&format!("{registry}/zenoh-1.10.2/src/api/session.rs")));
        assert!(!is_of_zenoh(&format!("{registry}/tokio-1.50.0/src/task.rs")));
        assert!(!is_of_zenoh("server/src/bus/inbox.rs"));
    }
}
