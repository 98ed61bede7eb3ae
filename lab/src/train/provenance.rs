//! Provenance of learnt weights: the command as it was run, the commit, and a digest of every
//! folder of pictures. Written at the head of the generated source, so that the weights can be
//! reproduced.

use sha2::{Digest as _, Sha256};
use std::{
    fmt::Write as _,
    fs,
    path::{Path, PathBuf},
    process::Command,
};

/// Inputs of a run of the training.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Provenance {
    /// The command line without the path of the program.
    command: Vec<String>,
    /// The commit of the sources; `None` outside a checkout.
    commit: Option<String>,
    /// Name and SHA-256 of every folder of pictures, in order.
    sets: Vec<(String, String)>,
}

impl Provenance {
    /// Of this process; `sets` are the folders that were learnt from (rendered ones follow from the
    /// command).
    pub(super) fn of_this_run(sets: &[PathBuf]) -> std::io::Result<Self> {
        let folders = sets.iter().filter(|set| set.is_dir());
        let name = |set: &Path| set.file_name().unwrap_or(set.as_os_str()).to_string_lossy().into_owned();
        let digests = folders.map(|set| Ok((name(set), digest(set)?)));
        Ok(Self {
            command: std::env::args().skip(1).collect(),
            commit: commit(),
            sets: digests.collect::<std::io::Result<_>>()?,
        })
    }

    /// The lines of a module's documentation.
    pub(super) fn lines(&self) -> String {
        let mut text = String::from("//! ```text\n//! waymark-lab");
        let mut used = "//! waymark-lab".len();
        for word in &self.command {
            if used + word.len() > 110 {
                text.push_str(" \\\n//!  ");
                used = 6;
            }
            used += word.len() + 1;
            // Writing to a String cannot fail.
            write!(text, " {word}").ok();
        }
        writeln!(text, "\n//! ```\n//!").ok();
        writeln!(text, "//! Commit: {}.", self.commit.as_deref().unwrap_or("not recorded")).ok();
        for (name, sha256) in &self.sets {
            writeln!(text, "//! Set `{name}`: SHA-256 {sha256} (`data/digest.py`).").ok();
        }
        text
    }
}

/// The commit that is checked out, with a mark if files differ from it.
fn commit() -> Option<String> {
    let git = |args: &[&str]| {
        let done = Command::new("git").args(args).current_dir(env!("CARGO_MANIFEST_DIR")).output().ok()?;
        done.status.success().then(|| String::from_utf8_lossy(&done.stdout).trim().to_owned())
    };
    let head = git(&["rev-parse", "HEAD"])?;
    let is_clean = git(&["status", "--porcelain"])?.is_empty();
    Some(if is_clean { head } else { format!("{head}, with changes") })
}

/// SHA-256 of one line "relative-path sha256-of-file" for each file, sorted, each ending with a
/// newline.
fn digest(folder: &Path) -> std::io::Result<String> {
    let (mut lines, mut open) = (Vec::new(), vec![folder.to_owned()]);
    while let Some(path) = open.pop() {
        if path.is_dir() {
            for entry in fs::read_dir(&path)? {
                open.push(entry?.path());
            }
            continue;
        }
        let relative = path.strip_prefix(folder).unwrap_or(&path);
        let parts: Vec<_> = relative.iter().map(|part| part.to_string_lossy()).collect();
        lines.push(format!("{} {}\n", parts.join("/"), hex(&Sha256::digest(fs::read(&path)?))));
    }
    lines.sort();
    Ok(hex(&Sha256::digest(lines.concat())))
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut text, byte| {
        // Writing to a String cannot fail.
        write!(text, "{byte:02x}").ok();
        text
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_digest_depends_on_names_and_content_alone() {
        let folders = [tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap()];
        for folder in &folders {
            fs::create_dir(folder.path().join("b")).unwrap();
            fs::write(folder.path().join("b/c.txt"), "two").unwrap();
            fs::write(folder.path().join("a.txt"), "one").unwrap();
        }
        let [first, second] = folders.each_ref().map(|f| digest(f.path()).unwrap());
        assert_eq!(first, second);
        // sha256sum of "a.txt <sha of one>\nb/c.txt <sha of two>\n".
        let lines: String = [("a.txt", "one"), ("b/c.txt", "two")]
            .map(|(name, text)| format!("{name} {}\n", hex(&Sha256::digest(text))))
            .concat();
        assert_eq!(first, hex(&Sha256::digest(lines)));
        fs::write(folders[1].path().join("a.txt"), "other").unwrap();
        assert_ne!(first, digest(folders[1].path()).unwrap());
    }

    #[test]
    fn the_head_has_command_commit_and_digests() {
        let command =
            ["train", "detector", "a-long-name-of-a-set-of-pictures", "--seed", "7"].map(str::to_owned);
        let sets = vec![("museum".to_owned(), "ab12".to_owned())];
        let made =
            Provenance { command: command.iter().cycle().take(20).cloned().collect(), commit: None, sets }
                .lines();
        assert!(made.contains("waymark-lab train detector") && made.contains("--seed 7"), "{made}");
        assert!(
            made.contains("Commit: not recorded.") && made.contains("Set `museum`: SHA-256 ab12"),
            "{made}"
        );
        assert!(made.lines().all(|l| l.starts_with("//!") && l.len() <= 120), "{made}");
    }
}
