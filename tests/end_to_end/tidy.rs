//! Claim: files, tests, types and constants named in documents exist, and so do the sections cited
//! in comments.

use std::{collections::BTreeSet, fs, path::PathBuf};
use tests::documents::{documents, markdown, root};

/// Ends of the paths that are checked.
const ENDINGS: [&str; 4] = [".rs", ".md", ".sql", ".proto"];
/// End of the path of a document.
const DOCUMENT: &str = ".md";
/// Folders with code and text of this project; missing ones are skipped.
const FOLDERS: [&str; 16] = [
    "cli",
    "link",
    "client",
    "engine",
    "formats",
    "lab",
    "map",
    "migrations",
    "protos",
    "recordings",
    "ros2",
    "server",
    "sim",
    "tests",
    "vision",
    "fuzz/fuzz_targets",
];

/// The pages of the method in one text.
fn method() -> String {
    markdown("docs/method").iter().map(|page| fs::read_to_string(page).expect("a page in UTF-8")).collect()
}

/// Every file of the project that ends with `.` and one of `endings`, with its text.
fn files(endings: &[&str]) -> Vec<(PathBuf, String)> {
    let mut found = Vec::new();
    let mut folders: Vec<PathBuf> = FOLDERS.map(|f| root().join(f)).into();
    folders.retain(|f| f.is_dir());
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).expect("a folder of sources") {
            let path = entry.expect("an entry of a folder of sources").path();
            if path.is_dir() {
                folders.extend((!path.ends_with("target")).then_some(path));
            } else if path.extension().and_then(|e| e.to_str()).is_some_and(|e| endings.contains(&e)) {
                let text = fs::read_to_string(&path).expect("a source in UTF-8");
                found.push((path, text));
            }
        }
    }
    found.sort();
    found
}

/// The sources of every crate in one text.
fn sources() -> String {
    files(&["rs"]).into_iter().map(|(_, text)| text).collect()
}

/// The names that `keyword` declares.
fn declared<'a>(sources: &'a str, keyword: &str) -> BTreeSet<&'a str> {
    let name = |rest: &'a str| rest.split(|c: char| !c.is_alphanumeric() && c != '_').next();
    sources.split(keyword).skip(1).filter_map(name).collect()
}

/// Texts between single backticks, by line.
fn quoted(text: &str) -> impl Iterator<Item = &str> {
    text.lines().filter(|line| !line.starts_with("```")).flat_map(|line| line.split('`').skip(1).step_by(2))
}

/// Paths with a folder between single backticks. A file name alone may mean several files, and `*`
/// does.
fn paths(text: &str) -> BTreeSet<&str> {
    let is_path = |word: &&str| {
        word.contains('/') && !word.contains([' ', '*']) && ENDINGS.iter().any(|end| word.ends_with(end))
    };
    quoted(text).filter(is_path).collect()
}

#[test]
fn paths_are_distinguished_from_other_words() {
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
    assert!(named > 200, "only {named} paths found: the documents are no longer read");
}

#[test]
fn tests_named_in_the_method_exist() {
    let sources = sources();
    let tests = declared(&sources, "fn ");
    let method = method();
    // Parts "Files and tests": every name in backticks that is no path is a test.
    let parts = method.split("\n#").filter(|part| part.contains("# Files and tests\n"));
    let names: Vec<&str> = parts.flat_map(quoted).filter(|name| !name.contains(['/', '.'])).collect();
    let missing: Vec<_> = names.iter().filter(|name| !tests.contains(**name)).collect();
    assert!(missing.is_empty(), "{missing:#?}");
    assert!(names.len() > 250, "only {} names found: the pages are no longer read", names.len());
}

#[test]
fn parameters_and_constants_named_in_the_method_exist() {
    let sources = sources();
    let (constants, structs) = (declared(&sources, "const "), declared(&sources, "struct "));
    let method = method();
    let is_constant = |name: &str| {
        let is_of = |c: char| c.is_ascii_uppercase() || c.is_ascii_digit() || c == '_';
        name.contains('_') && name.starts_with(|c: char| c.is_ascii_uppercase()) && name.chars().all(is_of)
    };
    let (mut missing, mut named) = (Vec::new(), 0);
    for word in quoted(&method) {
        let name = word.split("::").next().unwrap_or(word);
        let is_there = if is_constant(name) {
            constants.contains(name)
        } else if name.ends_with("Params") && name.chars().all(char::is_alphanumeric) {
            structs.contains(name)
        } else {
            continue;
        };
        named += 1;
        missing.extend((!is_there).then_some(word));
    }
    assert!(missing.is_empty(), "{missing:#?}");
    assert!(named > 100, "only {named} names found: the pages are no longer read");
}

/// Section numbers of headings and labels of table rows (`A10`, `E9`).
fn sections(method: &str) -> BTreeSet<&str> {
    let headings = method.lines().filter_map(|line| line.trim_start_matches('#').strip_prefix(' '));
    let numbers = headings.filter_map(|title| title.split(' ').next()).filter(|word| is_number(word));
    let rows = method.lines().filter_map(|line| line.strip_prefix("| ")?.split(' ').next());
    numbers.chain(rows.filter(|word| is_label(word))).collect()
}

/// `3`, `3.6`, `16.3.3`.
fn is_number(word: &str) -> bool {
    word.split('.').all(|part| !part.is_empty() && part.chars().all(|c| c.is_ascii_digit()))
}

/// `A` or `E` and one or two digits.
fn is_label(word: &str) -> bool {
    word.strip_prefix(['A', 'E'])
        .is_some_and(|number| matches!(number.len(), 1 | 2) && number.chars().all(|c| c.is_ascii_digit()))
}

/// The words of the comments of a file, with the number of their line.
fn comment_words(text: &str) -> Vec<(usize, &str)> {
    let mut words = Vec::new();
    for (i, line) in text.lines().enumerate() {
        let start = line.trim_start();
        let whole = ["//", "--", "#"].iter().find(|mark| start.starts_with(**mark));
        let said = match whole {
            Some(_) if start.starts_with("#[") || start.starts_with("#!") => continue,
            Some(_) => start,
            None => line.split_once(" // ").map_or("", |(_, after)| after),
        };
        let said = said.trim_start_matches(['/', '!', '-', '#']);
        words.extend(said.split_whitespace().map(|word| (i + 1, word)));
    }
    words
}

/// A word without the marks around it.
fn bare(word: &str) -> &str {
    let word = word.trim_start_matches(['(', '`', '"', '[']);
    word.trim_end_matches([')', '`', '"', ']', ',', '.', ':', ';'])
}

/// Citations of the method in comments, with the number of the line: `method 3.6`,
/// `method 17.1 to 17.3`, `section 6.3`, the labels `A10` and `E9`, and documents by their path.
fn citations(text: &str) -> Vec<(usize, &str)> {
    let words = comment_words(text);
    let trimmed = |i: usize| words.get(i).map(|(line, word)| (*line, bare(word)));
    let mut found = Vec::new();
    let mut i = 0;
    while let Some((line, word)) = trimmed(i) {
        i += 1;
        if is_label(word) || (word.starts_with("docs/") && word.ends_with(DOCUMENT) && !word.contains('*')) {
            found.push((line, word));
        }
        if !["method", "section", "sections"].iter().any(|mark| word.eq_ignore_ascii_case(mark)) {
            continue;
        }
        // A list goes on after a comma and after "to" and "and".
        let mut next = i;
        while let Some((line, number)) = trimmed(next).filter(|(_, number)| is_number(number)) {
            found.push((line, number));
            i = next + 1;
            let goes_on = words.get(i).is_some_and(|(_, word)| ["to", "and"].contains(word));
            next = if goes_on { i + 1 } else { i };
            if !goes_on && !words[next - 1].1.ends_with(',') {
                break;
            }
        }
    }
    found
}

#[test]
fn citations_are_distinguished_from_other_words() {
    let text = [
        "/// Departs from method 3.6, 13.4: see the",
        "/// method",
        "// 17.1 to 17.3 (register A3), E9; 4.5 px",
        "let x = 1; // method 2.",
    ]
    .join("\n");
    let expected = [(1, "3.6"), (1, "13.4"), (3, "17.1"), (3, "17.3"), (3, "A3"), (3, "E9"), (4, "2")];
    assert_eq!(citations(&text), expected);
    let none = "fn method() { 3.6 }\n// a method of 1.5 px\n#[doc = \"method 9.9\"]\n// A300 and E";
    assert_eq!(citations(none), []);
    assert_eq!(citations("-- docs/method/README.md, Sections 8."), [(1, "docs/method/README.md"), (1, "8")]);
}

#[test]
fn every_section_cited_in_a_comment_exists() {
    let method = method();
    let sections = sections(&method);
    let (mut missing, mut cited) = (Vec::new(), 0);
    for (path, text) in files(&["rs", "sql", "proto", "toml"]) {
        for (line, what) in citations(&text) {
            cited += 1;
            let is_there =
                if what.ends_with(DOCUMENT) { root().join(what).is_file() } else { sections.contains(what) };
            if !is_there {
                missing.push(format!("{}:{line}: {what}", path.display()));
            }
        }
    }
    assert!(missing.is_empty(), "{missing:#?}");
    assert!(cited > 150, "only {cited} citations found: the comments are no longer read");
}

/// Product code of `vision` that imports the paper's method: parameters, both detectors, their
/// trace, the preset, the decision.
const PAPER_ENTRIES: [&str; 7] = [
    "vision/src/detect/detector.rs",
    "vision/src/detect/params.rs",
    "vision/src/params/preset.rs",
    "vision/src/recognise/decision/by_points.rs",
    "vision/src/recognise/decision/result.rs",
    "vision/src/recognise/decision/verdict.rs",
    "vision/src/trace.rs",
];

#[test]
fn the_papers_method_is_imported_at_few_places() {
    let (folder, source) = (root().join("vision/src/paper"), root().join("vision/src"));
    let imports = files(&["rs"]).into_iter().filter(|(path, text)| {
        let Ok(inside) = path.strip_prefix(&source) else { return false };
        let is_test = inside.to_string_lossy().contains("tests");
        !path.starts_with(&folder) && !is_test && text.contains("paper::")
    });
    let imports: Vec<PathBuf> = imports.map(|(path, _)| path).collect();
    assert_eq!(imports, PAPER_ENTRIES.map(|path| root().join(path)));
}
