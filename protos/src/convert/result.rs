//! The result of recognition in wire form. Names are given by the caller: `vision` knows landmarks
//! by number only.

use super::geometry::pose3_wire;
use crate::v1;
use vision::{
    detect::QuadKind,
    geometry::Corners,
    model::LandmarkId,
    points::{agreement::Part, verify::PointEvidence},
    pose::{LandmarkPose, PoseSolution},
    recognise::{
        Evidence, IconEvidence, MatchCandidate, MatchRefusal, RecognitionResult, Verdict, log10_false_alarms,
    },
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
        QuadKind::Texture => v1::QuadKind::Texture,
    }
}

/// The three cases of a verdict.
pub fn verdict(recognition: Verdict) -> v1::Verdict {
    match recognition {
        Verdict::Unknown => v1::Verdict::Unknown,
        Verdict::Unique(_) => v1::Verdict::Unique,
        Verdict::Ambiguous(_) => v1::Verdict::Ambiguous,
    }
}

/// A candidate; `name` gives the landmark's name.
pub fn candidate(c: &MatchCandidate, name: impl Fn(LandmarkId) -> String) -> v1::Candidate {
    let (icon, likeness) = match c.evidence {
        Evidence::Icon(icon) => (Some(icon), icon.likeness),
        Evidence::Points { likeness } => (None, likeness),
    };
    // JSON has no infinity: an infinite distance or ratio (too few points) is absent.
    let of = |value: fn(&IconEvidence) -> f64| icon.as_ref().map(value).filter(|v| v.is_finite());
    v1::Candidate {
        landmark: name(c.landmark),
        correlation: of(|i| i.correlation),
        hausdorff: of(|i| i.hausdorff),
        distance: of(|i| i.distance),
        threshold: of(|i| i.tau),
        ratio: Some(c.ratio).filter(|r| r.is_finite()),
        probability: c.probability,
        refusal: c.refusal.map_or("", refusal).to_owned(),
        gradient_similarity: likeness.filter(|l| l.is_finite()),
    }
}

/// The word of a refusal.
pub fn refusal(refusal: MatchRefusal) -> &'static str {
    match refusal {
        MatchRefusal::Correlation => "correlation",
        MatchRefusal::Hausdorff => "hausdorff",
        MatchRefusal::Similarity => "similarity",
        MatchRefusal::Mismatch => "mismatch",
        MatchRefusal::LowContent => "low_content",
        MatchRefusal::Margin => "margin",
        MatchRefusal::Points => "points",
        MatchRefusal::Disagreement => "disagreement",
        MatchRefusal::Corners => "corners",
        MatchRefusal::Plain => "plain",
    }
}

/// The verdict's part of a quad's answer: everything but corners, kind, score and poses.
pub fn fill_verdict(quad: &mut v1::QuadAnswer, v: &RecognitionResult, name: impl Fn(LandmarkId) -> String) {
    quad.set_verdict(verdict(v.verdict));
    if let Verdict::Unique(id) = v.verdict {
        quad.landmark = name(id);
    }
    quad.candidates = v.candidates.iter().map(|c| candidate(c, &name)).collect();
    quad.entropy_m = v.possibilities.entropy_m(v.landmarks);
    quad.entropy_norm = v.possibilities.entropy_norm(v.landmarks);
    quad.probability_none = v.possibilities.probability_none();
    quad.confidence = v.confidence;
    quad.points = v.points.as_deref().map(|evidence| points(evidence, v.landmarks));
    quad.doubtful_landmark = doubtful(v).map(name).unwrap_or_default();
}

/// What points say of the first candidate, among `landmarks`.
pub fn points(evidence: &PointEvidence, landmarks: usize) -> v1::PointEvidence {
    let part = |part: &Part| match part {
        Part::Silent => v1::PartAgreement::Silent,
        Part::Agrees => v1::PartAgreement::Agrees,
        Part::Disagrees => v1::PartAgreement::Disagrees,
    };
    v1::PointEvidence {
        matches: evidence.matches as u32,
        inliers: evidence.inliers as u32,
        checked: evidence.checked as u32,
        agreeing: evidence.agreeing as u32,
        // JSON has no infinity.
        log10_chance: log10_false_alarms(evidence, landmarks).max(f64::MIN),
        agreement: evidence.agreement.0.as_flattened().iter().map(|p| part(p).into()).collect(),
    }
}

/// The landmark that is in doubt because a part of it shows something else.
fn doubtful(v: &RecognitionResult) -> Option<LandmarkId> {
    let best = v.candidates.first()?;
    let named = v.verdict == Verdict::Ambiguous(best.landmark);
    (named && best.refusal == Some(MatchRefusal::Disagreement)).then_some(best.landmark)
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

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix2;
    use vision::{paper::entropy::Possibilities, points::agreement::Agreement};

    #[test]
    fn an_infinite_distance_stays_writable() {
        let c = MatchCandidate {
            landmark: LandmarkId(4),
            evidence: Evidence::Icon(IconEvidence {
                correlation: 0.25,
                hausdorff: f64::INFINITY,
                likeness: Some(0.25),
                distance: f64::INFINITY,
                tau: 0.5,
            }),
            ratio: f64::INFINITY,
            probability: 0.0,
            refusal: Some(MatchRefusal::Hausdorff),
        };
        let wire = candidate(&c, |id| format!("l{}", id.0));
        assert_eq!(
            (wire.landmark.as_str(), wire.refusal.as_str(), wire.hausdorff),
            ("l4", "hausdorff", None)
        );
        let json = serde_json::to_value(&wire).unwrap();
        assert!(json["ratio"].is_null() && json["distance"].is_null() && json["threshold"] == 0.5);
    }

    fn ambiguous() -> RecognitionResult {
        RecognitionResult {
            verdict: Verdict::Ambiguous(LandmarkId(1)),
            candidates: vec![],
            possibilities: Possibilities::new(1, true),
            confidence: 0.2,
            rotation: 0,
            border: 0,
            aligned_px: None,
            landmarks: 2,
            points: None,
        }
    }

    fn evidence() -> PointEvidence {
        let mut agreement = Agreement::default();
        (agreement.0[0][0], agreement.0[1][0], agreement.0[4][3]) =
            (Part::Agrees, Part::Disagrees, Part::Agrees);
        PointEvidence {
            found_by: vision::seen_border::FoundBy::Points,
            matches: 30,
            inliers: 21,
            checked: 12,
            agreeing: 9,
            log10_nfa: -20.0,
            turned: 0,
            corners_px: Corners::try_from([[0.0, 0.0], [9.0, 0.0], [9.0, 9.0], [0.0, 9.0]]).unwrap(),
            corner_covariance_px2: [Matrix2::identity(); 4],
            agreement,
        }
    }

    /// Rows from the top, in each row from the left; false alarms among all landmarks of the map.
    #[test]
    fn points_travel_with_their_table() {
        let wire = points(&evidence(), 100);
        assert_eq!((wire.matches, wire.inliers, wire.checked, wire.agreeing), (30, 21, 12, 9));
        // Four turns (0.6) and 100 landmarks (2).
        assert!((wire.log10_chance + 17.4).abs() < 1e-9, "{}", wire.log10_chance);
        let said: Vec<_> =
            wire.agreement().enumerate().filter(|(_, p)| *p != v1::PartAgreement::Silent).collect();
        assert_eq!(wire.agreement.len(), 25);
        assert_eq!(
            said,
            [
                (0, v1::PartAgreement::Agrees),
                (5, v1::PartAgreement::Disagrees),
                (23, v1::PartAgreement::Agrees)
            ]
        );
        let never = PointEvidence { log10_nfa: f64::NEG_INFINITY, ..evidence() };
        assert!(serde_json::to_value(points(&never, 1)).unwrap()["log10_chance"].is_number());
    }

    /// The doubtful landmark has a field of its own: a client without that field reads "ambiguous".
    #[test]
    fn a_doubtful_landmark_is_named_apart() {
        let refused = |refusal| MatchCandidate {
            landmark: LandmarkId(1),
            evidence: Evidence::Points { likeness: None },
            ratio: 0.3,
            probability: 1.0,
            refusal: Some(refusal),
        };
        let filled = |refusal| {
            let points = Some(Box::new(evidence()));
            let v = RecognitionResult { candidates: vec![refused(refusal)], points, ..ambiguous() };
            let mut quad = v1::QuadAnswer::default();
            fill_verdict(&mut quad, &v, |_| "door".into());
            quad
        };
        let quad = filled(MatchRefusal::Disagreement);
        assert_eq!((quad.verdict(), quad.landmark.as_str()), (v1::Verdict::Ambiguous, ""));
        assert_eq!(
            (quad.doubtful_landmark.as_str(), quad.candidates[0].refusal.as_str()),
            ("door", "disagreement")
        );
        assert_eq!(quad.points.map(|p| p.inliers), Some(21));
        assert_eq!(filled(MatchRefusal::Margin).doubtful_landmark, "");
    }

    /// Where points decide, distances of icons are absent, and a landmark in doubt is not certain.
    #[test]
    fn nothing_is_sent_that_was_not_measured() {
        let c = MatchCandidate {
            landmark: LandmarkId(1),
            evidence: Evidence::Points { likeness: Some(0.4) },
            ratio: 0.3,
            probability: 0.5,
            refusal: Some(MatchRefusal::Disagreement),
        };
        let mut quad = v1::QuadAnswer::default();
        fill_verdict(&mut quad, &RecognitionResult { candidates: vec![c], ..ambiguous() }, |_| "door".into());
        let json = serde_json::to_value(&quad.candidates[0]).unwrap();
        let absent = ["correlation", "hausdorff", "distance", "threshold"];
        assert!(absent.iter().all(|name| json[*name].is_null()), "{json}");
        assert_eq!((json["gradient_similarity"].as_f64(), json["ratio"].as_f64()), (Some(0.4), Some(0.3)));
        assert!((quad.probability_none - 0.5).abs() < 1e-12 && quad.entropy_norm < 0.5, "{quad:?}");
    }

    #[test]
    fn only_a_unique_verdict_names_a_landmark() {
        let mut v = ambiguous();
        let mut quad = v1::QuadAnswer::default();
        fill_verdict(&mut quad, &v, |_| "door".into());
        assert_eq!((quad.verdict(), quad.landmark.as_str()), (v1::Verdict::Ambiguous, ""));
        v.verdict = Verdict::Unique(LandmarkId(1));
        fill_verdict(&mut quad, &v, |_| "door".into());
        assert_eq!((quad.verdict(), quad.landmark.as_str()), (v1::Verdict::Unique, "door"));
    }
}
