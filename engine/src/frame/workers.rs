//! A fixed pool of threads that turns frames into answers: decode, pipeline, robot pose, publish. Vision for robots runs
//! only here, never on the async runtime. A panic in a frame's work is caught, counted and answered as `internal`; the slot
//! is free again and the worker goes on. A thread that ends before it is told to makes the server fail.

use super::{
    ambiguous_observations::ambiguous_observations,
    analysis::{StageTimes, analyse_checked},
    context::FrameContext,
    decode::{ImageLimits, decode_frame},
    guided::{GuidedResult, recognise_guided},
    intake::{FrameJob, unknown_map},
    landmark_checks::{FrameEvaluation, LandmarkChecks, evaluate_expected_only, evaluate_frame},
    relocalise::{RelocalisationInput, RelocalisationUpdate, Relocalisers, hypothesis_wire},
    search_policy::SearchPolicy,
    slots::{FrameOutcome, SlotKey, Slots},
};
use crate::{
    motion::{FrameStamp, MotionTracker, PriorPose},
    observers::{
        answer_records::{AnswerBasis, AnswerRecord, AnswerRecorder},
        cameras::CameraSample,
        findings::{FindingSender, LandmarkFinding},
        frame_tap::{AnalysedFrame, FrameTap},
        frame_times::FrameTimes,
        kept_frames::KeptFrames,
        live::{LiveFrame, LiveHub},
    },
    snapshot::{MapSnapshot, Snapshots},
    supervision::{panics::Edge, vitals::Vitals},
};
use map::pose2::Pose2Covariance;
use protos::{CheckedFrame, Code, Name, Rejection, v1};
use std::{cell::Cell, sync::Arc, time::Instant};
use vision::{frame::GrayImage, model::LandmarkId, pipeline::FrameAnalysis};

mod pool;
pub use pool::Workers;

/// Takes answers and poses. Never waits.
pub trait Publish: Send + Sync + 'static {
    /// An answer to a frame.
    fn answer(&self, key: &SlotKey, answer: &v1::Answer);
    /// A fused pose.
    fn pose(&self, robot: &Name, pose: &v1::RobotPose);
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
    /// What pages show.
    pub live: Arc<LiveHub>,
    /// Largest frame.
    pub limits: ImageLimits,
    /// Pulses of the threads, and counters of panics.
    pub vitals: Arc<Vitals>,
    /// Where findings about landmarks go.
    pub findings: FindingSender,
    /// Where answers that are worth storing go.
    pub records: AnswerRecorder,
    /// Where the frames of those answers are kept.
    pub kept_frames: Arc<KeptFrames>,
    /// Relocalisations of robots without a pose.
    pub relocalisers: Arc<Relocalisers>,
    /// Takes frames of robots that gather views.
    pub frame_tap: Arc<dyn FrameTap>,
    /// How long frames take.
    pub times: Arc<FrameTimes>,
    /// Which frames are searched for all landmarks of their map.
    pub search: SearchPolicy,
}

/// A frame after its analysis.
struct AnsweredFrame {
    answer: v1::Answer,
    /// What it rests on, if it is to be stored.
    basis: Option<AnswerBasis>,
    map: Arc<MapSnapshot>,
    /// Its fixes and landmark checks; absent if the frame must not change the robot's pose or the map.
    evaluation: Option<FrameEvaluation>,
    /// The pose of a relocalised robot, and the landmarks that it rests on.
    relocalised: Option<(Pose2Covariance, Vec<LandmarkId>)>,
}

impl Engine {
    /// Answers one frame and publishes the answer; never panics. The outcome of an answered frame stands, whatever happens to
    /// the pose and the findings after it.
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
        let (answer, outcome) = refused(job, &failed());
        panics.catch(Edge::Frame, what, "it is not answered", || {
            self.reply_refused(key, job, answer, publish);
        });
        outcome
    }

    /// Answers one frame; `answered` holds the outcome as soon as the answer is published.
    fn process(
        &self,
        key: &SlotKey,
        job: &FrameJob,
        publish: &dyn Publish,
        answered: &Cell<Option<FrameOutcome>>,
    ) -> FrameOutcome {
        let done = if job.is_late(Instant::now()) {
            let detail = format!("waited {} ms", job.received.elapsed().as_millis());
            Err(Rejection::new(Code::Expired, "deadline_ms", detail))
        } else {
            self.analyse(key, job)
        };
        let AnsweredFrame { answer, basis, map, evaluation, relocalised } = match done {
            Ok(done) => done,
            Err(refusal) => {
                let (answer, outcome) = refused(job, &refusal);
                answered.set(Some(outcome));
                self.reply_refused(key, job, answer, publish);
                return outcome;
            }
        };
        let (frame, outcome) = (&job.frame, FrameOutcome::Processed);
        answered.set(Some(outcome));
        self.reply(key, job, (answer, basis), publish);
        let Some(evaluation) = evaluation else { return outcome };
        let at = frame_stamp(frame, &map);
        if let Some(pose) = self.motion.apply_frame(&key.robot, &key.camera, at, &evaluation.fixes()) {
            publish.pose(&key.robot, &pose);
        }
        if let Some((pose, landmarks)) = relocalised
            && let Some(pose) =
                self.motion.start_from_hypothesis(&key.robot, frame_stamp(frame, &map), &pose, &landmarks)
        {
            self.relocalisers.stop(&key.robot);
            publish.pose(&key.robot, &pose);
        }
        if let Some(LandmarkChecks { prior, observed, missed }) = evaluation.checks {
            let at = frame_stamp(frame, &map);
            let changes = self.motion.update_landmark_health(&key.robot, at, &prior, &observed, &missed);
            for change in changes {
                let name = map.landmarks.get(&change.landmark).map_or("", |l| l.name.as_str());
                self.findings.send(LandmarkFinding::new(&map.name, name, &change));
            }
        }
        outcome
    }

    /// Decode, pipeline, robot pose: everything that can fail on a frame's content.
    fn analyse(&self, key: &SlotKey, job: &FrameJob) -> Result<AnsweredFrame, Rejection> {
        let frame = &job.frame;
        #[cfg(test)]
        assert!(key.camera.as_str() != tests::PLANTED, "planted");
        // The whole answer rests on one version of the map.
        let map = self.snapshots.get(&job.map).ok_or_else(|| unknown_map(&job.map))?;
        let mut times = StageTimes::start();
        let picture = decode_frame(frame, self.limits)?;
        let image = picture.grey();
        times.ended("decode");
        // A frame is answered on any map. It changes the robot's pose and the map only on the robot's own map.
        let on_own_map = self.snapshots.robot_map(key.robot.as_str()).is_some_and(|own| own == map.name);
        let is_live = self.motion.epochs().current(&key.robot).is_none_or(|epoch| epoch == frame.epoch);
        let counts = on_own_map && is_live && job.stamp_instead_ns.is_none();
        let at = frame_stamp(frame, &map);
        let prior = counts.then(|| self.motion.prior_pose(&key.robot, &key.camera, at)).flatten();
        if let Some((answer, evaluation)) =
            self.expected_only(key, frame, (image, &map), prior.as_ref(), &mut times)
        {
            let basis = self.records.take(key, &answer, (image, &map), (&evaluation, frame));
            return Ok(AnsweredFrame { answer, basis, map, evaluation: Some(evaluation), relocalised: None });
        }
        let analysis = analyse_checked(frame, &picture, &map, &mut times);
        let mut answer = crate::frame::answer::answer(&analysis, &map);
        let context = FrameContext::new(frame, &analysis, &map);
        // The guide is the fused pose while nothing contradicts it; without one, the robot's own prior.
        let guide = match &prior {
            Some(prior) => prior.plan.guided.then_some(&prior.pose),
            None => frame.prior.as_ref().filter(|_| on_own_map),
        };
        let guided = guide.map_or_else(GuidedResult::default, |pose| recognise_guided(image, &context, pose));
        let evaluation = evaluate_frame(&context, prior, &guided);
        crate::frame::answer::fill_fixes(&mut answer, &evaluation, &guided, &map);
        if !counts {
            times.ended("localise");
            answer.timings = times.finish();
            let basis = self.records.take(key, &answer, (image, &map), (&evaluation, frame));
            if let Some(captured_ns) = job.stamp_instead_ns.filter(|_| on_own_map && is_live) {
                let frame = CheckedFrame { captured_ns, ..frame.clone() };
                let (quads, map_from_robot) = (analysis.quads, frame.prior);
                if self.is_gathered(key, &frame) {
                    let image = picture.into_grey();
                    let analysed = AnalysedFrame { image, quads, map: map.clone(), map_from_robot };
                    self.frame_tap.offer(key, &frame, analysed);
                }
            }
            return Ok(AnsweredFrame { answer, basis, map, evaluation: None, relocalised: None });
        }
        if let Some(intrinsics) = &frame.intrinsics {
            let (landmarks, extrinsics) =
                (crate::frame::fixes::unique_landmarks(&analysis), frame.mounting.as_ref());
            let image_px = [image.width() as u32, image.height() as u32];
            let fix = evaluation.fix.as_ref().map_err(|reason| *reason);
            let sample =
                CameraSample { intrinsics, image_px, landmarks: &landmarks, map: &map, extrinsics, fix };
            self.live.camera_registry().record_frame(key, &sample);
        }
        let has_pose = evaluation.checks.is_some() || evaluation.fix.is_ok();
        let update = self.relocalise(key, frame, (image, &analysis), &map, has_pose);
        let relocalised = update.and_then(|update| {
            answer.hypotheses = update.hypotheses.iter().map(hypothesis_wire).collect();
            update.pose
        });
        times.ended("localise");
        answer.timings = times.finish();
        let basis = self.records.take(key, &answer, (image, &map), (&evaluation, frame));
        if self.is_gathered(key, frame) {
            let map_from_robot = frame.prior.or(evaluation.prior);
            let (image, quads) = (picture.into_grey(), analysis.quads);
            let analysed = AnalysedFrame { image, quads, map: map.clone(), map_from_robot };
            self.frame_tap.offer(key, frame, analysed);
        }
        Ok(AnsweredFrame { answer, basis, map, evaluation: Some(evaluation), relocalised })
    }

    /// Answers a frame by the expected landmarks alone, where policy and schedule ask for no search of the map. `None` where
    /// they ask for one, or where the result calls for one: nothing found, a contradiction, or a missing landmark that is surely in
    /// view. Frames of robots that gather are always searched: they show objects that are on no map.
    fn expected_only(
        &self,
        key: &SlotKey,
        frame: &CheckedFrame,
        (image, map): (&GrayImage, &MapSnapshot),
        prior: Option<&PriorPose>,
        times: &mut StageTimes,
    ) -> Option<(v1::Answer, FrameEvaluation)> {
        let is_spared = |p: &&PriorPose| p.plan.guided && p.plan.global.is_none();
        let prior = prior.filter(is_spared).filter(|_| frame.is_whole())?;
        if !self.search.may_spare(self.slots.waiting()) || self.frame_tap.is_wanted(key) {
            return None;
        }
        let nothing = FrameAnalysis { quads: Vec::new() };
        let context = FrameContext::new(frame, &nothing, map);
        let guided = recognise_guided(image, &context, &prior.pose);
        let evaluation = evaluate_expected_only(&context, prior.clone(), &guided);
        times.ended("expected");
        if guided.report.global_reason().is_some() || evaluation.guided.is_none() {
            return None;
        }
        let mut answer = crate::frame::answer::answer(&nothing, map);
        answer.only_expected = true;
        crate::frame::answer::fill_fixes(&mut answer, &evaluation, &guided, map);
        times.ended("localise");
        answer.timings = times.finish();
        Some((answer, evaluation))
    }

    /// Whether a frame is wanted by a gathering. Of quads, no photograph is there to learn from.
    fn is_gathered(&self, key: &SlotKey, frame: &CheckedFrame) -> bool {
        frame.is_whole() && self.frame_tap.is_wanted(key)
    }

    /// Continues the relocalisation of a robot without a pose; ends it for a robot with one.
    fn relocalise(
        &self,
        key: &SlotKey,
        frame: &CheckedFrame,
        (image, analysis): (&GrayImage, &FrameAnalysis),
        map: &MapSnapshot,
        has_pose: bool,
    ) -> Option<RelocalisationUpdate> {
        let (extrinsics, camera) = (frame.mounting.as_ref()?, frame.intrinsics.as_ref()?);
        let odometry = frame.odometry?;
        if has_pose {
            self.relocalisers.stop(&key.robot);
            return None;
        }
        let observations = ambiguous_observations(image, analysis, map, extrinsics, camera);
        let input = RelocalisationInput { epoch: frame.epoch, map, odometry, observations: &observations };
        self.relocalisers.update(&key.robot, &input)
    }

    /// Publishes the answer to a frame that was not analysed.
    fn reply_refused(&self, key: &SlotKey, job: &FrameJob, answer: v1::Answer, publish: &dyn Publish) {
        let basis = self.records.take_refused(key, &answer);
        self.reply(key, job, (answer, basis), publish);
    }

    /// Counts an answer, shows it on pages, has it stored if there is a `basis`, and publishes it.
    fn reply(
        &self,
        key: &SlotKey,
        job: &FrameJob,
        (mut answer, basis): (v1::Answer, Option<AnswerBasis>),
        publish: &dyn Publish,
    ) {
        let frame = &job.frame;
        (answer.epoch, answer.seq, answer.captured_ns) = (frame.epoch, frame.seq, frame.captured_ns);
        answer.clock_suspect = job.clock_suspect;
        answer.latency_ms = job.received.elapsed().as_secs_f64() * 1e3;
        let (answer, now) = (Arc::new(answer), Instant::now());
        if let Some(basis) = basis {
            self.kept_frames.keep_answered(key, &answer, frame);
            self.records.send(AnswerRecord { key: key.clone(), answer: answer.clone(), basis });
        }
        if answer.rejection.is_none() {
            let (width_px, height_px, pixels) = (frame.width_px, frame.height_px, frame.pixels.clone());
            let answer = answer.clone();
            self.live.publish_answer(key, LiveFrame { width_px, height_px, pixels, answer }, now);
        } else {
            self.live.publish_refusal(key, answer.clone(), now);
        }
        self.times.add(&answer);
        tracing::debug!(status = answer.status().as_str_name(), ms = answer.latency_ms, "frame_answered");
        // Last, so that who has the answer finds it counted.
        publish.answer(key, &answer);
    }
}

fn frame_stamp<'a>(frame: &CheckedFrame, map: &'a MapSnapshot) -> FrameStamp<'a> {
    let CheckedFrame { epoch, captured_ns, odometry, .. } = *frame;
    FrameStamp { map: &map.name, epoch, captured_ns, odometry, now: Instant::now() }
}

/// The answer to a refused frame, and the frame's outcome.
fn refused(job: &FrameJob, refusal: &Rejection) -> (v1::Answer, FrameOutcome) {
    let (status, outcome) = match refusal.code {
        Code::Expired => (v1::Status::Expired, FrameOutcome::Expired),
        code => (v1::Status::Rejected, FrameOutcome::Rejected(code)),
    };
    let (rejection, map) = (Some(refusal.into()), job.map.clone());
    (v1::Answer { status: status.into(), rejection, map, ..v1::Answer::default() }, outcome)
}

/// The refusal after a panic.
pub fn failed() -> Rejection {
    Rejection::new(Code::Internal, "frame", "the server failed on this frame; see its log")
}

#[cfg(test)]
mod tests;
