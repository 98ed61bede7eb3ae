//! The generated parts of the documents: written from the stored figures, and compared with them.

use super::{comparison, figures::Figures, rows, table};
use anyhow::Context as _;
use cli::screen;
use std::{
    fs,
    path::{Path, PathBuf},
};

/// Where the figures of the last whole run are, from the root of the repository.
const STORED: &str = "docs/results/figures.json";
/// Marks around a generated part.
const BEGIN: &str = "<!-- written by `waymark-lab reproduce --render` from docs/results/figures.json -->\n";
const END: &str = "<!-- end of what is written -->\n";

/// A document with a generated part.
struct Document {
    path: &'static str,
    /// The line before which the part is put where there is none.
    before: &'static str,
    text: fn(&Figures) -> String,
}

const DOCUMENTS: [Document; 2] = [
    Document { path: "docs/EVALUATION.md", before: "## Outside\n", text: table::evaluation },
    Document { path: "README.md", before: "## What it needs, and what it cannot do\n", text: table::readme },
];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn read(path: &Path) -> anyhow::Result<String> {
    fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))
}

fn parsed(text: &str, path: &Path) -> anyhow::Result<Figures> {
    serde_json::from_str(text).with_context(|| format!("{} holds no figures", path.display()))
}

/// Stores the figures of `file` and writes all parts.
pub(super) fn render(file: &Path) -> anyhow::Result<()> {
    let text = read(file)?;
    let figures = parsed(&text, file)?;
    complete(&figures)?;
    let root = root();
    for document in &DOCUMENTS {
        let path = root.join(document.path);
        let written = with_part(&read(&path)?, document.before, &(document.text)(&figures))
            .with_context(|| document.path.to_owned())?;
        fs::write(&path, written).with_context(|| path.display().to_string())?;
        screen::say(document.path);
    }
    fs::write(root.join(STORED), text).with_context(|| STORED.to_owned())?;
    screen::say(STORED);
    Ok(())
}

/// Whether figures may stand in a document: of a whole run at a commit.
fn complete(figures: &Figures) -> anyhow::Result<()> {
    anyhow::ensure!(!figures.quick, "these are figures of --quick, which do not count");
    anyhow::ensure!(
        figures.commit.is_some() && !figures.changed,
        "these figures belong to no commit: commit all changes, then build and measure again"
    );
    let lacks = |row: &&super::Row| {
        let runs: usize = row.commands.iter().map(|command| command.presets.runs().len()).sum();
        figures.rows.iter().find(|found| found.id == row.id).is_none_or(|found| found.runs.len() != runs)
    };
    let lacking: Vec<&str> = rows().filter(lacks).map(|row| row.id).collect();
    anyhow::ensure!(
        lacking.is_empty(),
        "{} lack a preset or are absent: run without --only and --preset into the same folder",
        lacking.join(", ")
    );
    let faults = comparison::faults(figures);
    anyhow::ensure!(faults.is_empty(), "{}", faults.join("\n"));
    Ok(())
}

/// Compares the documents with the stored figures, or sees that none has a part where none are
/// stored.
pub(super) fn check() -> anyhow::Result<()> {
    let (root, mut wrong) = (root(), Vec::new());
    let stored = root.join(STORED);
    let figures = if stored.is_file() { Some(parsed(&read(&stored)?, &stored)?) } else { None };
    if let Some(figures) = &figures {
        complete(figures)?;
    }
    for document in &DOCUMENTS {
        let text = read(&root.join(document.path))?;
        let expected = figures.as_ref().map(document.text);
        if part(&text) != expected.as_deref() {
            wrong.push(document.path);
        }
    }
    let advice = match figures {
        Some(_) => format!("waymark-lab reproduce --render {STORED}"),
        None => format!("there is no {STORED}, so no document may have a generated part"),
    };
    anyhow::ensure!(wrong.is_empty(), "{} differ from the stored figures: {advice}", wrong.join(", "));
    screen::say(&match figures {
        Some(figures) => format!("The documents have the figures of {}.", figures.date),
        None => format!("No whole run is stored in {STORED} yet; no document has a generated part."),
    });
    Ok(())
}

/// The generated part of a document.
fn part(text: &str) -> Option<&str> {
    let (_, rest) = text.split_once(BEGIN)?;
    rest.split_once(END).map(|(part, _)| part)
}

/// The document with this part, in place of the one that it has or before a line.
fn with_part(text: &str, before: &str, part: &str) -> anyhow::Result<String> {
    let marked = format!("{BEGIN}{part}{END}");
    if let Some((start, rest)) = text.split_once(BEGIN) {
        let (_, end) = rest.split_once(END).context("the end of the generated part is missing")?;
        return Ok(format!("{start}{marked}{end}"));
    }
    let (start, end) = text.split_once(before).with_context(|| format!("no line is {before:?}"))?;
    Ok(format!("{start}{marked}\n{before}{end}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reproduce::table::tests::fixture;

    #[test]
    fn a_part_is_put_in_and_replaced_and_text_around_it_stays() {
        let first = with_part("# A\n\n## Outside\n\nprose\n", "## Outside\n", "| 1 |\n").unwrap();
        assert_eq!(part(&first), Some("| 1 |\n"));
        let second = with_part(&first, "## Outside\n", "| 2 |\n").unwrap();
        assert_eq!(part(&second), Some("| 2 |\n"));
        assert!(
            second.starts_with("# A\n\n<!--") && second.ends_with("-->\n\n## Outside\n\nprose\n"),
            "{second}"
        );
        assert_eq!(part("prose"), None);
        assert!(with_part("# A\n", "## Outside\n", "").is_err());
        assert!(with_part(&first.replace(END, ""), "## Outside\n", "").is_err());
    }

    #[test]
    fn only_a_whole_run_at_a_commit_may_stand_in_a_document() {
        let reason = |figures: &Figures| complete(figures).unwrap_err().to_string();
        assert!(reason(&Figures { quick: true, ..fixture() }).contains("--quick"));
        assert!(reason(&Figures { changed: true, ..fixture() }).contains("commit"));
        assert!(reason(&Figures { commit: None, ..fixture() }).contains("commit"));
        let lacking = reason(&fixture());
        assert!(lacking.contains("E2") && lacking.contains("S1") && !lacking.contains("E1,"), "{lacking}");
    }

    #[test]
    fn each_document_has_a_place_for_its_part() {
        for document in &DOCUMENTS {
            let text = read(&root().join(document.path)).unwrap();
            assert_eq!(text.matches(document.before).count(), 1, "{}", document.path);
        }
    }

    #[test]
    fn stored_figures_are_read_as_they_were_written() {
        let text = serde_json::to_string(&fixture()).unwrap();
        assert_eq!(parsed(&text, Path::new("x")).unwrap(), fixture());
        assert!(parsed("{}", Path::new("x")).is_err());
    }
}
