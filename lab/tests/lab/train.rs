//! Claim: `waymark-lab train similarity` writes weights that the detector takes, and refuses sets
//! it cannot learn from.

use crate::lab;
use serde_json::{Value, json};
use std::{ffi::OsString, fs};
use tempfile::TempDir;

#[test]
fn fitted_similarity_separates_pairs_and_is_a_parameter_file() {
    let folder = TempDir::new().expect("a temporary directory");
    let weights = folder.path().join("weights.json");
    let mut args: Vec<OsString> =
        ["train", "similarity", "corridor", "--views", "16", "--json", "--out"].map(Into::into).into();
    args.push(weights.clone().into());
    let run = lab(args);
    let report = run.last_json();
    let number = |path: &str| report.pointer(path).and_then(Value::as_f64).expect("a number");
    assert!(number("/pairs/opposite") >= 20.0 && number("/pairs/others") >= 20.0, "{report}");
    // Far above chance, on held-out views.
    assert!(number("/fitted/order_held_out") > 0.9, "{report}");
    let written: Value = serde_json::from_slice(&fs::read(&weights).expect("the weights")).expect("JSON");
    assert_eq!(written["similarity"]["weights"], report["fitted"]["weights"]);
    let sum: f64 =
        written["similarity"]["weights"].as_array().expect("weights").iter().filter_map(Value::as_f64).sum();
    assert!((sum - 1.0).abs() < 1e-6, "{written}");
    let mut args: Vec<OsString> =
        ["evaluate", "detection", "corridor", "--views=2", "--grouping=relaxation", "--params"]
            .map(Into::into)
            .into();
    args.push(weights.into());
    let evaluated = lab(args);
    assert!(evaluated.status == 0, "{evaluated:?}");
}

#[test]
fn sets_without_complete_labels_are_refused_by_name() {
    let folder = TempDir::new().expect("a temporary directory");
    let set = json!({"name": "x", "images": [{"file": "a.png", "quads_complete": false}]});
    fs::write(folder.path().join("truth.json"), set.to_string()).expect("a file");
    let args = ["train", "similarity"].map(OsString::from).into_iter().chain([folder.path().into()]);
    let run = lab(args);
    assert_eq!((run.status, run.stdout.as_str()), (1, ""), "{run:?}");
    assert!(run.stderr.contains(&folder.path().display().to_string()), "{run:?}");
    assert_eq!(run.stderr.lines().count(), 1, "{run:?}");
}
