//! Claim: a drive is recorded, played into another server as a robot and compared frame by frame; a
//! bag of ROS 2 that rosbags wrote gives the same answers as the same data by our own messages.

mod bags;
mod files;
mod poses;
mod readings;

use client::{api::NewMap, v1};
use map::pose2::Pose2;
use protos::{Key, Name, convert::geometry::pose2_wire};
use readings::{Reading, START_NS, write_recording};
use recordings::{Body, DriveReader, DriveWriter, Recorded};
use serde_json::{Value, json};
use server::config::Limits;
use sim::{
    building::Building,
    lesson::{LessonParams, stops},
    robot::{Robot, RobotParams},
};
use std::{fs::File, path::Path, sync::Arc, thread, time::Duration};
use tests::{
    Inside,
    command::{Run, waymark},
    robots::{MAP, put_walls, teach},
};

const LONGEST: Duration = Duration::from_mins(3);
const POSTERS: [&str; 2] = ["poster-0", "poster-1"];

/// A server whose map has two posters.
async fn taught(building: &Arc<Building>) -> Inside {
    let inside = Inside::start(Limits::default()).await;
    inside.maps().create_map(&NewMap::new(MAP)).await.expect("map");
    put_walls(&inside, building).await;
    teach(&inside, building, &POSTERS, 6).await;
    inside
}

/// Readings in front of the posters, with odometry that says where the robot is, as steps of one
/// drive.
fn in_front_of_posters(building: &Arc<Building>) -> Vec<Reading> {
    let mut robot = Robot::new(building.clone(), &RobotParams::default());
    let stops = stops(building, &LessonParams { seed: 5, views: 3, ..LessonParams::default() });
    let views = stops.iter().filter(|stop| POSTERS.contains(&stop.landmark.as_str()));
    views
        .map(|stop| {
            // Slow enough for a robot: odometry that jumps begins anew.
            let odom = Pose2::new(stop.step.map_from_robot.x_m * 0.1, 0.5, 0.25);
            Reading::simulated(&robot.look(&stop.step), odom)
        })
        .collect()
}

/// `waymark COMMAND FILE ...` against this server, unless the options name another.
fn run(inside: &Inside, command: &str, file: &Path, options: &[&str]) -> Run {
    let (url, zenoh) = (inside.url(), inside.server.zenoh_endpoint.clone());
    let mut line = vec![command, file.to_str().expect("a path"), "--json"];
    for (option, value) in [("--server", url.as_str()), ("--zenoh", zenoh.as_str())] {
        if !options.contains(&option) {
            line.extend([option, value]);
        }
    }
    waymark(line.iter().chain(options), LONGEST)
}

fn count(summary: &Value, pointer: &str) -> u64 {
    summary.pointer(pointer).and_then(Value::as_u64).unwrap_or_else(|| panic!("{pointer} of {summary}"))
}

#[tokio::test(flavor = "multi_thread")]
async fn a_drive_is_recorded_replayed_and_compared() {
    let building = Arc::new(Building::corridor(3));
    let inside = taught(&building).await;
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    let readings = in_front_of_posters(&building);
    write_recording(&at("drive.mcap"), &readings);

    let unknown = run(&inside, "replay", &at("drive.mcap"), &[]);
    assert_eq!(unknown.status, 0, "{unknown:?}");
    assert!(
        count(&unknown.last_json(), "/answered/rejected") > 0,
        "a robot that is not registered: {unknown:?}"
    );

    inside.maps().put_robot("r1", MAP).await.expect("robot");
    thread::scope(|scope| {
        let recorder = scope.spawn(|| run(&inside, "record", &at("heard.mcap"), &["--seconds", "20"]));
        while !at("heard.mcap").exists() {
            thread::sleep(Duration::from_millis(20));
        }
        let options =
            ["--map", MAP, "--answers", at("before.mcap").to_str().expect("a path")].map(str::to_owned);
        let options: Vec<&str> = options.iter().map(String::as_str).collect();
        let played = run(&inside, "replay", &at("drive.mcap"), &options);
        let summary = played.last_json();
        assert_eq!((played.status, count(&summary, "/frames")), (0, readings.len() as u64), "{played:?}");
        assert!(count(&summary, "/recognised") >= 3 && count(&summary, "/poses") >= 3, "{summary}");
        assert!(count(&summary, "/fused_poses") > 0, "{summary}");
        let recorded = recorder.join().expect("recorded");
        assert_eq!(recorded.status, 0, "{recorded:?}");
        assert_eq!(recorded.last_json()["maps"], json!([MAP]), "{recorded:?}");
    });
    let mut heard =
        DriveReader::open(File::open(at("heard.mcap")).expect("the recording")).expect("readable");
    let mut kinds = std::collections::BTreeMap::new();
    while let Some(message) = heard.next_message().expect("a message") {
        *kinds.entry(message.body.schema()).or_insert(0) += 1;
    }
    let n = readings.len();
    assert_eq!((kinds["waymark.v1.Frame"], kinds["waymark.v1.Answer"], kinds["waymark.v1.Scan"]), (n, n, n));
    assert!(kinds["waymark.v1.RobotPose"] > 0, "{kinds:?}");

    // What was heard has frames and their answers; the same server answers the same.
    let same = run(&inside, "replay", &at("heard.mcap"), &["--compare"]);
    assert_eq!((same.status, count(&same.last_json(), "/comparison/counts/same")), (0, n as u64), "{same:?}");

    inside.maps().delete_landmark(MAP, POSTERS[0]).await.expect("deleted");
    let before = at("before.mcap");
    let options = ["--compare", before.to_str().expect("a path")];
    let changed = run(&inside, "replay", &at("drive.mcap"), &options);
    let summary = changed.last_json();
    assert_eq!(changed.status, 1, "{changed:?}");
    assert!(count(&summary, "/comparison/counts/lost") > 0, "{summary}");
    let versions = &summary["comparison"]["map_versions"];
    assert!(versions[0] != versions[1], "two versions of the map: {summary}");
    inside.server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn failures_have_the_statuses_and_the_json_of_all_commands() {
    let inside = Inside::start(Limits::default()).await;
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    let robot = Name::new("r1").expect("a name");
    let file = File::create_new(at("drive.mcap")).expect("a file");
    let mut writer =
        DriveWriter::create(file, &Name::new("default").expect("a name"), "test").expect("begun");
    let odom_from_robot = Some(pose2_wire(&Pose2::default()));
    let odometry =
        v1::Odometry { epoch: 1, seq: 1, captured_ns: START_NS, odom_from_robot, ..v1::Odometry::default() };
    let (key, body) = (Key::Odometry(robot), Body::Odometry(odometry));
    writer.write(Recorded { log_time_ns: START_NS.unsigned_abs(), key, body }).expect("written");
    writer.finish().expect("finished");

    let nobody = ["--server", "http://127.0.0.1:1"];
    let (drive, new, missing) = (at("drive.mcap"), at("new.mcap"), at("missing.mcap"));
    let cases: [(&str, &Path, &[&str], i32, &str); 8] = [
        ("record", &new, &nobody, 6, "unreachable"),
        ("record", &new, &["--zenoh", "tcp/127.0.0.1:1"], 6, "unreachable"),
        ("record", &new, &["--seconds=-1"], 2, "usage"),
        ("record", &drive, &["--seconds", "1"], 4, "exists"),
        ("replay", &missing, &[], 2, "unreadable"),
        ("replay", &drive, &["--map", "nowhere"], 3, "unknown_map"),
        ("replay", &drive, &["--recorded", "r2"], 3, "not_recorded"),
        ("replay", &drive, &["--zenoh", "tcp/127.0.0.1:1"], 6, "unreachable"),
    ];
    for (command, file, options, status, code) in cases {
        let failed = run(&inside, command, file, options);
        let error: Value = serde_json::from_str(&failed.stderr).unwrap_or_else(|e| panic!("{e}: {failed:?}"));
        assert_eq!((failed.status, &error["error"]["code"]), (status, &json!(code)), "{failed:?}");
        assert_eq!((&error["error"]["exit_status"], failed.stdout.as_str()), (&json!(status), ""));
    }
    assert!(!new.exists(), "a recording that did not begin leaves no file");
    inside.server.stop().await;
}
