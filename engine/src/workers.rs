//! A fixed pool of threads that turns frames into answers: decode, pipeline, robot pose, publish. Vision runs nowhere
//! else for robots, and never on the async runtime. A panic anywhere in a frame's work is caught, answered as `internal`
//! and counted; its slot is free again and the worker goes on. A thread that ends untold makes the server fail.

use super::{
    cameras::CameraSample,
    decode::{ImageLimits, decode_frame},
    doubles::sighted,
    frame_analysis::{StageTimes, analyse_frame},
    frame_context::FrameContext,
    guided::{Guided, guided},
    intake::{FrameJob, unknown_map},
    judging::{JudgedFrame, LandmarkChecks, judged_expected, judged_frame},
    live::{LiveFrame, LiveHub},
    motion::{FrameStamp, MotionTracker, PriorPose},
    panics::Edge,
    search::{RelocalisationInput, RelocalisationUpdate, Relocalisers},
    slots::{FrameOutcome, SlotKey, Slots},
    snapshot::{MapSnapshot, Snapshots},
    standing::{FindingSender, LandmarkFinding},
};
use crate::frame_tap::{AnalysedFrame, FrameTap};
use crate::vitals::Vitals;
use map::{pose2::Pose2Covariance, relocalise::PoseHypothesis};
use protos::{CheckedFrame, Code, Name, Rejection, convert::geometry::pose2_covariance_wire, v1};
use std::{cell::Cell, sync::Arc, thread::JoinHandle, time::Instant};
use vision::{frame::GrayImage, model::LandmarkId, pipeline::FrameAnalysis};

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
    pub motion: Arc<MotionTracker>,
    /// What pages show.
    pub live: Arc<LiveHub>,
    /// What a frame may cost.
    pub limits: ImageLimits,
    /// Where threads say that they run and panics are counted.
    pub vitals: Arc<Vitals>,
    /// Where findings about landmarks go.
    pub findings: FindingSender,
    /// Robots that do not know where they are.
    pub searches: Arc<Relocalisers>,
    /// Where frames of robots that gather views go.
    pub gather: Arc<dyn FrameTap>,
    /// Whether every frame is searched for all landmarks of its map.
    pub search_every_frame: bool,
}

/// The threads.
#[derive(Debug)]
pub struct Workers {
    slots: Arc<Slots<FrameJob>>,
    motion: Arc<MotionTracker>,
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
    fn contained(&self, key: &SlotKey, job: &FrameJob, publish: &dyn Publish) -> FrameOutcome {
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
        answered: &Cell<Option<FrameOutcome>>,
    ) -> FrameOutcome {
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
        let (frame, outcome) = (&job.frame, FrameOutcome::Processed);
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
        if let Some(LandmarkChecks { grounds, judged, missed }) = judged.seen {
            let changes = self.motion.judged(&key.robot, moment(frame, &map), &grounds, &judged, &missed);
            for change in changes {
                let name = map.landmarks.get(&change.landmark).map_or("", |l| l.name.as_str());
                self.findings.tell(LandmarkFinding::new(&map.name, name, &change));
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
        // A frame may be answered on any map; what follows for the robot and for the map, only on its own.
        let on_own_map = self.snapshots.robot_map(key.robot.as_str()).is_some_and(|own| own == map.name);
        let is_live = self.motion.epochs().current(&key.robot).is_none_or(|epoch| epoch == frame.epoch);
        let counts = on_own_map && is_live && job.stamp_instead_ns.is_none();
        let at = moment(frame, &map);
        let grounds = counts.then(|| self.motion.grounds(&key.robot, &key.camera, at)).flatten();
        if let Some((answer, judged)) =
            self.expected_only(key, frame, (&image, &map), grounds.as_ref(), &mut times)
        {
            return Ok(Done { answer, map, judged: Some(judged), found: None });
        }
        let facts = analyse_frame(&image, frame.intrinsics.as_ref(), &map, &mut times);
        let mut answer = crate::frame_answer::answer(&facts, &map);
        let view = view(frame, &facts, &map);
        // The fused pose while nothing contradicts it; without one, what the robot itself believes.
        let guide = match &grounds {
            Some(grounds) => grounds.plan.guided.then_some(&grounds.pose),
            None => frame.prior.as_ref().filter(|_| on_own_map),
        };
        let guided = guide.map_or_else(Guided::default, |pose| guided(&image, &view, pose));
        let judged = judged_frame(&view, grounds, &guided);
        crate::frame_answer::fill_fixes(&mut answer, &judged, &guided, &map);
        if !counts {
            times.ended("localise");
            answer.timings = times.finish();
            if let Some(captured_ns) = job.stamp_instead_ns.filter(|_| on_own_map && is_live) {
                let frame = CheckedFrame { captured_ns, ..frame.clone() };
                let (quads, believed) = (facts.quads, frame.prior);
                if self.gather.is_wanted(key) {
                    self.gather.offer(
                        key,
                        &frame,
                        AnalysedFrame { image, quads, map: map.clone(), believed },
                    );
                }
            }
            return Ok(Done { answer, map, judged: None, found: None });
        }
        if let Some(intrinsics) = &frame.intrinsics {
            let (seen, mounting) = (crate::fixes::unique_landmarks(&facts), frame.mounting.as_ref());
            let image_px = [image.width() as u32, image.height() as u32];
            let fix = judged.fix.as_ref().map_err(|reason| *reason);
            self.live
                .watched()
                .looked(key, &CameraSample { intrinsics, image_px, seen: &seen, map: &map, mounting, fix });
        }
        let searched =
            self.search(key, frame, (&image, &facts), &map, judged.seen.is_some() || judged.fix.is_ok());
        let found = searched.and_then(|left| {
            answer.hypotheses = left.modes.iter().map(hypothesis).collect();
            left.decided
        });
        times.ended("localise");
        answer.timings = times.finish();
        if self.gather.is_wanted(key) {
            let believed = frame.prior.or(judged.prior);
            let analysed = AnalysedFrame { image, quads: facts.quads, map: map.clone(), believed };
            self.gather.offer(key, frame, analysed);
        }
        Ok(Done { answer, map, judged: Some(judged), found })
    }

    /// Answers a frame by the landmarks alone that the robot's pose expects, where the schedule asks for no search. `None`
    /// where it asks for one, or what is found calls for one: nothing, a contradiction, a landmark that is surely in view
    /// and was not found. Robots that gather are searched for: they want what is on no map.
    fn expected_only(
        &self,
        key: &SlotKey,
        frame: &CheckedFrame,
        (image, map): (&GrayImage, &MapSnapshot),
        grounds: Option<&PriorPose>,
        times: &mut StageTimes,
    ) -> Option<(v1::Answer, JudgedFrame)> {
        let is_spared = |g: &&PriorPose| g.plan.guided && g.plan.global.is_none();
        let grounds = grounds.filter(is_spared).filter(|_| !self.search_every_frame)?;
        if self.gather.is_wanted(key) {
            return None;
        }
        let nothing = FrameAnalysis { quads: Vec::new() };
        let view = view(frame, &nothing, map);
        let guided = guided(image, &view, &grounds.pose);
        let judged = judged_expected(&view, grounds.clone(), &guided);
        times.ended("expected");
        if guided.report.global_reason().is_some() || judged.guided.is_none() {
            return None;
        }
        let mut answer = crate::frame_answer::answer(&nothing, map);
        answer.only_expected = true;
        crate::frame_answer::fill_fixes(&mut answer, &judged, &guided, map);
        times.ended("localise");
        answer.timings = times.finish();
        Some((answer, judged))
    }

    /// Goes on with the search of a robot that does not know where it is.
    fn search(
        &self,
        key: &SlotKey,
        frame: &CheckedFrame,
        (image, facts): (&GrayImage, &FrameAnalysis),
        map: &MapSnapshot,
        is_known: bool,
    ) -> Option<RelocalisationUpdate> {
        let (mounting, camera) = (frame.mounting.as_ref()?, frame.intrinsics.as_ref()?);
        let odometry = frame.odometry?;
        if is_known {
            self.searches.end(&key.robot);
            return None;
        }
        let sighted = sighted(image, facts, map, mounting, camera);
        let glance = RelocalisationInput { epoch: frame.epoch, map, odometry, sighted: &sighted };
        self.searches.glance(&key.robot, &glance)
    }

    /// Publishes an answer and shows it on pages.
    fn reply(&self, key: &SlotKey, job: &FrameJob, mut answer: v1::Answer, publish: &dyn Publish) {
        let frame = &job.frame;
        (answer.epoch, answer.seq, answer.captured_ns) = (frame.epoch, frame.seq, frame.captured_ns);
        answer.clock_suspect = job.clock_suspect;
        answer.latency_ms = job.received.elapsed().as_secs_f64() * 1e3;
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

fn view<'a>(frame: &'a CheckedFrame, facts: &'a FrameAnalysis, map: &'a MapSnapshot) -> FrameContext<'a> {
    FrameContext {
        facts,
        map,
        mounting: frame.mounting.as_ref(),
        camera: frame.intrinsics.as_ref(),
        image_px: [f64::from(frame.width_px), f64::from(frame.height_px)],
        prior: frame.prior.as_ref(),
    }
}

fn hypothesis(mode: &PoseHypothesis) -> v1::Hypothesis {
    v1::Hypothesis { probability: mode.mass, map_from_robot: Some(pose2_covariance_wire(&mode.pose)) }
}

fn moment<'a>(frame: &CheckedFrame, map: &'a MapSnapshot) -> FrameStamp<'a> {
    let CheckedFrame { epoch, captured_ns, odometry, .. } = *frame;
    FrameStamp { map: &map.name, epoch, captured_ns, odometry, now: Instant::now() }
}

/// The answer that says why there is none, and how the frame has ended.
fn refused(job: &FrameJob, refusal: &Rejection) -> (v1::Answer, FrameOutcome) {
    let (status, outcome) = match refusal.code {
        Code::Expired => (v1::Status::Expired, FrameOutcome::Expired),
        code => (v1::Status::Rejected, FrameOutcome::Rejected(code)),
    };
    let (rejection, map) = (Some(refusal.into()), job.map.clone());
    (v1::Answer { status: status.into(), rejection, map, ..v1::Answer::default() }, outcome)
}

/// What a panic is answered with.
pub fn failed() -> Rejection {
    Rejection::new(Code::Internal, "frame", "the server failed on this frame; see its log")
}

#[cfg(test)]
mod tests;
