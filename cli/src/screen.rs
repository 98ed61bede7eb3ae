//! What commands show: results on standard output, everything else on standard error.

use indicatif::{ProgressBar, ProgressStyle};
use std::io::{IsTerminal, Write as _};

/// One result line on standard output. A closed pipe (`| head`) ends the program quietly.
pub fn say(line: &str) {
    if writeln!(std::io::stdout(), "{line}").is_err() {
        std::process::exit(0);
    }
}

/// One line on standard error.
pub fn complain(line: &str) {
    // With standard error gone there is nobody left to tell.
    writeln!(std::io::stderr(), "{line}").ok();
}

/// A progress bar of `steps`, on a terminal only.
pub fn progress(steps: usize, what: &'static str) -> ProgressBar {
    if !std::io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let style = ProgressStyle::with_template("{msg} {wide_bar} {pos}/{len} {eta}");
    ProgressBar::new(steps as u64)
        .with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
        .with_message(what)
}

/// `1 quad`, `2 quads`.
pub fn counted(count: u64, what: &str) -> String {
    if count == 1 { format!("1 {what}") } else { format!("{count} {what}s") }
}
