//! Claim: `waymark-lab reproduce` gives the figures of the very commands that it names, says what
//! it could not measure, goes on where it was interrupted, and the documents state its figures.

use crate::lab;
use serde_json::Value;
use std::{fs, path::Path};
use tempfile::TempDir;
use tests::command::Run;

fn reproduce(out: &Path, data: &Path, only: &str) -> (Run, Value) {
    let folders = [out, data].map(|path| path.to_str().expect("a path in UTF-8"));
    let run = lab(["reproduce", "--quick", "--only", only, "--out", folders[0], "--data", folders[1]]);
    let text = fs::read_to_string(out.join("figures.json")).expect("figures.json");
    (run, serde_json::from_str(&text).expect("JSON"))
}

#[test]
fn the_tables_of_the_documents_are_the_stored_figures() {
    let run = lab(["reproduce", "--check"]);
    assert_eq!(run.status, 0, "{run:?}");
    assert!(run.stdout.contains("is stored") || run.stdout.contains("have the figures of"), "{run:?}");
}

#[test]
fn figures_are_those_of_the_named_command_and_what_is_done_is_kept() {
    let folder = TempDir::new().expect("a temporary directory");
    let (first, figures) = reproduce(folder.path(), folder.path(), "B7,S10");
    let row = &figures["rows"][1];
    assert_eq!((&row["id"], &figures["quick"]), (&"B7".into(), &true.into()));
    let command = row["runs"][0]["command"].as_str().expect("a command");
    let words = command.split_whitespace().skip(1).chain(["--json"]);
    let report = lab(words).last_json();
    let figure = &row["runs"][0]["outcome"]["figures"][0];
    assert_eq!(figure["of"].as_f64(), report["points"].as_f64());
    assert_eq!(figure["value"].as_f64(), report["differ"].as_f64());
    assert_eq!(row["runs"][0]["seed"], 1);

    let absent = "set maps-ros-grid absent";
    assert_eq!(figures["rows"][0]["runs"][0]["outcome"]["not_measured"], absent);
    assert!(first.stdout.contains(absent) && first.stdout.contains("1 of 2 commands"), "{first:?}");
    assert!(first.stdout.contains("no figure counts") && !first.stderr.contains("kept"), "{first:?}");

    let (second, again) = reproduce(folder.path(), folder.path(), "B7,S10");
    assert!(second.stderr.contains("kept: waymark-lab evaluate visibility"), "{second:?}");
    assert_eq!(again["rows"][1], figures["rows"][1]);
}

#[test]
fn rows_that_do_not_exist_and_figures_of_a_smoke_test_are_refused() {
    let folder = TempDir::new().expect("a temporary directory");
    reproduce(folder.path(), folder.path(), "S10");
    let file = folder.path().join("figures.json");
    let refused = |words: &[&str], status: i32, reason: &str| {
        let run = lab(words);
        assert!(run.status == status && run.stderr.contains(reason), "{run:?}");
    };
    refused(&["reproduce", "--only", "E15"], 2, "none of E1");
    refused(&["reproduce", "--render", file.to_str().expect("a path in UTF-8")], 1, "--quick");
}
