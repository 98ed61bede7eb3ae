//! Tests of the program `waymark-lab` from outside: its figures are recounted by other means.

mod command_line;
mod evaluate;
mod floors;
mod outside;
mod plot;
mod real_pictures;
mod reproduce;
mod train;

use std::{ffi::OsStr, path::Path, time::Duration};
use tests::command::Run;

/// The program.
const PROGRAM: &str = env!("CARGO_BIN_EXE_waymark-lab");
/// Longest run, on a busy machine.
const LONGEST: Duration = Duration::from_mins(4);

/// Runs `waymark-lab` with these arguments.
fn lab<A: AsRef<OsStr>>(args: impl IntoIterator<Item = A>) -> Run {
    tests::command::run(Path::new(PROGRAM), args, LONGEST)
}
