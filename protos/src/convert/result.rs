//! What recognition found, in wire form. Names are the caller's: `vision` knows landmarks by number only.

use super::geometry::pose3_wire;
use crate::v1;
use vision::{
    detect::quads::{Corners, QuadKind},
    localise::pose::{LandmarkPose, PoseSolution},
    recognise::{Candidate, LandmarkId, Recognition, Refusal, Verdict},
};

/// Four corners, TL, TR, BR, BL.
pub fn corners(corners_px: &Corners) -> Vec<v1::Point> {
    corners_px.points().iter().map(|p| v1::Point { u_px: p.x, v_px: p.y }).collect()
}

/// Kind of a quad.
pub fn kind(kind: QuadKind) -> v1::QuadKind {
    match kind {
        QuadKind::Full => v1::QuadKind::Full,
        QuadKind::ThreeSided => v1::QuadKind::ThreeSided,
    }
}

/// The three cases of a verdict.
pub fn verdict(recognition: Recognition) -> v1::Verdict {
    match recognition {
        Recognition::Unknown => v1::Verdict::Unknown,
        Recognition::Unique(_) => v1::Verdict::Unique,
        Recognition::Ambiguous(_) => v1::Verdict::Ambiguous,
    }
}

/// A candidate; `name` gives the landmark's name.
pub fn candidate(c: &Candidate, name: impl Fn(LandmarkId) -> String) -> v1::Candidate {
    v1::Candidate {
        landmark: name(c.landmark),
        correlation: c.correlation,
        // Infinite (too few points) is told by absence: JSON has no infinity.
        hausdorff: c.hausdorff.is_finite().then_some(c.hausdorff),
        distance: finite(c.distance),
        tau: finite(c.tau),
        ratio: finite(c.ratio),
        probability: c.probability,
        refusal: c.refusal.map_or("", refusal).to_owned(),
        likeness: c.likeness.filter(|l| l.is_finite()),
    }
}

/// The word of a refusal.
pub fn refusal(refusal: Refusal) -> &'static str {
    match refusal {
        Refusal::Correlation => "correlation",
        Refusal::Hausdorff => "hausdorff",
        Refusal::Likeness => "likeness",
        Refusal::Contradiction => "contradiction",
        Refusal::Content => "content",
        Refusal::Margin => "margin",
    }
}

/// The verdict's part of a quad's answer: everything but corners, kind, score and poses.
pub fn fill_verdict(quad: &mut v1::QuadAnswer, v: &Verdict, name: impl Fn(LandmarkId) -> String) {
    quad.set_verdict(verdict(v.recognition));
    if let Recognition::Unique(id) = v.recognition {
        quad.landmark = name(id);
    }
    quad.candidates = v.candidates.iter().map(|c| candidate(c, &name)).collect();
    quad.entropy_m = v.entropy_m;
    quad.entropy_norm = v.entropy_norm;
    quad.confidence = v.confidence;
}

/// Best and second pose, and whether they can be told apart.
pub fn fill_pose(quad: &mut v1::QuadAnswer, pose: &LandmarkPose) {
    quad.pose = Some(solution(&pose.best));
    quad.second_pose = pose.second.as_ref().map(solution);
    quad.pose_ambiguous = pose.ambiguous;
}

fn solution(s: &PoseSolution) -> v1::LandmarkPose {
    v1::LandmarkPose {
        camera_from_landmark: Some(pose3_wire(&s.camera_from_landmark)),
        covariance: s.covariance.transpose().as_slice().to_vec(),
        reprojection_rms_px: s.reprojection_rms_px,
    }
}

/// Distances may be infinite (too few points); the wire and JSON say it as the largest number.
fn finite(value: f64) -> f64 {
    if value.is_finite() { value } else { f64::MAX }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_infinite_distance_stays_writable() {
        let c = Candidate {
            landmark: LandmarkId(4),
            correlation: 0.25,
            hausdorff: f64::INFINITY,
            likeness: Some(0.25),
            distance: f64::INFINITY,
            tau: 0.5,
            ratio: f64::INFINITY,
            probability: 0.0,
            refusal: Some(Refusal::Hausdorff),
        };
        let wire = candidate(&c, |id| format!("l{}", id.0));
        assert_eq!(
            (wire.landmark.as_str(), wire.refusal.as_str(), wire.hausdorff),
            ("l4", "hausdorff", None)
        );
        let json = serde_json::to_value(&wire).unwrap();
        assert!(json["distance"].is_number() && json["ratio"].is_number());
    }

    #[test]
    fn only_a_unique_verdict_names_a_landmark() {
        let mut v = Verdict {
            recognition: Recognition::Ambiguous(LandmarkId(1)),
            candidates: vec![],
            entropy_m: 1.0,
            entropy_norm: 0.5,
            confidence: 0.2,
            rotation: 0,
            border: 0,
            aligned_px: None,
            landmarks: 2,
        };
        let mut quad = v1::QuadAnswer::default();
        fill_verdict(&mut quad, &v, |_| "door".into());
        assert_eq!((quad.verdict(), quad.landmark.as_str()), (v1::Verdict::Ambiguous, ""));
        v.recognition = Recognition::Unique(LandmarkId(1));
        fill_verdict(&mut quad, &v, |_| "door".into());
        assert_eq!((quad.verdict(), quad.landmark.as_str()), (v1::Verdict::Unique, "door"));
    }
}
