//! Convex polygons as slices of vertices: area, intersection, overlap and the relations used by the
//! constraint tables. Vertices run clockwise on screen (u right, v down), as in
//! [`crate::geometry::corners::Corners`]; for the measures the other direction works as well. Does
//! not handle concave or self-crossing polygons.

use nalgebra::{Point2, Vector2};

/// Area in px^2, zero or more.
pub fn area(polygon: &[Point2<f64>]) -> f64 {
    signed_area(polygon).abs()
}

/// Area in px^2, positive when the vertices run clockwise on screen.
pub fn signed_area(polygon: &[Point2<f64>]) -> f64 {
    let Some(first) = polygon.first() else { return 0.0 };
    edges(polygon).map(|(a, b)| 0.5 * (a - first).perp(&(b - first))).sum()
}

/// Area common to two convex polygons, in px^2.
pub fn intersection_area(a: &[Point2<f64>], b: &[Point2<f64>]) -> f64 {
    if a.len() < 3 || b.len() < 3 || boxes_apart(a, b) {
        return 0.0;
    }
    let turn = signed_area(b).signum();
    // Each side of one cuts off corners of the other and adds at most one.
    if a.len() + b.len() <= SMALL {
        let (mut part, mut next) = (&mut [Point2::origin(); SMALL], &mut [Point2::origin(); SMALL]);
        part[..a.len()].copy_from_slice(a);
        let mut n = a.len();
        for side in edges(b) {
            let mut vertices = 0;
            cut(&part[..n], side, turn, |p| {
                // Rounding can make a polygon concave; a surplus corner is dropped, its area is
                // negligible.
                if let Some(place) = next.get_mut(vertices) {
                    (*place, vertices) = (p, vertices + 1);
                }
            });
            n = vertices;
            std::mem::swap(&mut part, &mut next);
        }
        return area(&part[..n]);
    }
    let mut part = a.to_vec();
    for side in edges(b) {
        let mut next = Vec::with_capacity(part.len() + 1);
        cut(&part, side, turn, |p| next.push(p));
        part = next;
    }
    area(&part)
}

/// Polygons with up to this many vertices in all are clipped in memory of fixed size.
const SMALL: usize = 12;

/// The vertices of the part of a polygon inside the line of a side of another of this orientation.
#[inline]
fn cut(
    polygon: &[Point2<f64>],
    (from, to): (&Point2<f64>, &Point2<f64>),
    turn: f64,
    mut keep: impl FnMut(Point2<f64>),
) {
    let inside = |p: &Point2<f64>| turn * (to - from).perp(&(p - from));
    let Some(mut p) = polygon.last() else { return };
    let mut dp = inside(p);
    for q in polygon {
        let dq = inside(q);
        if (dp > 0.0 && dq < 0.0) || (dp < 0.0 && dq > 0.0) {
            keep(p + (q - p) * (dp / (dp - dq)));
        }
        if dq >= 0.0 {
            keep(*q);
        }
        (p, dp) = (q, dq);
    }
}

/// Intersection over union of two convex polygons, 0 to 1; 0 when both are empty.
pub fn iou(a: &[Point2<f64>], b: &[Point2<f64>]) -> f64 {
    let (area_a, area_b) = (area(a), area(b));
    let common = intersection_area(a, b);
    let union = area_a + area_b - common;
    if union > 0.0 { (common / union).clamp(0.0, 1.0) } else { 0.0 }
}

/// Whether `point` lies inside a convex polygon or at most `tolerance_px` outside any of its sides.
pub fn contains(polygon: &[Point2<f64>], point: &Point2<f64>, tolerance_px: f64) -> bool {
    let turn = signed_area(polygon).signum();
    polygon.len() >= 3
        && edges(polygon).all(|(a, b)| {
            let side = b - a;
            turn * side.perp(&(point - a)) >= -tolerance_px * side.norm()
        })
}

/// Whether the vertices, in either direction, make a strictly convex polygon: every corner turns
/// the same way, and once round in all.
pub fn is_convex(polygon: &[Point2<f64>]) -> bool {
    let n = polygon.len();
    if n < 3 {
        return false;
    }
    let turn = signed_area(polygon).signum();
    let corners_turn = (0..n).all(|i| {
        let (a, b, c) = (polygon[i], polygon[(i + 1) % n], polygon[(i + 2) % n]);
        turn * (b - a).perp(&(c - b)) > 0.0
    });
    // A star turns the same way at every corner too, but leaves its vertices outside some edge.
    corners_turn && polygon.iter().all(|p| contains(polygon, p, 1e-9))
}

/// How two convex polygons lie, up to a tolerance.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Relation {
    /// No common area.
    Disjoint,
    /// The second lies in the first.
    Contains,
    /// The first lies in the second.
    Within,
    /// Anything else.
    Crossing,
}

/// Relation of two convex polygons. Disjoint: shrunk by `tolerance_px` each they do not meet (an
/// edge's normal separates them). Nested: every vertex of the inner one lies at most `tolerance_px`
/// outside the outer one.
pub fn relation(a: &[Point2<f64>], b: &[Point2<f64>], tolerance_px: f64) -> Relation {
    if separated(a, b, tolerance_px) || separated(b, a, tolerance_px) {
        Relation::Disjoint
    } else if b.iter().all(|p| contains(a, p, tolerance_px)) {
        Relation::Contains
    } else if a.iter().all(|p| contains(b, p, tolerance_px)) {
        Relation::Within
    } else {
        Relation::Crossing
    }
}

/// Whether the normal of an edge of `a` separates the polygons, up to an overlap of twice the
/// tolerance.
fn separated(a: &[Point2<f64>], b: &[Point2<f64>], tolerance_px: f64) -> bool {
    let turn = signed_area(a).signum();
    edges(a).any(|(p, q)| {
        let side = q - p;
        let inward = Vector2::new(-side.y, side.x) * turn / side.norm().max(f64::MIN_POSITIVE);
        b.iter().all(|v| inward.dot(&(v - p)) <= 2.0 * tolerance_px)
    })
}

fn boxes_apart(a: &[Point2<f64>], b: &[Point2<f64>]) -> bool {
    let (a_low, a_high) = bounds(a);
    let (b_low, b_high) = bounds(b);
    a_high.x < b_low.x || b_high.x < a_low.x || a_high.y < b_low.y || b_high.y < a_low.y
}

/// Corners of the axis-parallel bounding box: smallest and largest coordinates.
pub fn bounds(polygon: &[Point2<f64>]) -> (Point2<f64>, Point2<f64>) {
    let mut low = Point2::new(f64::INFINITY, f64::INFINITY);
    let mut high = Point2::new(f64::NEG_INFINITY, f64::NEG_INFINITY);
    for p in polygon {
        low = low.inf(p);
        high = high.sup(p);
    }
    (low, high)
}

fn edges(polygon: &[Point2<f64>]) -> impl Iterator<Item = (&Point2<f64>, &Point2<f64>)> {
    polygon.iter().zip(polygon.iter().cycle().skip(1))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn rectangle(u: f64, v: f64, width: f64, height: f64) -> [Point2<f64>; 4] {
        [[u, v], [u + width, v], [u + width, v + height], [u, v + height]].map(Point2::from)
    }

    /// Share of cell centres of a fine grid that a predicate accepts, times the grid's area: an
    /// oracle independent of clipping.
    fn grid_area(low: f64, high: f64, inside: impl Fn(&Point2<f64>) -> bool) -> f64 {
        let n = 500;
        let cell = (high - low) / f64::from(n);
        let at = |i: i32| low + (f64::from(i) + 0.5) * cell;
        (0..n * n).filter(|i| inside(&Point2::new(at(i % n), at(i / n)))).count() as f64 * cell * cell
    }

    /// Even-odd rule, independent of orientation tests by edge normals.
    fn ray_inside(polygon: &[Point2<f64>], p: &Point2<f64>) -> bool {
        edges(polygon)
            .filter(|(a, b)| {
                (a.y > p.y) != (b.y > p.y) && p.x < (b.x - a.x) * (p.y - a.y) / (b.y - a.y) + a.x
            })
            .count()
            % 2
            == 1
    }

    #[test]
    fn areas_of_rectangles() {
        let (a, b) = (rectangle(0.0, 0.0, 10.0, 8.0), rectangle(5.0, 4.0, 10.0, 8.0));
        assert!((area(&a) - 80.0).abs() < 1e-12);
        assert!((intersection_area(&a, &b) - 20.0).abs() < 1e-12);
        assert!((iou(&a, &b) - 20.0 / 140.0).abs() < 1e-12);
        assert!(iou(&a, &rectangle(20.0, 0.0, 5.0, 5.0)) < 1e-12);
        assert!((iou(&a, &a) - 1.0).abs() < 1e-12);
        assert!(iou(&[], &a) < 1e-12);
    }

    #[test]
    fn polygons_of_many_sides_are_clipped() {
        let round = |u: f64, sides: u32| -> Vec<Point2<f64>> {
            let angles = (0..sides).map(|i| std::f64::consts::TAU * f64::from(i) / f64::from(sides));
            angles.map(|a| Point2::new(u + 30.0 * a.cos(), 30.0 * a.sin())).collect()
        };
        // Either as many vertices as fit in fixed memory, or more.
        for sides in [SMALL as u32 / 2, 20] {
            let (a, b) = (round(-10.0, sides), round(10.0, sides));
            let counted = grid_area(-45.0, 45.0, |p| ray_inside(&a, p) && ray_inside(&b, p));
            assert!((intersection_area(&a, &b) - counted).abs() < 0.01 * area(&a));
        }
    }

    #[test]
    fn convexity_of_known_shapes() {
        assert!(is_convex(&rectangle(0.0, 0.0, 2.0, 1.0)));
        let dart = [[0.0, 0.0], [10.0, 0.0], [2.0, 2.0], [0.0, 10.0]].map(Point2::from);
        assert!(!is_convex(&dart));
        let crossed = [[0.0, 0.0], [10.0, 8.0], [10.0, 0.0], [0.0, 8.0]].map(Point2::from);
        assert!(!is_convex(&crossed));
        let star: Vec<_> = (0..5)
            .map(|i| f64::from(i) * 144.0_f64.to_radians())
            .map(|a| Point2::new(a.cos(), a.sin()))
            .collect();
        assert!(!is_convex(&star));
        let flat = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]].map(Point2::from);
        assert!(!is_convex(&flat));
    }

    #[test]
    fn relations_with_tolerance() {
        let a = rectangle(0.0, 0.0, 100.0, 100.0);
        assert_eq!(relation(&a, &rectangle(10.0, 10.0, 50.0, 50.0), 4.0), Relation::Contains);
        assert_eq!(relation(&rectangle(10.0, 10.0, 50.0, 50.0), &a, 4.0), Relation::Within);
        assert_eq!(relation(&a, &rectangle(-3.0, 10.0, 50.0, 50.0), 4.0), Relation::Contains);
        assert_eq!(relation(&a, &rectangle(-5.0, 10.0, 50.0, 50.0), 4.0), Relation::Crossing);
        assert_eq!(relation(&a, &rectangle(93.0, 0.0, 50.0, 50.0), 4.0), Relation::Disjoint);
        assert_eq!(relation(&a, &rectangle(91.0, 0.0, 50.0, 50.0), 4.0), Relation::Crossing);
    }

    fn quad() -> impl Strategy<Value = [Point2<f64>; 4]> {
        // Points on four quarters of a circle, hence convex, then squeezed.
        (
            prop::array::uniform4(0.05..0.95_f64),
            10.0..40.0_f64,
            -20.0..20.0_f64,
            -20.0..20.0_f64,
            0.3..1.0_f64,
        )
            .prop_map(|(t, radius, u, v, squeeze)| {
                std::array::from_fn(|i| {
                    let angle = (i as f64 + t[i]) * std::f64::consts::FRAC_PI_2;
                    Point2::new(u + radius * angle.cos(), v + radius * squeeze * angle.sin())
                })
            })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]
        #[test]
        fn clipping_agrees_with_grid_counting(a in quad(), b in quad()) {
            prop_assert!(is_convex(&a) && is_convex(&b));
            let counted = grid_area(-65.0, 65.0, |p| ray_inside(&a, p) && ray_inside(&b, p));
            prop_assert!((intersection_area(&a, &b) - counted).abs() < 0.01 * area(&a).max(area(&b)) + 4.0);
            prop_assert!((iou(&a, &b) - iou(&b, &a)).abs() < 1e-9);
            let mut reversed = b;
            reversed.reverse();
            prop_assert!((iou(&a, &b) - iou(&a, &reversed)).abs() < 1e-9);
        }

        #[test]
        fn containment_agrees_with_ray_casting(a in quad(), u in -60.0..60.0_f64, v in -60.0..60.0_f64) {
            let p = Point2::new(u, v);
            prop_assert_eq!(contains(&a, &p, 0.0), ray_inside(&a, &p));
        }
    }
}
