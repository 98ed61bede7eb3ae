//! A small bag of ROS 2 with MCAP storage, as `ros2 bag record -s mcap` writes it: a camera without
//! compression, a laser, and odometry in the transforms alone.

use map::{laser::Scan, pose2::Pose2};
use mcap::{Writer, records::MessageHeader};
use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use ros2::{
    convert::quaternion,
    messages::{
        self, CameraInfo, Header, Image, LaserScan, Message, RegionOfInterest, TFMessage, Time, Transform,
        TransformStamped,
    },
};
use sim::camera::Camera;
use std::{collections::BTreeMap, fs::File, io::BufWriter, path::Path};
use vision::frame::GrayImage;

/// When the bag begins, ns, and what lies between two stops.
const START_NS: i64 = 1_700_000_000_000_000_000;
const STEP_NS: i64 = 500_000_000;

/// What a robot measured at a stop.
#[derive(Debug)]
pub struct Stop {
    /// Where it was by its odometry.
    pub odom_from_robot: Pose2,
    /// What its laser measured.
    pub scan: Scan,
    /// What its camera saw.
    pub picture: GrayImage,
    /// Where that was.
    pub robot_from_camera: Isometry3<f64>,
}

/// How a laser is published.
#[derive(Debug, Clone, Copy)]
pub struct LaserTopic {
    /// Where.
    pub topic: &'static str,
    /// Whether the first ray comes again after a turn, as that of a `TurtleBot3` in Gazebo.
    pub repeats_first: bool,
}

/// A laser of a fan.
pub const LIDAR: LaserTopic = LaserTopic { topic: "/lidar", repeats_first: false };

/// Writes a bag: topics `/camera/color/image_raw`, `/camera/color/camera_info`, `/lidar` and `/tf`.
pub fn write(path: &Path, camera: &Camera, stops: &[Stop]) {
    write_with(path, camera, stops, LIDAR);
}

/// Writes the same bag with another laser.
pub fn write_with(path: &Path, camera: &Camera, stops: &[Stop], laser: LaserTopic) {
    let mut bag = Bag {
        writer: Writer::new(BufWriter::new(File::create_new(path).expect("a file"))).expect("begun"),
        channels: BTreeMap::new(),
    };
    for (i, stop) in (0..).zip(stops) {
        let at_ns = START_NS + i * STEP_NS;
        let robot_from_laser = stop.scan.robot_from_laser();
        let transforms = vec![
            transform(at_ns, "odom", "base_link", &in_space(&stop.odom_from_robot)),
            transform(at_ns, "base_link", "camera", &stop.robot_from_camera),
            transform(at_ns, "base_link", "laser", &in_space(robot_from_laser)),
        ];
        bag.put("/tf", &TFMessage { transforms }, at_ns);
        bag.put(laser.topic, &laser_scan(at_ns, &stop.scan, laser.repeats_first), at_ns + 1);
        bag.put("/camera/color/camera_info", &camera_info(at_ns, camera), at_ns + 2);
        let (width, height) = (stop.picture.width() as u32, stop.picture.height() as u32);
        let (header, data) = (header(at_ns, "camera"), stop.picture.data());
        let image = Image { header, height, width, encoding: "mono8", is_bigendian: 0, step: width, data };
        bag.put("/camera/color/image_raw", &image, at_ns + 3);
    }
    bag.writer.finish().expect("finished");
}

/// Writes a file of messages whose content nobody looks into: encoding of the messages, and topic,
/// type and bytes of each.
pub fn write_raw(path: &Path, encoding: &str, messages: &[(&str, &str, &[u8])]) {
    let mut writer = Writer::new(BufWriter::new(File::create_new(path).expect("a file"))).expect("begun");
    for (sequence, (topic, kind, bytes)) in (0..).zip(messages) {
        let schema = writer.add_schema(kind, "ros2msg", b"").expect("a schema");
        let channel_id = writer.add_channel(schema, topic, encoding, &BTreeMap::new()).expect("a channel");
        let at_ns = START_NS.unsigned_abs() + u64::from(sequence);
        let header = MessageHeader { channel_id, sequence, log_time: at_ns, publish_time: at_ns };
        writer.write_to_known_channel(&header, bytes).expect("written");
    }
    writer.finish().expect("finished");
}

struct Bag {
    writer: Writer<BufWriter<File>>,
    channels: BTreeMap<&'static str, u16>,
}

impl Bag {
    fn put<'a, M: Message<'a>>(&mut self, topic: &'static str, message: &M, at_ns: i64) {
        let channel_id = *self.channels.entry(topic).or_insert_with(|| {
            let name = M::NAME.to_string();
            let schema = self.writer.add_schema(&name, "ros2msg", b"").expect("a schema");
            self.writer.add_channel(schema, topic, "cdr", &BTreeMap::new()).expect("a channel")
        });
        let (log_time, publish_time) = (at_ns.unsigned_abs(), at_ns.unsigned_abs());
        let header = MessageHeader { channel_id, sequence: 0, log_time, publish_time };
        self.writer.write_to_known_channel(&header, &message.encode()).expect("written");
    }
}

fn header(at_ns: i64, frame_id: &str) -> Header<'_> {
    Header { stamp: Time::from_ns(at_ns).expect("before 2038"), frame_id }
}

fn in_space(pose: &Pose2) -> Isometry3<f64> {
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), pose.theta_rad);
    Isometry3::from_parts(Vector3::new(pose.x_m, pose.y_m, 0.0).into(), turn)
}

fn transform<'a>(
    at_ns: i64,
    parent: &'a str,
    child_frame_id: &'a str,
    parent_from_child: &Isometry3<f64>,
) -> TransformStamped<'a> {
    let t = parent_from_child.translation.vector;
    let translation = messages::Vector3 { x: t.x, y: t.y, z: t.z };
    let transform = Transform { translation, rotation: quaternion(&parent_from_child.rotation) };
    TransformStamped { header: header(at_ns, parent), child_frame_id, transform }
}

fn camera_info(at_ns: i64, camera: &Camera) -> CameraInfo<'static> {
    let k = camera.intrinsics();
    CameraInfo {
        header: header(at_ns, "camera"),
        height: camera.height_px() as u32,
        width: camera.width_px() as u32,
        distortion_model: "plumb_bob",
        d: vec![0.0; 5],
        k: [k.fx_px, 0.0, k.cx_px, 0.0, k.fy_px, k.cy_px, 0.0, 0.0, 1.0],
        r: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        p: [k.fx_px, 0.0, k.cx_px, 0.0, 0.0, k.fy_px, k.cy_px, 0.0, 0.0, 0.0, 1.0, 0.0],
        binning_x: 0,
        binning_y: 0,
        roi: RegionOfInterest::default(),
    }
}

fn laser_scan(at_ns: i64, scan: &Scan, repeats_first: bool) -> LaserScan<'static> {
    let mut ranges = scan.ranges_m().to_vec();
    ranges.extend(ranges.first().copied().filter(|_| repeats_first));
    let beams = ranges.len();
    LaserScan {
        header: header(at_ns, "laser"),
        angle_min: scan.bearing_rad(0) as f32,
        angle_max: scan.bearing_rad(beams - 1) as f32,
        angle_increment: scan.bearing_step_rad() as f32,
        time_increment: 0.0,
        scan_time: 0.0,
        range_min: 0.05,
        range_max: scan.max_range_m() as f32,
        ranges,
        intensities: Vec::new(),
    }
}
