//! One view of one picture against the landmarks of a map: the paper's distances over their
//! thresholds, and the outcome of the whole decision.

use super::lesson::Class;
use nalgebra::Matrix2;
use serde::Serialize;
use sim::exhibit::Exhibit;
use vision::{
    detect::{Quad, QuadKind, detect},
    geometry::{Corners, polygon},
    icon::icon,
    model::LandmarkId,
    params::Params,
    recognise::{MatchRefusal, RecognitionResult, Verdict, features, recognise},
    trace::NoTrace,
};

/// A detected quad belongs to the picture from this overlap on, or if this share of it lies inside.
const IOU_SAME: f64 = 0.5;
const INNER_SHARE: f64 = 0.9;

/// Outcome of a view of a taught picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Outcome {
    Right,
    /// Another landmark was named.
    Wrong,
    /// Doubtful: its points are there, but a connected part shows something else.
    Doubtful,
    /// Its points agree, but do not determine its corners.
    Corners,
    /// Only its icon matches; guided recognition may name it.
    Plain,
    /// Ambiguous with another landmark.
    Ambiguous,
    /// 1 minus gradient similarity is not below its threshold.
    Similarity,
    /// Similar, but the mismatch share is too large.
    Mismatch,
    /// Similar, but hardly in more than its frame.
    LowContent,
    /// Similar, but neither C^r nor H^r is below 0.8 of its threshold.
    Distances,
    /// Not among the match candidates.
    NotListed,
    /// No icon: the quad is too small, or leaves the image.
    NoIcon,
    /// No quad was found there.
    NotDetected,
}

impl Outcome {
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Right => "right",
            Self::Wrong => "wrong",
            Self::Doubtful => "doubtful",
            Self::Corners => "corners",
            Self::Plain => "plain",
            Self::Ambiguous => "ambiguous",
            Self::Similarity => "similarity",
            Self::Mismatch => "mismatch",
            Self::LowContent => "low_content",
            Self::Distances => "distances",
            Self::NotListed => "not listed",
            Self::NoIcon => "no icon",
            Self::NotDetected => "not detected",
        }
    }
}

/// Figures of one view.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ViewFigures {
    /// H^r / tau and C^r / tau at the corners of the first quad, and the ratio of the candidate
    /// that the decision compares with 1, whatever decides; infinite without.
    pub(crate) ratios: [f64; 3],
    pub(crate) outcome: Outcome,
}

/// A quad with given corners.
pub(crate) fn quad(corners_px: Corners) -> Quad {
    Quad {
        corners_px,
        corner_covariance_px2: [Matrix2::identity(); 4],
        side_support: [1.0; 4],
        side_clipped: [false; 4],
        score: 1.0,
        kind: QuadKind::Full,
        upright_ambiguous: false,
        alternates: Vec::new(),
    }
}

/// The picture's quads among those that the detector finds, the best overlap first.
pub(crate) fn detected(rendered: &Exhibit, p: &Params) -> Vec<Quad> {
    let truth = rendered.corners.points();
    let mut found: Vec<(f64, Quad)> = detect(&rendered.image, &p.detect, &mut NoTrace)
        .into_iter()
        .map(|q| (polygon::iou(truth, q.corners_px.points()), q))
        .filter(|(iou, q)| {
            let inside = || polygon::intersection_area(truth, q.corners_px.points());
            *iou >= IOU_SAME || inside() >= INNER_SHARE * q.corners_px.area_px2()
        })
        .collect();
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    found.into_iter().map(|(_, q)| q).collect()
}

/// Recognises a view of landmark `id` in the quad at `corners`, or in those that the detector
/// finds.
pub(crate) fn score_view(
    class: &Class,
    id: LandmarkId,
    rendered: &Exhibit,
    corners: Option<&Corners>,
    p: &Params,
) -> ViewFigures {
    let quads = corners.map_or_else(|| detected(rendered, p), |c| vec![quad(*c)]);
    let verdicts: Vec<RecognitionResult> =
        quads.iter().map(|q| recognise(&rendered.image, q, &class.models, class.kind, p)).collect();
    let mut ratios = [f64::INFINITY; 3];
    if let Some(at) = quads.first().map(|q| q.corners_px) {
        ratios = paper_ratios(class, id, rendered, &at, p);
    }
    let own = |v: &RecognitionResult| v.candidates.iter().find(|c| c.landmark == id).map(|c| c.ratio);
    ratios[2] = verdicts.iter().filter_map(own).fold(f64::INFINITY, f64::min);
    let outcome = verdicts.iter().map(|v| outcome(v, id)).min().unwrap_or(Outcome::NotDetected);
    // One wrong name makes the view wrong, whatever the other quads say.
    let wrong = verdicts.iter().any(|v| self::outcome(v, id) == Outcome::Wrong);
    let too_small = quads.first().is_some_and(|q| icon(&rendered.image, &q.corners_px, &p.icon).is_err());
    let outcome = match outcome {
        _ if wrong => Outcome::Wrong,
        Outcome::NotListed if too_small => Outcome::NoIcon,
        other => other,
    };
    ViewFigures { ratios, outcome }
}

/// H^r and C^r of the icon at `corners` to landmark `id`, over tau.
fn paper_ratios(
    class: &Class,
    id: LandmarkId,
    rendered: &Exhibit,
    corners: &Corners,
    p: &Params,
) -> [f64; 3] {
    let far = [f64::INFINITY; 3];
    let (Ok(icon), Some(model)) = (icon(&rendered.image, corners, &p.icon), class.models.get(id)) else {
        return far;
    };
    let d = model.distances(&features(icon, &p.recognise), &p.recognise);
    [d.hausdorff / model.hausdorff.tau, d.correlation / model.correlation.tau, f64::INFINITY]
}

fn outcome(verdict: &RecognitionResult, id: LandmarkId) -> Outcome {
    match verdict.verdict {
        Verdict::Unique(named) if named == id => return Outcome::Right,
        Verdict::Unique(_) => return Outcome::Wrong,
        Verdict::Ambiguous(named) => {
            let own = verdict.candidates.iter().find(|c| c.landmark == id && named == id);
            return match own.and_then(|c| c.refusal) {
                Some(MatchRefusal::Disagreement) => Outcome::Doubtful,
                Some(MatchRefusal::Corners) => Outcome::Corners,
                Some(MatchRefusal::Plain) => Outcome::Plain,
                _ => Outcome::Ambiguous,
            };
        }
        Verdict::Unknown => {}
    }
    let Some(own) = verdict.candidates.iter().find(|c| c.landmark == id) else { return Outcome::NotListed };
    match own.refusal {
        Some(MatchRefusal::Mismatch) => Outcome::Mismatch,
        Some(MatchRefusal::LowContent) => Outcome::LowContent,
        Some(MatchRefusal::Correlation | MatchRefusal::Hausdorff) => Outcome::Distances,
        _ => Outcome::Similarity,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use vision::{
        paper::entropy::Possibilities,
        recognise::{Evidence, MatchCandidate},
    };

    fn verdict(recognition: Verdict, refusal: Option<MatchRefusal>) -> RecognitionResult {
        let candidate = MatchCandidate {
            landmark: LandmarkId(3),
            evidence: Evidence::Points { likeness: Some(0.5) },
            ratio: 0.9,
            probability: 0.0,
            refusal,
        };
        RecognitionResult {
            verdict: recognition,
            candidates: vec![candidate],
            possibilities: Possibilities::new(1, false),
            confidence: 0.0,
            rotation: 0,
            border: 0,
            aligned_px: None,
            landmarks: 9,
            points: None,
        }
    }

    #[test]
    fn the_outcome_names_the_failed_gate() {
        let id = LandmarkId(3);
        for (recognition, refusal, expected) in [
            (Verdict::Unique(id), None, Outcome::Right),
            (Verdict::Unique(LandmarkId(4)), None, Outcome::Wrong),
            (Verdict::Ambiguous(LandmarkId(4)), None, Outcome::Ambiguous),
            (Verdict::Ambiguous(id), Some(MatchRefusal::Disagreement), Outcome::Doubtful),
            (Verdict::Ambiguous(id), Some(MatchRefusal::Corners), Outcome::Corners),
            (Verdict::Ambiguous(id), Some(MatchRefusal::Plain), Outcome::Plain),
            (Verdict::Ambiguous(id), Some(MatchRefusal::Margin), Outcome::Ambiguous),
            (Verdict::Ambiguous(LandmarkId(4)), Some(MatchRefusal::Plain), Outcome::Ambiguous),
            (Verdict::Unknown, Some(MatchRefusal::Similarity), Outcome::Similarity),
            (Verdict::Unknown, Some(MatchRefusal::Mismatch), Outcome::Mismatch),
            (Verdict::Unknown, Some(MatchRefusal::LowContent), Outcome::LowContent),
            (Verdict::Unknown, Some(MatchRefusal::Correlation), Outcome::Distances),
        ] {
            assert_eq!(outcome(&verdict(recognition, refusal), id), expected);
        }
        assert_eq!(outcome(&verdict(Verdict::Unknown, None), LandmarkId(5)), Outcome::NotListed);
    }
}
