//! A frame on its way, as one value that grows: opened (decoded, with its map and the pose without
//! it), then analysed: quads with verdicts by the pipeline of `vision`, landmarks that the pose
//! names, fixes and landmark checks.

use super::{
    context::FrameContext,
    guided::{GuidedObservation, GuidedResult, recognise_guided},
    landmark_checks::{FrameEvaluation, evaluate_expected_only, evaluate_frame},
    relocalise::RelocalisationUpdate,
};
use crate::{motion::PriorPose, snapshot::MapSnapshot};
use map::extrinsics::CameraExtrinsics;
use protos::{
    CheckedFrame,
    convert::{CheckedQuad, Pixels},
    v1,
};
use std::{cell::RefCell, sync::Arc, time::Instant};
use vision::{
    frame::{Intrinsics, Picture, PictureRef},
    geometry::Corners,
    model::LandmarkId,
    pipeline::{FrameAnalysis, FrameCamera, LandmarkDatabase, Pipeline, QuadAnalysis, analyse_quads},
    recognise::{RecognitionResult, Verdict},
    trace::{Stage, Trace},
    up::Up,
};

/// What a frame may change. Every frame is answered.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Effect {
    /// Its robot's pose, the health of landmarks, a relocalisation, a gathering.
    Full,
    /// A gathering alone: its capture time does not fit the robot's other messages.
    Gather {
        /// What the robot's clock showed at receipt, ns.
        captured_ns: i64,
    },
    /// Nothing: the robot has begun another epoch.
    AnswerOnly,
    /// Nothing: it is compared with another map than its robot's, on which the robot's own pose
    /// means nothing.
    OtherMap,
}

/// A decoded frame with what is known without looking at it.
#[derive(Debug)]
pub struct OpenedFrame<'a> {
    /// What the robot sent.
    pub frame: &'a CheckedFrame,
    /// Its picture.
    pub picture: Arc<Picture>,
    /// The version of the map that the whole answer rests on.
    pub map: Arc<MapSnapshot>,
    /// What it may change.
    pub effect: Effect,
    /// The robot's pose without the frame, as the server knows it.
    pub prior: Option<PriorPose>,
}

/// A frame with everything that was found in it.
#[derive(Debug)]
pub struct AnalysedFrame {
    /// Its picture.
    pub picture: Arc<Picture>,
    /// The version of the map it was compared with.
    pub map: Arc<MapSnapshot>,
    /// What it may change.
    pub effect: Effect,
    /// Its quads with verdicts; none where only expected landmarks were looked for.
    pub analysis: FrameAnalysis,
    /// Landmarks that the pose names.
    pub guided: GuidedResult,
    /// Fixes and landmark checks.
    pub evaluation: FrameEvaluation,
    /// How far the relocalisation of a robot without a pose has come.
    pub relocalisation: Option<RelocalisationUpdate>,
    /// How long each stage took.
    pub stages: Vec<v1::StageTime>,
}

/// A quad of the answer.
#[derive(Debug, Clone, Copy)]
pub struct FoundQuad<'a> {
    /// As detected; absent for an expected landmark that was found without a detection.
    pub detected: Option<&'a QuadAnalysis>,
    /// Present where the pose names it.
    pub guided: Option<&'a GuidedObservation>,
}

impl FoundQuad<'_> {
    /// Its corners; of a named landmark its own top-left first, however the picture hangs.
    pub fn corners_px(&self) -> Option<Corners> {
        if let Some(guided) = self.guided {
            return Some(guided.corners_px);
        }
        let QuadAnalysis { quad, recognition, border_px, .. } = self.detected?;
        let unique = recognition.as_ref().filter(|found| matches!(found.verdict, Verdict::Unique(_)));
        let rotated = |found: &RecognitionResult| quad.corners_px.rotated(found.rotation);
        Some(border_px.unwrap_or_else(|| unique.map_or(quad.corners_px, rotated)))
    }

    /// The landmark that it is named after, globally or guided; else its nearest candidate.
    pub fn best_candidate(&self) -> Option<LandmarkId> {
        let recognition = self.detected.and_then(|quad| quad.recognition.as_ref());
        match (recognition.map(|found| found.verdict), self.guided) {
            (Some(Verdict::Unique(id)), _) => Some(id),
            (_, Some(guided)) => Some(guided.landmark),
            _ => Some(recognition?.candidates.first()?.landmark),
        }
    }
}

/// The quads of an answer in its order: detected ones, then expected landmarks without a detection.
pub fn found_quads<'a>(analysis: &'a FrameAnalysis, guided: &'a GuidedResult) -> Vec<FoundQuad<'a>> {
    let detected = |quad| FoundQuad { detected: Some(quad), guided: None };
    let mut found: Vec<_> = analysis.quads.iter().map(detected).collect();
    for observation in &guided.observations {
        let guided = Some(observation);
        match observation.quad.and_then(|quad| found.get_mut(quad)) {
            Some(quad) => quad.guided = guided,
            None => found.push(FoundQuad { detected: None, guided }),
        }
    }
    found
}

impl OpenedFrame<'_> {
    /// Looks for all landmarks of the map. The guide is the server's pose while nothing contradicts
    /// it; without one, the robot's own.
    pub fn searched(&self, times: &mut StageTimes) -> AnalysedFrame {
        let analysis = analyse_checked(self.frame, &*self.picture, &self.map, times);
        let context = FrameContext::new(self.frame, &analysis, &self.map);
        let guide = match &self.prior {
            Some(prior) => prior.plan.guided.then_some(&prior.pose),
            None => self.frame.prior.as_ref().filter(|_| self.effect != Effect::OtherMap),
        };
        let guided = guide
            .map_or_else(GuidedResult::default, |pose| recognise_guided(self.picture.grey(), &context, pose));
        let evaluation = evaluate_frame(&context, self.prior.clone(), &guided);
        self.with(analysis, guided, evaluation)
    }

    /// Looks for the landmarks that the server's pose expects alone. `None` where the result calls
    /// for a search: nothing found, a contradiction, or a missing landmark that is surely in view.
    pub fn by_expected(&self, times: &mut StageTimes) -> Option<AnalysedFrame> {
        let prior = self.prior.clone()?;
        let analysis = FrameAnalysis { quads: Vec::new() };
        let context = FrameContext::new(self.frame, &analysis, &self.map);
        let guided = recognise_guided(self.picture.grey(), &context, &prior.pose);
        let evaluation = evaluate_expected_only(&context, prior, &guided);
        times.ended("expected");
        let is_enough = guided.report.global_reason().is_none() && evaluation.guided.is_some();
        is_enough.then(|| self.with(analysis, guided, evaluation))
    }

    fn with(
        &self,
        analysis: FrameAnalysis,
        guided: GuidedResult,
        evaluation: FrameEvaluation,
    ) -> AnalysedFrame {
        let (picture, map, effect) = (self.picture.clone(), self.map.clone(), self.effect);
        let (relocalisation, stages) = (None, Vec::new());
        AnalysedFrame { picture, map, effect, analysis, guided, evaluation, relocalisation, stages }
    }
}

/// Times the stages of the pipeline.
#[derive(Debug)]
pub struct StageTimes {
    since: Instant,
    times: Vec<v1::StageTime>,
}

impl StageTimes {
    /// The first stage begins now.
    pub fn start() -> Self {
        Self { since: Instant::now(), times: Vec::new() }
    }

    /// A stage outside the pipeline has just ended.
    pub fn ended(&mut self, stage: &str) {
        let now = Instant::now();
        let ms = (now - self.since).as_secs_f64() * 1e3;
        tracing::trace!(stage, ms, "stage_ended");
        self.times.push(v1::StageTime { stage: stage.to_owned(), ms });
        self.since = now;
    }

    /// Every stage so far.
    pub fn finish(&mut self) -> Vec<v1::StageTime> {
        std::mem::take(&mut self.times)
    }
}

impl Trace for StageTimes {
    fn finished(&mut self, stage: Stage) {
        self.ended(stage.name());
    }
}

/// Recognises a frame: what its detector finds, or the quads that the robot found, from there on
/// alike.
pub fn analyse_checked<'a>(
    frame: &CheckedFrame,
    picture: impl Into<PictureRef<'a>>,
    map: &MapSnapshot,
    times: &mut StageTimes,
) -> FrameAnalysis {
    let picture = picture.into();
    let camera = frame_camera(frame.intrinsics.as_ref(), frame.mounting.as_ref(), map);
    let Pixels::Quads(found) = &frame.pixels else { return analyse_frame(picture, camera, map, times) };
    let quads = found.iter().map(|CheckedQuad { quad, .. }| quad.clone()).collect();
    analyse_quads(picture.grey(), quads, camera, database(map), &map.params, times)
}

/// Recognises a picture against one version of a map: the whole pipeline.
pub fn analyse_frame<'a>(
    picture: impl Into<PictureRef<'a>>,
    camera: FrameCamera<'_>,
    map: &MapSnapshot,
    times: &mut StageTimes,
) -> FrameAnalysis {
    // Taken out while in use: a panic leaves no half-written pipeline behind.
    let mut pipeline = PIPELINE.take();
    let analysis = pipeline.analyse(picture, camera, database(map), &map.params, times);
    PIPELINE.set(pipeline);
    analysis
}

/// A camera on a robot. Without its mounting, up is not known.
pub fn frame_camera<'a>(
    intrinsics: Option<&'a Intrinsics>,
    mounting: Option<&CameraExtrinsics>,
    map: &MapSnapshot,
) -> FrameCamera<'a> {
    let up = mounting.and_then(|mounting| Up::new(mounting.camera_up()));
    let up = if map.has_level_landmarks() { up.map(Up::with_level_landmarks) } else { up };
    let height_m = mounting.map(|mounting| mounting.robot_from_camera.translation.z);
    FrameCamera { intrinsics, up, height_m }
}

fn database(map: &MapSnapshot) -> LandmarkDatabase<'_> {
    LandmarkDatabase { models: &map.models, sizes: &map.sizes, kind: map.distance }
}

thread_local! {
    /// Buffers that the pipeline reuses from frame to frame; one pipeline a worker thread.
    static PIPELINE: RefCell<Pipeline> = RefCell::default();
}

#[cfg(test)]
mod tests;
