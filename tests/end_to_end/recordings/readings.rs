//! What a robot measured at a stop, written as a recording of our own messages.

use client::v1;
use map::{laser::Scan, pose2::Pose2};
use protos::{
    Key, Name,
    convert::geometry::{intrinsics_wire, pose2_wire, pose3_wire},
};
use recordings::{Body, DriveWriter, Recorded};
use sim::robot::SensorReadings;
use std::{fs::File, path::Path};
use tests::robots::{jpeg, scan_of};
use vision::frame::Intrinsics;

/// When the drive was, ns, and how long it takes from stop to stop.
pub(super) const START_NS: i64 = 1_700_000_000_000_000_000;
const STEP_NS: i64 = 500_000_000;

/// Odometry, scan and picture of one time.
pub(super) struct Reading {
    pub(super) odom_from_robot: Pose2,
    pub(super) scan: Scan,
    pub(super) picture: Vec<u8>,
    pub(super) size_px: [u32; 2],
    pub(super) intrinsics: Intrinsics,
    pub(super) robot_from_camera: v1::Pose3,
}

impl Reading {
    pub(super) fn simulated(readings: &SensorReadings, odom_from_robot: Pose2) -> Self {
        let image = &readings.frame.image;
        Self {
            odom_from_robot,
            scan: readings.scan.clone(),
            picture: jpeg(image),
            size_px: [image.width() as u32, image.height() as u32],
            intrinsics: *sim::camera::Camera::vga().intrinsics(),
            robot_from_camera: pose3_wire(&readings.step.robot_from_camera),
        }
    }
}

pub(super) fn captured_ns(i: usize) -> i64 {
    START_NS + i as i64 * STEP_NS
}

/// The readings as a recording of robot `r1`.
pub(super) fn write_recording(path: &Path, readings: &[Reading]) {
    let (robot, camera) = (Name::new("r1").expect("a name"), Name::new("camera").expect("a name"));
    let fleet = Name::new("default").expect("a name");
    let mut writer =
        DriveWriter::create(File::create_new(path).expect("a file"), &fleet, "test").expect("begun");
    for (i, reading) in readings.iter().enumerate() {
        let (captured_ns, number) = (captured_ns(i), i as u64 + 1);
        let odom = pose2_wire(&reading.odom_from_robot);
        let odometry = v1::Odometry {
            epoch: 1,
            seq: number,
            captured_ns,
            odom_from_robot: Some(odom),
            ..v1::Odometry::default()
        };
        let scan = scan_of(&reading.scan, &reading.odom_from_robot, captured_ns);
        let frame = v1::Frame {
            epoch: 1,
            seq: number,
            captured_ns,
            encoding: v1::ImageEncoding::Jpeg.into(),
            width_px: reading.size_px[0],
            height_px: reading.size_px[1],
            image: reading.picture.clone().into(),
            intrinsics: Some(intrinsics_wire(&reading.intrinsics)),
            robot_from_camera: Some(reading.robot_from_camera),
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
