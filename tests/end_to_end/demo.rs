//! Claim: the demo runs without preparation: no landmark is named wrongly, and its robot is
//! localised better than by odometry alone. Its drive is recorded on demand, and a survey makes a
//! map of the recording. One drive of a robot that knows nothing is a lesson, too.

use recordings::{Body, DriveReader};
use serde_json::Value;
use std::{fs::File, path::Path, time::Duration};
use tests::command::waymark;

const LONGEST: Duration = Duration::from_mins(4);

fn number(summary: &Value, pointer: &str) -> f64 {
    summary.pointer(pointer).and_then(Value::as_f64).unwrap_or_else(|| panic!("{pointer} of {summary}"))
}

#[test]
fn a_robot_of_the_demo_is_localised() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("demo.mcap");
    let args = "demo --robots 1 --legs 1 --rate-hz 1 --seed 2 --json --http 127.0.0.1:0 --record";
    let run = waymark(args.split(' ').chain([file.to_str().expect("a path")]), LONGEST);
    assert_eq!(run.status, 0, "{run:?}");
    assert_eq!(run.stdout.lines().count(), 1, "results only: {run:?}");
    let summary = run.last_json();
    let of = |pointer| number(&summary, pointer);
    assert!(of("/frames") >= 30.0 && of("/answers") <= of("/frames"), "{summary}");
    assert!(of("/landmarks_active") >= 4.0, "{summary}");
    assert_eq!((&summary["false_matches"], &summary["false_guided"]), (&0.into(), &0.into()), "{summary}");
    assert!(of("/guided") > 0.0, "{summary}");
    assert!(of("/recognitions") > 0.0 && of("/corrections") > 0.0, "{summary}");
    let (with, without) = (of("/position_error_m/median"), of("/odometry_error_m/median"));
    assert!(with < 0.2 && with < without, "{with} m with landmarks, {without} m without: {summary}");

    let mut drive = DriveReader::open(File::open(&file).expect("the recording")).expect("readable");
    let (mut frames, mut answers) = (0, 0);
    while let Some(message) = drive.next_message().expect("a message") {
        frames += usize::from(matches!(message.body, Body::Frame(_)));
        answers += usize::from(matches!(message.body, Body::Answer(_)));
    }
    assert_eq!((frames as f64, answers as f64), (of("/frames"), of("/answers")), "{summary}");
    let alone = a_recording_is_surveyed(&file);
    two_recordings_are_one_map(&file, &alone);
}

/// The landmarks that a survey accepts.
fn accepted(report: &Value) -> Vec<&Value> {
    let landmarks = report["landmarks"].as_array().expect("landmarks");
    landmarks.iter().filter(|landmark| landmark["refused"].is_null()).collect()
}

fn a_recording_is_surveyed(file: &Path) -> Value {
    let run = waymark(["survey", file.to_str().expect("a path"), "--json"], LONGEST);
    assert_eq!(run.status, 0, "{run:?}");
    assert!(run.stderr.contains("--into MAP"), "{run:?}");
    let report = run.last_json();
    let found = accepted(&report);
    assert!(found.len() >= 3, "{report}");
    for landmark in found {
        // Posters hang on walls, in reach of the eye, and are no larger than a door.
        let of = |field: &str| number(landmark, field);
        assert!((0.8..2.2).contains(&of("/z_m")) && of("/sigma_m") < 0.3, "{landmark}");
        assert!((0.2..2.5).contains(&of("/width_m")) && (0.2..2.5).contains(&of("/height_m")), "{landmark}");
    }
    assert!(number(&report, "/walls") >= 4.0 && number(&report, "/distance_m") > 15.0, "{report}");
    report
}

/// The same drive twice is two drives through one building. The map begins where it is told to: it
/// is that of the first drive `alone`, turned to the left and moved.
fn two_recordings_are_one_map(file: &Path, alone: &Value) {
    let again = file.with_file_name("again.mcap");
    std::fs::copy(file, &again).expect("a copy");
    let [file, again] = [file, &again].map(|path| path.to_str().expect("a path"));
    let origin = format!("--origin=3,-2,{}", std::f64::consts::FRAC_PI_2);
    let run = waymark(["survey", file, again, &origin, "--json"], LONGEST);
    assert_eq!(run.status, 0, "{run:?}");
    let report = run.last_json();
    assert_eq!(report["odometry_scale_percent"].as_array().map(Vec::len), Some(2), "{report}");
    assert!((number(&report, "/frames") - 2.0 * number(alone, "/frames")).abs() < 1e-9, "{report}");
    let (found, before) = (accepted(&report), accepted(alone));
    assert!(found.len() >= 3, "{report}");
    for landmark in found {
        let of = |field: &str| number(landmark, field);
        let [x, y] = [of("/y_m") + 2.0, 3.0 - of("/x_m")];
        let there = |other: &&&Value| (number(other, "/x_m") - x).hypot(number(other, "/y_m") - y) < 0.15;
        let one = before.iter().find(there).unwrap_or_else(|| panic!("{landmark} in {alone}"));
        assert!(of("/views") > 1.5 * number(one, "/views"), "{landmark} {one}");
    }
}

#[test]
fn one_drive_of_a_robot_that_knows_nothing_surveys_the_corridor() {
    let args = "demo --survey --robots 1 --legs 1 --rate-hz 2 --seed 2 --json --http 127.0.0.1:0";
    let run = waymark(args.split(' '), LONGEST);
    assert_eq!(run.status, 0, "{run:?}");
    let summary = run.last_json();
    let of = |pointer| number(&summary, pointer);
    assert_eq!((&summary["false_matches"], &summary["false_guided"]), (&0.into(), &0.into()), "{summary}");
    assert!(of("/landmarks_active") >= 4.0 && of("/corrections") > 10.0, "{summary}");
    assert!(of("/recognitions") > 0.8 * of("/landmark_views"), "{summary}");
    assert!(of("/position_error_m/median") < 0.08 && of("/position_error_m/p95") < 0.13, "{summary}");
}
