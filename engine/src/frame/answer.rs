//! Answers as messages: names instead of numbers, verdicts, landmark poses, and the robot's pose
//! where placed landmarks give one. What is not known is an absent field, never zero.

use super::{
    analysis::{AnalysedFrame, FoundQuad, StageTimes, analyse_frame, found_quads, frame_camera},
    fixes::{PoseRefusal, photograph_pose},
    guided::GuidedResult,
    intake::FrameJob,
    landmark_checks::FrameEvaluation,
};
use crate::snapshot::MapSnapshot;
use map::{
    localise::{CameraPose, FixQuantity, RefusalCause, pose_cautions},
    relocalise::PoseHypothesis,
};
use nalgebra::Point2;
use protos::{
    Code, Rejection,
    convert::{
        geometry::{pose2_covariance_wire, pose3_wire},
        result::{corners, fill_pose, fill_verdict, kind, points},
    },
    v1,
};
use std::time::Instant;
use vision::{
    border::BorderError,
    frame::{Intrinsics, PictureRef},
    model::LandmarkId,
    pipeline::{FrameAnalysis, PoseUnavailable, QuadAnalysis},
};

/// The answer to a frame of a robot.
pub fn answer_to_frame(job: &FrameJob, frame: &AnalysedFrame) -> v1::Answer {
    let mut answer = frame_answer(frame);
    echo(&mut answer, job);
    answer
}

/// The answer to a frame that was not analysed.
pub fn refusal(job: &FrameJob, reason: &Rejection) -> v1::Answer {
    let status = if reason.code == Code::Expired { v1::Status::Expired } else { v1::Status::Rejected };
    let (rejection, map) = (Some(reason.into()), job.map.clone());
    let mut answer = v1::Answer { status: status.into(), rejection, map, ..v1::Answer::default() };
    echo(&mut answer, job);
    answer
}

fn echo(answer: &mut v1::Answer, job: &FrameJob) {
    let frame = &job.frame;
    (answer.epoch, answer.seq, answer.captured_ns) = (frame.epoch, frame.seq, frame.captured_ns);
    answer.clock_suspect = job.clock_suspect;
    answer.latency_ms = job.received.elapsed().as_secs_f64() * 1e3;
}

/// What is answered to a frame, without the echo of its numbers.
pub fn frame_answer(frame: &AnalysedFrame) -> v1::Answer {
    let AnalysedFrame { map, analysis, guided, evaluation, relocalisation, stages, .. } = frame;
    let hypotheses = relocalisation.iter().flat_map(|update| &update.hypotheses).map(hypothesis_wire);
    v1::Answer {
        hypotheses: hypotheses.collect(),
        timings: stages.clone(),
        ..with_fixes(analysis, guided, evaluation, map)
    }
}

/// Status, quads, and the robot's pose or why there is none.
fn with_fixes(
    analysis: &FrameAnalysis,
    guided: &GuidedResult,
    evaluation: &FrameEvaluation,
    map: &MapSnapshot,
) -> v1::Answer {
    let names = |ids: &[LandmarkId]| ids.iter().map(|id| name(map, *id)).collect();
    let mut answer = with_quads(&found_quads(analysis, guided), map);
    answer.only_expected = evaluation.only_expected;
    if let Some(fix) = &evaluation.guided {
        answer.guided_map_from_robot = Some(pose2_covariance_wire(&fix.pose));
        answer.guided_landmarks = names(&fix.landmarks);
    }
    match &evaluation.fix {
        Ok(fix) => {
            answer.map_from_robot = Some(pose2_covariance_wire(&fix.pose));
            answer.pose_landmarks = names(&fix.landmarks);
        }
        Err(reason) => reason.as_str().clone_into(&mut answer.pose_refusal),
    }
    answer.pose_refusal_detail = evaluation.refusal.as_ref().map(|r| refusal_wire(r, |id| name(map, id)));
    answer
}

/// The answer to one picture without a robot: an uploaded photograph. Nothing says how the camera
/// was held.
pub fn answer_to_photograph<'a>(
    picture: impl Into<PictureRef<'a>>,
    camera: Option<&Intrinsics>,
    map: &MapSnapshot,
) -> v1::Answer {
    analyse_photograph(picture, camera, map).0
}

/// The same with the analysis that the answer rests on: quad by quad in the same order.
pub fn analyse_photograph<'a>(
    picture: impl Into<PictureRef<'a>>,
    camera: Option<&Intrinsics>,
    map: &MapSnapshot,
) -> (v1::Answer, FrameAnalysis) {
    let (started, mut times) = (Instant::now(), StageTimes::start());
    let analysis = analyse_frame(picture, frame_camera(camera, None, map), map, &mut times);
    let mut answer = quads_answer(&analysis, map);
    if camera.is_some() {
        match photograph_pose(&analysis, map) {
            Ok(pose) => {
                answer.pose_cautions = cautions_of(&pose, map);
                answer.camera_pose = Some(camera_pose_wire(&pose, map));
            }
            Err(reason) => reason.as_str().clone_into(&mut answer.camera_pose_refusal),
        }
    }
    answer.timings = times.finish();
    answer.latency_ms = started.elapsed().as_secs_f64() * 1e3;
    (answer, analysis)
}

/// Status and quads of a picture, without echo, times and robot pose.
pub fn quads_answer(analysis: &FrameAnalysis, map: &MapSnapshot) -> v1::Answer {
    with_quads(&found_quads(analysis, &GuidedResult::default()), map)
}

fn with_quads(found: &[FoundQuad<'_>], map: &MapSnapshot) -> v1::Answer {
    let quads: Vec<_> = found.iter().map(|found| quad(found, map)).collect();
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

fn quad(found: &FoundQuad<'_>, map: &MapSnapshot) -> v1::QuadAnswer {
    let mut quad = found.detected.map(|analysis| detected(analysis, map)).unwrap_or_default();
    quad.corners = found.corners_px().as_ref().map(corners).unwrap_or_default();
    if let Some(observation) = found.guided {
        if found.detected.is_none() {
            quad.set_kind(v1::QuadKind::Expected);
            quad.set_verdict(v1::Verdict::Unknown);
            quad.points = observation.points.as_ref().map(|evidence| points(evidence, 1));
        }
        quad.set_sighting(v1::Sighting::Guided);
        quad.guided_landmark = name(map, observation.landmark);
        fill_pose(&mut quad, &observation.pose);
    }
    quad
}

fn detected(analysis: &QuadAnalysis, map: &MapSnapshot) -> v1::QuadAnswer {
    let mut quad = v1::QuadAnswer {
        kind: kind(analysis.quad.kind).into(),
        score: analysis.quad.score,
        verdict: v1::Verdict::Unknown.into(),
        ..v1::QuadAnswer::default()
    };
    if let Some(result) = &analysis.recognition {
        fill_verdict(&mut quad, result, |id| name(map, id));
        if quad.verdict() == v1::Verdict::Unique {
            quad.set_sighting(v1::Sighting::Global);
        }
    }
    match &analysis.pose {
        Ok(pose) => fill_pose(&mut quad, pose),
        Err(reason) => pose_refusal(reason).clone_into(&mut quad.pose_refusal),
    }
    quad
}

/// The word on the wire; empty where no landmark was recognised.
fn pose_refusal(reason: &PoseUnavailable) -> &'static str {
    match reason {
        PoseUnavailable::NotUnique => "",
        PoseUnavailable::NoCamera => "no_intrinsics",
        PoseUnavailable::NoSize(_) => "no_size",
        PoseUnavailable::Border(BorderError::Reprojection { .. }) => "reprojection",
        PoseUnavailable::Border(BorderError::Unclear) => "border_unclear",
        PoseUnavailable::Border(BorderError::Pose(_)) => "degenerate",
    }
}

/// A hypothesis as a message.
fn hypothesis_wire(hypothesis: &PoseHypothesis) -> v1::Hypothesis {
    let map_from_robot = Some(pose2_covariance_wire(&hypothesis.pose));
    v1::Hypothesis { probability: hypothesis.mass, map_from_robot }
}

fn camera_pose_wire(pose: &CameraPose, map: &MapSnapshot) -> v1::CameraPose {
    v1::CameraPose {
        map_from_camera: Some(pose3_wire(&pose.map_from_camera)),
        covariance: pose.covariance.transpose().as_slice().to_vec(),
        landmarks: pose.landmarks.iter().map(|id| name(map, *id)).collect(),
    }
}

/// What the walls say against the pose of a photograph.
fn cautions_of(pose: &CameraPose, map: &MapSnapshot) -> Vec<String> {
    let at_m = pose.map_from_camera.translation.vector.xy();
    let position_m2 = pose.covariance.fixed_view::<2, 2>(3, 3).trace();
    cautions(&at_m.into(), position_m2.sqrt(), &pose.landmarks, map)
}

/// The words for what the walls say against a position, map frame, by these landmarks.
pub(crate) fn cautions(
    at_m: &Point2<f64>,
    sigma_m: f64,
    landmarks: &[LandmarkId],
    map: &MapSnapshot,
) -> Vec<String> {
    let place = |id: &LandmarkId| map.landmarks.get(id)?.place.map(|p| Point2::new(p.x_m, p.y_m));
    let centres: Vec<_> = landmarks.iter().filter_map(place).collect();
    let found = pose_cautions(at_m, sigma_m, &centres, &map.walls);
    found.into_iter().map(|caution| caution.as_str().to_owned()).collect()
}

fn name(map: &MapSnapshot, id: LandmarkId) -> String {
    map.landmarks.get(&id).map_or_else(|| format!("#{}", id.0), |info| info.name.clone())
}

/// As a message; `name` gives the landmark's name.
fn refusal_wire(refusal: &PoseRefusal, name: impl Fn(LandmarkId) -> String) -> v1::PoseRefusalDetail {
    let causes = refusal.causes.iter().map(|cause| cause_wire(cause, &name)).collect();
    let sentence = sentence(&refusal.causes, &name);
    v1::PoseRefusalDetail { chi2: refusal.chi2, limit: refusal.limit, causes, sentence }
}

fn cause_wire(cause: &RefusalCause, name: impl Fn(LandmarkId) -> String) -> v1::PoseRefusalCause {
    let (quantity, unit) = match cause.quantity {
        FixQuantity::Size(_) => (v1::FixQuantity::Size, "m"),
        FixQuantity::CameraHeight => (v1::FixQuantity::CameraHeight, "m"),
        FixQuantity::CameraTilt => (v1::FixQuantity::CameraTilt, "rad"),
        FixQuantity::Mounting => (v1::FixQuantity::Mounting, "px"),
    };
    v1::PoseRefusalCause {
        quantity: quantity.into(),
        landmark: match cause.quantity {
            FixQuantity::Size(landmark) => name(landmark),
            FixQuantity::CameraHeight | FixQuantity::CameraTilt | FixQuantity::Mounting => String::new(),
        },
        expected: cause.expected,
        measured: cause.measured,
        sigma: cause.sigma,
        unit: unit.to_owned(),
    }
}

/// What does not fit, by how much, and what to check.
fn sentence(causes: &[RefusalCause], name: impl Fn(LandmarkId) -> String) -> String {
    let (mut parts, mut checks) = (Vec::new(), Vec::new());
    for RefusalCause { quantity, expected, measured, .. } in causes {
        match quantity {
            FixQuantity::Size(landmark) => {
                let landmark = name(*landmark);
                parts.push(format!("`{landmark}` would be {measured:.2} m wide, not {expected:.2} m"));
                checks.push("size");
            }
            FixQuantity::CameraHeight => {
                parts.push(format!("the camera would hang at {measured:.2} m, not at {expected:.2} m"));
                checks.push("camera height");
            }
            FixQuantity::CameraTilt => {
                let [measured, expected] = [measured, expected].map(|a| a.to_degrees());
                parts
                    .push(format!("the camera would look up by {measured:.1} degrees, not by {expected:.1}"));
                checks.push("tilt");
            }
            FixQuantity::Mounting => {
                let sentence = "Landmark seen, but its corners are off by";
                return format!(
                    "{sentence} {measured:.1} px with any one of size, camera height and tilt changed: check the mounting and its place."
                );
            }
        }
    }
    checks.dedup();
    format!("Landmark seen, but {}: check {} and mounting.", parts.join(", or "), checks.join(", "))
}

#[cfg(test)]
mod tests;
