//! Where and when figures were measured: the commit, the processor, the day.

use sha2::{Digest as _, Sha256};
use std::{fmt::Write as _, path::Path, process::Command, time::SystemTime};

/// The commit of the sources that this program was built from, and whether files differ from it.
/// `None`: there is no git, or no repository any more.
pub(super) fn commit() -> (Option<String>, bool) {
    let git = |args: &[&str]| {
        let done = Command::new("git").arg("-C").arg(env!("CARGO_MANIFEST_DIR")).args(args).output().ok()?;
        done.status.success().then(|| String::from_utf8_lossy(&done.stdout).trim().to_owned())
    };
    let changed = git(&["status", "--porcelain", "--untracked-files=no"]);
    (git(&["rev-parse", "HEAD"]), changed.is_none_or(|files| !files.is_empty()))
}

/// The day, UTC, as in 2026-11-28.
pub(super) fn date() -> String {
    humantime::format_rfc3339_seconds(SystemTime::now()).to_string().chars().take(10).collect()
}

/// The name of the processor, where the system tells it.
pub(super) fn processor() -> String {
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let name = text.lines().find_map(|line| line.strip_prefix("model name")?.split_once(':'));
    name.map_or_else(|| std::env::consts::ARCH.to_owned(), |(_, name)| name.trim().to_owned())
}

/// A digest of a program file: the same build gives the same figures.
pub(super) fn digest(program: &Path) -> std::io::Result<String> {
    let digest = Sha256::digest(std::fs::read(program)?);
    Ok(digest.iter().fold(String::new(), |mut text, byte| {
        // Writing to a String cannot fail.
        write!(text, "{byte:02x}").ok();
        text
    }))
}
