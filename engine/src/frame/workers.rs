//! A fixed pool of threads that turns frames into answers: decode, pipeline, robot pose, publish;
//! and one for laser scans. Vision for robots runs only here, never on the async runtime. A panic
//! in a frame's work is caught, counted and answered as `internal`; the slot is free again and the
//! worker goes on. A thread that ends before it is told to makes the server fail, and so does one
//! that does not come to the end of a frame ([`crate::heartbeats`]).

use super::{
    ambiguous_observations::ambiguous_observations,
    analysis::{AnalysedFrame, Effect, OpenedFrame, StageTimes},
    answer::{answer_to_frame, refusal},
    decode::{ImageLimits, decode_frame},
    intake::{FrameJob, unknown_map},
    landmark_checks::LandmarkChecks,
    relocalise::{RelocalisationInput, RelocalisationUpdate, Relocalisers},
    slots::{FrameOutcome, SlotKey, Slots},
};
use crate::{
    motion::{FrameStamp, MotionTracker, PriorPose},
    snapshot::{MapSnapshot, Snapshots},
    supervision::{
        panics::Edge,
        threads::{self, Class},
        vitals::Vitals,
    },
};
use map::landmark_health::HealthChange;
use protos::{CheckedFrame, Code, Name, Rejection, v1};
use std::{cell::Cell, fmt::Debug, sync::Arc, thread::JoinHandle, time::Instant};

/// Takes answers and poses. Never waits.
pub trait Publish: Send + Sync + 'static {
    /// An answer to a frame.
    fn answer(&self, key: &SlotKey, answer: &v1::Answer);
    /// A fused pose.
    fn pose(&self, robot: &Name, pose: &v1::RobotPose);
}

/// A frame with its answer.
#[derive(Debug, Clone, Copy)]
pub struct AnsweredFrame<'a> {
    /// Robot and camera.
    pub key: &'a SlotKey,
    /// What the robot sent.
    pub frame: &'a CheckedFrame,
    /// What was found in it; absent where it was refused.
    pub analysed: Option<&'a AnalysedFrame>,
    /// What is about to be published.
    pub answer: &'a Arc<v1::Answer>,
}

/// Watches frames. Workers call it: an implementation never waits.
pub trait FrameObserver: Debug + Send + Sync {
    /// A frame was answered. The answer is published afterwards, so that who has it finds it
    /// counted.
    fn answered(&self, _frame: &AnsweredFrame<'_>) {}

    /// The frames of a robot changed the health of landmarks.
    fn health_changed(&self, _map: &MapSnapshot, _changes: &[HealthChange]) {}

    /// Whether frames of this camera are looked at for objects that are on no map.
    fn gathers(&self, _key: &SlotKey) -> bool {
        false
    }
}

/// When a frame may do without the search of the whole map. It does where [`map::guided::Schedule`]
/// asks for none and the expected landmarks are found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SearchPolicy {
    /// Never: every frame is searched.
    Every,
    /// While at least so many frames wait for a worker. They would be answered late, or superseded.
    UnlessWaiting(u64),
    /// Always.
    Scheduled,
}

impl SearchPolicy {
    /// Whether a frame may do without a search while `waiting` others wait.
    pub fn may_spare(self, waiting: u64) -> bool {
        match self {
            Self::Every => false,
            Self::UnlessWaiting(least) => waiting >= least,
            Self::Scheduled => true,
        }
    }
}

/// What the workers share.
#[derive(Debug, Clone)]
pub struct Engine {
    /// Where frames wait.
    pub slots: Arc<Slots<FrameJob>>,
    /// Maps.
    pub snapshots: Arc<Snapshots>,
    /// The motion of robots.
    pub motion: Arc<MotionTracker>,
    /// Largest frame.
    pub limits: ImageLimits,
    /// Pulses of the threads, and counters of panics.
    pub vitals: Arc<Vitals>,
    /// Relocalisations of robots without a pose.
    pub relocalisers: Arc<Relocalisers>,
    /// Which frames are searched for all landmarks of their map.
    pub search: SearchPolicy,
    /// What watches frames, in the order in which it learns of them.
    pub observers: Vec<Arc<dyn FrameObserver>>,
}

impl Engine {
    /// Answers a frame in a span of its own: by robot, camera, epoch and number it can be followed
    /// through the log.
    fn answer_in_span(&self, key: &SlotKey, job: &FrameJob, publish: &dyn Publish) -> FrameOutcome {
        let (robot, camera, frame) = (&key.robot, &key.camera, &job.frame);
        let (epoch, seq) = (frame.epoch, frame.seq);
        let waited_ms = u64::try_from(job.received.elapsed().as_millis()).unwrap_or(u64::MAX);
        tracing::debug_span!("frame", %robot, %camera, epoch, seq, waited_ms)
            .in_scope(|| self.answer_frame(key, job, publish))
    }

    /// Answers one frame and publishes the answer; never panics. The outcome of an answered frame
    /// stands, whatever happens to the pose and the findings after it.
    fn answer_frame(&self, key: &SlotKey, job: &FrameJob, publish: &dyn Publish) -> FrameOutcome {
        let answered = Cell::new(None);
        let seq = job.frame.seq;
        let what = format_args!("frame {seq} of robot {}, camera {}", key.robot, key.camera);
        let panics = self.vitals.panics();
        let processed = panics.catch(Edge::Frame, what, "its slot is free again", || {
            self.process(key, job, publish, &answered)
        });
        if let Some(outcome) = processed.or(answered.get()) {
            return outcome;
        }
        let refused = Err(failed());
        panics.catch(Edge::Frame, what, "it is not answered", || {
            publish.answer(key, &self.answer(key, job, &refused));
        });
        outcome(&refused)
    }

    /// Answers one frame; `answered` holds the outcome before the answer is published.
    fn process(
        &self,
        key: &SlotKey,
        job: &FrameJob,
        publish: &dyn Publish,
        answered: &Cell<Option<FrameOutcome>>,
    ) -> FrameOutcome {
        let analysed = self.analyse(key, job);
        let outcome = outcome(&analysed);
        let answer = self.answer(key, job, &analysed);
        answered.set(Some(outcome));
        publish.answer(key, &answer);
        if let Ok(found) = &analysed
            && found.effect == Effect::Full
        {
            self.apply(key, &job.frame, found, publish);
        }
        outcome
    }

    /// Everything that can fail on a frame's content: decode, recognition, fixes.
    fn analyse(&self, key: &SlotKey, job: &FrameJob) -> Result<AnalysedFrame, Rejection> {
        let frame = &job.frame;
        if job.is_late(Instant::now()) {
            let detail = format!("waited {} ms", job.received.elapsed().as_millis());
            return Err(Rejection::new(Code::Expired, "deadline_ms", detail));
        }
        #[cfg(test)]
        assert!(key.camera.as_str() != tests::PLANTED, "planted");
        // The whole answer rests on one version of the map.
        let map = self.snapshots.get(&job.map).ok_or_else(|| unknown_map(&job.map))?;
        let mut times = StageTimes::start();
        let picture = Arc::new(decode_frame(frame, self.limits)?);
        times.ended("decode");
        let effect = self.effect(key, job, &map);
        let prior = self.prior(key, frame, &map, effect);
        let opened = OpenedFrame { frame, picture, map, effect, prior };
        let by_expected =
            self.may_spare_search(key, &opened).then(|| opened.by_expected(&mut times)).flatten();
        let mut found = by_expected.unwrap_or_else(|| opened.searched(&mut times));
        found.relocalisation = self.relocalise(key, frame, &found);
        times.ended("localise");
        found.stages = times.finish();
        Ok(found)
    }

    /// What a frame may change.
    fn effect(&self, key: &SlotKey, job: &FrameJob, map: &MapSnapshot) -> Effect {
        let own = self.snapshots.robot_map(key.robot.as_str());
        let live = self.motion.epochs().current(&key.robot);
        match job.stamp_instead_ns {
            _ if own.is_none_or(|own| own != map.name) => Effect::OtherMap,
            _ if live.is_some_and(|live| live != job.frame.epoch) => Effect::AnswerOnly,
            Some(captured_ns) => Effect::Gather { captured_ns },
            None => Effect::Full,
        }
    }

    fn prior(
        &self,
        key: &SlotKey,
        frame: &CheckedFrame,
        map: &MapSnapshot,
        effect: Effect,
    ) -> Option<PriorPose> {
        let at = frame_stamp(frame, map);
        if effect == Effect::Full { self.motion.prior_pose(&key.robot, &key.camera, at) } else { None }
    }

    /// Whether policy and schedule ask for no search of the map. Frames of robots that gather are
    /// always searched: they show objects that are on no map.
    fn may_spare_search(&self, key: &SlotKey, opened: &OpenedFrame<'_>) -> bool {
        let plan = opened.prior.as_ref().map(|prior| &prior.plan);
        plan.is_some_and(|plan| plan.guided && plan.global.is_none())
            && opened.frame.is_whole()
            && self.search.may_spare(self.slots.waiting())
            && !self.observers.iter().any(|observer| observer.gathers(key))
    }

    /// Continues the relocalisation of a robot without a pose; ends it for a robot with one.
    fn relocalise(
        &self,
        key: &SlotKey,
        frame: &CheckedFrame,
        found: &AnalysedFrame,
    ) -> Option<RelocalisationUpdate> {
        let (extrinsics, camera) = (frame.mounting.as_ref()?, frame.intrinsics.as_ref()?);
        let (odometry, evaluation, map) = (frame.odometry?, &found.evaluation, &found.map);
        if found.effect != Effect::Full || evaluation.only_expected {
            return None;
        }
        if evaluation.checks.is_some() || evaluation.fix.is_ok() {
            self.relocalisers.stop(&key.robot);
            return None;
        }
        let image = found.picture.grey();
        let observations = ambiguous_observations(image, &found.analysis, map, extrinsics, camera);
        let input = RelocalisationInput { epoch: frame.epoch, map, odometry, observations: &observations };
        self.relocalisers.update(&key.robot, &input)
    }

    /// Writes the answer to a frame and shows it to the observers.
    fn answer(
        &self,
        key: &SlotKey,
        job: &FrameJob,
        analysed: &Result<AnalysedFrame, Rejection>,
    ) -> Arc<v1::Answer> {
        let answer = Arc::new(match analysed {
            Ok(found) => answer_to_frame(job, found),
            Err(reason) => refusal(job, reason),
        });
        let (frame, analysed) = (&job.frame, analysed.as_ref().ok());
        let answered = AnsweredFrame { key, frame, analysed, answer: &answer };
        self.observers.iter().for_each(|observer| observer.answered(&answered));
        tracing::debug!(status = answer.status().as_str_name(), ms = answer.latency_ms, "frame_answered");
        answer
    }

    /// Changes the robot's pose and the health of landmarks by a frame.
    fn apply(&self, key: &SlotKey, frame: &CheckedFrame, found: &AnalysedFrame, publish: &dyn Publish) {
        let (robot, map, fixes) = (&key.robot, &found.map, found.evaluation.fixes());
        if let Some(pose) = self.motion.apply_frame(robot, &key.camera, frame_stamp(frame, map), &fixes) {
            publish.pose(robot, &pose);
        }
        let relocalised = found.relocalisation.as_ref().and_then(|update| update.pose.as_ref());
        if let Some((pose, landmarks)) = relocalised
            && let Some(pose) =
                self.motion.start_from_hypothesis(robot, frame_stamp(frame, map), pose, landmarks)
        {
            self.relocalisers.stop(robot);
            publish.pose(robot, &pose);
        }
        if let Some(LandmarkChecks { prior, observed, missed }) = &found.evaluation.checks {
            let at = frame_stamp(frame, map);
            let changes = self.motion.update_landmark_health(robot, at, prior, observed, missed);
            self.observers.iter().for_each(|observer| observer.health_changed(map, &changes));
        }
    }
}

fn frame_stamp<'a>(frame: &CheckedFrame, map: &'a MapSnapshot) -> FrameStamp<'a> {
    let CheckedFrame { epoch, captured_ns, odometry, .. } = *frame;
    FrameStamp { map: &map.name, epoch, captured_ns, odometry, now: Instant::now() }
}

fn outcome(analysed: &Result<AnalysedFrame, Rejection>) -> FrameOutcome {
    match analysed {
        Ok(_) => FrameOutcome::Processed,
        Err(Rejection { code: Code::Expired, .. }) => FrameOutcome::Expired,
        Err(Rejection { code, .. }) => FrameOutcome::Rejected(*code),
    }
}

/// The refusal after a panic.
pub fn failed() -> Rejection {
    Rejection::new(Code::Internal, "frame", "the server failed on this frame; see its log")
}

/// The threads: some for frames, one for laser scans.
#[derive(Debug)]
pub struct Workers {
    slots: Arc<Slots<FrameJob>>,
    motion: Arc<MotionTracker>,
    threads: Vec<JoinHandle<()>>,
}

impl Workers {
    /// Starts `count` threads for frames, at least one, and one for laser scans.
    pub fn start(engine: &Engine, count: usize, publish: &Arc<impl Publish>) -> std::io::Result<Self> {
        let mut running = Vec::with_capacity(count + 1);
        for i in 0..count.max(1) {
            let (engine, publish) = (engine.clone(), publish.clone());
            let name = format!("vision-{i}");
            let pulse = engine.vitals.begin(format!("the worker thread {name}"));
            let heart = engine.vitals.hearts().begin(format!("the worker thread {name}"));
            running.push(threads::spawn(Class::Answers, name, move || {
                // Dropped with the thread, however that ends.
                let _pulse = pulse;
                while let Some((key, job)) = engine.slots.take() {
                    heart.beat();
                    let outcome = engine.answer_in_span(&key, &job, publish.as_ref());
                    threads::note_frame(Instant::now());
                    engine.slots.finish(&key, outcome);
                    heart.rest();
                }
            })?);
        }
        let (laser, publish) = (engine.clone(), publish.clone());
        let pulse = engine.vitals.begin("the laser thread");
        let heart = engine.vitals.hearts().begin("the laser thread");
        running.push(threads::spawn(Class::Answers, "laser", move || {
            let _pulse = pulse;
            while let Some((robot, job)) = laser.motion.scans().take() {
                heart.beat();
                let what = format_args!("a scan of robot {robot}");
                laser.vitals.panics().catch(Edge::Scan, what, "it corrects nothing", || {
                    if let Some(pose) = laser.motion.fix_by_scan(&robot, &job, Instant::now()) {
                        publish.pose(&robot, &pose);
                    }
                });
                heart.rest();
            }
        })?);
        Ok(Self { slots: engine.slots.clone(), motion: engine.motion.clone(), threads: running })
    }

    /// Returns when every frame in work is answered. Waits: not for an async thread.
    pub fn stop(self) {
        self.slots.close();
        self.motion.scans().close();
        for thread in self.threads {
            if thread.join().is_err() {
                tracing::error!("worker_panicked");
            }
        }
    }
}

#[cfg(test)]
mod tests;
