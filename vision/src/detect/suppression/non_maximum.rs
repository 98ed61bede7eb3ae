//! Non-maximum suppression. In: scored quads that may conflict. Out: quads with their sides on
//! borders, each more likely an object than those it conflicts with. Nested quads may both stay;
//! quads that cross may not.

use crate::{
    detect::{
        border_model::{
            choose_sides::{SnappedSides, choose_sides},
            quad_classifier::{QUAD_FEATURES, probability, quad_features},
        },
        edge_support::gradients::Gradients,
        params::QuadParams,
        proposals::quad_seed::overlap_exceeds,
        quad::Quad,
        refine::{
            corners::refine,
            rating::{ScoredQuad, rate_one, rating_search, same},
        },
    },
    geometry::polygon::{self, Relation},
};
use nalgebra::Point2;

/// Most rated quads that are compared with each other, those of most weight first.
pub const MAX_RATED: usize = 160;

/// How the sides of two quads lie that are named from the corners that fit best: for each side of
/// `a` the side of `b` that it faces, and whether both lie on one line.
struct Facing {
    shared: [bool; 4],
}

impl Facing {
    fn new(a: &[Point2<f64>; 4], b: &[Point2<f64>; 4]) -> Self {
        let gap = |shift: usize| (0..4).map(|i| (a[i] - b[(i + shift) % 4]).norm()).sum::<f64>();
        let shift = (0..4).min_by(|x, y| gap(*x).total_cmp(&gap(*y))).unwrap_or(0);
        let shared = std::array::from_fn(|i| {
            let (from, side, j) = (a[i], a[(i + 1) % 4] - a[i], (i + shift) % 4);
            let off = |q: &Point2<f64>| side.perp(&(q - from)).abs() / side.norm();
            off(&b[j]) <= SHARED_SIDE_PX && off(&b[(j + 1) % 4]) <= SHARED_SIDE_PX
        });
        Self { shared }
    }

    fn count(&self) -> usize {
        self.shared.iter().filter(|s| **s).count()
    }
}

/// Lines closer than this count as the same side.
const SHARED_SIDE_PX: f64 = 4.0;

/// Keeps the quads that conflict with no better one: that cross none and share an edge with none.
///
/// Departs from method 3.4: its table of compatible quads is kept (disjoint and nested may stay,
/// crossing may not), but quads are taken greedily by rank instead of by relaxation over pairs.
pub fn suppress_overlaps(rated: Vec<ScoredQuad>, p: &QuadParams) -> Vec<Quad> {
    let mut result: Vec<Quad> = Vec::new();
    for quad in different(rated, p) {
        if !result.iter().any(|k| conflict(k.corners_px.points(), quad.corners_px.points())) {
            result.push(quad);
        }
    }
    result
}

/// The quads by rank, each once, at most [`MAX_RATED`].
fn different(mut rated: Vec<ScoredQuad>, p: &QuadParams) -> Vec<Quad> {
    rated.retain(|r| r.quad.score >= p.min_score);
    rated.sort_by(|a, b| {
        b.rank
            .total_cmp(&a.rank)
            .then(crate::detect::suppression::nested_borders::by_corners(&a.quad, &b.quad))
    });
    let mut different: Vec<Quad> = Vec::new();
    for r in rated {
        let corners = r.quad.corners_px.points();
        if different.len() < MAX_RATED && !different.iter().any(|d| same(d.corners_px.points(), corners)) {
            different.push(r.quad);
        }
    }
    different
}

/// Whether two quads conflict: they cross, or one edge would belong to both. Two borders of one
/// object differ on all four sides.
fn conflict(a: &[Point2<f64>; 4], b: &[Point2<f64>; 4]) -> bool {
    match polygon::relation(a, b, SHARED_SIDE_PX) {
        Relation::Disjoint => false,
        Relation::Crossing => true,
        Relation::Contains | Relation::Within => Facing::new(a, b).count() > 0,
    }
}

/// A quad with its sides moved to the likeliest border, and the features of its score.
#[derive(Debug, Clone)]
pub struct ClassifiedQuad {
    /// The quad; its score is the probability of the quad classifier.
    pub quad: Quad,
    /// See [`quad_features`].
    pub features: [f64; QUAD_FEATURES],
}

/// Moves the sides of the rated quads, by rank, to the lines that look most like borders, and
/// classifies them as objects. A quad that conflicts with one of at least `sure_probability` is
/// skipped. All classified quads are returned, at most [`MAX_CLASSIFIED`]. The previous border of a
/// quad stays among its alternates.
pub fn snap_sides(rated: Vec<ScoredQuad>, g: &Gradients, p: &QuadParams) -> Vec<ClassifiedQuad> {
    let border_model = p.side_network();
    let classifier = p.thing_network();
    let mut classified: Vec<ClassifiedQuad> = Vec::new();
    for quad in different(rated, p) {
        // A quad much larger than an object that it contains may still replace it.
        let taken = |q: &Quad| {
            let corners = q.corners_px.points();
            let objects = classified.iter().filter(|s| s.quad.score >= p.sure_probability);
            objects
                .map(|s| s.quad.corners_px.points())
                .any(|k| conflict_or_same(k, corners) && !is_part(k, corners))
        };
        if taken(&quad) {
            continue;
        }
        if classified.len() >= MAX_CLASSIFIED {
            break;
        }
        let Some(chosen) = choose_sides(g, quad.corners_px.points(), border_model) else { continue };
        let moved = moved(&quad, &chosen, g, p).filter(|q| !taken(q));
        let (quad, sides) = match moved {
            Some(moved) => (moved, &chosen.sides),
            None => (quad, &chosen.nearest),
        };
        let features = quad_features(sides, quad.corners_px.points(), quad.score, (g.width(), g.height()));
        let score = probability(classifier, &features);
        classified.push(ClassifiedQuad { quad: Quad { score, ..quad }, features });
    }
    classified
}

/// Non-maximum suppression by probability; above `sure_probability` by rank. Exception: a quad
/// replaces the quads that it conflicts with if all of them are parts of it (a window and its
/// panes) and none is clearly better.
pub fn suppress_non_maxima(mut classified: Vec<ClassifiedQuad>, p: &QuadParams) -> Vec<Quad> {
    let mut result: Vec<Quad> = Vec::new();
    let likely = |s: &ClassifiedQuad| s.quad.score.min(p.sure_probability);
    classified.retain(|s| s.quad.score >= p.min_asked_probability.min(p.min_probability));
    classified.sort_by(|a, b| likely(b).total_cmp(&likely(a)));
    for quad in classified.into_iter().map(|s| s.quad) {
        let corners = quad.corners_px.points();
        let conflicts = |k: &Quad| conflict_or_same(k.corners_px.points(), corners);
        let worst = |q: &Quad| q.side_support.iter().copied().fold(1.0, f64::min);
        let gives_way = |k: &Quad| {
            k.score <= quad.score + PART_SLACK
                && worst(k) <= worst(&quad) + SUPPORT_SLACK
                && is_part(k.corners_px.points(), corners)
        };
        if result.iter().filter(|k| conflicts(k)).all(gives_way) {
            result.retain(|k| !conflicts(k));
            result.push(quad);
        }
    }
    result
}

/// Whether two quads are the same or conflict.
fn conflict_or_same(a: &[Point2<f64>; 4], b: &[Point2<f64>; 4]) -> bool {
    overlap_exceeds(a, b, SAME_IOU) || conflict(a, b)
}

/// Whether `part` is cut from `whole` by a line across, as a pane from its window: three sides are
/// the same, and the whole is much larger.
fn is_part(part: &[Point2<f64>; 4], whole: &[Point2<f64>; 4]) -> bool {
    polygon::area(part) < MAX_PART * polygon::area(whole)
        && polygon::relation(whole, part, SHARED_SIDE_PX) == Relation::Contains
        && Facing::new(whole, part).count() == 3
}

/// A part may be this much likelier than its whole: probabilities near 1 differ by chance.
const PART_SLACK: f64 = 0.02;
/// Its worst side may have this much more support: one that runs over a gap between two panes is no
/// side.
const SUPPORT_SLACK: f64 = 0.06;
/// Largest area of a part as a share of the whole; above it they are the same object.
const MAX_PART: f64 = 0.6;

/// Most quads whose sides are moved.
pub const MAX_CLASSIFIED: usize = 80;
/// Quads that overlap by more than this are the same.
const SAME_IOU: f64 = 0.8;
/// A quad whose sides moved is still the same object if both overlap by this much.
const MOVED_IOU: f64 = 0.4;

/// The quad with its sides where they look most like a border; none if that is not a well supported
/// quad.
fn moved(quad: &Quad, chosen: &SnappedSides, g: &Gradients, p: &QuadParams) -> Option<Quad> {
    let before = quad.corners_px.points();
    let search = rating_search(p, p.refit_reach_px);
    let rated = rate_one(&refine(g, &chosen.corners_px, search)?, p)?;
    let after = rated.quad.corners_px.points();
    if !overlap_exceeds(before, after, MOVED_IOU) {
        return None;
    }
    let mut alternates = quad.alternates.clone();
    if !overlap_exceeds(before, after, SAME_BORDER_IOU) {
        alternates.insert(0, quad.corners_px);
    }
    Some(Quad { alternates, score: quad.score.max(rated.quad.score), ..rated.quad })
}

/// Borders that overlap by more are the same border.
const SAME_BORDER_IOU: f64 = 0.97;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        detect::{
            quad::QuadKind,
            refine::rating::{score_proposals, tests::squares},
        },
        geometry::corners::Corners,
    };
    use nalgebra::Matrix2;

    #[test]
    fn the_numbers_of_compared_and_classified_quads_are_bounded() {
        let (image, map, seeds) = squares(14);
        let g = Gradients { image: &image, gx: map.gx(), gy: map.gy() };
        // No quad is an object, so none suppresses another.
        let p = QuadParams { max_refitted: usize::MAX, sure_probability: 2.0, ..QuadParams::default() };
        let rated = score_proposals(&seeds, &g, &p);
        assert!(rated.len() > MAX_RATED && MAX_RATED > MAX_CLASSIFIED);
        assert_eq!(suppress_overlaps(rated.clone(), &p).len(), MAX_RATED);
        assert_eq!(snap_sides(rated.clone(), &g, &p).len(), MAX_CLASSIFIED);
        // Fewer are all classified.
        assert_eq!(snap_sides(rated[..MAX_CLASSIFIED - 1].to_vec(), &g, &p).len(), MAX_CLASSIFIED - 1);
    }

    fn classified_quad([left, top, right, bottom]: [f64; 4], score: f64, support: f64) -> ClassifiedQuad {
        let corners = [[left, top], [right, top], [right, bottom], [left, bottom]];
        let quad = Quad {
            corners_px: Corners::try_from(corners).unwrap(),
            corner_covariance_px2: [Matrix2::identity(); 4],
            side_support: [1.0, support, 1.0, 1.0],
            side_clipped: [false; 4],
            score,
            kind: QuadKind::Full,
            upright_ambiguous: false,
            alternates: Vec::new(),
        };
        ClassifiedQuad { quad, features: [0.0; QUAD_FEATURES] }
    }

    fn params() -> QuadParams {
        QuadParams {
            min_probability: 0.5,
            min_asked_probability: 0.5,
            sure_probability: 0.98,
            ..QuadParams::default()
        }
    }

    const WINDOW: [f64; 4] = [20.0, 20.0, 120.0, 160.0];

    #[test]
    fn a_window_replaces_its_panes() {
        let panes = || {
            vec![
                classified_quad([20.0, 20.0, 120.0, 90.0], 0.99, 1.0),
                classified_quad([20.0, 90.0, 120.0, 160.0], 0.9, 1.0),
            ]
        };
        let result = |whole: ClassifiedQuad| {
            let mut all = panes();
            all.push(whole);
            suppress_non_maxima(all, &params())
        };
        let found = result(classified_quad(WINDOW, 0.98, 0.95));
        assert_eq!(found.len(), 1);
        assert!(found[0].corners_px.area_px2() > 13_900.0, "{found:?}");
        // Not when it is less likely, when a side runs over a gap, or when it reaches further than
        // the panes.
        for whole in [
            classified_quad(WINDOW, 0.9, 1.0),
            classified_quad(WINDOW, 0.98, 0.85),
            classified_quad([0.0, 20.0, 120.0, 180.0], 0.98, 1.0),
            classified_quad(WINDOW, 0.4, 1.0),
        ] {
            assert_eq!(result(whole).len(), 2);
        }
        // A quad hardly larger than an existing one is the same object.
        let same =
            vec![classified_quad(WINDOW, 0.985, 1.0), classified_quad([20.0, 20.0, 120.0, 210.0], 0.99, 1.0)];
        assert!(suppress_non_maxima(same, &params())[0].corners_px.area_px2() < 14_100.0);
    }

    #[test]
    fn of_conflicting_quads_the_most_probable_stays() {
        let beside = [60.0, 0.0, 160.0, 140.0];
        let left = |first: f64, second: f64| {
            let found = suppress_non_maxima(
                vec![classified_quad(WINDOW, first, 1.0), classified_quad(beside, second, 1.0)],
                &params(),
            );
            found.iter().map(|q| q.corners_px.points()[0].x).collect::<Vec<_>>()
        };
        assert_eq!(left(0.9, 0.95), [60.0]);
        assert_eq!(left(0.95, 0.9), [20.0]);
        // Of two with a sure probability the one of higher rank, which comes first.
        assert_eq!(left(0.985, 0.99), [20.0]);
        assert!(left(0.4, 0.45).is_empty());
    }
}
