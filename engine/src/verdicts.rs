//! What was seen in an image, as the answer to send: names instead of numbers, verdicts, poses of landmarks, and the
//! robot's pose where landmarks of known place allow one. When anything is unsure a field is absent, never zero.

use super::{
    guided::{Guided, GuidedSighting},
    judging::JudgedFrame,
    snapshot::MapSnapshot,
};
use map::{
    extrinsics::CameraExtrinsics,
    localise::{Fix, FixRefusal, FixResult, LandmarkObservation, LocaliseParams, robot_pose},
    pose2::Pose2Covariance,
};
use protos::{
    convert::{
        geometry::pose2_covariance_wire,
        result::{corners, fill_pose, fill_verdict, kind, points},
    },
    v1,
};
use std::{cell::RefCell, time::Instant};
use vision::{
    frame::{GrayImage, Intrinsics},
    model::LandmarkId,
    pipeline::{FrameAnalysis, LandmarkDatabase, Pipeline, PoseUnavailable, QuadAnalysis},
    pose::LandmarkPose,
    recognise::Verdict,
    trace::{Stage, Trace},
};

/// Why there is no robot pose: several solutions are left.
pub const AMBIGUOUS: &str = "ambiguous";

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

/// Recognises an image against one version of a map: the whole pipeline.
pub fn look(
    image: &GrayImage,
    camera: Option<&Intrinsics>,
    map: &MapSnapshot,
    times: &mut StageTimes,
) -> FrameAnalysis {
    let landmarks = LandmarkDatabase { models: &map.models, sizes: &map.sizes, kind: map.distance };
    // Taken out while in use: a panic leaves none behind that is half written.
    let mut pipeline = PIPELINE.take();
    let facts = pipeline.analyse(image, camera, landmarks, &map.params, times);
    PIPELINE.set(pipeline);
    facts
}

thread_local! {
    /// What the pipeline keeps from frame to frame; each worker thread its own.
    static PIPELINE: RefCell<Pipeline> = RefCell::default();
}

/// The answer to one image without a robot: an uploaded photograph.
pub fn answer_to_photograph(image: &GrayImage, camera: Option<&Intrinsics>, map: &MapSnapshot) -> v1::Answer {
    let (started, mut times) = (Instant::now(), StageTimes::start());
    let facts = look(image, camera, map, &mut times);
    let mut answer = answer(&facts, map);
    answer.timings = times.finish();
    answer.age_ms = started.elapsed().as_secs_f64() * 1e3;
    answer
}

/// Facts with names: status and quads, without echo, times and robot pose.
pub fn answer(facts: &FrameAnalysis, map: &MapSnapshot) -> v1::Answer {
    let quads: Vec<_> = facts.quads.iter().map(|q| quad(q, map)).collect();
    let any = |verdict| quads.iter().any(|q: &v1::QuadAnswer| q.verdict() == verdict);
    let status = if any(v1::Verdict::Unique) {
        v1::Status::Matched
    } else if any(v1::Verdict::Ambiguous) {
        v1::Status::Ambiguous
    } else {
        v1::Status::NoMatch
    };
    v1::Answer {
        map: map.name.clone(),
        map_version: map.version,
        status: status.into(),
        quads,
        ..v1::Answer::default()
    }
}

fn quad(facts: &QuadAnalysis, map: &MapSnapshot) -> v1::QuadAnswer {
    let mut quad = v1::QuadAnswer {
        corners: corners(&facts.quad.corners_px),
        kind: kind(facts.quad.kind).into(),
        score: facts.quad.score,
        verdict: v1::Verdict::Unknown.into(),
        ..v1::QuadAnswer::default()
    };
    if let Some(verdict) = &facts.recognition {
        fill_verdict(&mut quad, verdict, |id| name(map, id));
        if quad.verdict() == v1::Verdict::Unique {
            quad.set_sighting(v1::Sighting::Global);
            // The landmark's own top-left first, however the picture hangs.
            quad.corners = corners(&facts.quad.corners_px.rotated(verdict.rotation));
        }
    }
    match &facts.pose {
        Ok(pose) => fill_pose(&mut quad, pose),
        Err(PoseUnavailable::NotUnique) => {}
        Err(PoseUnavailable::NoCamera) => "no_intrinsics".clone_into(&mut quad.pose_refusal),
        Err(PoseUnavailable::NoSize(_)) => "no_size".clone_into(&mut quad.pose_refusal),
        Err(PoseUnavailable::Pose(_)) => "degenerate".clone_into(&mut quad.pose_refusal),
    }
    quad
}

fn name(map: &MapSnapshot, id: LandmarkId) -> String {
    map.landmarks.get(&id).map_or_else(|| format!("#{}", id.0), |info| info.name.clone())
}

/// The landmarks that were recognised without doubt, with their poses.
pub fn recognised(facts: &FrameAnalysis) -> Vec<(LandmarkId, &LandmarkPose)> {
    let unique = |q: &QuadAnalysis| match q.recognition.as_ref()?.verdict {
        Verdict::Unique(id) => Some(id),
        Verdict::Unknown | Verdict::Ambiguous(_) => None,
    };
    facts.quads.iter().filter_map(|q| Some((unique(q)?, q.pose.as_ref().ok()?))).collect()
}

/// Landmarks that were recognised, posed, and have a place that is trusted; or the word that says why there are none:
/// empty when no landmark was recognised.
pub fn sightings<'a>(
    facts: &'a FrameAnalysis,
    map: &'a MapSnapshot,
) -> Result<Vec<LandmarkObservation<'a>>, &'static str> {
    let posed = recognised(facts);
    if posed.is_empty() {
        // The quads say why each has no pose.
        return Err("");
    }
    let placed = |(landmark, seen)| {
        let info = map.landmarks.get(&landmark)?;
        Some((info, LandmarkObservation { landmark, seen, place: info.place.as_ref()? }))
    };
    let placed: Vec<_> = posed.into_iter().filter_map(placed).collect();
    if placed.is_empty() {
        return Err("landmark_not_placed");
    }
    let trusted: Vec<_> = placed.into_iter().filter(|(info, _)| info.is_trusted()).map(|(_, s)| s).collect();
    if trusted.is_empty() { Err("landmark_quarantined") } else { Ok(trusted) }
}

/// What sightings say of the robot's pose, or the word that says why they say nothing.
pub fn robot_fixes(
    sightings: &[LandmarkObservation<'_>],
    mounting: Option<&CameraExtrinsics>,
    prior: Option<&Pose2Covariance>,
) -> Result<FixResult, &'static str> {
    let Some(mounting) = mounting else { return Err("no_mounting") };
    if sightings.is_empty() {
        return Err("unsure");
    }
    robot_pose(sightings, mounting, prior, &LocaliseParams::default()).map_err(|error| {
        tracing::error!(%error, "checked inputs were refused by localisation");
        "degenerate"
    })
}

/// The one pose that is left, or the word that says why there is none.
pub fn only(fix: &FixResult) -> Result<Fix, &'static str> {
    match fix {
        FixResult::Fixed(fix) => Ok((**fix).clone()),
        FixResult::Ambiguous(_) => Err(AMBIGUOUS),
        FixResult::Refused(refusal) => Err(refusal_word(refusal)),
    }
}

/// The robot's pose by sightings, or the word that says why not.
pub fn robot_fix(
    sightings: &[LandmarkObservation<'_>],
    mounting: Option<&CameraExtrinsics>,
    prior: Option<&Pose2Covariance>,
) -> Result<Fix, &'static str> {
    only(&robot_fixes(sightings, mounting, prior)?)
}

fn refusal_word(refusal: &FixRefusal) -> &'static str {
    match refusal {
        FixRefusal::Room { .. } => "gate_room",
        FixRefusal::Prior { .. } => "gate_prior",
        FixRefusal::Side => "gate_side",
        FixRefusal::Disagree { .. } => "disagree",
        FixRefusal::Degenerate => "degenerate",
    }
}

/// The quad of a landmark that was not detected and found all the same.
fn asked_for(sighting: &GuidedSighting) -> v1::QuadAnswer {
    v1::QuadAnswer {
        kind: v1::QuadKind::Expected.into(),
        verdict: v1::Verdict::Unknown.into(),
        points: sighting.points.as_ref().map(|evidence| points(evidence, 1)),
        ..v1::QuadAnswer::default()
    }
}

/// Writes the robot's pose, or why there is none, and what the pose known before adds, into the answer.
pub fn fill_fixes(answer: &mut v1::Answer, judged: &JudgedFrame, guided: &Guided, map: &MapSnapshot) {
    for sighting in &guided.sightings {
        let index = sighting.quad.unwrap_or(answer.quads.len());
        if index == answer.quads.len() {
            answer.quads.push(asked_for(sighting));
        }
        let Some(quad) = answer.quads.get_mut(index) else { continue };
        quad.set_sighting(v1::Sighting::Guided);
        quad.guided_landmark = name(map, sighting.landmark);
        quad.corners = corners(&sighting.corners_px);
        fill_pose(quad, &sighting.seen);
    }
    if let Some(fix) = &judged.guided {
        answer.guided_map_from_robot = Some(pose2_covariance_wire(&fix.pose));
        answer.guided_landmarks = fix.landmarks.iter().map(|id| name(map, *id)).collect();
    }
    match &judged.fix {
        Ok(fix) => {
            answer.map_from_robot = Some(pose2_covariance_wire(&fix.pose));
            answer.pose_landmarks = fix.landmarks.iter().map(|id| name(map, *id)).collect();
        }
        Err(word) => (*word).clone_into(&mut answer.pose_refusal),
    }
}
