//! Claim: what a file of messages holds is played and built from, or a sentence says what it is and
//! what to do; nothing ends with status 0 where nothing was used.

use super::{LONGEST, count, poses::drive, run};
use client::api::NewMap;
use serde_json::Value;
use server::config::Limits;
use sim::building::Building;
use sim::laser::LaserParams;
use std::{fs, path::Path, sync::Arc};
use tests::{
    Inside,
    bag::{self, LaserTopic, Stop},
    command::{Run, waymark},
    open_data,
    robots::MAP,
};

/// Class, code and words of a failure.
fn failure(failed: &Run) -> (i32, String, String) {
    let error: Value = serde_json::from_str(&failed.stderr).unwrap_or_else(|e| panic!("{e}: {failed:?}"));
    let text = |field: &str| error["error"][field].as_str().expect("a text").to_owned();
    (failed.status, text("code"), format!("{} {}", text("detail"), text("advice")))
}

fn build(file: &Path, options: &[&str]) -> Run {
    waymark([&["map", "build", file.to_str().expect("a path"), "--json"], options].concat(), LONGEST)
}

#[test]
fn walls_are_built_from_a_bag() {
    let building = Arc::new(Building::corridor(3));
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("bag_0.mcap");
    let stops: Vec<Stop> = drive(&building)
        .into_iter()
        .map(|(readings, _)| Stop {
            odom_from_robot: readings.odom_from_robot,
            scan: readings.scan,
            picture: vision::frame::GrayImage::from_fn(64, 48, |_, _| 9),
            robot_from_camera: nalgebra::Isometry3::identity(),
        })
        .collect();
    bag::write(&file, &sim::camera::Camera::vga(), &stops);
    let options = ["--scan", "/lidar"];
    let built = build(&file, &options);
    assert_eq!((built.status, count(&built.last_json(), "/scans")), (0, stops.len() as u64), "{built:?}");
    assert!(count(&built.last_json(), "/segments") >= 2, "{built:?}");
    // The folder of a bag is the bag.
    let whole = build(folder.path(), &options);
    let without_times = |run: &Run| {
        let mut json = run.last_json();
        for times in ["seconds", "times_faster_than_recorded"] {
            json[times] = Value::Null;
        }
        json
    };
    assert_eq!(without_times(&whole), without_times(&built));

    let (status, code, words) = failure(&build(&file, &[]));
    assert_eq!((status, code.as_str()), (3, "no_scans"));
    assert!(
        words.contains("no topic /scan") && words.contains("--scan") && words.contains("/lidar"),
        "{words}"
    );
    let (status, code, words) = failure(&build(&file, &["--scan", "/tf"]));
    assert_eq!((status, code.as_str()), (3, "no_scans"));
    assert!(words.contains("tf2_msgs/msg/TFMessage"), "{words}");
    // Scans whose place by odometry nothing tells.
    let (status, code, words) = failure(&build(&file, &["--scan", "/lidar", "--odom-frame", "nowhere"]));
    assert_eq!((status, code.as_str()), (5, "no_scans"));
    assert!(words.contains("40 times") && words.contains("no odometry from `/tf`"), "{words}");
    assert!(words.contains("--odometry") && words.contains("--odom-frame"), "{words}");
}

/// `TurtleBot3` in Gazebo (ROBOTIS-GIT/turtlebot3 #404): 360 rays, a step of 0.017501922 rad, so
/// that the last one is the first one again.
#[tokio::test(flavor = "multi_thread")]
async fn the_scans_of_a_turtlebot_are_used_and_walls_are_built_of_them() {
    const RAYS: usize = 359;
    const STEP_RAD: f64 = 0.017_501_922_324_299_812;
    let building = Arc::new(Building::corridor(3));
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("bag_0.mcap");
    let laser =
        LaserParams { beams: RAYS, field_rad: (RAYS - 1) as f64 * STEP_RAD, ..LaserParams::default() };
    let stops: Vec<Stop> = drive(&building)
        .into_iter()
        .zip(1..)
        .map(|((readings, truth), seed)| Stop {
            odom_from_robot: readings.odom_from_robot,
            scan: sim::laser::scan(&building, &truth, &laser, seed),
            picture: vision::frame::GrayImage::from_fn(64, 48, |_, _| 9),
            robot_from_camera: nalgebra::Isometry3::identity(),
        })
        .collect();
    let topic = LaserTopic { topic: "/scan", repeats_first: true };
    bag::write_with(&file, &sim::camera::Camera::vga(), &stops, topic);
    let built = build(&file, &[]);
    assert_eq!((built.status, count(&built.last_json(), "/scans")), (0, stops.len() as u64), "{built:?}");

    let inside = Inside::start(Limits::default()).await;
    inside.maps().create_map(&NewMap::new(MAP)).await.expect("map");
    let mut files = vec![(file, stops.len() as u64)];
    // The bag of the report, where it is.
    files.extend(open_data("outside-inputs").map(|data| (data.join("l_tb3.mcap"), 1)));
    for (number, (file, least)) in files.iter().enumerate() {
        let robot = format!("tb{number}");
        let played = run(&inside, "replay", file, &["--robot", &robot, "--map", MAP]);
        assert_eq!(played.status, 0, "{played:?}");
        assert!(count(&played.last_json(), "/scans") >= *least, "{played:?}");
        let activity = inside.maps().robot(&robot).await.expect("the robot").activity.expect("activity");
        let scan = activity.inputs.iter().find(|input| input.input == "scan").expect("scans");
        assert_eq!((scan.refused, scan.used >= *least), (0, true), "{}: {scan:?}", file.display());
    }
    inside.server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn what_cannot_be_played_is_said_and_fails() {
    const IMAGE: &str = "sensor_msgs/msg/Image";
    const CHATTER: &str = "std_msgs/msg/String";
    let inside = Inside::start(Limits::default()).await;
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    let packed: &[u8] = b"\x28\xb5\x2f\xfd\x04\x00rest";
    bag::write_raw(&at("packed.mcap"), "cdr", &[("/cam/image_raw", IMAGE, packed), ("/scan", IMAGE, packed)]);
    bag::write_raw(&at("chatter.mcap"), "cdr", &[("/chatter", CHATTER, b"\0\x01\0\0")]);
    bag::write_raw(&at("ros1.mcap"), "ros1", &[("/scan", "sensor_msgs/LaserScan", b"\0\0\0\0")]);
    bag::write_raw(&at("empty.mcap"), "cdr", &[]);
    fs::write(at("old.db3"), b"SQLite format 3\0").expect("written");
    fs::write(at("old.bag"), b"#ROSBAG V2.0\n").expect("written");
    fs::write(at("whole.mcap.zstd"), packed).expect("written");
    fs::write(at("notes.mcap"), b"no messages at all").expect("written");
    fs::create_dir(at("bag")).expect("a folder");
    fs::write(at("bag/bag_0.db3"), b"SQLite format 3\0").expect("written");
    let cases: [(&str, i32, &str, &str); 9] = [
        ("packed.mcap", 2, "packed_messages", "ros2 bag convert"),
        ("chatter.mcap", 5, "nothing_played", "1 times messages of type"),
        ("ros1.mcap", 3, "not_recorded", "rosbags-convert"),
        ("empty.mcap", 3, "not_recorded", "No robot's messages"),
        ("old.db3", 2, "not_mcap", "ros2 bag convert"),
        ("old.bag", 2, "not_mcap", "rosbags-convert"),
        ("whole.mcap.zstd", 2, "not_mcap", "zstd -d"),
        ("notes.mcap", 1, "failed", "it is no MCAP file"),
        ("bag", 2, "not_mcap", "ros2 bag convert"),
    ];
    for (name, status, code, words) in cases {
        let failed = failure(&run(&inside, "replay", &at(name), &["--robot", "r1"]));
        assert_eq!((failed.0, failed.1.as_str()), (status, code), "{name}: {}", failed.2);
        assert!(failed.2.contains(words), "{name}: {}", failed.2);
        if !["notes.mcap", "chatter.mcap"].contains(&name) {
            let built = failure(&build(&at(name), &[]));
            assert_eq!((built.0, built.1.as_str()), (status, code), "map build {name}: {}", built.2);
        }
    }
    let (status, code, words) = failure(&build(&at("chatter.mcap"), &[]));
    assert_eq!((status, code.as_str()), (3, "no_scans"));
    assert!(words.contains("/chatter (std_msgs/msg/String)"), "{words}");
    inside.server.stop().await;
}
