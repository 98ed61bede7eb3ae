//! Workers without any transport: panics, late work, overload.

use super::*;
use crate::{frame::intake::Intake, observers::live::LiveHub, scene};
use protos::{
    convert::{EncodedImage, Encoding, Pixels},
    prost::Message,
};
use std::{sync::Mutex, time::Duration};

/// The analysis of frames of this camera panics.
pub(super) const PLANTED: &str = "panics";

#[derive(Default)]
struct Sent(Mutex<Vec<v1::Answer>>);

impl Publish for Sent {
    fn answer(&self, _: &SlotKey, answer: &v1::Answer) {
        self.0.lock().unwrap().push(answer.clone());
    }

    fn pose(&self, _: &Name, _: &v1::RobotPose) {}
}

fn intake(engine: &Engine, deadline: Duration) -> Intake {
    let (slots, snapshots) = (engine.slots.clone(), engine.snapshots.clone());
    let motion = engine.motion.clone();
    Intake { slots, snapshots, motion, frame_bytes: 100_000, deadline, linked_maps_only: false }
}

fn key(camera: usize) -> SlotKey {
    SlotKey { robot: Name::new("r1").unwrap(), camera: Name::new(format!("c{camera}")).unwrap() }
}

fn message(seq: u64, bytes: usize) -> protos::prost::bytes::Bytes {
    let encoding = v1::ImageEncoding::Gray8.into();
    let image = vec![0; bytes].into();
    let frame =
        v1::Frame { epoch: 1, seq, encoding, width_px: 32, height_px: 24, image, ..v1::Frame::default() };
    frame.encode_to_vec().into()
}

fn hall() -> Engine {
    scene::engine(&[Arc::new(MapSnapshot::empty("hall", 1))]).0
}

/// Panics on answers if it is told to.
#[derive(Default)]
struct Panicking {
    on_answers: bool,
    sent: Sent,
}

impl Publish for Panicking {
    fn answer(&self, key: &SlotKey, answer: &v1::Answer) {
        assert!(!self.on_answers, "planted");
        self.sent.answer(key, answer);
    }

    fn pose(&self, _: &Name, _: &v1::RobotPose) {}
}

/// What the API told of the robot when its answers came: frames answered, frames refused.
struct ToldAt(Arc<LiveHub>, Mutex<Vec<(u64, u64)>>);

impl Publish for ToldAt {
    fn answer(&self, key: &SlotKey, _: &v1::Answer) {
        let told = self.0.activity(&key.robot, Instant::now());
        let counts = told.map_or((0, 0), |told| (told.answered, told.inputs.iter().map(|i| i.refused).sum()));
        self.1.lock().unwrap().push(counts);
    }

    fn pose(&self, _: &Name, _: &v1::RobotPose) {}
}

/// Who has the answer and asks at once finds its frame counted.
#[test]
fn a_frame_is_counted_before_its_answer_is_sent() {
    let (engine, observers) = scene::engine(&[Arc::new(MapSnapshot::empty("hall", 1))]);
    let told = ToldAt(observers.live, Mutex::default());
    let intake = intake(&engine, Duration::from_mins(1));
    for (seq, camera) in [(1, key(0).camera), (2, Name::new(PLANTED).unwrap())] {
        intake.receive(key(0), message(seq, 768)).unwrap();
        let (_, job) = engine.slots.try_take().unwrap();
        engine.answer_frame(&SlotKey { robot: key(0).robot, camera }, &job, &told);
        engine.slots.finish(&key(0), FrameOutcome::Processed);
    }
    assert_eq!(*told.1.lock().unwrap(), [(1, 0), (1, 1)]);
}

fn settled(engine: &Engine) -> crate::frame::slots::FrameCounts {
    loop {
        let counts = engine.slots.counts();
        if counts.waiting == 0 && counts.in_work == 0 {
            return counts;
        }
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// A panic outside of the analysis, where the answer is published.
#[test]
fn a_panic_beside_the_analysis_leaves_the_camera_usable() {
    let (engine, breaks) = (hall(), Arc::new(Panicking { on_answers: true, ..Panicking::default() }));
    let workers = Workers::start(&engine, 1, &breaks).unwrap();
    let intake = intake(&engine, Duration::from_mins(1));
    for seq in 1..=2 {
        intake.receive(key(0), message(seq, 768)).unwrap();
        let counts = settled(&engine);
        assert_eq!((counts.processed, counts.missing()), (seq, 0));
    }
    assert_eq!(engine.vitals.panics().at(Edge::Frame), 2);
    assert_eq!(engine.vitals.failure(), None);
    engine.vitals.stop();
    workers.stop();
}

/// A panic inside of the analysis: one answer.
#[test]
fn a_panic_of_the_analysis_is_answered_and_counted() {
    let (engine, sent) = (hall(), Sent::default());
    intake(&engine, Duration::from_mins(1)).receive(key(0), message(1, 768)).unwrap();
    let (_, job) = engine.slots.try_take().unwrap();
    let k = SlotKey { robot: key(0).robot, camera: Name::new(PLANTED).unwrap() };
    let outcome = engine.answer_frame(&k, &job, &sent);
    let answer = sent.0.lock().unwrap().pop().unwrap();
    assert!(sent.0.lock().unwrap().is_empty());
    let code = answer.rejection.map(|r| r.code);
    assert_eq!((outcome, code.as_deref()), (FrameOutcome::Rejected(Code::Internal), Some("internal")));
    assert_eq!(engine.vitals.panics().at(Edge::Frame), 1);
}

#[test]
fn a_thread_that_ends_untold_is_a_failure() {
    let engine = hall();
    let workers = Workers::start(&engine, 1, &Arc::new(Sent::default())).unwrap();
    assert_eq!(engine.vitals.failure(), None);
    // No more frames, although the server was not told to stop.
    engine.slots.close();
    let started = Instant::now();
    let failure = loop {
        if let Some(failure) = engine.vitals.failure() {
            break failure;
        }
        assert!(started.elapsed() < Duration::from_secs(5));
        std::thread::sleep(Duration::from_millis(1));
    };
    assert_eq!(failure.part, "the worker thread vision-0");
    workers.stop();
}

#[test]
fn late_work_is_not_begun() {
    let (engine, sent) = (hall(), Sent::default());
    intake(&engine, Duration::ZERO).receive(key(0), message(1, 768)).unwrap();
    let (k, job) = engine.slots.try_take().unwrap();
    std::thread::sleep(Duration::from_millis(2));
    assert_eq!(engine.answer_frame(&k, &job, &sent), FrameOutcome::Expired);
    let answer = sent.0.lock().unwrap().pop().unwrap();
    assert_eq!((answer.status(), answer.seq, answer.timings.len()), (v1::Status::Expired, 1, 0));
}

#[test]
fn a_map_that_is_gone_is_a_refusal() {
    let (engine, sent) = (hall(), Sent::default());
    intake(&engine, Duration::from_secs(9)).receive(key(0), message(1, 768)).unwrap();
    engine.snapshots.remove_map("hall");
    let (k, job) = engine.slots.try_take().unwrap();
    assert_eq!(engine.answer_frame(&k, &job, &sent), FrameOutcome::Rejected(Code::UnknownMap));
}

/// Far more frames than the pool can take: each is answered or superseded, none is lost, none
/// answered twice.
#[test]
fn overload_conserves_frames() {
    let (engine, sent) = (hall(), Arc::new(Sent::default()));
    let workers = Workers::start(&engine, 2, &sent).unwrap();
    let intake = intake(&engine, Duration::from_mins(1));
    let (cameras, frames) = (4, 200);
    for seq in 1..=frames {
        for camera in 0..cameras {
            intake.receive(key(camera), message(seq, 768)).unwrap();
        }
        if seq % 50 == 0 {
            intake.receive(key(0), message(seq, 768)).unwrap_err();
        }
    }
    while engine.slots.counts().waiting > 0 {
        std::thread::sleep(Duration::from_millis(1));
    }
    workers.stop();
    let counts = engine.slots.counts();
    assert_eq!((counts.missing(), counts.in_work, counts.waiting), (0, 0, 0));
    assert_eq!(counts.received, cameras as u64 * frames + 4);
    assert_eq!(counts.rejected_total(), 4);
    let answers = sent.0.lock().unwrap();
    assert_eq!(answers.len() as u64, counts.processed);
    let last = answers.iter().filter(|a| a.seq == frames).count();
    assert_eq!(last, cameras, "the newest of each camera is always answered");
    assert!(counts.superseded > 0);
}

/// The scene's robot in front of the first poster, at rest by its odometry.
struct RestingRobot {
    engine: Engine,
    stops: Vec<sim::robot::SensorReadings>,
    intrinsics: vision::frame::Intrinsics,
    seq: u64,
}

impl RestingRobot {
    fn new(search: SearchPolicy) -> Self {
        let mut scene = scene::Scene::new();
        let map = scene.taught();
        let engine = Engine { search, ..scene::engine(std::slice::from_ref(&map)).0 };
        let stops = scene.stops(5, 1).into_iter().map(|(_, readings)| readings).collect();
        Self { engine, stops, intrinsics: scene.intrinsics(), seq: 0 }
    }

    /// The next frame is taken in front of poster `poster`; by odometry the robot has not moved.
    fn frame(&mut self, poster: usize) -> v1::Answer {
        self.seq += 1;
        let readings = &self.stops[poster];
        let odometry = self.stops[0].step.odom_from_robot;
        let frame = CheckedFrame {
            epoch: 1,
            seq: self.seq,
            captured_ns: self.seq as i64 * 200_000_000,
            width_px: 640,
            height_px: 480,
            pixels: Pixels::Image(EncodedImage {
                encoding: Encoding::Gray8,
                bytes: readings.frame.image.data().to_vec().into(),
            }),
            intrinsics: Some(self.intrinsics),
            mounting: Some(map::extrinsics::CameraExtrinsics::new(readings.step.robot_from_camera).unwrap()),
            odometry: Some(odometry),
            prior: None,
            deadline_ms: None,
            map: None,
        };
        let now = Instant::now();
        let job = FrameJob {
            frame,
            map: scene::MAP.to_owned(),
            received: now,
            deadline: now + Duration::from_mins(10),
            clock_suspect: false,
            stamp_instead_ns: None,
            message_bytes: 0,
        };
        let sent = Sent::default();
        assert_eq!(self.engine.answer_frame(&key(0), &job, &sent), FrameOutcome::Processed);
        sent.0.lock().unwrap().pop().unwrap()
    }

    /// Distance of the fused pose from where the frames of a poster were taken, metres.
    fn off_m(&self, poster: usize) -> f64 {
        let fused = self.engine.motion.pose(&key(0).robot, scene::MAP, Instant::now()).unwrap();
        let truth = self.stops[poster].step.map_from_robot;
        (fused.pose.x_m - truth.x_m).hypot(fused.pose.y_m - truth.y_m)
    }
}

#[test]
fn two_frames_of_three_are_answered_by_expected_landmarks_where_searches_are_spared() {
    let mut robot = RestingRobot::new(SearchPolicy::Scheduled);
    let answers: Vec<_> = (0..7).map(|_| robot.frame(0)).collect();
    let spared: Vec<bool> = answers.iter().map(|a| a.only_expected).collect();
    assert_eq!(spared, [false, true, true, false, true, true, false]);
    for answer in &answers {
        let (global, guided) = (answer.map_from_robot.is_some(), answer.guided_map_from_robot.is_some());
        assert_eq!((global, guided), (!answer.only_expected, answer.only_expected), "{answer:?}");
        let named = answer.quads.iter().any(|q| !q.landmark.is_empty() || !q.guided_landmark.is_empty());
        assert!(named, "{answer:?}");
    }
    assert!(robot.off_m(0) < 0.1, "{}", robot.off_m(0));
    let mut every = RestingRobot::new(SearchPolicy::Every);
    assert!((0..4).all(|_| !every.frame(0).only_expected));
}

/// Frames of another camera, which nothing takes, are what waits.
#[test]
fn searches_are_spared_only_while_enough_frames_wait() {
    let mut robot = RestingRobot::new(SearchPolicy::UnlessWaiting(2));
    let intake = intake(&robot.engine, Duration::from_mins(1));
    let spared = |robot: &mut RestingRobot| (0..5).map(|_| robot.frame(0).only_expected).collect::<Vec<_>>();
    assert_eq!(spared(&mut robot), [false; 5]);
    intake.receive(key(1), message(1, 768)).unwrap();
    assert_eq!(spared(&mut robot), [false; 5]);
    intake.receive(key(2), message(1, 768)).unwrap();
    assert_eq!(spared(&mut robot), [true, true, false, true, true]);
    while robot.engine.slots.try_take().is_some() {}
    assert_eq!(spared(&mut robot), [false; 5]);
}

/// No expected landmark is found: the frame is searched at once, and the third contradiction
/// replaces the pose.
#[test]
fn a_robot_that_was_carried_away_is_found_out_although_searches_are_spared() {
    let mut robot = RestingRobot::new(SearchPolicy::Scheduled);
    for _ in 0..3 {
        robot.frame(0);
    }
    assert!(robot.off_m(1) > 1.0, "the posters hang apart");
    for _ in 0..3 {
        let answer = robot.frame(1);
        assert!(!answer.only_expected && answer.map_from_robot.is_some(), "{answer:?}");
    }
    assert!(robot.off_m(1) < 0.2, "{}", robot.off_m(1));
}

/// Does not come back from an answer until it is let go.
struct Stuck(Mutex<std::sync::mpsc::Receiver<()>>);

impl Publish for Stuck {
    fn answer(&self, _: &SlotKey, _: &v1::Answer) {
        self.0.lock().unwrap().recv().ok();
    }

    fn pose(&self, _: &Name, _: &v1::RobotPose) {}
}

#[test]
fn a_worker_that_does_not_come_to_the_end_of_a_frame_stalls() {
    let (engine, (release, held)) = (hall(), std::sync::mpsc::channel());
    let workers = Workers::start(&engine, 2, &Arc::new(Stuck(Mutex::new(held)))).unwrap();
    let intake = intake(&engine, Duration::from_mins(1));
    let seconds = |n| {
        for _ in 0..n {
            engine.vitals.hearts().tick(Duration::from_secs(1));
        }
    };
    seconds(9);
    assert!(engine.vitals.stalled().is_none(), "they have nothing to do");
    intake.receive(key(0), message(1, 768)).unwrap();
    while engine.slots.counts().in_work == 0 {
        std::thread::sleep(Duration::from_millis(1));
    }
    seconds(1);
    // The worker may begin to work after the frame was taken.
    while engine.vitals.stalled().is_none() {
        seconds(1);
        std::thread::sleep(Duration::from_millis(1));
    }
    let stalled = engine.vitals.stalled().unwrap();
    assert!(stalled.part().starts_with("the worker thread vision-"), "{}", stalled.part());
    drop(release);
    while engine.slots.counts().in_work > 0 {
        std::thread::sleep(Duration::from_millis(1));
    }
    while engine.vitals.stalled().is_some() {
        seconds(1);
        std::thread::sleep(Duration::from_millis(1));
    }
    engine.vitals.stop();
    workers.stop();
}
