//! A server with a taught corridor, a robot of ROS and a native one, and the messages that both
//! send.

use map::pose2::Pose2;
use nalgebra::Isometry3;
use protos::{convert::geometry::pose3_wire, prost::Message as _, v1};
use ros2::messages::{
    CameraInfo, CompressedImage, Header, Image, LaserScan, Message, Odometry, Pose, PoseWithCovariance,
    Quaternion, TFMessage, Time, Transform, TransformStamped, Vector3,
};
use server::config::{Limits, RawConfig, RawRos2, RawRos2Robot, RawTls};
use sim::{
    building::Building,
    corridor::CorridorParams,
    robot::{RobotParams, SensorReadings},
};
use std::{
    path::PathBuf,
    sync::{Arc, Mutex},
    time::{Duration, SystemTime, UNIX_EPOCH},
};
use tempfile::TempDir;
use tests::{
    Inside, SOON,
    command::waymark,
    eventually,
    robots::{MAP, jpeg, put_walls},
    ros::{
        CAMERA_INFO, COMPRESSED_IMAGE, IMAGE, LASER_SCAN, ODOMETRY, RosRobot, Speech, TF_MESSAGE, Type,
        free_endpoint,
    },
};
use zenoh::{Session, qos::CongestionControl};

pub(super) const IMAGES: &str = "/camera/image_raw/compressed";
pub(super) const CALIBRATION: &str = "/camera/camera_info";
pub(super) const RAW_IMAGES: &str = "/raw/image_raw";
pub(super) const OPTICAL: &str = "camera_optical_frame";

/// Answers and poses of all robots, as on the wire of Waymark.
#[derive(Debug, Clone, Default)]
pub(super) struct Published {
    pub(super) answers: Arc<Mutex<Vec<(String, v1::Answer)>>>,
    pub(super) poses: Arc<Mutex<Vec<(String, v1::RobotPose)>>>,
}

impl Published {
    /// The answer to the frame of a robot that was captured then.
    pub(super) async fn answer(&self, robot: &str, captured_ns: i64) -> v1::Answer {
        let found = || async {
            let answers = self.answers.lock().expect("not poisoned");
            answers.iter().find(|(r, a)| r == robot && a.captured_ns == captured_ns).map(|(_, a)| a.clone())
        };
        eventually(&format!("an answer to {robot}"), found).await
    }
}

/// A native robot without SDK, and an ear for what every robot gets.
pub(super) struct Native {
    pub(super) session: Session,
    pub(super) seen: Published,
    seq: u64,
}

impl Native {
    pub(super) async fn connect(endpoint: &str) -> Self {
        let config = format!(
            r#"{{ mode: "client", connect: {{ endpoints: ["{endpoint}"] }}, scouting: {{ multicast: {{ enabled: false }} }} }}"#
        );
        let session = zenoh::open(zenoh::Config::from_json5(&config).expect("settings")).await.expect("open");
        let seen = Published::default();
        let robot = |key: &str| key.split('/').nth(4).unwrap_or_default().to_owned();
        let (answers, poses) = (seen.answers.clone(), seen.poses.clone());
        let noted = move |sample: zenoh::sample::Sample| {
            let answer = v1::Answer::decode(&*sample.payload().to_bytes()).expect("an answer");
            answers.lock().expect("not poisoned").push((robot(sample.key_expr().as_str()), answer));
        };
        let declared = session.declare_subscriber("waymark/1/default/robot/*/answer").callback(noted);
        declared.background().await.expect("answers");
        let noted = move |sample: zenoh::sample::Sample| {
            let pose = v1::RobotPose::decode(&*sample.payload().to_bytes()).expect("a pose");
            poses.lock().expect("not poisoned").push((robot(sample.key_expr().as_str()), pose));
        };
        let declared = session.declare_subscriber("waymark/1/default/robot/*/pose").callback(noted);
        declared.background().await.expect("poses");
        Self { session, seen, seq: 0 }
    }

    pub(super) async fn put(&self, key: &str, camera: Option<&str>, message: Vec<u8>) {
        let put = self.session.put(format!("waymark/1/default/robot/native/{key}"), message);
        let put = put.attachment(camera);
        // A busy machine may not lose what is compared.
        put.congestion_control(CongestionControl::Block).await.expect("sent");
    }

    pub(super) async fn odometry(&mut self, readings: &SensorReadings, captured_ns: i64) {
        self.seq += 1;
        let odom_from_robot = Some(pose2(&readings.step.odom_from_robot));
        let odometry =
            v1::Odometry { epoch: 1, seq: self.seq, captured_ns, odom_from_robot, ..v1::Odometry::default() };
        self.put("odometry", None, odometry.encode_to_vec()).await;
    }

    /// A frame of camera `camera`, with the picture in this encoding.
    pub(super) async fn frame(
        &mut self,
        (camera, encoding, image): (&str, v1::ImageEncoding, Vec<u8>),
        readings: &SensorReadings,
        captured_ns: i64,
    ) {
        self.seq += 1;
        let vga = sim::camera::Camera::vga();
        let k = vga.intrinsics();
        let frame = v1::Frame {
            epoch: 1,
            seq: self.seq,
            captured_ns,
            encoding: encoding.into(),
            width_px: 640,
            height_px: 480,
            image: image.into(),
            intrinsics: Some(v1::Intrinsics {
                fx_px: k.fx_px,
                fy_px: k.fy_px,
                cx_px: k.cx_px,
                cy_px: k.cy_px,
                ..v1::Intrinsics::default()
            }),
            robot_from_camera: Some(pose3_wire(&readings.step.robot_from_camera)),
            odometry: Some(pose2(&readings.step.odom_from_robot)),
            ..v1::Frame::default()
        };
        self.put("frame", Some(camera), frame.encode_to_vec()).await;
    }
}

pub(super) fn pose2(pose: &Pose2) -> v1::Pose2 {
    v1::Pose2 { x_m: pose.x_m, y_m: pose.y_m, theta_rad: pose.theta_rad }
}

pub(super) fn now_ns() -> i64 {
    SystemTime::now().duration_since(UNIX_EPOCH).expect("after 1970").as_nanos() as i64
}

pub(super) fn header(ns: i64, frame_id: &str) -> Header<'_> {
    Header { stamp: Time::from_ns(ns).expect("before 2038"), frame_id }
}

pub(super) fn transform<'a>(
    ns: i64,
    child_frame_id: &'a str,
    base_from_child: &Isometry3<f64>,
) -> TFMessage<'a> {
    let (t, q) = (base_from_child.translation.vector, base_from_child.rotation.quaternion());
    let transform = Transform {
        translation: Vector3 { x: t.x, y: t.y, z: t.z },
        rotation: Quaternion { x: q.i, y: q.j, z: q.k, w: q.w },
    };
    TFMessage {
        transforms: vec![TransformStamped { header: header(ns, "base_link"), child_frame_id, transform }],
    }
}

pub(super) fn calibration(ns: i64) -> CameraInfo<'static> {
    let camera = sim::camera::Camera::vga();
    let k = camera.intrinsics();
    CameraInfo {
        header: header(ns, OPTICAL),
        height: 480,
        width: 640,
        distortion_model: "plumb_bob",
        k: [k.fx_px, 0.0, k.cx_px, 0.0, k.fy_px, k.cy_px, 0.0, 0.0, 1.0],
        ..CameraInfo::default()
    }
}

pub(super) fn odometry(ns: i64, pose: &Pose2) -> Odometry<'static> {
    let (sin, cos) = (0.5 * pose.theta_rad).sin_cos();
    let orientation = Quaternion { x: 0.0, y: 0.0, z: sin, w: cos };
    let pose = Pose { position: Vector3 { x: pose.x_m, y: pose.y_m, z: 0.0 }, orientation };
    let pose = PoseWithCovariance { pose, ..PoseWithCovariance::default() };
    Odometry { header: header(ns, "odom"), child_frame_id: "base_link", pose, ..Odometry::default() }
}

pub(super) fn scan(ns: i64, readings: &SensorReadings) -> LaserScan<'static> {
    let scan = &readings.scan;
    LaserScan {
        header: header(ns, "laser"),
        angle_min: scan.bearing_rad(0) as f32,
        angle_increment: scan.bearing_step_rad() as f32,
        range_min: 0.05,
        range_max: scan.max_range_m() as f32,
        ranges: scan.ranges_m().to_vec(),
        ..LaserScan::default()
    }
}

/// Enrols a robot, as a person does. Where its files are.
pub(super) fn enrol(inside: &Inside, robot: &str, folders: &TempDir) -> PathBuf {
    let folder = folders.path().join(robot);
    let out = folder.to_str().expect("a path");
    let run = waymark(["robot", "enrol", robot, "--out", out, "--server", &inside.url()], SOON);
    assert_eq!(run.status, 0, "{run:?}");
    folder
}

/// A server with a taught corridor, a robot of ROS and a native one.
pub(super) struct Run {
    pub(super) inside: Inside,
    pub(super) building: Arc<Building>,
    pub(super) native: Native,
    pub(super) ros: RosRobot,
    /// What was sent, by capture time.
    pub(super) odometry: Vec<(i64, Pose2)>,
    /// Certificates of robots, where the endpoint is encrypted.
    pub(super) certificates: Option<TempDir>,
}

const TOPICS: [(&str, Type); 5] = [
    ("/tf", TF_MESSAGE),
    ("/odom", ODOMETRY),
    ("/scan", LASER_SCAN),
    (CALIBRATION, CAMERA_INFO),
    (IMAGES, COMPRESSED_IMAGE),
];

impl Run {
    pub(super) async fn start(speech: Speech, change: impl FnOnce(&mut RawRos2Robot)) -> Self {
        Self::start_on(speech, None, change).await
    }

    /// The same with the encrypted endpoint. The robot of ROS has a certificate and this namespace;
    /// the native one comes from the server's own machine.
    pub(super) async fn start_encrypted(
        domain: u32,
        namespace: &str,
        change: impl FnOnce(&mut RawRos2Robot),
    ) -> Self {
        Self::start_on(Speech::Rmw(domain), Some(namespace), change).await
    }

    async fn start_on(
        speech: Speech,
        encrypted: Option<&str>,
        change: impl FnOnce(&mut RawRos2Robot),
    ) -> Self {
        let (bridge, domain, key_prefix) = match speech {
            Speech::Rmw(domain) => (false, domain, encrypted.unwrap_or_default().to_owned()),
            Speech::Bridge(namespace) => (true, 0, namespace.to_owned()),
        };
        let mut robot =
            RawRos2Robot { robot: "r1".into(), bridge, domain, key_prefix, ..RawRos2Robot::default() };
        change(&mut robot);
        let ros2 = RawRos2 { robot: vec![robot] };
        // Busy machines take longer than half a second for a frame.
        let limits = Limits { frame_deadline_ms: 60_000, ..Limits::default() };
        let local = encrypted.map(|_| free_endpoint());
        let tls = RawTls {
            enabled: encrypted.is_some(),
            local_zenoh: local.clone().unwrap_or_default(),
            ..RawTls::default()
        };
        let inside = Inside::start_with(RawConfig { ros2, limits, tls, ..RawConfig::default() }).await;
        let params = CorridorParams { posters: 1, column: false, ..CorridorParams::default() };
        let building = Arc::new(Building::corridor_with(&params, 3));
        inside.maps().create_map(&client::api::NewMap::new(MAP)).await.expect("map");
        put_walls(&inside, &building).await;
        for robot in ["r1", "native"] {
            inside.maps().put_robot(robot, MAP).await.expect("robot");
        }
        let endpoint = &inside.server.zenoh_endpoint;
        let native = Native::connect(local.as_ref().unwrap_or(endpoint)).await;
        let certificates = encrypted.map(|_| TempDir::new().expect("a folder"));
        let ros = match encrypted.zip(certificates.as_ref()) {
            None => RosRobot::start(endpoint, speech).await,
            Some((namespace, folder)) => {
                let folder = enrol(&inside, "r1", folder);
                RosRobot::start_encrypted(endpoint, speech, &folder, namespace).await
            }
        };
        Self { inside, building, native, ros, odometry: Vec::new(), certificates }
    }

    /// Announces what a robot with camera and laser publishes, and waits until the images are
    /// subscribed to.
    pub(super) async fn announce(&mut self) {
        let laser = RobotParams::default().laser.robot_from_laser.to_isometry3();
        let fixed = transform(1, "laser", &laser);
        self.ros.keep("/tf_static", TF_MESSAGE, fixed.encode()).await;
        for (topic, kind) in TOPICS {
            self.ros.declare("MP", topic, kind).await;
        }
    }

    /// Waits until the robot's session knows the server's subscriptions: a message before that
    /// reaches nobody. Empty messages are sent, which the server counts and refuses.
    pub(super) async fn is_heard(&self) {
        for (topic, kind) in TOPICS {
            let key = self.ros.key(topic, kind);
            let counted = || async {
                self.ros.put_raw(&key, Vec::new(), None).await;
                tokio::time::sleep(Duration::from_millis(50)).await;
                self.status().await.received.get(topic).filter(|count| **count > 0).map(|_| ())
            };
            eventually("a message of each topic is counted", counted).await;
        }
    }

    /// Sends what both robots see at a step; `suffix` of the key of the image. The capture time.
    pub(super) async fn show(&mut self, readings: &SensorReadings, suffix: &str, with_image: bool) -> i64 {
        let (ros, ns) = (&mut self.ros, now_ns());
        self.odometry.push((ns, readings.step.odom_from_robot));
        let mounting = transform(ns, OPTICAL, &readings.step.robot_from_camera);
        ros.put("/tf", TF_MESSAGE, "", mounting.encode()).await;
        ros.put(CALIBRATION, CAMERA_INFO, "", calibration(ns).encode()).await;
        ros.put("/odom", ODOMETRY, "", odometry(ns, &readings.step.odom_from_robot).encode()).await;
        self.native.odometry(readings, ns).await;
        ros.put("/scan", LASER_SCAN, "", scan(ns, readings).encode()).await;
        if with_image {
            let data = jpeg(&readings.frame.image);
            let image = CompressedImage { header: header(ns, OPTICAL), format: "jpeg", data: &data };
            ros.put(IMAGES, COMPRESSED_IMAGE, suffix, image.encode()).await;
            self.native.frame(("front", v1::ImageEncoding::Jpeg, data), readings, ns).await;
        }
        ns
    }

    /// Sends the picture of a step, whose transforms and odometry are there, without compression:
    /// in colour by ROS, in grey by the native robot.
    pub(super) async fn show_raw(&mut self, readings: &SensorReadings, ns: i64) {
        let gray = readings.frame.image.data();
        let colours: Vec<u8> = gray.iter().flat_map(|g| [*g; 3]).collect();
        let image = Image {
            header: header(ns, OPTICAL),
            height: 480,
            width: 640,
            encoding: "rgb8",
            is_bigendian: 0,
            step: 3 * 640,
            data: &colours,
        };
        self.ros.put(RAW_IMAGES, IMAGE, "", image.encode()).await;
        self.native.frame(("raw", v1::ImageEncoding::Gray8, gray.to_vec()), readings, ns).await;
    }

    pub(super) async fn status(&self) -> client::api::Ros2Status {
        let status = self.inside.maps().ros2_status("r1").await.expect("what became of the messages");
        assert!(status.configured);
        status
    }

    pub(super) async fn reasons(&self, topic: &str, word: &str) -> u64 {
        let reasons = self.status().await.reasons;
        reasons.get(topic).and_then(|words| words.get(word)).copied().unwrap_or(0)
    }

    pub(super) async fn stop(self) {
        self.ros.stop().await;
        self.native.session.close().await.expect("closed");
        self.inside.server.stop().await;
    }
}
