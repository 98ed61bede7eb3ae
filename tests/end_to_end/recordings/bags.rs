//! Bags of ROS 2 that rosbags writes: from simulated readings, and from open photographs and an
//! open laser log.

use super::{
    LONGEST, count, in_front_of_posters,
    readings::{Reading, captured_ns, write_recording},
    run, taught,
};
use client::{
    LandmarkRegion,
    api::{NewMap, Place, Size},
    v1,
};
use formats::scan_log::{self, LaserDefaults};
use serde_json::{Value, json};
use server::config::Limits;
use sim::building::Building;
use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
    sync::Arc,
};
use tests::{Inside, SOON, command::waymark, open_data, robots::MAP, skipped};
use vision::frame::{Distortion, Intrinsics};

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

/// Writes the readings as `own.mcap`, our messages, and as `bag.mcap`. False without rosbags, which
/// is printed.
fn write_both(folder: &Path, readings: &[Reading]) -> bool {
    let python = match python(folder) {
        Ok(python) => python,
        Err(reason) => {
            skipped(&format!("rosbags cannot be installed: {reason}"));
            return false;
        }
    };
    write_recording(&folder.join("own.mcap"), readings);
    let frames = readings.iter().enumerate().map(|(i, reading)| {
        let picture = folder.join(format!("{i}.jpg"));
        fs::write(&picture, &reading.picture).expect("a picture");
        let (camera, odom, scan) = (reading.robot_from_camera, reading.odom_from_robot, &reading.scan);
        let (k, laser) = (reading.intrinsics, scan.robot_from_laser());
        json!({
            "at_ns": captured_ns(i),
            "picture": picture,
            "size": reading.size_px,
            "k": [k.fx_px, 0, k.cx_px, 0, k.fy_px, k.cy_px, 0, 0, 1],
            "odom": [odom.x_m, odom.y_m, odom.theta_rad],
            "camera": [camera.x_m, camera.y_m, camera.z_m, camera.qx, camera.qy, camera.qz, camera.qw],
            "laser": { "pose": [laser.x_m, laser.y_m, laser.theta_rad], "first": scan.bearing_rad(0),
                "step": scan.bearing_step_rad(), "max": scan.max_range_m(), "ranges": scan.ranges_m() },
        })
    });
    let all = json!({ "frames": frames.collect::<Vec<_>>() });
    fs::write(folder.join("readings.json"), all.to_string()).expect("the readings");
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("end_to_end/recordings/bag.py");
    let made = Command::new(python).arg(script).arg(folder).output().expect("Python");
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    true
}

/// Plays our own messages as robot `r1`; the counts. The answers are in `own-answers.mcap`.
fn play_own(inside: &Inside, folder: &Path) -> Value {
    let answers = folder.join("own-answers.mcap");
    let options = ["--map", MAP, "--answers", answers.to_str().expect("a path")];
    let own = run(inside, "replay", &folder.join("own.mcap"), &options);
    assert_eq!(own.status, 0, "{own:?}");
    own.last_json()
}

/// Plays the bag, and checks that every answer is that of our own messages, whose counts are `own`.
fn check_bag(inside: &Inside, folder: &Path, own: &Value, readings: usize) {
    let answers = folder.join("own-answers.mcap");
    let options = ["--robot", "r1", "--map", MAP, "--compare", answers.to_str().expect("a path")];
    let bag = run(inside, "replay", &folder.join("bag.mcap"), &options);
    let (summary, n) = (bag.last_json(), readings as u64);
    assert_eq!((bag.status, count(&summary, "/comparison/counts/same")), (0, n), "{bag:?}");
    assert_eq!((count(&summary, "/scans"), count(&summary, "/odometry")), (n, n), "{summary}");
    assert_eq!(summary["poses"], own["poses"], "{summary}");
    assert_eq!(summary["problems"], json!({}), "{summary}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_bag_gives_the_same_answers_as_our_own_messages() {
    let folder = tempfile::tempdir().expect("a folder");
    let building = Arc::new(Building::corridor(3));
    let readings = in_front_of_posters(&building);
    if !write_both(folder.path(), &readings) {
        return;
    }
    let inside = taught(&building).await;
    let own = play_own(&inside, folder.path());
    assert!(count(&own, "/recognised") >= 3 && count(&own, "/poses") >= 3, "{own}");
    // Another server with the same map: the first one knows where the robot is.
    inside.server.stop().await;
    let inside = taught(&building).await;
    check_bag(&inside, folder.path(), &own, readings.len());
    inside.server.stop().await;
}

/// Photographs of paintings, of which [`TAUGHT`] are known, with the number of the scan that was
/// measured with each. The first three show painting 258 to a robot that stands where the log
/// begins.
const PHOTOGRAPHS: [(&str, usize); 9] = [
    ("w22a_021", 0),
    ("w22a_021", 0),
    ("w22a_021", 0),
    ("w19a_000", 1),
    ("w19a_021", 2),
    ("w19a_022", 3),
    ("w19d_018", 4),
    ("w19e_010", 5),
    ("w19b_009", 6),
];
const TAUGHT: [&str; 3] = ["81", "90", "258"];

/// The camera on the robot, as the first photograph has it: ahead, 1.2 m above the floor, 0.9
/// degrees down.
const MOUNTING: v1::Pose3 =
    v1::Pose3 { x_m: 0.0414, y_m: 0.0479, z_m: 1.1945, qx: -0.49559, qy: 0.51238, qz: -0.50140, qw: 0.49037 };

/// A map with the walls of this log. Painting 258 hangs where the first photograph shows it to a
/// robot at the log's first pose, the origin of the map.
async fn museum(log: &Path, paintings: &Path) -> Inside {
    let inside = Inside::start(Limits::default()).await;
    let maps = inside.maps();
    maps.create_map(&NewMap::new(MAP)).await.expect("map");
    let url = inside.url();
    let build =
        ["map", "build", log.to_str().expect("a path"), "--into", MAP, "--yes", "--json", "--server", &url];
    let built = waymark(build, LONGEST);
    assert_eq!(built.status, 0, "{built:?}");
    let (width_m, height_m) = (0.665, 0.80);
    for name in TAUGHT {
        let theta_rad = std::f64::consts::PI;
        let place = Place { x_m: 1.4, y_m: 0.0, z_m: 1.2, theta_rad, ..Place::default() };
        let place = (name == "258").then_some(place);
        maps.add_landmark(MAP, name, Some(Size { width_m, height_m }), place).await.expect("landmark");
        let picture = fs::read(paintings.join(format!("db/{name:0>5}.jpg"))).expect("a painting");
        maps.upload_view(MAP, name, picture, LandmarkRegion::WholeImage).await.expect("view");
    }
    let job = maps.learn(MAP, None, None).await.expect("job");
    maps.wait_for_job(job, 3 * SOON, |_| {}).await.expect("the lesson ends");
    inside
}

/// The photographs, each with a scan of the log and the odometry of the same time.
fn in_a_museum(log: &Path, paintings: &Path) -> Vec<Reading> {
    let log = scan_log::read(log, &LaserDefaults::default()).expect("the log");
    let reading = |(photograph, scan): &(&str, usize)| {
        let picture = fs::read(paintings.join(format!("wall/{photograph}.jpg"))).expect("a photograph");
        let image = image::load_from_memory(&picture).expect("an image");
        let size_px = [image.width(), image.height()];
        let [cx_px, cy_px] = size_px.map(|size| f64::from(size) / 2.0);
        Reading {
            odom_from_robot: log.records[*scan].odom,
            scan: log.records[*scan].scan.clone(),
            picture,
            size_px,
            intrinsics: Intrinsics::new(900.0, 900.0, cx_px, cy_px, Distortion::default()).expect("a camera"),
            robot_from_camera: MOUNTING,
        }
    };
    PHOTOGRAPHS.iter().map(reading).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_bag_of_open_data_gives_the_same_answers_as_our_own_messages() {
    let (Some(paintings), Some(logs)) = (open_data("museum-paintings"), open_data("laser-carmen-corrected"))
    else {
        return;
    };
    let log = logs.join("orebro-corrected.log.gz");
    let folder = tempfile::tempdir().expect("a folder");
    let readings = in_a_museum(&log, &paintings);
    if !write_both(folder.path(), &readings) {
        return;
    }
    let inside = museum(&log, &paintings).await;
    let own = play_own(&inside, folder.path());
    assert!(count(&own, "/recognised") >= 5 && count(&own, "/poses") >= 3, "{own}");
    assert!(count(&own, "/fused_poses") > 3, "the laser carries the pose on: {own}");
    inside.server.stop().await;
    let inside = museum(&log, &paintings).await;
    check_bag(&inside, folder.path(), &own, readings.len());
    inside.server.stop().await;
}
