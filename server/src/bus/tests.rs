//! Over loopback zenoh, with the robot's own client: what is promised on the wire holds.

use super::*;
use crate::{
    config::RawConfig,
    engine::{
        intake::Intake,
        scene::{self, Scene},
        snapshot::MapSnapshot,
        workers::{Engine, Workers},
    },
};
use client::{Capture, Delivery, RobotClient, RobotOptions};
use protos::prost::Message;
use std::time::Duration;
use vision::frame::GrayImage;

const WAIT: Duration = Duration::from_secs(20);

struct Running {
    bus: Bus,
    engine: Engine,
    workers: Workers,
}

async fn running(engine: Engine, workers: usize) -> Running {
    let raw = RawConfig { zenoh: "tcp/127.0.0.1:0".into(), fleet: "test".into(), ..RawConfig::default() };
    let config = Config::try_from(raw).unwrap();
    let intake = Arc::new(Intake {
        slots: engine.slots.clone(),
        snapshots: engine.snapshots.clone(),
        frame_bytes: config.limits.frame_bytes,
        deadline: Duration::from_secs(30),
    });
    let to =
        Receivers { intake, motion: engine.motion.clone(), live: engine.live.clone(), gazes: Arc::default() };
    let bus = Bus::open(&config, to).await.unwrap();
    let workers = Workers::start(&engine, workers, &Arc::new(bus.outbox().clone())).unwrap();
    Running { bus, engine, workers }
}

impl Running {
    async fn robot(&self, name: &str) -> RobotClient {
        let options = RobotOptions {
            delivery: Delivery::Every,
            ..RobotOptions::new(self.bus.endpoint(), "test", name)
        };
        RobotClient::connect(&options).await.unwrap()
    }

    async fn stop(self) {
        let workers = self.workers;
        tokio::task::spawn_blocking(move || workers.stop()).await.unwrap();
        self.bus.close().await;
        let counts = self.engine.slots.counts();
        assert_eq!((counts.missing(), counts.waiting, counts.in_work), (0, 0, 0), "{counts:?}");
        assert_eq!(self.engine.panics.load(std::sync::atomic::Ordering::Relaxed), 0);
    }
}

fn plain() -> Capture {
    Capture::gray(&GrayImage::from_fn(64, 48, |u, _| u as u8))
}

#[tokio::test(flavor = "multi_thread")]
async fn a_robot_is_localised_by_what_it_was_taught() {
    let mut scene = Scene::new();
    let running = running(scene::engine(&[scene.taught()]), 1).await;
    let robot = running.robot("r1").await;
    let mut poses = robot.poses();
    let (mut fixes, mut seen) = (0, 0);
    for (name, look) in scene.looks(99, 3) {
        let step = &look.step;
        let capture = Capture::gray(&look.frame.image)
            .with_intrinsics(&scene.intrinsics())
            .with_mounting(&step.robot_from_camera)
            .with_odometry(&step.odom_from_robot);
        let answer = robot.recognise("front", capture, WAIT).await.unwrap();
        assert_eq!((answer.map.as_str(), answer.map_version), (scene::MAP, 3));
        for quad in answer.quads.iter().filter(|q| !q.landmark.is_empty()) {
            let truth = look.frame.truth.landmark(&quad.landmark).expect("named, but not in the picture");
            let at = quad.corners.iter().zip(truth.corners_px.points());
            let worst = at.map(|(a, b)| (a.u_px - b.x).hypot(a.v_px - b.y)).fold(0.0, f64::max);
            assert!(worst < 6.0, "{}: corners {worst} px off", quad.landmark);
            seen += usize::from(quad.landmark == name);
        }
        if let Some(pose) = answer.map_from_robot.and_then(|p| p.pose) {
            fixes += 1;
            let truth = &step.map_from_robot;
            let off = (pose.x_m - truth.x_m).hypot(pose.y_m - truth.y_m);
            assert!(off < 0.3, "{off} m off at {truth:?}");
            let fused = tokio::time::timeout(WAIT, poses.recv()).await.unwrap().unwrap();
            assert_eq!((fused.map.as_str(), fused.corrections > 0), (scene::MAP, true));
        }
    }
    assert!(seen >= 4 && fixes >= 2, "{seen} of 6 recognised, {fixes} poses");
    robot.close().await.unwrap();
    running.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn every_bad_frame_is_answered_and_the_server_goes_on() {
    let running = running(scene::engine(&[Arc::new(MapSnapshot::empty("hall", 3))]), 1).await;
    let robot = running.robot("r1").await;
    let ok = robot.recognise("front", plain(), WAIT).await.unwrap();
    assert_eq!((ok.status(), ok.map.as_str()), (v1::Status::NoMatch, "hall"));
    assert!(ok.map_from_robot.is_none() && ok.age_ms > 0.0 && ok.timings.iter().any(|t| t.stage == "edges"));

    let mut answers = robot.answers();
    let mut refused = async |frame: Vec<u8>| {
        robot.publish_raw_frame("front", frame).await.unwrap();
        let answer = tokio::time::timeout(WAIT, answers.recv()).await.unwrap().unwrap().answer;
        assert_eq!(answer.status(), v1::Status::Rejected, "{answer:?}");
        let r = answer.rejection.unwrap();
        (r.code, r.field)
    };
    let is = |code: &str, field: &str| (code.to_owned(), field.to_owned());
    let base = v1::Frame {
        epoch: robot.epoch(),
        seq: 100,
        encoding: v1::ImageEncoding::Jpeg.into(),
        width_px: 64,
        height_px: 48,
        image: b"this is no image".to_vec().into(),
        ..v1::Frame::default()
    };
    assert_eq!(refused(b"\xff\xff\xff".to_vec()).await, is("bad_message", "frame"));
    assert_eq!(refused(base.encode_to_vec()).await, is("wrong_encoding", "image"));
    let mut broken = base.clone();
    (broken.seq, broken.image) = (101, vec![0xFF, 0xD8, 0xFF, 0xE0, 0, 4, 1, 1].into());
    assert_eq!(refused(broken.encode_to_vec()).await, is("bad_image", "image"));
    let png = {
        let mut out = Vec::new();
        let encoder = image::codecs::png::PngEncoder::new(&mut out);
        image::ImageEncoder::write_image(encoder, &[9; 12], 4, 3, image::ExtendedColorType::L8).unwrap();
        out
    };
    let wrong =
        v1::Frame { seq: 102, encoding: v1::ImageEncoding::Png.into(), image: png.into(), ..base.clone() };
    assert_eq!(refused(wrong.encode_to_vec()).await, is("size_mismatch", "width_px"));
    let camera = v1::Intrinsics { fx_px: 500.0, fy_px: f64::NAN, ..v1::Intrinsics::default() };
    let nan = v1::Frame { seq: 103, intrinsics: Some(camera), ..base.clone() };
    assert_eq!(refused(nan.encode_to_vec()).await, is("not_finite", "intrinsics.fy_px"));
    assert_eq!(refused(v1::Frame { seq: 1, ..base.clone() }.encode_to_vec()).await, is("not_newer", "seq"));
    let elsewhere = v1::Frame { seq: 104, map: "cellar".into(), ..base.clone() };
    assert_eq!(refused(elsewhere.encode_to_vec()).await, is("unknown_map", "map"));

    let stranger = running.robot("stranger").await;
    let answer = stranger.recognise("front", plain(), WAIT).await.unwrap();
    assert_eq!(answer.rejection.unwrap().code, "unknown_robot");
    let last = robot.recognise("front2", plain(), WAIT).await.unwrap();
    assert_eq!(last.status(), v1::Status::NoMatch, "the server goes on");
    let counts = running.engine.slots.counts();
    assert_eq!(counts.rejected[&protos::Code::UnknownRobot], 1);
    running.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn presence_odometry_and_map_changes_pass() {
    let running = running(scene::engine(&[Arc::new(MapSnapshot::empty("hall", 3))]), 1).await;
    let mut events = running.engine.live.events();
    let mut next = async |kind: &str| loop {
        let event = tokio::time::timeout(WAIT, events.recv()).await.unwrap().unwrap();
        if event.kind() == kind {
            return event;
        }
    };
    let robot = running.robot("r1").await;
    next("presence").await;
    assert_eq!(running.engine.live.alive().len(), 1);

    robot.publish_odometry(&map::pose2::Pose2::new(1.0, 2.0, 0.1)).await.unwrap();
    let scan = v1::Scan { ranges_m: vec![f32::NAN], max_range_m: f64::NAN, ..v1::Scan::default() };
    robot.publish_scan(scan).await.unwrap();
    // Odometry and scans have no answer: wait until both are counted.
    let counted = async {
        loop {
            let (odometry, scans) = running.engine.motion.counts();
            if (odometry.accepted, scans.rejected.len()) == (1, 1) {
                return scans;
            }
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
    };
    let scans = tokio::time::timeout(WAIT, counted).await.unwrap();
    assert_eq!(scans.rejected, [(protos::Code::Missing, 1)].into());

    running.engine.snapshots.publish(Arc::new(MapSnapshot::empty("hall", 4)));
    assert_eq!(next("map_changed").await.map(), "hall");
    let answer = robot.recognise("front", plain(), WAIT).await.unwrap();
    assert_eq!(answer.map_version, 4, "the next answer rests on the new version");

    robot.close().await.unwrap();
    next("presence").await;
    assert!(running.engine.live.alive().is_empty());
    running.stop().await;
}
