//! Claim: photographs of paintings on real walls are found and recognised, none as another. A floor
//! against regressions, far below the figures of docs/EVALUATION.md; skipped, with the reason,
//! without the pictures.

use crate::lab;
use serde_json::{Value, json};
use std::{
    fs,
    path::{Path, PathBuf},
};
use tempfile::TempDir;
use tests::open_data;

/// Photographs with paintings that are taught, and with distractors alone.
const PHOTOGRAPHS: usize = 10;
const DISTRACTORS: usize = 3;
/// Share of labelled paintings found at IoU 0.7; the whole set measured 0.92.
const FLOOR_RECALL_70: f64 = 0.75;
/// Least number of right names.
const FLOOR_RIGHT: u64 = 4;

/// The set's folder, where it is.
fn museum() -> Option<PathBuf> {
    open_data("museum-paintings")?.canonicalize().ok()
}

/// A folder in the evaluation format with some photographs of walls, and the known paintings on
/// them to teach from.
fn excerpt(museum: &Path) -> (TempDir, usize) {
    let text = fs::read(museum.join("truth.json")).expect("truth.json");
    let mut truth: Value = serde_json::from_slice(&text).expect("JSON");
    let all = truth["images"].as_array().expect("images").iter().filter(|i| i["whole_image"] != true);
    let has_distractor = |image: &&Value| {
        let quads = image["quads"].as_array().expect("quads");
        !quads.is_empty() && quads.iter().all(|q| q["landmark"].is_null())
    };
    let plain =
        all.clone().filter(|i| i["stratum"] == "plain").filter(|i| !has_distractor(i)).take(PHOTOGRAPHS);
    let images: Vec<Value> = plain.chain(all.filter(has_distractor).take(DISTRACTORS)).cloned().collect();
    assert_eq!(images.len(), PHOTOGRAPHS + DISTRACTORS, "the set has become smaller");
    let quads: Vec<&Value> = images.iter().flat_map(|i| i["quads"].as_array().expect("quads")).collect();
    let teach: Vec<Value> = truth["teach"]
        .as_array()
        .expect("teach")
        .iter()
        .filter(|t| quads.iter().any(|q| q["landmark"] == t["landmark"]))
        .cloned()
        .collect();
    assert!(teach.len() >= PHOTOGRAPHS / 2, "{} to teach", teach.len());
    let count = quads.len();
    (truth["images"], truth["teach"]) = (json!(images), json!(teach));
    // The pictures are not copied.
    for key in ["images", "teach"] {
        for entry in truth[key].as_array_mut().expect("entries") {
            entry["file"] = json!(museum.join(entry["file"].as_str().expect("a name")));
        }
    }
    let folder = TempDir::new().expect("a temporary directory");
    fs::write(folder.path().join("truth.json"), truth.to_string()).expect("truth.json");
    (folder, count)
}

#[test]
fn paintings_on_real_walls_are_found_and_never_confused() {
    let Some(museum) = museum() else { return };
    let (folder, quads) = excerpt(&museum);
    let images = (PHOTOGRAPHS + DISTRACTORS) as u64;
    let evaluate = |what: &str| {
        let args = ["evaluate".as_ref(), what.as_ref(), folder.path().as_os_str(), "--json".as_ref()];
        let run = lab(args);
        assert_eq!(run.status, 0, "{run:?}");
        run.last_json()
    };
    let found = evaluate("detection");
    assert_eq!(
        (found["images"].as_u64(), found["quads"].as_u64()),
        (Some(images), Some(quads as u64)),
        "{found}"
    );
    assert!(found["recall_70"].as_f64().expect("a share") >= FLOOR_RECALL_70, "{found}");
    let known = evaluate("recognition");
    assert_eq!(known["images"].as_u64(), Some(images), "{known}");
    assert!(known["right"].as_u64().expect("a count") >= FLOOR_RIGHT, "{known}");
    assert_eq!(
        (known["wrong"].as_u64(), known["distractors_accepted"].as_u64()),
        (Some(0), Some(0)),
        "{known}"
    );
}
