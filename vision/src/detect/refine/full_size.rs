//! Refits sides at full resolution: quads of a large image are detected at a working scale, where
//! localisation is several times coarser. In: quads in coordinates of the full image. Out: the same
//! quads with refined corners, none dropped.

use crate::{
    detect::{
        edge_buffers::DetectBuffers,
        edge_support::gradients::Gradients,
        params::{DetectParams, QuadParams},
        quad::{Quad, QuadKind},
        refine::refit::refit_corners,
    },
    frame::{GrayImage, Picture, PictureRef},
    geometry::corners::Corners,
};
use nalgebra::Vector2;

/// Search distance of sides, in pixels of the working scale.
const REACH_WORKING_PX: f64 = 1.0;
/// Pixels around a quad that its gradients need: the filter forgets within ten.
const MARGIN_PX: usize = 12;
/// Cut-outs of all quads together are at most this many images large; the best quads come first.
const MAX_CUT_SHARE: usize = 2;

/// Refits the four-sided quads of an image whose working scale was `factor` times smaller.
pub(crate) fn at_full_size(
    quads: Vec<Quad>,
    image: PictureRef,
    factor: usize,
    p: &DetectParams,
    memory: &mut DetectBuffers,
) -> Vec<Quad> {
    if factor <= 1 {
        return quads;
    }
    let reach_px = p.quads.refit_reach_px.max(REACH_WORKING_PX * factor as f64);
    let search = QuadParams { refit_reach_px: reach_px, ..p.quads.clone() };
    let mut left_px = MAX_CUT_SHARE * image.width() * image.height();
    let refitted = |quad: Quad| {
        let margin = reach_px.ceil() as usize + MARGIN_PX;
        let window = Window::around(&quad.corners_px, margin, (image.width(), image.height()));
        let Some(rest) = left_px.checked_sub(window.area_px()).filter(|_| quad.kind == QuadKind::Full) else {
            return quad;
        };
        left_px = rest;
        let cut = window.cut(image);
        let map = memory.edges((&cut).into(), &p.edges);
        let g = Gradients { image: cut.grey(), gx: map.gx(), gy: map.gy() };
        let sharp = window.moved(&quad.corners_px, -1.0).map(|corners_px| {
            let here = Quad { corners_px, alternates: Vec::new(), ..quad.clone() };
            refit_corners(here, &g, &search)
        });
        memory.give_back(map);
        let back = sharp.and_then(|s| Some(Quad { corners_px: window.moved(&s.corners_px, 1.0)?, ..s }));
        match back {
            Some(sharp) => Quad { alternates: quad.alternates, ..sharp },
            None => quad,
        }
    };
    quads.into_iter().map(refitted).collect()
}

/// A part of an image: its top-left pixel and its size.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Window {
    left: usize,
    top: usize,
    width: usize,
    height: usize,
}

impl Window {
    /// The bounding box of the corners, wider by `margin` on all sides, clipped to an image of some
    /// size. It touches the image border only where the quad is near it, so no other quad is taken
    /// for clipped.
    fn around(corners: &Corners, margin: usize, (width, height): (usize, usize)) -> Self {
        let span = |at: fn(&nalgebra::Point2<f64>) -> f64, size: usize| {
            let values = corners.points().map(|c| at(&c));
            let low = values.into_iter().fold(f64::INFINITY, f64::min);
            let high = values.into_iter().fold(f64::NEG_INFINITY, f64::max);
            // Saturating casts: a corner may lie outside of the image.
            let from = (low.floor().max(0.0) as usize).saturating_sub(margin).min(size - 1);
            let to = (high.ceil().max(0.0) as usize).saturating_add(margin + 1).clamp(from + 1, size);
            (from, to - from)
        };
        let (left, width) = span(|c| c.x, width);
        let (top, height) = span(|c| c.y, height);
        Self { left, top, width, height }
    }

    fn area_px(&self) -> usize {
        self.width * self.height
    }

    fn cut(&self, image: PictureRef) -> Picture {
        image.map(|plane| self.cut_plane(plane))
    }

    fn cut_plane(&self, image: &GrayImage) -> GrayImage {
        let rows = image.data().chunks_exact(image.width()).skip(self.top).take(self.height);
        let data = rows.flat_map(|row| &row[self.left..self.left + self.width]).copied().collect();
        // A part of an image is never too large for one.
        GrayImage::new(self.width, self.height, data).unwrap_or_else(|_| image.clone())
    }

    /// The corners shifted by the window's origin: `sign` 1 to image coordinates, -1 to window
    /// coordinates.
    fn moved(&self, corners: &Corners, sign: f64) -> Option<Corners> {
        let shift = Vector2::new(self.left as f64, self.top as f64) * sign;
        Corners::new(corners.points().map(|c| c + shift)).ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        detect::{detector::detect, tests::fixtures::render},
        trace::NoTrace,
    };
    use nalgebra::Point2;

    const QUAD: [[f64; 2]; 4] = [[301.3, 240.2], [903.7, 290.4], [880.1, 760.3], [322.6, 700.9]];

    fn worst_px(found: &Quad) -> f64 {
        let errors = found.corners_px.points().iter().zip(QUAD);
        errors.map(|(a, b)| (a - Point2::from(b)).norm()).fold(0.0, f64::max)
    }

    #[test]
    fn corners_of_a_large_image_are_refined_at_full_size() {
        // A little noise, the same on every run.
        let mut image = render(1280, 960, 140, &[(QUAD, 80)]);
        let mut state = 1_u32;
        image = GrayImage::from_fn(1280, 960, |u, v| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            image.at(u, v).saturating_add_signed((state >> 24) as i8 / 24)
        });
        let p = DetectParams::default();
        let found = detect(&image, &p, &mut NoTrace);
        let best = found.iter().min_by(|a, b| worst_px(a).total_cmp(&worst_px(b))).expect("a quad");
        assert!(worst_px(best) < 0.025, "{} px", worst_px(best));
        assert!(best.corner_covariance_px2.iter().all(|c| c.trace() < 0.2), "{best:?}");
    }

    #[test]
    fn the_total_area_of_windows_is_bounded() {
        let image = render(1280, 960, 140, &[(QUAD, 80)]);
        let p = DetectParams::default();
        let found = detect(&image, &p, &mut NoTrace);
        let quad = found.iter().find(|q| worst_px(q) < 2.0).expect("the quad");
        // The same quad, off by a pixel, so often that its cut-outs fill more than two images.
        let shift = Vector2::new(1.0, 0.0);
        let off = Quad {
            corners_px: Corners::new(quad.corners_px.points().map(|c| c + shift)).expect("a quad"),
            ..quad.clone()
        };
        let window = Window::around(&off.corners_px, 14, (1280, 960));
        let fit = MAX_CUT_SHARE * 1280 * 960 / window.area_px();
        let sharp =
            at_full_size(vec![off.clone(); fit + 1], (&image).into(), 2, &p, &mut DetectBuffers::default());
        assert!(sharp[..fit].iter().all(|q| worst_px(q) < 0.15));
        assert_eq!(sharp[fit], off);
    }

    #[test]
    fn windows_are_clipped_to_the_image() {
        let image = GrayImage::from_fn(50, 40, |u, v| (u + 3 * v) as u8);
        let corners = |points: [[f64; 2]; 4]| Corners::new(points.map(Point2::from)).expect("convex");
        let all =
            Window::around(&corners([[-9.0, -9.0], [90.0, -9.0], [90.0, 90.0], [-9.0, 90.0]]), 3, (50, 40));
        assert_eq!(all, Window { left: 0, top: 0, width: 50, height: 40 });
        assert_eq!(all.cut_plane(&image), image);
        let part =
            Window::around(&corners([[10.2, 9.0], [20.0, 9.0], [20.0, 20.5], [10.2, 20.0]]), 3, (50, 40));
        assert_eq!(part, Window { left: 7, top: 6, width: 17, height: 19 });
        assert_eq!(part.cut_plane(&image).at(4, 5), image.at(11, 11));
        // Wholly outside: still a window, of at least a pixel.
        let away =
            Window::around(&corners([[60.0, 60.0], [70.0, 60.0], [70.0, 70.0], [60.0, 70.0]]), 3, (50, 40));
        assert!(away.area_px() >= 1 && away.left + away.width <= 50 && away.top + away.height <= 40);
    }
}
