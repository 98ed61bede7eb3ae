//! Which labelled quads are easy to see: a picture and a label in, yes or no out.

use crate::evaluate::truth::TruthQuad;
use nalgebra::Point2;
use vision::{frame::GrayImage, geometry::Corners};

/// The shortest side of an easy quad is longer than this, in pixels.
pub(super) const MIN_SIDE_PX: f64 = 60.0;
/// Along each side of an easy quad, inside and outside differ by more than this, in grey levels.
pub(super) const MIN_CONTRAST: f64 = 20.0;

/// Samples along a side.
const SAMPLES: usize = 64;
/// Share of a side next to each corner that is left out.
const CORNER_SHARE: f64 = 0.1;
/// Distances from a side at which grey levels are read, in pixels: past the blur of the edge
/// itself.
const BESIDE_PX: [f64; 3] = [2.0, 3.0, 4.0];

/// Whether the quad counts, is large, and has contrast along all four sides.
pub(super) fn is_easy(image: &GrayImage, quad: &TruthQuad) -> bool {
    quad.counts() && quad.corners.min_side_px() > MIN_SIDE_PX && contrast(image, &quad.corners) > MIN_CONTRAST
}

/// The least, over the sides, of the difference between the mean grey levels inside and outside.
fn contrast(image: &GrayImage, corners: &Corners) -> f64 {
    let c = corners.points();
    (0..4).map(|i| side_contrast(image, &c[i], &c[(i + 1) % 4])).fold(f64::INFINITY, f64::min)
}

/// 0 where the image does not show both sides of the edge.
fn side_contrast(image: &GrayImage, from: &Point2<f64>, to: &Point2<f64>) -> f64 {
    let side = to - from;
    let outwards = nalgebra::Vector2::new(side.y, -side.x) / side.norm();
    let mean = |sign: f64| {
        let along = (0..SAMPLES)
            .map(|i| CORNER_SHARE + (1.0 - 2.0 * CORNER_SHARE) * (i as f64 + 0.5) / SAMPLES as f64);
        let places = along.flat_map(|t| BESIDE_PX.map(|d| from + side * t + outwards * (sign * d)));
        let levels: Vec<f64> = places.filter_map(|at| level(image, &at)).collect();
        (!levels.is_empty()).then(|| levels.iter().sum::<f64>() / levels.len() as f64)
    };
    match (mean(1.0), mean(-1.0)) {
        (Some(outside), Some(inside)) => (outside - inside).abs(),
        _ => 0.0,
    }
}

/// The grey level of the pixel that holds a point; `None` outside of the image.
fn level(image: &GrayImage, at: &Point2<f64>) -> Option<f64> {
    let (u, v) = (at.x.round(), at.y.round());
    let is_inside = u >= 0.0 && v >= 0.0 && u < image.width() as f64 && v < image.height() as f64;
    is_inside.then(|| f64::from(image.data()[v as usize * image.width() + u as usize]))
}

#[cfg(test)]
mod tests {
    use super::{super::score::tests::corners, *};
    use crate::evaluate::truth::QuadState;

    fn label(corners: Corners) -> TruthQuad {
        let state = QuadState::Full;
        TruthQuad { corners, landmark: None, state, class: None, counted: true, view_angle_rad: None }
    }

    /// A card of 80 x 100 px at (40, 30) on a wall of 120, whose lower half of the wall is `below`.
    fn card(level: u8, below: u8) -> GrayImage {
        GrayImage::from_fn(200, 180, move |u, v| match (u, v) {
            (40..120, 30..130) => level,
            (_, 100..) => below,
            _ => 120,
        })
    }

    #[test]
    fn easy_is_large_whole_and_has_contrast_on_all_sides() {
        let whole = label(corners(39.5, 29.5, 80.0, 100.0));
        assert!((contrast(&card(90, 120), &whole.corners) - 30.0).abs() < 1e-9);
        assert!(is_easy(&card(99, 120), &whole));
        assert!(!is_easy(&card(101, 120), &whole), "too faint");
        assert!(!is_easy(&card(90, 95), &whole), "the lower side has no contrast");
        let small = label(corners(39.5, 29.5, 59.0, 100.0));
        let narrow = GrayImage::from_fn(200, 180, |u, v| match (u, v) {
            (40..99, 30..130) => 20,
            _ => 120,
        });
        assert!(!is_easy(&narrow, &small), "a side is too short");
        for hard in [
            TruthQuad { state: QuadState::Occluded, ..whole.clone() },
            TruthQuad { counted: false, ..whole.clone() },
        ] {
            assert!(!is_easy(&card(90, 120), &hard));
        }
    }
}
