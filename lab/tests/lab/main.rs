//! The laboratory's program as a box: what it prints is recounted by other means.

mod command_line;
mod evaluate;
mod plot_map;
mod real_pictures;
mod train;

use std::{ffi::OsStr, path::Path, time::Duration};
use tests::command::Run;

/// The program.
const PROGRAM: &str = env!("CARGO_BIN_EXE_waymark-lab");
/// Longest run: machines that check are busy.
const LONGEST: Duration = Duration::from_mins(4);

/// Runs `waymark-lab` with these arguments.
fn lab<A: AsRef<OsStr>>(args: impl IntoIterator<Item = A>) -> Run {
    tests::command::run(Path::new(PROGRAM), args, LONGEST)
}
