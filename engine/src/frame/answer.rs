//! The answer to a frame: names instead of numbers, verdicts, landmark poses, and the robot's pose where placed landmarks
//! give one. What is not known is an absent field, never zero.

use super::{
    analysis::{StageTimes, analyse_frame, frame_camera},
    fixes::photograph_pose,
    guided::{GuidedObservation, GuidedResult},
    landmark_checks::FrameEvaluation,
    pose_refusal::refusal_wire,
};
use crate::snapshot::MapSnapshot;
use map::localise::{CameraPose, pose_cautions};
use nalgebra::Point2;
use protos::{
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

/// The answer to one picture without a robot: an uploaded photograph. Nothing says how the camera was held.
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
    let mut answer = answer(&analysis, map);
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

/// Status and quads, without echo, times and robot pose.
pub fn answer(analysis: &FrameAnalysis, map: &MapSnapshot) -> v1::Answer {
    let quads: Vec<_> = analysis.quads.iter().map(|q| quad(q, map)).collect();
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

fn quad(analysis: &QuadAnalysis, map: &MapSnapshot) -> v1::QuadAnswer {
    let mut quad = v1::QuadAnswer {
        corners: corners(&analysis.quad.corners_px),
        kind: kind(analysis.quad.kind).into(),
        score: analysis.quad.score,
        verdict: v1::Verdict::Unknown.into(),
        ..v1::QuadAnswer::default()
    };
    if let Some(result) = &analysis.recognition {
        fill_verdict(&mut quad, result, |id| name(map, id));
        if quad.verdict() == v1::Verdict::Unique {
            quad.set_sighting(v1::Sighting::Global);
            // The landmark's own top-left corner comes first, however the picture hangs.
            quad.corners = corners(&analysis.quad.corners_px.rotated(result.rotation));
        }
    }
    if let Some(border_px) = &analysis.border_px {
        quad.corners = corners(border_px);
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

/// The quad of an expected landmark that was found without a detection.
fn expected_quad(observation: &GuidedObservation) -> v1::QuadAnswer {
    v1::QuadAnswer {
        kind: v1::QuadKind::Expected.into(),
        verdict: v1::Verdict::Unknown.into(),
        points: observation.points.as_ref().map(|evidence| points(evidence, 1)),
        ..v1::QuadAnswer::default()
    }
}

/// Writes the robot's pose, or why there is none, and the guided observations into the answer.
pub fn fill_fixes(
    answer: &mut v1::Answer,
    evaluation: &FrameEvaluation,
    guided: &GuidedResult,
    map: &MapSnapshot,
) {
    for observation in &guided.observations {
        let index = observation.quad.unwrap_or(answer.quads.len());
        if index == answer.quads.len() {
            answer.quads.push(expected_quad(observation));
        }
        let Some(quad) = answer.quads.get_mut(index) else { continue };
        quad.set_sighting(v1::Sighting::Guided);
        quad.guided_landmark = name(map, observation.landmark);
        quad.corners = corners(&observation.corners_px);
        fill_pose(quad, &observation.pose);
    }
    if let Some(fix) = &evaluation.guided {
        answer.guided_map_from_robot = Some(pose2_covariance_wire(&fix.pose));
        answer.guided_landmarks = fix.landmarks.iter().map(|id| name(map, *id)).collect();
    }
    match &evaluation.fix {
        Ok(fix) => {
            answer.map_from_robot = Some(pose2_covariance_wire(&fix.pose));
            answer.pose_landmarks = fix.landmarks.iter().map(|id| name(map, *id)).collect();
        }
        Err(reason) => reason.as_str().clone_into(&mut answer.pose_refusal),
    }
    answer.pose_refusal_detail = evaluation.refusal.as_ref().map(|r| refusal_wire(r, |id| name(map, id)));
}

#[cfg(test)]
mod tests;
