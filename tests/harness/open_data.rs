//! Open data, which is not part of the repository: photographs and laser logs.

use std::{
    io::Write as _,
    path::{Path, PathBuf},
};

/// A set of open data: a folder of `WAYMARK_DATA`, else of `shared/data` beside the repository.
/// None where it is absent, which is printed.
pub fn open_data(set: &str) -> Option<PathBuf> {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data");
    let folder = std::env::var_os("WAYMARK_DATA").map_or(beside, PathBuf::from).join(set);
    if folder.is_dir() {
        return Some(folder);
    }
    skipped(&format!("no open data in {} (set WAYMARK_DATA)", folder.display()));
    None
}

/// Prints that this test is skipped, past the capture of output: it must be visible, and `.ci/run`
/// lists all of them at its end.
pub fn skipped(reason: &str) {
    let thread = std::thread::current();
    let test = thread.name().unwrap_or("a test");
    writeln!(std::io::stderr(), "skipped: {test}: {reason}").expect("standard error");
}
