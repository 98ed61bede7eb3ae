//! What the documents name is there: every path in backticks that ends like a file of this repository exists.

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
};

/// Ends of the paths that are looked at.
const ENDINGS: [&str; 4] = [".rs", ".md", ".sql", ".proto"];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// README.md and docs/*.md.
fn documents() -> Vec<PathBuf> {
    let mut found = vec![root().join("README.md")];
    let entries = fs::read_dir(root().join("docs")).expect("the docs folder");
    found.extend(entries.map(|e| e.expect("an entry of the docs folder").path()));
    found.retain(|path| path.extension().is_some_and(|e| e == "md"));
    found.sort();
    found
}

/// Paths with a folder between single backticks; one name alone may stand for many files, `*` does.
fn paths(text: &str) -> BTreeSet<&str> {
    let quoted = text.lines().flat_map(|line| line.split('`').skip(1).step_by(2));
    let is_path = |word: &&str| {
        word.contains('/') && !word.contains([' ', '*']) && ENDINGS.iter().any(|end| word.ends_with(end))
    };
    quoted.filter(is_path).collect()
}

#[test]
fn paths_are_told_from_other_words() {
    let text = "`map/src/lines.rs` and `a::b`, `x.rs`, `docs/*.md`, map/src/no.rs\n`sim/a.md` `b c/d.rs`";
    assert_eq!(paths(text).into_iter().collect::<Vec<_>>(), ["map/src/lines.rs", "sim/a.md"]);
}

#[test]
fn documents_name_only_files_that_exist() {
    let mut missing = Vec::new();
    let mut named = 0;
    for document in documents() {
        let text = fs::read_to_string(&document).expect("a document in UTF-8");
        for path in paths(&text) {
            named += 1;
            if !root().join(path).is_file() {
                missing.push(format!("{}: {path}", document.display()));
            }
        }
    }
    assert!(missing.is_empty(), "{missing:#?}");
    assert!(named > 20, "only {named} paths found: the documents are no longer read");
}

/// The sources of every crate in one text.
fn sources() -> String {
    let mut text = String::new();
    let mut folders: Vec<PathBuf> =
        ["vision", "map", "formats", "protos", "sim", "client", "server", "lab", "tests"]
            .map(|f| root().join(f))
            .into();
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).expect("a folder of sources") {
            let path = entry.expect("an entry of a folder of sources").path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "rs") {
                text += &fs::read_to_string(path).expect("a source in UTF-8");
            }
        }
    }
    text
}

#[test]
fn tests_named_in_the_method_exist() {
    let method = fs::read_to_string(root().join("docs/METHOD.md")).expect("docs/METHOD.md");
    let sources = sources();
    // Rows of tables: | section | file | test | departure |
    let columns = method.lines().filter(|line| line.starts_with('|')).filter_map(|row| row.split('|').nth(3));
    let names: Vec<&str> = columns.flat_map(|column| column.split('`').skip(1).step_by(2)).collect();
    let missing: Vec<_> = names.iter().filter(|name| !sources.contains(&format!("fn {name}("))).collect();
    assert!(missing.is_empty(), "{missing:#?}");
    assert!(names.len() > 20, "only {} names found: the tables are no longer read", names.len());
}
