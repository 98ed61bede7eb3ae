//! Claim: a drive is recorded, played into another server as a robot and compared frame by frame; a bag of ROS 2 that
//! rosbags wrote gives the same answers as the same data by our own messages.

use client::{api::NewMap, v1};
use map::pose2::Pose2;
use protos::{
    Key, Name,
    convert::geometry::{intrinsics_wire, pose2_wire, pose3_wire},
};
use recordings::{Body, DriveReader, DriveWriter, Recorded};
use serde_json::{Value, json};
use server::config::Limits;
use sim::{
    building::Building,
    lesson::{LessonParams, stops},
    robot::{Robot, RobotParams, SensorReadings},
};
use std::{
    fs::{self, File},
    path::{Path, PathBuf},
    process::Command,
    sync::Arc,
    thread,
    time::Duration,
};
use tests::{
    Inside,
    command::{Run, waymark},
    robots::{MAP, jpeg, put_walls, scan_of, teach},
};

const LONGEST: Duration = Duration::from_mins(3);
const POSTERS: [&str; 2] = ["poster-0", "poster-1"];
/// When the drive was, ns, and how long it takes from view to view.
const START_NS: i64 = 1_700_000_000_000_000_000;
const STEP_NS: i64 = 500_000_000;

/// A server whose map has two posters.
async fn taught(building: &Arc<Building>) -> Inside {
    let inside = Inside::start(Limits::default()).await;
    inside.maps().create_map(&NewMap::new(MAP)).await.expect("map");
    put_walls(&inside, building).await;
    teach(&inside, building, &POSTERS, 6).await;
    inside
}

/// Readings in front of the posters, with odometry that says where the robot is, as steps of one drive.
fn readings(building: &Arc<Building>) -> Vec<SensorReadings> {
    let mut robot = Robot::new(building.clone(), &RobotParams::default());
    let stops = stops(building, &LessonParams { seed: 5, views: 3, ..LessonParams::default() });
    let views = stops.iter().filter(|stop| POSTERS.contains(&stop.landmark.as_str()));
    views
        .map(|stop| {
            let mut readings = robot.look(&stop.step);
            // Slow enough for a robot: odometry that jumps begins anew.
            readings.step.odom_from_robot = Pose2::new(stop.step.map_from_robot.x_m * 0.1, 0.5, 0.25);
            readings
        })
        .collect()
}

fn captured_ns(i: usize) -> i64 {
    START_NS + i as i64 * STEP_NS
}

/// The readings as a recording of robot `r1`.
fn write_recording(path: &Path, readings: &[SensorReadings]) {
    let (robot, camera) = (Name::new("r1").expect("a name"), Name::new("camera").expect("a name"));
    let fleet = Name::new("default").expect("a name");
    let mut writer =
        DriveWriter::create(File::create_new(path).expect("a file"), &fleet, "test").expect("begun");
    for (i, readings) in readings.iter().enumerate() {
        let (captured_ns, number) = (captured_ns(i), i as u64 + 1);
        let odom = pose2_wire(&readings.step.odom_from_robot);
        let odometry = v1::Odometry { epoch: 1, seq: number, captured_ns, odom_from_robot: Some(odom) };
        let scan = scan_of(&readings.scan, &readings.step.odom_from_robot, captured_ns);
        let frame = v1::Frame {
            epoch: 1,
            seq: number,
            captured_ns,
            encoding: v1::ImageEncoding::Jpeg.into(),
            width_px: readings.frame.image.width() as u32,
            height_px: readings.frame.image.height() as u32,
            image: jpeg(&readings.frame.image).into(),
            intrinsics: Some(intrinsics_wire(sim::camera::Camera::vga().intrinsics())),
            robot_from_camera: Some(pose3_wire(&readings.step.robot_from_camera)),
            odometry: Some(odom),
            ..v1::Frame::default()
        };
        let bodies = [
            (Key::Odometry(robot.clone()), Body::Odometry(odometry)),
            (Key::Scan(robot.clone()), Body::Scan(v1::Scan { epoch: 1, seq: number, ..scan })),
            (Key::Frame(robot.clone(), camera.clone()), Body::Frame(frame)),
        ];
        for (k, (key, body)) in (0..).zip(bodies) {
            let log_time_ns = captured_ns.unsigned_abs() + k;
            writer.write(Recorded { log_time_ns, key, body }).expect("written");
        }
    }
    writer.finish().expect("finished");
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
    let readings = readings(&building);
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
    let odometry = v1::Odometry { epoch: 1, seq: 1, captured_ns: START_NS, odom_from_robot };
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

/// A Python with rosbags: that of `WAYMARK_PYTHON`, or a fresh environment in `folder`.
fn python(folder: &Path) -> Result<PathBuf, String> {
    if let Some(python) = std::env::var_os("WAYMARK_PYTHON") {
        return Ok(python.into());
    }
    let run = |program: &Path, args: &[&str]| {
        let done = Command::new(program).args(args).output().map_err(|e| e.to_string())?;
        done.status.success().then_some(()).ok_or_else(|| String::from_utf8_lossy(&done.stderr).into_owned())
    };
    let environment = folder.join("venv");
    run(Path::new("python3"), &["-m", "venv", &environment.to_string_lossy()])?;
    let python = environment.join("bin/python");
    run(&python, &["-m", "pip", "install", "--quiet", "rosbags==0.11.9", "mcap==1.6.0"])?;
    Ok(python)
}

/// The readings as numbers and pictures for `bag.py`.
fn write_readings(folder: &Path, readings: &[SensorReadings]) {
    let camera = sim::camera::Camera::vga();
    let k = camera.intrinsics();
    let frames: Vec<Value> = readings
        .iter()
        .enumerate()
        .map(|(i, readings)| {
            let picture = folder.join(format!("{i}.jpg"));
            fs::write(&picture, jpeg(&readings.frame.image)).expect("a picture");
            let mounting = pose3_wire(&readings.step.robot_from_camera);
            let (odom, scan) = (readings.step.odom_from_robot, &readings.scan);
            json!({
                "at_ns": captured_ns(i),
                "picture": picture,
                "odom": [odom.x_m, odom.y_m, odom.theta_rad],
                "camera": [mounting.x_m, mounting.y_m, mounting.z_m, mounting.qx, mounting.qy, mounting.qz, mounting.qw],
                "laser": { "pose": [scan.robot_from_laser().x_m, scan.robot_from_laser().y_m, scan.robot_from_laser().theta_rad],
                    "first": scan.bearing_rad(0), "step": scan.bearing_step_rad(), "max": scan.max_range_m(),
                    "ranges": scan.ranges_m() },
            })
        })
        .collect();
    let image = &readings[0].frame.image;
    let all = json!({ "width": image.width(), "height": image.height(), "frames": frames,
        "k": [k.fx_px, 0, k.cx_px, 0, k.fy_px, k.cy_px, 0, 0, 1] });
    fs::write(folder.join("readings.json"), all.to_string()).expect("the readings");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_bag_gives_the_same_answers_as_our_own_messages() {
    let folder = tempfile::tempdir().expect("a folder");
    let python = match python(folder.path()) {
        Ok(python) => python,
        Err(reason) => return println!("skipped: rosbags cannot be installed: {reason}"),
    };
    let building = Arc::new(Building::corridor(3));
    let inside = taught(&building).await;
    let at = |name: &str| folder.path().join(name);
    let readings = readings(&building);
    write_recording(&at("own.mcap"), &readings);
    write_readings(folder.path(), &readings);
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("end_to_end/bag.py");
    let made = Command::new(python).arg(script).arg(folder.path()).output().expect("Python");
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));

    let answers = at("own-answers.mcap");
    let answers = answers.to_str().expect("a path");
    let own = run(&inside, "replay", &at("own.mcap"), &["--map", MAP, "--answers", answers]);
    assert_eq!(own.status, 0, "{own:?}");
    let own = own.last_json();
    assert!(count(&own, "/recognised") >= 3 && count(&own, "/poses") >= 3, "{own}");
    // Another server with the same map: the first one knows where the robot is.
    inside.server.stop().await;
    let inside = taught(&building).await;
    let bag = run(&inside, "replay", &at("bag.mcap"), &["--robot", "r1", "--map", MAP, "--compare", answers]);
    let summary = bag.last_json();
    let n = readings.len() as u64;
    assert_eq!((bag.status, count(&summary, "/comparison/counts/same")), (0, n), "{bag:?}");
    assert_eq!((count(&summary, "/scans"), count(&summary, "/odometry")), (n, n), "{summary}");
    assert_eq!(summary["poses"], own["poses"], "{summary}");
    assert_eq!(summary["problems"], json!({}), "{summary}");
    inside.server.stop().await;
}
