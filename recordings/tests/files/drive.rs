//! A short drive with a message of every kind.

use protos::{
    Key, Name,
    api::{Landmark, WallsBody},
    v1,
};
use recordings::{Body, DriveReader, DriveWriter, MapContent, ReadError, Recorded};
use std::io::Cursor;

/// When the drive begins, ns.
pub(crate) const START_NS: u64 = 1_700_000_000_000_000_000;
const STEP_NS: u64 = 50_000_000;

pub(crate) fn name(text: &str) -> Name {
    Name::new(text).expect("a name")
}

fn covariance() -> Vec<f64> {
    vec![0.01, 0.0, 0.0, 0.0, 0.01, 0.0, 0.0, 0.0, 0.001]
}

/// Five frames of each encoding that viewers know, with odometry, scans, answers and poses between
/// them.
pub(crate) fn messages(image_bytes: usize) -> Vec<Recorded> {
    let (robot, camera) = (name("r1"), name("front"));
    let mut all = Vec::new();
    for i in 0..15_u64 {
        let captured_ns = (START_NS + i * STEP_NS) as i64;
        let pose = v1::Pose2 { x_m: i as f64 * 0.1, y_m: 1.0, theta_rad: 0.2 };
        let fix = v1::Pose2Covariance { pose: Some(pose), covariance: covariance() };
        let frame = frame(i, captured_ns, pose, image_bytes);
        let answer = answer(&frame, fix.clone());
        let odometry = v1::Odometry {
            epoch: 7,
            seq: 3 * i,
            captured_ns,
            odom_from_robot: Some(pose),
            ..v1::Odometry::default()
        };
        let fused = v1::RobotPose {
            epoch: 7,
            captured_ns,
            map: "office".into(),
            map_from_robot: Some(fix),
            ..v1::RobotPose::default()
        };
        let bodies = [
            (Key::Odometry(robot.clone()), Body::Odometry(odometry)),
            (Key::Frame(robot.clone(), camera.clone()), Body::Frame(frame)),
            (Key::Scan(robot.clone()), Body::Scan(scan(3 * i + 2, captured_ns, pose))),
            (Key::Answer(robot.clone(), camera.clone()), Body::Answer(answer)),
            (Key::Pose(robot.clone()), Body::Pose(fused)),
        ];
        for (k, (key, body)) in (0..).zip(bodies) {
            all.push(Recorded { log_time_ns: START_NS + i * STEP_NS + k, key, body });
        }
    }
    let changed = v1::MapChanged { map: "office".into(), version: 5, ..v1::MapChanged::default() };
    let log_time_ns = START_NS + 15 * STEP_NS;
    all.push(Recorded { log_time_ns, key: Key::MapChanged(name("office")), body: Body::MapChanged(changed) });
    all
}

fn frame(i: u64, captured_ns: i64, odometry: v1::Pose2, image_bytes: usize) -> v1::Frame {
    let encoding = [v1::ImageEncoding::Jpeg, v1::ImageEncoding::Png, v1::ImageEncoding::Gray8];
    v1::Frame {
        epoch: 7,
        seq: 3 * i + 1,
        captured_ns,
        encoding: encoding[i as usize % 3].into(),
        width_px: 4,
        height_px: 3,
        image: (0..image_bytes).map(|k| (k as u64 * 7 + i) as u8).collect::<Vec<u8>>().into(),
        intrinsics: Some(v1::Intrinsics {
            fx_px: 500.0,
            fy_px: 500.0,
            cx_px: 2.0,
            cy_px: 1.5,
            ..v1::Intrinsics::default()
        }),
        robot_from_camera: Some(v1::Pose3 { qw: 1.0, z_m: 1.2, ..v1::Pose3::default() }),
        odometry: Some(odometry),
        ..v1::Frame::default()
    }
}

fn scan(seq: u64, captured_ns: i64, odometry: v1::Pose2) -> v1::Scan {
    v1::Scan {
        epoch: 7,
        seq,
        captured_ns,
        odom_from_robot: Some(odometry),
        robot_from_laser: Some(v1::Pose2 { x_m: 0.2, ..v1::Pose2::default() }),
        first_bearing_rad: -1.0,
        bearing_step_rad: 0.5,
        max_range_m: 30.0,
        ranges_m: vec![1.0, 2.5, 30.0, 4.0, 1.5],
        ..v1::Scan::default()
    }
}

fn answer(frame: &v1::Frame, fix: v1::Pose2Covariance) -> v1::Answer {
    let corner = |u_px, v_px| v1::Point { u_px, v_px };
    let quad = v1::QuadAnswer {
        corners: vec![corner(0.0, 0.0), corner(3.0, 0.0), corner(3.0, 2.0), corner(0.0, 2.0)],
        verdict: v1::Verdict::Unique.into(),
        sighting: v1::Sighting::Global.into(),
        landmark: "poster".into(),
        score: 0.9,
        ..v1::QuadAnswer::default()
    };
    v1::Answer {
        epoch: 7,
        seq: frame.seq,
        captured_ns: frame.captured_ns,
        map: "office".into(),
        map_version: 4,
        status: v1::Status::Matched.into(),
        quads: vec![quad],
        map_from_robot: Some(fix),
        ..v1::Answer::default()
    }
}

/// The landmark of the map.
pub(crate) fn landmark() -> Landmark {
    serde_json::from_value(serde_json::json!({
        "name": "poster", "status": "active", "failed_gates": [], "waived_gates": [], "views": 3,
        "size": { "width_m": 0.6, "height_m": 0.84 },
        "place": { "x_m": 1.0, "y_m": 2.0, "z_m": 1.5, "theta_rad": -std::f64::consts::FRAC_PI_2 },
        "health": "sound",
    }))
    .expect("a landmark")
}

/// A recording of these messages, with a map before them.
pub(crate) fn file(messages: &[Recorded]) -> Vec<u8> {
    let mut file = Cursor::new(Vec::new());
    let mut writer = DriveWriter::create(&mut file, &name("default"), "test").expect("a file");
    let walls: WallsBody = [[[0.0, 0.0], [4.0, 0.0]], [[4.0, 0.0], [4.0, 2.0]]].into_iter().collect();
    let content = MapContent { map: "office", version: 4, walls: &walls, landmarks: &[landmark()] };
    writer.write_map(&content, START_NS).expect("written");
    for message in messages {
        writer.write(message.clone()).expect("written");
    }
    let written = writer.finish().expect("finished");
    assert_eq!(written.messages, messages.len() as u64);
    file.into_inner()
}

/// All messages of a file.
pub(crate) fn read(file: &[u8]) -> Result<Vec<Recorded>, ReadError> {
    let mut reader = DriveReader::open(Cursor::new(file))?;
    let mut all = Vec::new();
    while let Some(message) = reader.next_message()? {
        all.push(message);
    }
    Ok(all)
}
