//! Claim: every promise of `docs/OPERATIONS.md` names tests, and each of them exists.

use std::{collections::BTreeSet, fs, path::Path};
use tests::documents::root;

/// Names of all tests: functions after an attribute that ends in `test]` or `test(...)]`, those
/// that run on each store, and those of Python.
fn tests_in(folder: &Path, found: &mut BTreeSet<String>) {
    for entry in fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        let name = path.file_name().and_then(|n| n.to_str()).unwrap_or_default();
        if path.is_dir() {
            if !name.starts_with('.') && !["target", "node_modules", "data"].contains(&name) {
                tests_in(&path, found);
            }
            continue;
        }
        let kind = path.extension().and_then(|kind| kind.to_str());
        let is_python = name.starts_with("test_") && kind == Some("py");
        if !is_python && kind != Some("rs") {
            continue;
        }
        let text = fs::read_to_string(&path).expect("UTF-8");
        let (mut is_next, mut is_list) = (is_python, false);
        for line in text.lines().map(str::trim) {
            is_list = line.ends_with("on_each_store! {") || (is_list && line != "}");
            if is_list {
                found.extend(line.split(',').map(|name| name.trim().to_owned()));
                continue;
            }
            if line.starts_with("#[") {
                is_next |= line.contains("test]") || line.contains("test(");
                continue;
            }
            let function = line.trim_start_matches("pub ").trim_start_matches("async ");
            let word = if is_python { "def test_" } else { "fn " };
            let Some(rest) = function.strip_prefix(word).filter(|_| is_next) else { continue };
            let name: String = rest.chars().take_while(|c| c.is_ascii_alphanumeric() || *c == '_').collect();
            found.insert(if is_python { format!("test_{name}") } else { name });
            is_next = is_python;
        }
    }
}

/// Promises of the table with the tests that they name.
fn promises(text: &str) -> Vec<(String, Vec<String>)> {
    let rows = text.lines().filter(|line| line.starts_with("| P"));
    let row = |line: &str| {
        let cells: Vec<&str> = line.trim_matches('|').split('|').map(str::trim).collect();
        let named = cells.last().map_or("", |cell| cell).split('`').skip(1).step_by(2);
        (cells[0].to_owned(), named.map(str::to_owned).collect())
    };
    rows.map(row).collect()
}

/// Promises that are proven by nothing.
fn unproven(text: &str, tests: &BTreeSet<String>) -> Vec<String> {
    let is_proven = |named: &Vec<String>| !named.is_empty() && named.iter().all(|name| tests.contains(name));
    promises(text).into_iter().filter(|(_, named)| !is_proven(named)).map(|(promise, _)| promise).collect()
}

#[test]
fn every_promise_names_tests_that_exist() {
    let mut tests = BTreeSet::new();
    tests_in(&root(), &mut tests);
    assert!(tests.len() > 800, "{} tests were found", tests.len());
    let text = fs::read_to_string(root().join("docs/OPERATIONS.md")).expect("the document");
    assert!(promises(&text).len() >= 15, "the table is not read");
    assert_eq!(unproven(&text, &tests), [""; 0]);
    for wrong in ["| P1 | durable | nothing |", "| P1 | durable | `no_such_test` |"] {
        assert_eq!(unproven(wrong, &tests), ["P1"], "{wrong}");
    }
}
