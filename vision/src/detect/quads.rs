//! The quad: four corners of something flat, seen in perspective (method 3.4 to 3.6).

use super::{
    border::canonical,
    corners::refine,
    evidence::{Gradients, MAX_SAMPLES, Search},
    grouping::{QuadSeed, match_quads},
    hypotheses::HypothesisParams,
    learnt,
    network::Network,
    segments::EdgeSegment,
    side_model::SIDE_FEATURES,
    similarity::SegmentPair,
    thing_model::THING_FEATURES,
    three_sided::three_sided,
};
use crate::params::DetectParams;
use nalgebra::{Matrix2, Point2};
use serde::{Deserialize, Deserializer, Serialize, de::Error as _};

/// Why four points are not the corners of a quad.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum CornersError {
    /// A coordinate is NaN or infinite.
    #[error("a corner is not finite")]
    NotFinite,
    /// The polygon is concave, crossing, flat, or runs counter-clockwise on screen.
    #[error("corners are not a strictly convex polygon, clockwise on screen")]
    NotConvex,
}

/// Four corners in pixels: top-left, top-right, bottom-right, bottom-left as a viewer in front sees them, hence
/// clockwise on screen (u right, v down). Strictly convex. Everything in Waymark that has corners has them in this
/// order.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "[[f64; 2]; 4]", into = "[[f64; 2]; 4]")]
pub struct Corners([Point2<f64>; 4]);

impl Corners {
    /// Smallest area of a triangle of three successive corners, in px^2: below it they count as collinear.
    const MIN_TRIANGLE_PX2: f64 = 1e-6;

    /// Checks order, convexity and finiteness.
    pub fn new(corners_px: [Point2<f64>; 4]) -> Result<Self, CornersError> {
        if corners_px.iter().any(|c| !c.x.is_finite() || !c.y.is_finite()) {
            return Err(CornersError::NotFinite);
        }
        let convex = (0..4).all(|i| {
            let (a, b, c) = (corners_px[i], corners_px[(i + 1) % 4], corners_px[(i + 2) % 4]);
            0.5 * (b - a).perp(&(c - b)) > Self::MIN_TRIANGLE_PX2
        });
        if convex { Ok(Self(corners_px)) } else { Err(CornersError::NotConvex) }
    }

    /// Sorts four points clockwise on screen, starting at the corner that makes the quad most upright (image gravity
    /// is +v). Method 4, rule A10.
    pub fn from_unordered(mut points_px: [Point2<f64>; 4]) -> Result<Self, CornersError> {
        if points_px.iter().any(|c| !c.x.is_finite() || !c.y.is_finite()) {
            return Err(CornersError::NotFinite);
        }
        let centre = points_px.iter().fold(Point2::origin(), |m: Point2<f64>, p| m + p.coords * 0.25);
        let angle = |p: &Point2<f64>| (p.y - centre.y).atan2(p.x - centre.x);
        points_px.sort_by(|a, b| angle(a).total_cmp(&angle(b)));
        let sorted = Self::new(points_px)?;
        let start = (0..4)
            .min_by(|a, b| sorted.rotated(*a).lean_rad().total_cmp(&sorted.rotated(*b).lean_rad()))
            .unwrap_or(0);
        Ok(sorted.rotated(start))
    }

    /// The corners TL, TR, BR, BL.
    pub fn points(&self) -> &[Point2<f64>; 4] {
        &self.0
    }

    /// The same quad with corner `shift` (0 to 3) named top-left.
    #[must_use]
    pub fn rotated(&self, shift: usize) -> Self {
        Self(std::array::from_fn(|i| self.0[(i + shift) % 4]))
    }

    /// Mean angle between the sides TL-BL and TR-BR and image gravity (+v): 0 when upright, pi upside down.
    pub fn lean_rad(&self) -> f64 {
        let [tl, tr, br, bl] = self.0;
        let angle = |side: nalgebra::Vector2<f64>| side.x.abs().atan2(side.y);
        f64::midpoint(angle(bl - tl), angle(br - tr))
    }

    /// Area in px^2.
    pub fn area_px2(&self) -> f64 {
        let [a, b, c, d] = self.0;
        0.5 * (c - a).perp(&(d - b))
    }

    /// Distance to `other`'s of the corner that is furthest from it.
    pub fn furthest_px(&self, other: &Self) -> f64 {
        self.0.iter().zip(&other.0).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max)
    }

    /// Length of the shortest side.
    pub fn min_side_px(&self) -> f64 {
        (0..4).map(|i| (self.0[(i + 1) % 4] - self.0[i]).norm()).fold(f64::INFINITY, f64::min)
    }
}

impl TryFrom<[[f64; 2]; 4]> for Corners {
    type Error = CornersError;
    fn try_from(c: [[f64; 2]; 4]) -> Result<Self, CornersError> {
        Self::new(c.map(|[x, y]| Point2::new(x, y)))
    }
}

impl From<Corners> for [[f64; 2]; 4] {
    fn from(c: Corners) -> Self {
        c.0.map(|p| [p.x, p.y])
    }
}

/// How many sides were seen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum QuadKind {
    /// Four sides: fit for recognition and metric pose.
    Full,
    /// Three sides, the fourth is the chord of the free ends: topology only, never a metric pose.
    ThreeSided,
}

/// What a border that was found in a picture is off by besides the noise of its edges, per coordinate: another edge of the
/// frame, a shadow, a side that bends. The covariance of the corners knows nothing of it: where that says 0.04 px, corners
/// of rendered posters are 0.2 to 0.4 px off, whatever their size (docs/EVALUATION.md, "Navigation").
pub const BORDER_SIGMA_PX: f64 = 0.3;

/// A detected quad.
#[derive(Debug, Clone, PartialEq)]
pub struct Quad {
    /// Sub-pixel corners.
    pub corners_px: Corners,
    /// Covariance of each corner, px^2, in the corners' order.
    pub corner_covariance_px2: [Matrix2<f64>; 4],
    /// Share of each side (TL-TR, TR-BR, BR-BL, BL-TL) that edges support, 0 to 1.
    pub side_support: [f64; 4],
    /// Whether each side runs into the image border.
    pub side_clipped: [bool; 4],
    /// How sure the detector is, 0 to 1.
    pub score: f64,
    /// Four sides or three.
    pub kind: QuadKind,
    /// A second way to name the top-left corner is nearly as upright: recognition tries all four rotations.
    pub upright_ambiguous: bool,
    /// Other borders of the same thing (mat, canvas, inner frame) and what hangs inside (a poster on a door), nested in
    /// `corners_px`, outermost first.
    pub alternates: Vec<Corners>,
}

impl Quad {
    /// Covariance of each corner as far as it can be believed: of the fitted edges, and [`BORDER_SIGMA_PX`].
    pub fn believed_covariance_px2(&self) -> [Matrix2<f64>; 4] {
        self.corner_covariance_px2.map(|c| c + Matrix2::identity() * BORDER_SIGMA_PX.powi(2))
    }
}

/// How quads are formed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Grouping {
    /// The paper's: two relaxations and sets of three sides.
    Relaxation,
    /// Corner chains with a searched fourth side, checked against the gradient.
    #[default]
    Hypotheses,
}

/// What a quad of the search becomes that lies inside another and is no border of the same thing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Nested {
    /// An alternate of the outer one, unless that is the more doubtful of the two or holds several things.
    #[default]
    Alternates,
    /// A quad of its own.
    Quads,
}

/// Parameters of the last stage.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct QuadParams {
    /// The paper's grouping or the search.
    pub grouping: Grouping,
    /// The search works on an image reduced by a whole factor to about this longer side; 0 for full size.
    pub working_side_px: usize,
    /// Scales of the search, each half the one before: a coarse one sees through ragged, ornate borders.
    pub scales: usize,
    /// The search.
    pub hypotheses: HypothesisParams,
    /// Share of each side that edges must support for the outermost border of a group to be its quad.
    pub min_side_support: f64,
    /// Nested quads above this `IoU` are borders of one thing.
    pub nested_iou: f64,
    /// What other nested quads become, for the search.
    pub nested: Nested,
    /// How far from a rough side its edge points are looked for.
    pub refit_reach_px: f64,
    /// Smallest step height of an edge point, grey levels.
    pub min_step: f64,
    /// Most seeds of a scale that are refitted, at most [`MAX_REFITTED`](super::rating::MAX_REFITTED); half as many
    /// small ones come on top.
    pub max_refitted: usize,
    /// Most borders of one thing that are rated on a scale.
    pub max_alike: usize,
    /// Smallest score of a quad of the search.
    pub min_score: f64,
    /// Whether the search moves each side to the line beside it that looks most like a border.
    pub choose_sides: bool,
    /// What makes a side a border; without one, what was learnt with the program.
    #[serde(skip_serializing_if = "Option::is_none", deserialize_with = "checked::<SIDE_FEATURES, _>")]
    pub side_model: Option<Network>,
    /// What makes a quad a thing; without one, what was learnt with the program.
    #[serde(skip_serializing_if = "Option::is_none", deserialize_with = "checked::<THING_FEATURES, _>")]
    pub thing_model: Option<Network>,
    /// Smallest probability that a quad of the search is a thing.
    pub min_probability: f64,
    /// A quad that is a thing with at least this probability keeps what contradicts it from being looked at.
    pub sure_probability: f64,
    /// Whether to report sets of three sides.
    pub three_sided: bool,
    /// Smallest c5 of a set of three sides.
    pub min_three_sided_closing: f64,
    /// Smallest score of a set of three sides of the search.
    pub min_three_sided_score: f64,
}

impl Default for QuadParams {
    fn default() -> Self {
        Self {
            grouping: Grouping::default(),
            working_side_px: 640,
            scales: 2,
            hypotheses: HypothesisParams::default(),
            min_side_support: 0.5,
            nested_iou: 0.6,
            nested: Nested::default(),
            refit_reach_px: 2.0,
            min_step: 4.0,
            max_refitted: 60,
            max_alike: 8,
            min_score: 0.4,
            choose_sides: true,
            side_model: None,
            thing_model: None,
            min_probability: 0.65,
            sure_probability: 0.95,
            three_sided: true,
            min_three_sided_closing: 0.5,
            min_three_sided_score: 0.5,
        }
    }
}

/// A network for `N` measurements, checked where it comes in.
fn checked<'de, const N: usize, D: Deserializer<'de>>(from: D) -> Result<Option<Network>, D::Error> {
    let network = Option::<Network>::deserialize(from)?;
    if let Some(network) = &network {
        network.check(N).map_err(D::Error::custom)?;
    }
    Ok(network)
}

impl QuadParams {
    /// What makes a side a border.
    pub fn side_network(&self) -> &Network {
        self.side_model.as_ref().unwrap_or_else(|| learnt::side_model())
    }

    /// What makes a quad a thing.
    pub fn thing_network(&self) -> &Network {
        self.thing_model.as_ref().unwrap_or_else(|| learnt::thing_model())
    }
}

/// Quads from the matched pairs of pass 1: pass 2, three-sided sets, refitted corners, canonical border. Best first.
pub fn quads(segments: &[EdgeSegment], pairs: &[SegmentPair], g: &Gradients, p: &DetectParams) -> Vec<Quad> {
    let size = (g.width(), g.height());
    let full = match_quads(segments, pairs, size, &p.relaxation);
    let mut found: Vec<Quad> = full.iter().filter_map(|s| quad(s, QuadKind::Full, g, &p.quads)).collect();
    if p.quads.three_sided {
        let mut in_quad = vec![false; segments.len()];
        full.iter().flat_map(|s| s.sides).flatten().for_each(|i| in_quad[i] = true);
        let left: Vec<SegmentPair> =
            pairs.iter().filter(|s| !in_quad[s.k] && !in_quad[s.l]).cloned().collect();
        for s in pairs {
            (in_quad[s.k], in_quad[s.l]) = (true, true);
        }
        let sets = three_sided(segments, &left, &in_quad, p.quads.min_three_sided_closing, size);
        found.extend(sets.iter().filter_map(|s| quad(s, QuadKind::ThreeSided, g, &p.quads)));
    }
    canonical(found, p.quads.nested_iou, p.quads.min_side_support, p.relaxation.pair_tolerance_px)
}

/// Refits a seed on the gradient planes. The score is the similarity of its pairs times the support of its worst
/// side (method 3.6); of three sides, the worst of those that were seen.
fn quad(seed: &QuadSeed, kind: QuadKind, g: &Gradients, p: &QuadParams) -> Option<Quad> {
    let search = Search {
        reach_px: p.refit_reach_px,
        min_step: p.min_step,
        samples: MAX_SAMPLES,
        between_pixels: true,
        least_support: 0.0,
    };
    let refined = refine(g, &seed.corners_px, search)?;
    let mut support = refined.support();
    let side_support = support;
    if kind == QuadKind::ThreeSided {
        support.sort_by(f64::total_cmp);
        support[0] = 1.0;
    }
    let worst = support.into_iter().fold(1.0, f64::min);
    Some(Quad {
        corners_px: refined.corners_px,
        corner_covariance_px2: refined.covariance_px2,
        side_support,
        side_clipped: refined.clipped,
        score: (seed.similarity * worst).clamp(0.0, 1.0),
        kind,
        upright_ambiguous: refined.upright_ambiguous,
        alternates: Vec::new(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square() -> [[f64; 2]; 4] {
        [[0.0, 0.0], [10.0, 0.0], [10.0, 8.0], [0.0, 8.0]]
    }

    #[test]
    fn corners_are_checked() {
        assert!(Corners::try_from(square()).is_ok());
        let mut counter_clockwise = square();
        counter_clockwise.reverse();
        assert_eq!(Corners::try_from(counter_clockwise), Err(CornersError::NotConvex));
        let mut nan = square();
        nan[2][1] = f64::NAN;
        assert_eq!(Corners::try_from(nan), Err(CornersError::NotFinite));
        let crossed = [[0.0, 0.0], [10.0, 8.0], [10.0, 0.0], [0.0, 8.0]];
        assert_eq!(Corners::try_from(crossed), Err(CornersError::NotConvex));
        let collinear = [[0.0, 0.0], [5.0, 0.0], [10.0, 0.0], [0.0, 8.0]];
        assert_eq!(Corners::try_from(collinear), Err(CornersError::NotConvex));
    }

    #[test]
    fn unordered_points_become_upright() {
        let expected = Corners::try_from(square()).unwrap();
        for order in [[0, 1, 2, 3], [2, 0, 3, 1], [3, 2, 1, 0]] {
            let points = order.map(|i| Point2::from(square()[i]));
            assert_eq!(Corners::from_unordered(points).unwrap(), expected);
        }
        assert!((expected.area_px2() - 80.0).abs() < 1e-12);
        assert!((expected.min_side_px() - 8.0).abs() < 1e-12);
    }

    #[test]
    fn four_rotations_come_back() {
        let corners = Corners::try_from(square()).unwrap();
        assert_eq!(corners.rotated(1).rotated(3), corners);
        assert!(corners.rotated(2).lean_rad() > 3.0);
    }
}
