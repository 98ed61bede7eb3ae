//! Hand-made segments and rendered quads for this module's tests.

use crate::{detect::segments::edge_segments::EdgeSegment, frame::GrayImage};
use nalgebra::{Point2, Vector2};

/// A segment between two points, as an ideal extractor would give it. The brighter side is right of
/// p to q.
pub(crate) fn segment(p: [f64; 2], q: [f64; 2]) -> EdgeSegment {
    let (p_px, q_px) = (Point2::from(p), Point2::from(q));
    let along = (q_px - p_px).normalize();
    let normal = Vector2::new(-along.y, along.x);
    let theta = along.y.atan2(along.x).rem_euclid(std::f64::consts::PI);
    EdgeSegment {
        p_px,
        q_px,
        length_px: (q_px - p_px).norm(),
        theta_rad: theta,
        normal,
        rho_px: normal.dot(&p_px.coords),
        contrast: 50.0,
        support: (q_px - p_px).norm() as usize,
        chain: 0,
        theta_variance: 1e-6,
        offset_variance: 0.01,
        clipped: false,
    }
}

/// The four sides of a quad, each shortened by `gap_px` at both ends.
pub(crate) fn sides(corners: [[f64; 2]; 4], gap_px: f64) -> Vec<EdgeSegment> {
    (0..4)
        .map(|i| {
            let (a, b) = (Point2::from(corners[i]), Point2::from(corners[(i + 1) % 4]));
            let cut = (b - a).normalize() * gap_px;
            segment((a + cut).into(), (b - cut).into())
        })
        .collect()
}

/// Renders clockwise convex polygons over a background, later ones on top, with 4 x 4 samples a
/// pixel.
pub(crate) fn render(
    width: usize,
    height: usize,
    background: u8,
    quads: &[([[f64; 2]; 4], u8)],
) -> GrayImage {
    let quads: Vec<_> = quads.iter().map(|(c, level)| (c.map(Point2::from), f64::from(*level))).collect();
    GrayImage::from_fn(width, height, |u, v| {
        let mut sum = 0.0;
        for i in 0..16 {
            let at = |i: usize| (i as f64 + 0.5) / 4.0 - 0.5;
            let p = Point2::new(u as f64 + at(i % 4), v as f64 + at(i / 4));
            let inside =
                |c: &[Point2<f64>; 4]| (0..4).all(|i| (c[(i + 1) % 4] - c[i]).perp(&(p - c[i])) >= 0.0);
            sum += quads.iter().rev().find(|(c, _)| inside(c)).map_or(f64::from(background), |q| q.1);
        }
        (sum / 16.0).round() as u8
    })
}
