//! Claim: the pictures of the metric stages in docs/method are what `waymark-lab plot` draws now, and each page names
//! the command of its picture.

use crate::lab;
use std::{
    fs,
    path::{Path, PathBuf},
};
use tempfile::TempDir;

/// Stage, and the page of the method that shows it.
const STAGES: [(&str, &str); 8] = [
    ("placement", "11-placement.md"),
    ("localisation", "13-localisation.md"),
    ("gaze", "14-gaze.md"),
    ("fusion", "15-fusion.md"),
    ("laser-map", "17-laser-map.md"),
    ("guided", "26-guided-recognition.md"),
    ("health", "27-landmark-health.md"),
    ("relocalisation", "28-relocalisation.md"),
];
/// Largest picture: pages shall load at once.
const MAX_BYTES: usize = 150_000;

fn docs() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs")
}

/// The first line in which two pictures differ.
fn difference(committed: &str, drawn: &str) -> Option<String> {
    let mut pairs = committed.lines().zip(drawn.lines()).enumerate();
    let line =
        pairs.find(|(_, (a, b))| a != b).map(|(i, (a, b))| format!("line {}: {a}\nis now: {b}", i + 1));
    let lengths = || format!("{} lines are now {}", committed.lines().count(), drawn.lines().count());
    line.or_else(|| (committed != drawn).then(lengths))
}

#[test]
fn the_pictures_of_the_method_are_what_is_drawn_now() {
    let folder = TempDir::new().expect("a temporary directory");
    for (stage, page) in STAGES {
        let name = format!("{stage}.svg");
        let committed = fs::read_to_string(docs().join("pictures/method").join(&name)).expect("a picture");
        let out = folder.path().join(&name);
        let out = out.to_str().expect("UTF-8");
        let run = lab(["plot", stage, "--out", out]);
        assert_eq!(run.status, 0, "{run:?}");
        let drawn = fs::read_to_string(out).expect("what was drawn");
        assert!(drawn.len() <= MAX_BYTES, "{name} has {} bytes", drawn.len());
        if let Some(difference) = difference(&committed, &drawn) {
            let path = format!("docs/pictures/method/{name}");
            panic!("{path}, {difference}\nIf that is meant: waymark-lab plot {stage} --out {path}");
        }
        let page = fs::read_to_string(docs().join("method").join(page)).expect("a page");
        let command = format!("`waymark-lab plot {stage} --out {name}`");
        assert!(page.contains(&command) && page.contains(&format!("(../pictures/method/{name})")), "{name}");
    }
}

#[test]
fn a_changed_number_is_a_difference() {
    let committed = fs::read_to_string(docs().join("pictures/method/fusion.svg")).expect("a picture");
    assert_eq!(difference(&committed, &committed), None);
    let last = committed.rfind(|c: char| c.is_ascii_digit()).expect("a number");
    let digit = if committed.as_bytes()[last] == b'1' { "2" } else { "1" };
    let changed = format!("{}{digit}{}", &committed[..last], &committed[last + 1..]);
    assert!(difference(&committed, &changed).is_some_and(|d| d.contains("is now")), "{last}");
    let shorter = committed.lines().next().expect("a line");
    assert!(difference(&committed, shorter).is_some_and(|d| d.contains("lines are now 1")));
}
