//! A fixed pool of threads that turns frames into answers: decode, pipeline, robot pose, publish. Vision runs nowhere
//! else for robots, and never on the async runtime. A panic anywhere in a frame's work is caught, answered as `internal`
//! and counted; its slot is free again and the worker goes on. A thread that ends untold makes the server fail.

use super::{
    cameras::Look,
    decode::{ImageLimits, decode_frame},
    doubles::sighted,
    guided::{Guided, guided},
    intake::{FrameJob, unknown_map},
    judging::{JudgedFrame, Seen, View, judged_frame},
    live::{LiveFrame, LiveHub},
    motion::{Moment, Motion},
    panics::Edge,
    search::{Glance, Left, Searches},
    slots::{Outcome, SlotKey, Slots},
    snapshot::{MapSnapshot, Snapshots},
    standing::{Findings, Found},
    verdicts::{self, StageTimes},
};
use crate::{
    gather::{Hook, Looked},
    vitals::Vitals,
};
use map::{hypotheses::Mode, pose2::Pose2Covariance};
use protos::{CheckedFrame, Code, Name, Rejection, convert::geometry::pose2_covariance_wire, v1};
use std::{cell::Cell, sync::Arc, thread::JoinHandle, time::Instant};
use vision::{frame::GrayImage, pipeline::FrameFacts, recognise::LandmarkId};

/// Where answers and poses go. Must not wait.
pub trait Publish: Send + Sync + 'static {
    /// An answer to a frame.
    fn answer(&self, key: &SlotKey, answer: &v1::Answer);
    /// A fused pose.
    fn pose(&self, robot: &Name, pose: &v1::RobotPose);
}

/// What workers share.
#[derive(Debug, Clone)]
pub struct Engine {
    /// Where frames wait.
    pub slots: Arc<Slots<FrameJob>>,
    /// Maps.
    pub snapshots: Arc<Snapshots>,
    /// Robots on the move.
    pub motion: Arc<Motion>,
    /// What pages show.
    pub live: Arc<LiveHub>,
    /// What a frame may cost.
    pub limits: ImageLimits,
    /// Where threads say that they run and panics are counted.
    pub vitals: Arc<Vitals>,
    /// Where findings about landmarks go.
    pub findings: Findings,
    /// Robots that do not know where they are.
    pub searches: Arc<Searches>,
    /// Where frames of robots that gather views go.
    pub gather: Hook,
}

/// The threads.
#[derive(Debug)]
pub struct Workers {
    slots: Arc<Slots<FrameJob>>,
    motion: Arc<Motion>,
    threads: Vec<JoinHandle<()>>,
}

impl Workers {
    /// Starts `count` threads for frames, at least one, and one for laser scans.
    pub fn start(engine: &Engine, count: usize, publish: &Arc<impl Publish>) -> std::io::Result<Self> {
        let mut threads = Vec::with_capacity(count + 1);
        for i in 0..count.max(1) {
            let (engine, publish) = (engine.clone(), publish.clone());
            let name = format!("vision-{i}");
            let pulse = engine.vitals.begin(format!("the worker thread {name}"));
            threads.push(std::thread::Builder::new().name(name).spawn(move || {
                // Ends with the thread, however that ends.
                let _pulse = pulse;
                while let Some((key, job)) = engine.slots.take() {
                    let outcome = engine.contained(&key, &job, publish.as_ref());
                    engine.slots.finish(&key, outcome);
                }
            })?);
        }
        let (lasers, publish) = (engine.clone(), publish.clone());
        let named = std::thread::Builder::new().name("laser".to_owned());
        let pulse = engine.vitals.begin("the laser thread");
        threads.push(named.spawn(move || {
            let _pulse = pulse;
            while let Some((robot, job)) = lasers.motion.scans().take() {
                let what = format_args!("a scan of robot {robot}");
                lasers.vitals.panics().catch(Edge::Scan, what, "it corrects nothing", || {
                    if let Some(pose) = lasers.motion.laser(&robot, &job, Instant::now()) {
                        publish.pose(&robot, &pose);
                    }
                });
            }
        })?);
        Ok(Self { slots: engine.slots.clone(), motion: engine.motion.clone(), threads })
    }

    /// Ends when every frame in work is answered. Waits: not for an async thread.
    pub fn stop(self) {
        self.slots.close();
        self.motion.scans().close();
        for thread in self.threads {
            if thread.join().is_err() {
                tracing::error!("a worker ended by a panic");
            }
        }
    }
}

/// What came of a frame.
struct Done {
    answer: v1::Answer,
    map: Arc<MapSnapshot>,
    /// What it says of the robot and the landmarks; absent where it must not count.
    judged: Option<JudgedFrame>,
    /// Where a robot that searched is found, and the landmarks that say so.
    found: Option<(Pose2Covariance, Vec<LandmarkId>)>,
}

impl Engine {
    /// Answers one frame and publishes the answer; never panics. What a frame has come to once it is answered stands,
    /// whatever happens to the pose and the findings after it.
    fn contained(&self, key: &SlotKey, job: &FrameJob, publish: &dyn Publish) -> Outcome {
        let answered = Cell::new(None);
        let seq = job.frame.seq;
        let what = format_args!("frame {seq} of robot {}, camera {}", key.robot, key.camera);
        let panics = self.vitals.panics();
        let worked = panics
            .catch(Edge::Frame, what, "its slot is free again", || self.work(key, job, publish, &answered));
        if let Some(outcome) = worked.or(answered.get()) {
            return outcome;
        }
        let (answer, outcome) = refused(job, &failed());
        panics.catch(Edge::Frame, what, "it is not answered", || self.reply(key, job, answer, publish));
        outcome
    }

    /// Answers one frame; `answered` says what it has come to as soon as the answer is on its way.
    fn work(
        &self,
        key: &SlotKey,
        job: &FrameJob,
        publish: &dyn Publish,
        answered: &Cell<Option<Outcome>>,
    ) -> Outcome {
        let done = if Instant::now() > job.deadline {
            let detail = format!("waited {} ms", job.received.elapsed().as_millis());
            Err(Rejection::new(Code::Expired, "deadline_ms", detail))
        } else {
            self.analyse(key, job)
        };
        let Done { answer, map, judged, found } = match done {
            Ok(done) => done,
            Err(refusal) => {
                let (answer, outcome) = refused(job, &refusal);
                answered.set(Some(outcome));
                self.reply(key, job, answer, publish);
                return outcome;
            }
        };
        let (frame, outcome) = (&job.frame, Outcome::Processed);
        answered.set(Some(outcome));
        self.reply(key, job, answer, publish);
        let Some(judged) = judged else { return outcome };
        let at = moment(frame, &map);
        if let Some(pose) = self.motion.looked(&key.robot, &key.camera, at, &judged.fixes()) {
            publish.pose(&key.robot, &pose);
        }
        if let Some((pose, landmarks)) = found
            && let Some(pose) = self.motion.found(&key.robot, moment(frame, &map), &pose, &landmarks)
        {
            self.searches.end(&key.robot);
            publish.pose(&key.robot, &pose);
        }
        if let Some(Seen { grounds, judged, missed }) = judged.seen {
            let changes = self.motion.judged(&key.robot, moment(frame, &map), &grounds, &judged, &missed);
            for change in changes {
                let name = map.landmarks.get(&change.landmark).map_or("", |l| l.name.as_str());
                self.findings.tell(Found::new(&map.name, name, &change));
            }
        }
        outcome
    }

    /// Decode, pipeline, robot pose: everything that can fail on a frame's content.
    fn analyse(&self, key: &SlotKey, job: &FrameJob) -> Result<Done, Rejection> {
        let frame = &job.frame;
        #[cfg(test)]
        assert!(key.camera.as_str() != tests::PLANTED, "planted");
        // One version of the map for the whole answer, whatever is published meanwhile.
        let map = self.snapshots.get(&job.map).ok_or_else(|| unknown_map(&job.map))?;
        let mut times = StageTimes::start();
        let image = decode_frame(frame, self.limits)?;
        times.ended("decode");
        let facts = verdicts::look(&image, frame.intrinsics.as_ref(), &map, &mut times);
        let mut answer = verdicts::answer(&facts, &map);
        // A frame may be answered on any map; what follows for the robot and for the map, only on its own.
        let on_own_map = self.snapshots.robot_map(key.robot.as_str()).is_some_and(|own| own == map.name);
        let is_live = self.motion.epochs().current(&key.robot).is_none_or(|epoch| epoch == frame.epoch);
        let counts = on_own_map && is_live && job.stamp_instead_ns.is_none();
        let at = moment(frame, &map);
        let grounds = counts.then(|| self.motion.grounds(&key.robot, &key.camera, at)).flatten();
        let view = View {
            facts: &facts,
            map: &map,
            mounting: frame.mounting.as_ref(),
            camera: frame.intrinsics.as_ref(),
            image_px: [f64::from(frame.width_px), f64::from(frame.height_px)],
            prior: frame.prior.as_ref(),
        };
        // The fused pose while nothing contradicts it; without one, what the robot itself believes.
        let guide = match &grounds {
            Some(grounds) => grounds.plan.guided.then_some(&grounds.pose),
            None => frame.prior.as_ref().filter(|_| on_own_map),
        };
        let guided = guide.map_or_else(Guided::default, |pose| guided(&image, &view, pose));
        let judged = judged_frame(&view, grounds, &guided);
        verdicts::fill_fixes(&mut answer, &judged, &guided, &map);
        if !counts {
            times.ended("localise");
            answer.timings = times.finish();
            if let Some(captured_ns) = job.stamp_instead_ns.filter(|_| on_own_map && is_live) {
                let frame = CheckedFrame { captured_ns, ..frame.clone() };
                let (quads, believed) = (facts.quads, frame.prior);
                self.gather.offer(key, &frame, || Looked { image, quads, map: map.clone(), believed });
            }
            return Ok(Done { answer, map, judged: None, found: None });
        }
        if let Some(intrinsics) = &frame.intrinsics {
            let (seen, mounting) = (verdicts::recognised(&facts), frame.mounting.as_ref());
            let image_px = [image.width() as u32, image.height() as u32];
            let fix = judged.fix.as_ref().map_err(|word| *word);
            self.live
                .watched()
                .looked(key, &Look { intrinsics, image_px, seen: &seen, map: &map, mounting, fix });
        }
        let searched =
            self.search(key, frame, (&image, &facts), &map, judged.seen.is_some() || judged.fix.is_ok());
        let found = searched.and_then(|left| {
            answer.hypotheses = left.modes.iter().map(hypothesis).collect();
            left.decided
        });
        times.ended("localise");
        answer.timings = times.finish();
        self.gather.offer(key, frame, || {
            let believed = frame.prior.or(judged.prior);
            Looked { image, quads: facts.quads, map: map.clone(), believed }
        });
        Ok(Done { answer, map, judged: Some(judged), found })
    }

    /// Goes on with the search of a robot that does not know where it is.
    fn search(
        &self,
        key: &SlotKey,
        frame: &CheckedFrame,
        (image, facts): (&GrayImage, &FrameFacts),
        map: &MapSnapshot,
        is_known: bool,
    ) -> Option<Left> {
        let (mounting, camera) = (frame.mounting.as_ref()?, frame.intrinsics.as_ref()?);
        let odometry = frame.odometry?;
        if is_known {
            self.searches.end(&key.robot);
            return None;
        }
        let sighted = sighted(image, facts, map, mounting, camera);
        let glance = Glance { epoch: frame.epoch, map, odometry, sighted: &sighted };
        self.searches.glance(&key.robot, &glance)
    }

    /// Publishes an answer and shows it on pages.
    fn reply(&self, key: &SlotKey, job: &FrameJob, mut answer: v1::Answer, publish: &dyn Publish) {
        let frame = &job.frame;
        (answer.epoch, answer.seq, answer.captured_ns) = (frame.epoch, frame.seq, frame.captured_ns);
        answer.clock_suspect = job.clock_suspect;
        answer.age_ms = job.received.elapsed().as_secs_f64() * 1e3;
        publish.answer(key, &answer);
        let answer = Arc::new(answer);
        if answer.rejection.is_none() {
            let (encoding, width_px, height_px) = (frame.encoding, frame.width_px, frame.height_px);
            self.live.answered(
                key,
                LiveFrame { encoding, width_px, height_px, image: frame.image.clone(), answer },
            );
        } else {
            self.live.refused(key, answer);
        }
    }
}

fn hypothesis(mode: &Mode) -> v1::Hypothesis {
    v1::Hypothesis { mass: mode.mass, map_from_robot: Some(pose2_covariance_wire(&mode.pose)) }
}

fn moment<'a>(frame: &CheckedFrame, map: &'a MapSnapshot) -> Moment<'a> {
    let CheckedFrame { epoch, captured_ns, odometry, .. } = *frame;
    Moment { map: &map.name, epoch, captured_ns, odometry, now: Instant::now() }
}

/// The answer that says why there is none, and how the frame has ended.
fn refused(job: &FrameJob, refusal: &Rejection) -> (v1::Answer, Outcome) {
    let (status, outcome) = match refusal.code {
        Code::Expired => (v1::Status::Expired, Outcome::Expired),
        code => (v1::Status::Rejected, Outcome::Rejected(code)),
    };
    let (rejection, map) = (Some(refusal.into()), job.map.clone());
    (v1::Answer { status: status.into(), rejection, map, ..v1::Answer::default() }, outcome)
}

/// What a panic is answered with.
pub(crate) fn failed() -> Rejection {
    Rejection::new(Code::Internal, "frame", "the server failed on this frame; see its log")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::{intake::Intake, scene};
    use protos::prost::Message;
    use std::{sync::Mutex, time::Duration};

    /// The analysis of this camera's frames panics.
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
        Intake { slots, snapshots, motion: engine.motion.clone(), frame_bytes: 100_000, deadline }
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
        scene::engine(&[Arc::new(MapSnapshot::empty("hall", 1))])
    }

    /// Panics where it is told to.
    #[derive(Default)]
    struct Breaks {
        answers: bool,
        sent: Sent,
    }

    impl Publish for Breaks {
        fn answer(&self, key: &SlotKey, answer: &v1::Answer) {
            assert!(!self.answers, "planted");
            self.sent.answer(key, answer);
        }

        fn pose(&self, _: &Name, _: &v1::RobotPose) {}
    }

    fn settled(engine: &Engine) -> crate::engine::slots::FrameCounts {
        loop {
            let counts = engine.slots.counts();
            if counts.waiting == 0 && counts.in_work == 0 {
                return counts;
            }
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    /// Outside the analysis: where the answer is handed over.
    #[test]
    fn a_panic_beside_the_analysis_leaves_the_camera_usable() {
        let (engine, breaks) = (hall(), Arc::new(Breaks { answers: true, ..Breaks::default() }));
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

    /// Inside it: answered, once.
    #[test]
    fn a_panic_of_the_analysis_is_answered_and_counted() {
        let (engine, sent) = (hall(), Sent::default());
        intake(&engine, Duration::from_mins(1)).receive(key(0), message(1, 768)).unwrap();
        let (_, job) = engine.slots.try_take().unwrap();
        let k = SlotKey { robot: key(0).robot, camera: Name::new(PLANTED).unwrap() };
        let outcome = engine.contained(&k, &job, &sent);
        let answer = sent.0.lock().unwrap().pop().unwrap();
        assert!(sent.0.lock().unwrap().is_empty());
        let code = answer.rejection.map(|r| r.code);
        assert_eq!((outcome, code.as_deref()), (Outcome::Rejected(Code::Internal), Some("internal")));
        assert_eq!(engine.vitals.panics().at(Edge::Frame), 1);
    }

    #[test]
    fn a_thread_that_ends_untold_is_a_failure() {
        let engine = hall();
        let workers = Workers::start(&engine, 1, &Arc::new(Sent::default())).unwrap();
        assert_eq!(engine.vitals.failure(), None);
        // No frames any more, and nobody has told the server to stop.
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
        assert_eq!(engine.contained(&k, &job, &sent), Outcome::Expired);
        let answer = sent.0.lock().unwrap().pop().unwrap();
        assert_eq!((answer.status(), answer.seq, answer.timings.len()), (v1::Status::Expired, 1, 0));
    }

    #[test]
    fn a_map_that_is_gone_is_a_refusal() {
        let (engine, sent) = (hall(), Sent::default());
        intake(&engine, Duration::from_secs(9)).receive(key(0), message(1, 768)).unwrap();
        engine.snapshots.remove_map("hall");
        let (k, job) = engine.slots.try_take().unwrap();
        assert_eq!(engine.contained(&k, &job, &sent), Outcome::Rejected(Code::UnknownMap));
    }

    /// Far more frames than the pool can take: each is answered or superseded, none is lost, none answered twice.
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
}
