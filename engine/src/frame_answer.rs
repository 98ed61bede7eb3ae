//! The answer to a frame: names instead of numbers, verdicts, poses of landmarks, and the robot's pose where landmarks of known
//! place allow one. When anything is unsure a field is absent, never zero.

use super::{
    frame_analysis::{StageTimes, analyse_frame},
    guided::{Guided, GuidedSighting},
    judging::JudgedFrame,
    snapshot::MapSnapshot,
};
use protos::{
    convert::{
        geometry::pose2_covariance_wire,
        result::{corners, fill_pose, fill_verdict, kind, points},
    },
    v1,
};
use std::time::Instant;
use vision::{
    frame::{GrayImage, Intrinsics},
    model::LandmarkId,
    pipeline::{FrameAnalysis, PoseUnavailable, QuadAnalysis},
};

/// The answer to one image without a robot: an uploaded photograph.
pub fn answer_to_photograph(image: &GrayImage, camera: Option<&Intrinsics>, map: &MapSnapshot) -> v1::Answer {
    let (started, mut times) = (Instant::now(), StageTimes::start());
    let facts = analyse_frame(image, camera, map, &mut times);
    let mut answer = answer(&facts, map);
    answer.timings = times.finish();
    answer.latency_ms = started.elapsed().as_secs_f64() * 1e3;
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
        Err(reason) => reason.as_str().clone_into(&mut answer.pose_refusal),
    }
}
