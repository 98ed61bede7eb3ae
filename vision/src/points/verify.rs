//! Verification of a landmark in a patch: matches, homography, then the agreement of the landmark's
//! other points at their projected positions. The points that determined the homography are not
//! independent evidence; the others are held out, so their agreement counts in full.

use crate::{
    detect::quad::BORDER_SIGMA_PX,
    frame::GrayImage,
    geometry::{corners::Corners, homography::Homography},
    points::{
        agreement::{AGREEING_BY_CHANCE, Agreement, Check, checks, unturned},
        consensus::{Consensus, consensus, distinct},
        evidence::log10_tail,
        matching::{Match, MatchGate, matches},
        patch::{Patch, inner_px},
        point::{Point, SeenPatch},
        taught::TaughtPoint,
    },
    seen_border::{FoundBy, SeenBorder},
};
use nalgebra::{Matrix2, Point2, SMatrix};

/// Most points of a patch.
pub const MAX_PATCH_POINTS: usize = 250;
/// Gates of matches in a global search: the detected border may differ from the taught one.
pub const GLOBAL_GATE: MatchGate = MatchGate { place: 0.3, scale: 1.6, distance: 90, ratio: 0.9 };
/// Gates of matches at an expected landmark.
pub const GUIDED_GATE: MatchGate = MatchGate { place: 0.15, scale: 1.4, distance: 90, ratio: 0.95 };
/// A match agrees with a homography by chance with this probability.
const CHANCE_OF_MATCH: f64 = 0.01;
/// Largest log10 tail probability of the matches at which a homography is verified.
const MIN_LOG10_MATCHES: f64 = -5.0;
/// log10 of the number of independent homographies that a search tries.
const LOG10_HOMOGRAPHIES: f64 = 14.0;
/// Points nearer than this along both axes, in landmark units, are one piece of evidence.
const APART: f32 = 0.04;
/// Smallest standard deviation of a keypoint's place, in image pixels.
const MIN_SIGMA_PX: f64 = 0.3;

/// A landmark's points, ready for comparison.
#[derive(Debug, Clone)]
pub struct Target {
    points: Vec<Point>,
    plain: Vec<u32>,
}

impl Target {
    /// The points.
    pub fn points(&self) -> &[Point] {
        &self.points
    }

    /// Unpacks `taught`.
    pub fn new(taught: &[TaughtPoint]) -> Self {
        Self {
            points: taught.iter().map(TaughtPoint::point).collect(),
            plain: taught.iter().map(TaughtPoint::plain).collect(),
        }
    }
}

/// Point evidence for a landmark in a patch.
#[derive(Debug, Clone, PartialEq)]
pub struct PointEvidence {
    /// Tentative matches at different places.
    pub matches: usize,
    /// Those of them that agree on the homography.
    pub inliers: usize,
    /// Held-out points of the landmark inside the patch, at different places.
    pub checked: usize,
    /// Those of them that agree.
    pub agreeing: usize,
    /// log10 of the number of false alarms (expected such coincidences in one comparison with an
    /// unrelated patch): 0 at most. A caller that compares with N landmarks adds log10 N.
    pub log10_nfa: f64,
    /// Quarters by which the patch was turned.
    pub turned: usize,
    /// The taught border's corners in the image, TL first.
    pub corners_px: Corners,
    /// Their covariances, px^2.
    pub corner_covariance_px2: [Matrix2<f64>; 4],
    /// Whether the corners are those of the homography, or were aligned from there with the learnt
    /// icon.
    pub found_by: FoundBy,
    /// Which parts of the landmark agree.
    pub agreement: Agreement,
}

impl PointEvidence {
    /// The landmark's border, independent of the detected one.
    pub fn border(&self) -> SeenBorder {
        let (corners_px, covariance_px2) = (self.corners_px, self.corner_covariance_px2);
        SeenBorder { corners_px, covariance_px2, found_by: self.found_by }
    }
}

/// A homography that has yet to be verified.
#[derive(Debug, Clone)]
pub struct Hypothesis {
    /// Quarters by which the patch was turned.
    pub turned: usize,
    /// Tentative matches.
    pub matches: Vec<Match>,
    /// Those of them that agree.
    pub consensus: Consensus,
    /// Matches at different places.
    pub distinct: usize,
    /// log10 of the tail of the inliers.
    pub log10_matches: f64,
}

impl Hypothesis {
    /// Every point of the target, looked at where the homography puts it in `seen`.
    pub fn checks(&self, seen: &SeenPatch, target: &Target) -> Vec<Check> {
        let map = &self.consensus.seen_from_taught;
        checks(seen, self.turned, map, &target.points, &target.plain)
    }
}

/// The homography that matches of `points` (of a patch, turned by `turned` quarters) with the
/// target agree on.
pub(crate) fn hypothesis(
    points: &[Point],
    turned: usize,
    target: &Target,
    gate: &MatchGate,
    enough: f64,
) -> Option<Hypothesis> {
    let matches = matches(points, &target.points, gate);
    let all: Vec<usize> = (0..matches.len()).collect();
    let count = distinct(&all, &target.points, &matches);
    let least = (4..=count).find(|k| log10_tail(count, *k, CHANCE_OF_MATCH) <= enough)?;
    let consensus = consensus(points, &target.points, &matches, least)?;
    let log10_matches = log10_tail(count, consensus.distinct, CHANCE_OF_MATCH);
    (log10_matches <= enough).then_some(Hypothesis {
        turned,
        matches,
        consensus,
        distinct: count,
        log10_matches,
    })
}

/// The evidence for `hypothesis` in `seen`. `None` where its corners are no quad in the image.
pub fn verified(seen: &SeenPatch, hypothesis: &Hypothesis, target: &Target) -> Option<PointEvidence> {
    let Hypothesis { turned, matches, consensus, distinct, log10_matches } = hypothesis;
    let checks = hypothesis.checks(seen, target);
    let used: Vec<[f32; 2]> =
        consensus.inliers.iter().map(|i| target.points[matches[*i].taught].at).collect();
    let (checked, agreeing, variants) = held_out(&checks, target, &used);
    let chance = (f64::from(AGREEING_BY_CHANCE) * variants).min(0.5);
    let log10_nfa = (log10_matches + LOG10_HOMOGRAPHIES).min(0.0) + log10_tail(checked, agreeing, chance);
    let (corners_px, corner_covariance_px2) = corners(seen, *turned, hypothesis, target)?;
    Some(PointEvidence {
        matches: *distinct,
        inliers: consensus.distinct,
        checked,
        agreeing,
        log10_nfa,
        turned: *turned,
        corners_px,
        corner_covariance_px2,
        found_by: FoundBy::Points,
        agreement: Agreement::new(&checks, &target.points),
    })
}

/// Places that were not `used` yet and have texture, how many of them agree, and the mean number of
/// points of a place (several views of a landmark differ): a place agrees if any of its points
/// does.
fn held_out(checks: &[Check], target: &Target, used: &[[f32; 2]]) -> (usize, usize, f64) {
    let near = |a: &[f32; 2], b: &[f32; 2]| (a[0] - b[0]).abs() < APART && (a[1] - b[1]).abs() < APART;
    let mut places: Vec<([f32; 2], bool)> = Vec::new();
    let mut points = 0;
    for check in checks.iter().filter(|c| !c.is_silent()) {
        let at = target.points[check.taught].at;
        if used.iter().any(|u| near(u, &at)) {
            continue;
        }
        points += 1;
        match places.iter_mut().find(|(place, _)| near(place, &at)) {
            Some((_, agrees)) => *agrees |= check.agrees(),
            None => places.push((at, check.agrees())),
        }
    }
    let agreeing = places.iter().filter(|(_, agrees)| *agrees).count();
    (places.len(), agreeing, f64::from(points) / places.len().max(1) as f64)
}

/// Corners of the taught border in the image, with covariances from the residuals of the inliers
/// and from the uncertainty of the taught border.
fn corners(
    seen: &SeenPatch,
    turned: usize,
    hypothesis: &Hypothesis,
    target: &Target,
) -> Option<(Corners, [Matrix2<f64>; 4])> {
    let unit = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(Point2::from);
    let map = &hypothesis.consensus.seen_from_taught;
    let to_image = |at: Point2<f64>| seen.patch.to_image(unturned([at.x, at.y], turned));
    let mut points_px = [Point2::origin(); 4];
    for (px, at) in points_px.iter_mut().zip(&unit) {
        *px = to_image(map.apply(at))?;
    }
    let corners = Corners::new(points_px).ok()?;
    let image_from_taught = Homography::from_points(&unit, &points_px).ok()?;
    // Derivatives of the inliers' pixels by the eight coordinates of the corners.
    let nudged: Vec<Homography> = (0..8)
        .map(|i| {
            let mut moved = points_px;
            moved[i / 2][i % 2] += 0.5;
            Homography::from_points(&unit, &moved)
        })
        .collect::<Result<_, _>>()
        .ok()?;
    let mut normal = SMatrix::<f64, 8, 8>::zeros();
    let (mut square, mut count) = (0.0, 0.0);
    for i in &hypothesis.consensus.inliers {
        let Match { seen: s, taught: t, .. } = hypothesis.matches[*i];
        let from = target.points[t].at.map(f64::from);
        let at = Point2::from(from);
        let here = image_from_taught.apply(&at);
        let rows: [SMatrix<f64, 1, 8>; 2] = std::array::from_fn(|axis| {
            SMatrix::from_fn(|_, i| 2.0 * (nudged[i].apply(&at)[axis] - here[axis]))
        });
        for row in rows {
            normal += row.transpose() * row;
        }
        let own = seen.points[s].at.map(f64::from);
        let found = seen.patch.to_image(own)?;
        square += (found - here).norm_squared();
        count += 2.0;
    }
    // Robust against few inliers: eight coordinates were fitted.
    let variance = (square / (count - 8.0_f64).max(1.0)).max(MIN_SIGMA_PX.powi(2));
    // A weak prior keeps directions that no inlier fixes finite.
    let prior = 1.0 / corners.area_px2();
    let covariance = (normal / variance + SMatrix::<f64, 8, 8>::identity() * prior).try_inverse()?;
    let border = Matrix2::identity() * BORDER_SIGMA_PX.powi(2);
    let of = |i: usize| covariance.fixed_view::<2, 2>(2 * i, 2 * i).into_owned() + border;
    Some((corners, std::array::from_fn(of)))
}

/// The evidence for one landmark, whose corners are expected at `predicted_px` (TL first), without
/// a detected quad; the landmark may be partly outside the image. `None`: no homography with enough
/// matches.
pub fn verify_at(image: &GrayImage, taught: &[TaughtPoint], predicted_px: &Corners) -> Option<PointEvidence> {
    let patch = Patch::new(image, predicted_px, inner_px(predicted_px))?;
    let seen = SeenPatch::new(patch, MAX_PATCH_POINTS);
    let target = Target::new(taught);
    let found = hypothesis(&seen.points, 0, &target, &GUIDED_GATE, MIN_LOG10_MATCHES)?;
    verified(&seen, &found, &target)
}

/// The homography in a search of the whole map.
pub fn global_hypothesis(points: &[Point], turned: usize, target: &Target) -> Option<Hypothesis> {
    hypothesis(points, turned, target, &GLOBAL_GATE, MIN_LOG10_MATCHES)
}
