//! Claim: `waymark replay --poses` writes the fused poses with the stamps of the recording, and
//! they are where the robot was; the walls of `waymark map build` from the same recording are those
//! of the building.

use super::{
    LONGEST, count,
    readings::{Reading, captured_ns, write_recording},
    run, taught,
};
use map::pose2::Pose2;
use sim::{
    building::Building,
    drive::DriveParams,
    robot::{Robot, RobotParams},
};
use std::{collections::BTreeMap, fs, sync::Arc};
use tests::{command::waymark, robots::MAP};

/// Steps of the drive: past both posters.
const STEPS: usize = 40;

/// A drive along the corridor with its truth.
pub(super) fn drive(building: &Arc<Building>) -> Vec<(Reading, Pose2)> {
    let drive = DriveParams { seed: 7, rate_hz: 2.0, legs: 1, ..DriveParams::default() };
    let robot = Robot::new(building.clone(), &RobotParams { drive, ..RobotParams::default() });
    let steps = robot.take(STEPS);
    steps.map(|r| (Reading::simulated(&r, r.step.odom_from_robot), r.step.map_from_robot)).collect()
}

/// Poses by stamp (ns), and how many comments there are.
fn tum(text: &str) -> (BTreeMap<i64, Pose2>, usize) {
    let (comments, lines): (Vec<&str>, Vec<&str>) = text.lines().partition(|line| line.starts_with('#'));
    let pose = |line: &&str| {
        let words: Vec<&str> = line.split(' ').collect();
        assert_eq!(words.len(), 8, "{line}");
        let (seconds, fraction) = words[0].split_once('.').expect("a fraction");
        assert_eq!(fraction.len(), 9, "{line}");
        let stamp: i64 = format!("{seconds}{fraction}").parse().expect("ns");
        let number = |i: usize| words[i].parse::<f64>().expect("a number");
        assert!((number(6).hypot(number(7)) - 1.0).abs() < 1e-6, "a unit quaternion: {line}");
        (stamp, Pose2::new(number(1), number(2), 2.0 * number(6).atan2(number(7))))
    };
    (lines.iter().map(pose).collect(), comments.len())
}

#[tokio::test(flavor = "multi_thread")]
async fn fused_poses_of_a_replay_are_where_the_robot_was() {
    let building = Arc::new(Building::corridor(3));
    let inside = taught(&building).await;
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    let (readings, truth): (Vec<_>, Vec<_>) = drive(&building).into_iter().unzip();
    write_recording(&at("drive.mcap"), &readings);
    let out = at("out.tum");
    let options = ["--map", MAP, "--speed", "2", "--poses", out.to_str().expect("a path")];
    let played = run(&inside, "replay", &at("drive.mcap"), &options);
    assert_eq!(played.status, 0, "{played:?}");
    let (poses, comments) = tum(&fs::read_to_string(&out).expect("the poses"));
    assert_eq!(count(&played.last_json(), "/poses_written"), poses.len() as u64);
    assert!(comments >= 2, "the head says what the columns are");
    assert!(poses.len() >= STEPS / 3, "{} poses of {STEPS} steps", poses.len());
    let mut errors_m = Vec::new();
    for (stamp_ns, pose) in &poses {
        let i = (0..STEPS).find(|i| captured_ns(*i) == *stamp_ns);
        let i = i.unwrap_or_else(|| panic!("{stamp_ns} is no stamp of the recording"));
        errors_m.push((pose.x_m - truth[i].x_m).hypot(pose.y_m - truth[i].y_m));
        let turned = (pose.theta_rad - truth[i].theta_rad).sin().abs();
        assert!(turned < 0.2, "step {i}: {turned} rad off");
    }
    errors_m.sort_by(f64::total_cmp);
    let (median, worst) = (errors_m[errors_m.len() / 2], errors_m[errors_m.len() - 1]);
    assert!(median < 0.1 && worst < 0.5, "median {median} m, worst {worst} m");

    let again = run(&inside, "replay", &at("drive.mcap"), &options);
    assert_eq!(again.status, 4, "no file is overwritten: {again:?}");
    inside.server.stop().await;
}

/// Distance of the two longest walls, metres: the width of a corridor.
fn between_longest_m(mut walls: Vec<[[f64; 2]; 2]>) -> f64 {
    let along = |[a, b]: &[[f64; 2]; 2]| [b[0] - a[0], b[1] - a[1]];
    let length = |wall: &[[f64; 2]; 2]| along(wall)[0].hypot(along(wall)[1]);
    walls.sort_by(|a, b| length(b).total_cmp(&length(a)));
    let ([x, y], [from, _]) = (along(&walls[0]), walls[0]);
    let middle = [0, 1].map(|k| 0.5 * (walls[1][0][k] + walls[1][1][k]) - from[k]);
    (x * middle[1] - y * middle[0]).abs() / length(&walls[0])
}

#[test]
fn walls_are_built_from_a_recording() {
    let building = Arc::new(Building::corridor(3));
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name).to_str().expect("a path").to_owned();
    let readings: Vec<_> = drive(&building).into_iter().map(|(reading, _)| reading).collect();
    let scans = readings.len() as u64;
    write_recording(at("drive.mcap").as_ref(), &readings);
    let built = waymark(["map", "build", &at("drive.mcap"), "--out", &at("map.json"), "--json"], LONGEST);
    assert_eq!(built.status, 0, "{built:?}");
    let summary = built.last_json();
    assert_eq!(count(&summary, "/scans"), scans, "{summary}");
    assert!(count(&summary, "/segments") >= 2, "{summary}");
    assert!(summary["times_faster_than_recorded"].is_number(), "scans have their times: {summary}");
    let map: serde_json::Value =
        serde_json::from_str(&fs::read_to_string(at("map.json")).expect("a map")).expect("JSON");
    let end = |wall: &serde_json::Value, end: &str| -> [f64; 2] {
        serde_json::from_value(wall[end].clone()).expect("a point")
    };
    let built =
        map["segments"].as_array().expect("walls").iter().map(|wall| [end(wall, "a"), end(wall, "b")]);
    let walls = building.walls().iter().map(|w| [[w.a_m.x, w.a_m.y], [w.b_m.x, w.b_m.y]]);
    let (width_m, true_m) = (between_longest_m(built.collect()), between_longest_m(walls.collect()));
    assert!((width_m - true_m).abs() < 0.05, "the corridor is {true_m} m wide, not {width_m} m");

    // A second robot in the file: which is meant is asked, and named.
    let other = waymark(["map", "build", &at("drive.mcap"), "--recorded", "r9", "--json"], LONGEST);
    assert!(
        other.status == 3 && other.stderr.contains("not_recorded") && other.stderr.contains("r1"),
        "{other:?}"
    );
    // One that is cut is used up to there.
    let whole = fs::read(at("drive.mcap")).expect("the recording");
    fs::write(at("cut.mcap"), &whole[..whole.len() * 2 / 3]).expect("written");
    let cut = waymark(["map", "build", &at("cut.mcap"), "--json"], LONGEST);
    assert!(cut.status == 0 && cut.stderr.contains("ends inside a record"), "{cut:?}");
    assert!(count(&cut.last_json(), "/scans") < scans, "{cut:?}");
}
