//! Claim: code and documents keep the rules of docs/STYLE.md that a program can check.

use std::{
    fs,
    path::{Path, PathBuf},
};

/// Folders with hand-written code.
const CRATES: [&str; 14] = [
    "vision",
    "map",
    "formats",
    "protos",
    "ros2",
    "recordings",
    "sim",
    "link",
    "client",
    "engine",
    "server",
    "cli",
    "lab",
    "tests",
];
/// Longest file of code, in lines.
const MAX_FILE_LINES: usize = 400;
/// Files that a program writes.
const GENERATED: [&str; 2] = ["protos/src/generated.rs", "recordings/src/foxglove/generated.rs"];
/// Names that say how something is perceived or believed, not what it is.
const AMBIGUOUS: [&str; 15] = [
    "Seen", "Look", "Looked", "Glance", "Glimpse", "Told", "Laid", "Grounds", "Found", "Left", "Eye", "Kept",
    "Judged", "Doubles", "Sighted",
];
/// Longest cell of a table and longest line of prose, in characters.
const MAX_CELL: usize = 300;
const MAX_LINE: usize = 120;
/// Longest line that is a comment of code, in characters. rustfmt does not wrap them.
const MAX_COMMENT: usize = 100;
/// Words of history, which belongs to docs/results.
const HISTORY: [&str; 5] = ["not kept", "builds before", "the stop before", "asked were", "(issue"];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// Every file below `folders` with this ending, and its text.
fn files(folders: &[&str], ending: &str) -> Vec<(String, String)> {
    let mut open: Vec<PathBuf> = folders.iter().map(|f| root().join(f)).collect();
    let mut found = Vec::new();
    while let Some(path) = open.pop() {
        if path.is_dir() {
            let entries = fs::read_dir(&path).expect("a folder");
            open.extend(entries.map(|e| e.expect("an entry").path()).filter(|p| !p.ends_with("target")));
        } else if path.extension().is_some_and(|e| e == ending) {
            let name = path.strip_prefix(root()).expect("inside").display().to_string();
            found.push((name, fs::read_to_string(&path).expect("UTF-8")));
        }
    }
    found.sort();
    found
}

/// The documents that state the present.
fn documents() -> Vec<(String, String)> {
    let mut all = files(&["docs", "README.md", "CONTRIBUTING.md", "SECURITY.md", "CHANGELOG.md"], "md");
    all.retain(|(name, _)| !name.starts_with("docs/results"));
    assert!(all.len() > 20, "only {} documents found", all.len());
    all
}

#[test]
fn no_file_of_code_is_too_long() {
    let code = files(&CRATES, "rs");
    assert!(code.len() > 300, "only {} files found", code.len());
    let is_long = |(name, text): &&(String, String)| {
        text.lines().count() > MAX_FILE_LINES && !GENERATED.contains(&name.as_str())
    };
    let long: Vec<_> = code.iter().filter(is_long).map(|(name, _)| name).collect();
    assert!(long.is_empty(), "over {MAX_FILE_LINES} lines: {long:#?}");
}

#[test]
fn comments_wrap() {
    let mut long = Vec::new();
    for (name, text) in
        files(&CRATES, "rs").into_iter().filter(|(name, _)| !GENERATED.contains(&name.as_str()))
    {
        let mut is_code = false;
        for (number, line) in (1..).zip(text.lines()) {
            let is_comment = line.trim_start().starts_with("//");
            is_code ^= is_comment && line.contains("```");
            // Code, links and commands cannot be broken: a line breaks at a space outside of
            // backticks.
            let outside: String = line.trim_start().split('`').step_by(2).collect();
            let breaks = outside.trim_start_matches(['/', '!', ' ']).contains(' ');
            let is_whole = !breaks || line.contains("](") || line.contains("://") || line.ends_with('\\');
            let is_prose = is_comment && !line.contains(" waymark") && !is_code && !is_whole;
            if is_prose && line.chars().count() > MAX_COMMENT {
                long.push(format!("{name}:{number}"));
            }
        }
    }
    assert!(long.is_empty(), "comments over {MAX_COMMENT} characters: {long:#?}");
}

#[test]
fn types_are_named_after_what_they_are() {
    let mut wrong = Vec::new();
    for (name, text) in files(&CRATES, "rs") {
        for line in text.lines().map(str::trim_start).filter(|l| l.starts_with("pub")) {
            let mut words = line.split(|c: char| !c.is_alphanumeric() && c != '_').filter(|w| !w.is_empty());
            let declares = words.any(|w| ["struct", "enum", "trait", "type"].contains(&w));
            if let Some(word) = words.next().filter(|w| declares && AMBIGUOUS.contains(w)) {
                wrong.push(format!("{name}: {word}"));
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn documents_are_short_of_line_and_state_the_present() {
    let mut wrong = Vec::new();
    for (name, text) in documents() {
        let mut is_code = false;
        for (number, line) in (1..).zip(text.lines()) {
            is_code ^= line.starts_with("```");
            let at = format!("{name}:{number}");
            if line.split('|').any(|cell| line.starts_with('|') && cell.chars().count() > MAX_CELL) {
                wrong.push(format!("{at}: a cell over {MAX_CELL} characters"));
            }
            // Formulas, links and tables cannot be broken.
            let is_whole = ['|', '$'].iter().any(|c| line.trim_start().starts_with(*c));
            let is_prose = !is_code && !is_whole && !line.contains("](") && !line.contains("://");
            if is_prose && line.chars().count() > MAX_LINE {
                wrong.push(format!("{at}: over {MAX_LINE} characters"));
            }
            let lower = line.to_lowercase();
            wrong.extend(HISTORY.iter().filter(|h| lower.contains(**h)).map(|h| format!("{at}: `{h}`")));
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}
