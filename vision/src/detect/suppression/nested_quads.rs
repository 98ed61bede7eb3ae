//! Quads inside other quads (method 3.6): the content of a picture or a text box on it is no
//! landmark, a poster on a door may be one. In: chosen quads. Out: the same with inner quads as
//! alternates of the outer one, which recognition tries as well.

use crate::{
    detect::{
        quad::{Quad, QuadKind},
        suppression::nested_borders::by_corners,
    },
    geometry::polygon::{self, Relation},
};

/// Most alternates of a quad including inner quads: the number of further borders that recognition
/// tries. Inner quads beyond it stay quads.
pub const MAX_WITH_NESTED: usize = 5;
/// Two disjoint quads inside that score at least this share of the outer one make it a container: a
/// window round its panes, a wall panel round its pictures.
const CONTENT_SCORE_SHARE: f64 = 0.65;
/// A quad may score this much less than an inner one and still absorb it: probabilities near 1
/// differ by chance.
const SCORE_SLACK: f64 = 0.1;

/// Makes every quad inside a better one an alternate of it, outermost first. A quad that scores
/// clearly less than the one inside absorbs nothing, nor does a container. Output order: by
/// descending score, then by corners.
pub fn absorb(mut quads: Vec<Quad>, tolerance_px: f64) -> Vec<Quad> {
    quads.sort_by(|a, b| b.corners_px.area_px2().total_cmp(&a.corners_px.area_px2()).then(by_corners(a, b)));
    let mut result: Vec<Quad> = Vec::new();
    while !quads.is_empty() {
        // The largest of those left; only a smaller one can lie inside.
        let mut outer = quads.remove(0);
        let lies_inside = |q: &Quad| {
            outer.kind == QuadKind::Full
                && q.kind == QuadKind::Full
                && relation(&outer, q, tolerance_px) == Relation::Contains
        };
        let inner: Vec<usize> = (0..quads.len()).filter(|i| lies_inside(&quads[*i])).collect();
        let content: Vec<&Quad> = inner
            .iter()
            .map(|i| &quads[*i])
            .filter(|q| q.score >= CONTENT_SCORE_SHARE * outer.score)
            .collect();
        let container = content.iter().enumerate().any(|(i, a)| {
            content[i + 1..].iter().any(|b| relation(a, b, tolerance_px) == Relation::Disjoint)
        });
        if !container {
            let mut taken = vec![false; quads.len()];
            for i in inner {
                let fits = outer.alternates.len() + 1 + quads[i].alternates.len() <= MAX_WITH_NESTED;
                if fits && outer.score + SCORE_SLACK >= quads[i].score {
                    outer.alternates.push(quads[i].corners_px);
                    outer.alternates.append(&mut quads[i].alternates);
                    taken[i] = true;
                }
            }
            let mut taken = taken.into_iter();
            quads.retain(|_| !taken.next().unwrap_or(false));
            outer.alternates.sort_by(|a, b| b.area_px2().total_cmp(&a.area_px2()));
        }
        result.push(outer);
    }
    result.sort_by(|a, b| b.score.total_cmp(&a.score).then(by_corners(a, b)));
    result
}

fn relation(a: &Quad, b: &Quad, tolerance_px: f64) -> Relation {
    polygon::relation(a.corners_px.points(), b.corners_px.points(), tolerance_px)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::corners::Corners;
    use nalgebra::Matrix2;

    fn quad([left, top, right, bottom]: [f64; 4], score: f64) -> Quad {
        Quad {
            corners_px: Corners::try_from([[left, top], [right, top], [right, bottom], [left, bottom]])
                .unwrap(),
            corner_covariance_px2: [Matrix2::identity(); 4],
            side_support: [1.0; 4],
            side_clipped: [false; 4],
            score,
            kind: QuadKind::Full,
            upright_ambiguous: false,
            alternates: Vec::new(),
        }
    }

    const DOOR: [f64; 4] = [0.0, 0.0, 200.0, 400.0];
    const POSTER: [f64; 4] = [60.0, 80.0, 140.0, 180.0];

    #[test]
    fn a_poster_becomes_an_alternate_of_its_door() {
        let mut poster = quad(POSTER, 0.9);
        let mat = quad([65.0, 85.0, 135.0, 175.0], 0.9).corners_px;
        poster.alternates = vec![mat];
        let text = quad([80.0, 100.0, 120.0, 130.0], 0.9);
        let quads = absorb(vec![text.clone(), poster.clone(), quad(DOOR, 0.9)], 4.0);
        assert_eq!(quads.len(), 1);
        assert_eq!(quads[0].corners_px, quad(DOOR, 0.9).corners_px);
        assert_eq!(quads[0].alternates, vec![poster.corners_px, mat, text.corners_px]);
    }

    #[test]
    fn a_less_probable_outer_quad_absorbs_nothing() {
        assert_eq!(absorb(vec![quad(DOOR, 0.79), quad(POSTER, 0.9)], 4.0).len(), 2);
    }

    #[test]
    fn a_container_absorbs_nothing() {
        let below = [60.0, 200.0, 140.0, 300.0];
        let quads = |score| vec![quad(DOOR, 1.0), quad(POSTER, 0.9), quad(below, score)];
        assert_eq!(absorb(quads(0.66), 4.0).len(), 3);
        // One of the two scores low: the other is the only content.
        assert_eq!(absorb(quads(0.64), 4.0).len(), 1);
    }

    #[test]
    fn quads_beside_each_other_and_sets_of_three_sides_stay() {
        let beside = quad([220.0, 0.0, 300.0, 100.0], 0.7);
        let three = Quad { kind: QuadKind::ThreeSided, ..quad(POSTER, 0.5) };
        assert_eq!(absorb(vec![quad(DOOR, 0.9), beside, three], 4.0).len(), 3);
    }

    #[test]
    fn no_quad_has_more_alternates_than_recognition_tries() {
        let nest = |n: usize| {
            let ring = |i: usize| {
                let inset = 12.0 * i as f64;
                quad([inset, inset, 300.0 - inset, 300.0 - inset], 0.9)
            };
            absorb((0..n).map(ring).collect(), 4.0)
        };
        assert_eq!(nest(MAX_WITH_NESTED + 1).len(), 1);
        let over = nest(MAX_WITH_NESTED + 2);
        assert_eq!(over.iter().map(|q| q.alternates.len()).max(), Some(MAX_WITH_NESTED));
        // Inner quads beyond the bound stay quads.
        assert_eq!(over.len(), 2);
    }
}
