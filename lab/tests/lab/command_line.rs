//! Claim: every command of `waymark-lab` explains its options, one that does not exist is refused,
//! and speed is measured without data and without Python.

use crate::{LONGEST, PROGRAM, lab};
use serde_json::Value;
use std::{ffi::OsString, path::Path};
use tempfile::TempDir;
use tests::{
    command::{check_help, check_refused},
    documents::check_command_lines,
};

/// Options that each command must name in its help.
const OPTIONS: [(&str, &[&str]); 29] = [
    (
        "evaluate navigation",
        &["--drives", "--posters", "--length-m", "--rate-hz", "--seed", "--json", "--plot"],
    ),
    (
        "evaluate detection",
        &[
            "--min-side-px",
            "--params",
            "--compare",
            "--plot",
            "--worst",
            "--draw",
            "--misses",
            "--reviewed",
            "--json",
            "--keep",
            "--views",
            "--seed",
            "<SETS>",
        ],
    ),
    (
        "evaluate outside",
        &[
            "--usual-camera",
            "--strangers",
            "--peer",
            "--python",
            "--draw",
            "--misses",
            "--json",
            "--set",
            "<FOLDERS>",
        ],
    ),
    ("evaluate modalities", &["--runs", "--drives", "--seed", "--json", "--plot"]),
    ("evaluate recognition", &["--generated-views", "--preset", "--distance", "--misses", "--json", "<SET>"]),
    ("evaluate drawing", &["--views", "--seed", "--json", "--draw"]),
    ("reproduce", &["--preset", "--out", "--only", "--quick", "--data", "--render", "--check"]),
    (
        "evaluate viewpoint",
        &[
            "--set",
            "--photographs",
            "--taught",
            "--landmarks",
            "--views",
            "--size-px",
            "--corner-noise-px",
            "--detector",
            "--seed",
            "--plot",
            "--json",
        ],
    ),
    ("evaluate roll", &["--posters", "--views", "--seed", "--json"]),
    ("evaluate scale", &["--landmarks", "--views", "--detector", "--plot"]),
    ("evaluate illumination", &["--landmarks", "--views", "--detector", "--plot"]),
    ("evaluate occlusion", &["--landmarks", "--views", "--detector", "--plot"]),
    ("evaluate discrimination", &["--landmarks", "--distractors", "--views", "--own-views", "--plot"]),
    ("evaluate lookalikes", &["--pairs", "--views", "--photographs"]),
    ("evaluate confidence", &["--quads", "--set", "--plot", "--json"]),
    (
        "evaluate calibration",
        &[
            "--photoreal",
            "--numbers",
            "--views",
            "--trials",
            "--corner-noise-px",
            "--seed",
            "--python",
            "--json",
            "--plot",
            "[SETS]...",
        ],
    ),
    ("evaluate placement", &["--rooms", "--views", "--corridors", "--seed", "--json"]),
    ("evaluate pose", &["--draws", "--drives", "--seed", "--no-peers", "--python", "--json"]),
    (
        "evaluate mapping",
        &["--odometry-noise", "--seed", "--duration-s", "--params", "--draw", "--plot", "--json", "[LOGS]"],
    ),
    ("evaluate joint", &["--buildings", "--seed", "--cases", "--json"]),
    ("evaluate grids", &["--min-length-m", "--draw", "--json", "<MAPS>"]),
    ("evaluate visibility", &["--maps", "--points", "--seed", "--plot", "--json"]),
    ("train confidence", &["--quads", "--set", "--photographs", "--rust"]),
    (
        "train detector",
        &[
            "--scenes",
            "--pictures",
            "--weight",
            "--folds",
            "--held-out-seed",
            "--hidden",
            "--ridge",
            "--steps",
            "--out",
            "--rust",
            "--json",
            "[SETS]...",
        ],
    ),
    ("train similarity", &["--out", "--json", "--without", "--views", "--seed", "<SETS>"]),
    ("plot", &["--out", "--image", "--seed", "<STAGE>"]),
    ("bench", &["--frames", "--landmarks", "--rounds", "--seed", "--json"]),
    (
        "bench detect",
        &["--data", "--count", "--rounds", "--no-peers", "--python", "--seed", "--json", "[IMAGES]"],
    ),
    (
        "bench recognise",
        &[
            "--landmarks",
            "--taught",
            "--quads",
            "--recall-quads",
            "--frames",
            "--rounds",
            "--views",
            "--no-peers",
            "--python",
            "--seed",
            "--json",
        ],
    ),
];

#[test]
fn every_command_explains_its_options() {
    check_help(Path::new(PROGRAM), &OPTIONS, LONGEST);
}

#[test]
fn commands_in_the_documents_exist() {
    check_command_lines(Path::new(PROGRAM), "waymark-lab", 30, LONGEST);
}

#[test]
fn unknown_commands_and_values_are_refused() {
    for line in ["evaluate", "evaluate recognition --distance near .", "train", "plot icon", "serve"] {
        check_refused(Path::new(PROGRAM), line, LONGEST);
    }
}

#[test]
fn detection_is_timed_without_data_and_without_python() {
    let folder = TempDir::new().expect("a temporary directory");
    let nowhere = folder.path().join("nothing");
    let mut args: Vec<OsString> =
        ["bench", "detect", "--count", "1", "--rounds", "1", "--json"].map(Into::into).into();
    args.extend(["--python".into(), nowhere.clone().into(), "--data".into(), nowhere.into()]);
    let run = lab(args);
    assert!(run.stderr.contains("OpenCV is left out") && run.stderr.contains("pip install"), "{run:?}");
    let report = run.last_json();
    assert_eq!((&report["frames"], &report["from"]), (&1.into(), &"rendered corridors".into()), "{report}");
    let ms =
        |name: &str| report["ours"][name]["median_ms"].as_f64().unwrap_or_else(|| panic!("{name}: {report}"));
    assert!(0.0 < ms("edges") && ms("edges") < ms("frame to segments"), "{report}");
    assert!(report["stages_ms"]["quads"].as_f64().is_some_and(|ms| ms > 0.0), "{report}");
    assert_eq!(report["ratios"], Value::Array(vec![]), "{report}");
}
