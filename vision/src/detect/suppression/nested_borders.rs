//! The canonical border of an object (method 3.6). Frames, mats and canvases give nested near-equal
//! quads, and an icon must not flip between them. In: quads. Out: of each group the outermost that
//! edges support well; the others are alternates.

use crate::{
    detect::{proposals::quad_seed::overlap_exceeds, quad::Quad},
    geometry::polygon::{self, Relation},
};

/// Most alternates kept for a quad, the outermost first.
pub const MAX_ALTERNATES: usize = 8;

/// Groups `quads` and merges each group into one. Output order: by descending score, then by
/// corners.
pub fn canonical(mut quads: Vec<Quad>, nested_iou: f64, min_support: f64, tolerance_px: f64) -> Vec<Quad> {
    quads.sort_by(|a, b| b.corners_px.area_px2().total_cmp(&a.corners_px.area_px2()).then(by_corners(a, b)));
    let mut groups: Vec<Vec<Quad>> = Vec::new();
    for quad in quads {
        // The largest member comes first, so a later quad can only lie within it.
        let home = groups.iter_mut().find(|group| {
            let (outer, inner) = (group[0].corners_px.points(), quad.corners_px.points());
            group[0].kind == quad.kind
                && overlap_exceeds(outer, inner, nested_iou)
                && polygon::relation(outer, inner, tolerance_px) == Relation::Contains
        });
        match home {
            Some(group) => group.push(quad),
            None => groups.push(vec![quad]),
        }
    }
    let mut chosen: Vec<Quad> = groups.into_iter().map(|g| merge(g, min_support)).collect();
    chosen.sort_by(|a, b| b.score.total_cmp(&a.score).then(by_corners(a, b)));
    chosen
}

/// The outermost well supported member; without one, the best supported. The rest become its
/// alternates.
fn merge(group: Vec<Quad>, min_support: f64) -> Quad {
    let worst_side = |q: &Quad| q.side_support.iter().copied().fold(1.0, f64::min);
    let pick = group.iter().position(|q| worst_side(q) >= min_support).unwrap_or_else(|| {
        (0..group.len())
            .fold(0, |best, i| if worst_side(&group[i]) > worst_side(&group[best]) { i } else { best })
    });
    let of_member =
        |i: usize| group[i].alternates.iter().copied().chain((i != pick).then_some(group[i].corners_px));
    let mut rest: Vec<_> = (0..group.len()).flat_map(of_member).collect();
    rest.sort_by(|a, b| b.area_px2().total_cmp(&a.area_px2()));
    rest.truncate(MAX_ALTERNATES);
    let mut quad = group.into_iter().nth(pick).expect("pick is an index of the group");
    quad.alternates = rest;
    quad
}

/// A total order on corners, to break ties.
pub(crate) fn by_corners(a: &Quad, b: &Quad) -> std::cmp::Ordering {
    let key = |q: &Quad| q.corners_px.points().map(|p| [p.x, p.y]);
    let (a, b) = (key(a), key(b));
    a.iter()
        .flatten()
        .zip(b.iter().flatten())
        .map(|(x, y)| x.total_cmp(y))
        .find(|o| o.is_ne())
        .unwrap_or(std::cmp::Ordering::Equal)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{detect::quad::QuadKind, geometry::corners::Corners};
    use nalgebra::Matrix2;

    fn nested(inset: f64, support: f64) -> Quad {
        let (low, high) = (inset, 200.0 - inset);
        Quad {
            corners_px: Corners::try_from([[low, low], [high, low], [high, high], [low, high]]).unwrap(),
            corner_covariance_px2: [Matrix2::identity(); 4],
            side_support: [1.0, 1.0, support, 1.0],
            side_clipped: [false; 4],
            score: support,
            kind: QuadKind::Full,
            upright_ambiguous: false,
            alternates: Vec::new(),
        }
    }

    #[test]
    fn the_outermost_supported_border_wins() {
        let quads = canonical(vec![nested(10.0, 0.9), nested(0.0, 0.5), nested(5.0, 0.6)], 0.6, 0.6, 4.0);
        assert_eq!(quads.len(), 1);
        assert_eq!(quads[0].corners_px, nested(5.0, 0.6).corners_px);
        assert_eq!(quads[0].alternates, vec![nested(0.0, 0.5).corners_px, nested(10.0, 0.9).corners_px]);
        // Without a supported one the best supported.
        let weak = canonical(vec![nested(10.0, 0.4), nested(0.0, 0.3)], 0.6, 0.6, 4.0);
        assert_eq!(weak[0].corners_px, nested(10.0, 0.4).corners_px);
    }

    #[test]
    fn a_small_quad_inside_is_another_object() {
        assert_eq!(canonical(vec![nested(0.0, 0.9), nested(60.0, 0.9)], 0.6, 0.6, 4.0).len(), 2);
    }

    #[test]
    fn the_number_of_alternates_is_bounded() {
        let many = (0..MAX_ALTERNATES + 4).map(|i| nested(i as f64, 0.9)).collect();
        let quads = canonical(many, 0.6, 0.6, 4.0);
        assert_eq!(quads.len(), 1);
        assert_eq!(quads[0].alternates.len(), MAX_ALTERNATES);
    }
}
