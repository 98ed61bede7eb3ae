//! Over loopback zenoh, with the robot's own client: what is promised on the wire holds.

mod localise;
mod quads;

use super::*;
use crate::config::RawConfig;
use client::{Capture, Delivery, RobotClient, RobotOptions};
use engine::{
    Observers,
    intake::Intake,
    scene::{self, Scene},
    snapshot::MapSnapshot,
    workers::{Engine, Workers},
};
use protos::prost::Message;
use std::time::Duration;
use vision::frame::GrayImage;

const WAIT: Duration = Duration::from_secs(20);

struct Running {
    bus: Bus,
    engine: Engine,
    observers: Observers,
    workers: Workers,
}

async fn running(engine: (Engine, Observers), workers: usize) -> Running {
    running_with(engine, workers, None).await
}

async fn running_with(
    (engine, observers): (Engine, Observers),
    workers: usize,
    certificates: Option<Arc<CertificateRegistry>>,
) -> Running {
    let raw = RawConfig { zenoh: "tcp/127.0.0.1:0".into(), fleet: "test".into(), ..RawConfig::default() };
    let config = Config::try_from(raw).unwrap();
    let intake = Arc::new(Intake {
        slots: engine.slots.clone(),
        snapshots: engine.snapshots.clone(),
        motion: engine.motion.clone(),
        frame_bytes: config.limits.frame_bytes,
        deadline: Duration::from_secs(30),
        linked_maps_only: false,
    });
    let to = Receivers {
        intake,
        motion: engine.motion.clone(),
        live: observers.live.clone(),
        gazes: Arc::default(),
        vitals: engine.vitals.clone(),
        certificates,
        server: Name::new("test").unwrap(),
        fleet: None,
    };
    let bus = Bus::open(&config, to, Sockets::take(&config).await.unwrap(), None).await.unwrap();
    let workers = Workers::start(&engine, workers, &Arc::new(bus.outbox().clone())).unwrap();
    Running { bus, engine, observers, workers }
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
        assert_eq!(self.engine.vitals.panics().total(), 0);
    }
}

/// Raw colour of 1920 x 1200 px has 6.9 MB: more than the router takes of a message.
#[tokio::test(flavor = "multi_thread")]
async fn a_frame_over_the_limit_is_refused_at_once_and_counted() {
    let running = running(scene::engine(&[Arc::new(MapSnapshot::empty("hall", 3))]), 1).await;
    let robot = running.robot("r1").await;
    let limit = crate::config::Limits::default().frame_bytes;
    for rows in [1200, limit as u32 / 5760 + 1] {
        let pixels = vec![7; 5760 * rows as usize];
        let capture = Capture::raw(v1::ImageEncoding::Bgr8, (1920, rows), pixels).unwrap();
        let begun = std::time::Instant::now();
        let answer = robot.recognise("front", capture, WAIT).await.unwrap();
        let rejection = answer.rejection.unwrap();
        assert_eq!((rejection.code.as_str(), rejection.field.as_str()), ("too_large", "image"));
        assert!(rejection.detail.contains("limits.frame_bytes"), "{}", rejection.detail);
        assert!(begun.elapsed() < Duration::from_secs(5), "{:?}", begun.elapsed());
    }
    let name = Name::new("r1").unwrap();
    let activity = running.observers.live.activity(&name, std::time::Instant::now());
    assert!(format!("{activity:?}").contains("too_large"), "{activity:?}");
    let within = Capture::raw(v1::ImageEncoding::Bgr8, (1280, 1024), vec![7; 3_932_160]).unwrap();
    assert_eq!(robot.recognise("front", within, WAIT).await.unwrap().status(), v1::Status::NoMatch);
    robot.close().await.unwrap();
    running.stop().await;
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
    for (name, readings) in scene.stops(99, 3) {
        let step = &readings.step;
        let capture = Capture::gray(&readings.frame.image)
            .with_intrinsics(&scene.intrinsics())
            .with_mounting(&step.robot_from_camera)
            .with_odometry(&step.odom_from_robot);
        let answer = robot.recognise("front", capture, WAIT).await.unwrap();
        assert_eq!((answer.map.as_str(), answer.map_version), (scene::MAP, 3));
        for quad in answer.quads.iter().filter(|q| !q.landmark.is_empty()) {
            let truth = readings.frame.truth.landmark(&quad.landmark).expect("named, but not in the picture");
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
    assert!(
        ok.map_from_robot.is_none() && ok.latency_ms > 0.0 && ok.timings.iter().any(|t| t.stage == "edges")
    );

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

    let unknown = running.robot("stranger").await;
    let answer = unknown.recognise("front", plain(), WAIT).await.unwrap();
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
    let mut events = running.observers.live.events();
    let mut next = async |kind: &str| loop {
        let event = tokio::time::timeout(WAIT, events.recv()).await.unwrap().unwrap();
        if event.kind() == kind {
            return event;
        }
    };
    let robot = running.robot("r1").await;
    next("presence").await;
    let r1 = protos::Name::new("r1").unwrap();
    let status = || running.engine.motion.epochs().status(&r1, std::time::Instant::now());
    assert_eq!((status().alive, status().epoch), (true, None));

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
    assert_eq!(status().epoch, Some(robot.epoch()));

    robot.close().await.unwrap();
    next("presence").await;
    assert_eq!((status().alive, status().epoch), (false, None));
    running.stop().await;
}

/// A link to the server that can be made to stop reading.
struct StallingLink {
    endpoint: String,
    stalled: tokio::sync::watch::Sender<bool>,
}

impl StallingLink {
    /// Passes everything between one client and `server` (`tcp/ADDRESS`) until it is stalled.
    async fn open(server: &str) -> Self {
        use tokio::io::{AsyncReadExt, AsyncWriteExt};
        let address: std::net::SocketAddr = server.strip_prefix("tcp/").unwrap().parse().unwrap();
        let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
        let endpoint = format!("tcp/{}", listener.local_addr().unwrap());
        let (stalled, mut stall) = tokio::sync::watch::channel(false);
        tokio::spawn(async move {
            let (near, _) = listener.accept().await.unwrap();
            let socket = tokio::net::TcpSocket::new_v4().unwrap();
            // A small window, so that the server's queue is full soon after the stall.
            socket.set_recv_buffer_size(4096).unwrap();
            let (mut from_server, mut to_server) = socket.connect(address).await.unwrap().into_split();
            let (mut from_near, mut to_near) = near.into_split();
            tokio::spawn(async move { tokio::io::copy(&mut from_near, &mut to_server).await });
            let mut buffer = vec![0; 4096];
            loop {
                if *stall.borrow() {
                    // The connection stays open; nothing is read from it.
                    drop(stall.wait_for(|stalled| !stalled).await);
                }
                let Ok(n @ 1..) = from_server.read(&mut buffer).await else { return };
                if to_near.write_all(&buffer[..n]).await.is_err() {
                    return;
                }
            }
        });
        Self { endpoint, stalled }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_subscriber_that_does_not_read_delays_no_answer() {
    const CHANGES: u64 = 40_000;
    const AT_ONCE: Duration = Duration::from_secs(2);
    let running = running(scene::engine(&[Arc::new(MapSnapshot::empty("hall", 3))]), 1).await;
    let link = StallingLink::open(running.bus.endpoint()).await;
    let slow = zenoh::open(
        zenoh::Config::from_json5(&format!(
            r#"{{ mode: "client", connect: {{ endpoints: ["{}"] }}, scouting: {{ multicast: {{ enabled: false }} }} }}"#,
            link.endpoint
        ))
        .unwrap(),
    )
    .await
    .unwrap();
    let keys = Keys::new(&protos::Name::new("test").unwrap());
    let changed = Key::MapChanged(protos::Name::new("m".repeat(64)).unwrap());
    let subscriber = slow.declare_subscriber(keys.build(&changed)).await.unwrap();
    let robot = running.robot("r1").await;
    let tell = |version| {
        running
            .bus
            .outbox()
            .send(&changed, &v1::MapChanged { map: "m".repeat(64), version, ..v1::MapChanged::default() });
    };
    // The subscription is there once a change arrives.
    let arrived = async {
        loop {
            tell(0);
            let heard = tokio::time::timeout(Duration::from_millis(20), subscriber.recv_async()).await;
            if let Ok(sample) = heard {
                return sample.unwrap().congestion_control();
            }
        }
    };
    let congestion_control = tokio::time::timeout(WAIT, arrived).await.unwrap();
    assert_eq!(congestion_control, zenoh::qos::CongestionControl::Drop, "the sending thread may not wait");

    link.stalled.send_replace(true);
    let mut slowest = Duration::ZERO;
    for version in 1..=CHANGES {
        tell(version);
        if version % 500 == 0 {
            let asked = std::time::Instant::now();
            robot.recognise("front", plain(), WAIT).await.unwrap();
            slowest = slowest.max(asked.elapsed());
        }
    }
    assert!(slowest < AT_ONCE, "an answer took {slowest:?} while a subscriber did not read");
    assert_eq!(robot.map_version("hall", WAIT).await.unwrap(), Some(3), "whoever missed a change asks");
    assert_eq!(robot.map_version("cellar", WAIT).await.unwrap(), None);
    robot.close().await.unwrap();
    drop((subscriber, link));
    running.stop().await;
}

/// Through the callback a panic would end zenoh's task that receives from that robot.
#[test]
fn a_callback_that_panics_is_counted_and_receives_on() {
    let (vitals, received) = (Arc::new(Vitals::default()), Arc::new(std::sync::Mutex::new(Vec::new())));
    let kept = received.clone();
    let callback = super::caught(&vitals, "frame", move |number: u8| {
        assert!(number != 2, "planted");
        kept.lock().unwrap().push(number);
    });
    for number in 1..=3 {
        callback(number);
    }
    assert_eq!(*received.lock().unwrap(), [1, 3]);
    assert_eq!((vitals.panics().at(Edge::Message), vitals.failure()), (1, None));
}

/// A callback on the sending thread's own way: what it sends is never taken.
#[tokio::test(flavor = "multi_thread")]
async fn an_outbox_whose_thread_is_held_stalls() {
    let engine = scene::engine(&[Arc::new(MapSnapshot::empty("hall", 1))]);
    let running = running(engine, 1).await;
    let (release, held) = std::sync::mpsc::channel::<()>();
    let held = std::sync::Mutex::new(held);
    let blocking = move |_| {
        held.lock().unwrap().recv().ok();
    };
    let keys = Keys::new(&Name::new("test").unwrap());
    let planted =
        running.bus.session().unwrap().declare_subscriber(keys.all_poses()).callback(blocking).await.unwrap();
    let (outbox, hearts) = (running.bus.outbox().clone(), running.engine.vitals.clone());
    outbox.heart().beat();
    let beats_again = || {
        outbox.probe();
        hearts.hearts().tick(Duration::from_secs(1));
        outbox.heart().still() == Duration::ZERO
    };
    let until = std::time::Instant::now() + WAIT;
    hearts.hearts().tick(Duration::from_secs(1));
    while !beats_again() {
        assert!(std::time::Instant::now() < until, "it does not beat by probes");
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    outbox.send(&Key::Pose(Name::new("r1").unwrap()), &v1::RobotPose::default());
    while hearts.stalled().is_none_or(|heart| heart.part() != "the outbox") {
        beats_again();
        assert!(std::time::Instant::now() < until, "it beats though its thread is held");
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    assert!(outbox.waiting() > 0);
    drop(release);
    while !beats_again() {
        assert!(std::time::Instant::now() < until, "it does not go on");
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    planted.undeclare().await.unwrap();
    running.stop().await;
}
