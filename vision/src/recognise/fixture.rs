//! Drawn posters and photographs of them, for tests.

use crate::{
    detect::quad::{Quad, QuadKind},
    frame::GrayImage,
    geometry::{corners::Corners, homography::Homography},
    icon::Icon,
    learn::{lesson::learn, synthesis::views, threshold_fit::refit_thresholds, training_view::TrainingView},
    model::{landmark_id::LandmarkId, landmark_model::LandmarkModel, model_set::ModelSet},
    params::Params,
};
use nalgebra::{Matrix2, Point2};
use std::sync::Arc;

/// Side of a drawn poster, in pixels.
const POSTER_PX: usize = 240;

/// A small repeatable generator.
pub(crate) struct Dice(u64);

impl Dice {
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1)
    }

    /// In [0, 1).
    pub(crate) fn roll(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f64 / f64::from(1 << 24)
    }
}

/// An icon of 75 x 75 px with the grey levels of `grey`, of places from 0 to 1, right and down.
pub(crate) fn drawn_icon(grey: impl Fn(f64, f64) -> f64) -> Icon {
    const SIZE: usize = 75;
    let at = |i: usize| (i as f64 + 0.5) / SIZE as f64;
    let pixels = (0..SIZE * SIZE).map(|i| grey(at(i % SIZE), at(i / SIZE)) as f32).collect();
    Icon { size: SIZE, pixels, source_scale: 1.0 }
}

/// Texture everywhere, grey levels 30 to 210.
pub(crate) fn waves(x: f64, y: f64) -> f64 {
    120.0 + 50.0 * (19.0 * x + 9.0 * y * y).sin() + 40.0 * (17.0 * y - 14.0 * x).cos()
}

/// Ellipses and boxes of all sizes on a shaded ground; another seed, another poster.
pub(crate) fn poster(seed: u64) -> GrayImage {
    let mut dice = Dice::new(seed);
    let shapes: Vec<[f64; 6]> = (0..60)
        .map(|i| {
            let size = 8.0 + 50.0 * dice.roll() * (1.0 - f64::from(i) / 80.0);
            let (x, y) = (dice.roll() * POSTER_PX as f64, dice.roll() * POSTER_PX as f64);
            [x, y, size, size * (0.4 + dice.roll()), 30.0 + 200.0 * dice.roll(), dice.roll()]
        })
        .collect();
    GrayImage::from_fn(POSTER_PX, POSTER_PX, |u, v| {
        let (u, v) = (u as f64, v as f64);
        let mut grey = 90.0 + 0.2 * u + 0.1 * v;
        for [x, y, a, b, shade, kind] in &shapes {
            let (dx, dy) = ((u - x) / a, (v - y) / b);
            let inside = if *kind < 0.5 { dx.hypot(dy) < 1.0 } else { dx.abs().max(dy.abs()) < 0.8 };
            if inside {
                grey = *shade;
            }
        }
        grey as u8
    })
}

/// The corners of a whole poster.
pub(crate) fn whole() -> Corners {
    let high = POSTER_PX as f64 - 0.5;
    Corners::try_from([[-0.5, -0.5], [high, -0.5], [high, high], [-0.5, high]]).unwrap()
}

/// A 400 x 400 photograph of `poster` at `corners` on a grey wall: grey levels gain g + offset.
pub(crate) fn photograph(poster: &GrayImage, corners: &Corners, gain: f64, offset: f64) -> GrayImage {
    let map = Homography::square_to_quad(POSTER_PX, corners).unwrap().inverse().unwrap();
    GrayImage::from_fn(400, 400, |u, v| {
        let mut sum = 0.0;
        for i in 0..9 {
            let (du, dv) = (f64::from(i % 3) / 3.0 - 1.0 / 3.0, f64::from(i / 3) / 3.0 - 1.0 / 3.0);
            let p = map.apply(&Point2::new(u as f64 + du, v as f64 + dv));
            let high = POSTER_PX as f64 - 0.5;
            let on = p.x > -0.5 && p.y > -0.5 && p.x < high && p.y < high;
            sum += if on { f64::from(poster.sample(p.x, p.y)) } else { 150.0 };
        }
        (gain * sum / 9.0 + offset).clamp(0.0, 255.0) as u8
    })
}

/// Corners of a view from the left.
pub(crate) fn oblique() -> Corners {
    Corners::try_from([[90.0, 80.0], [280.0, 110.0], [285.0, 300.0], [95.0, 330.0]]).unwrap()
}

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

/// Poster `seed`, learnt as landmark `id` from itself and generated views.
pub(crate) fn trained_model(id: u64, seed: u64, p: &Params) -> LandmarkModel {
    let image = poster(seed);
    let mut all = vec![TrainingView::photographed(&image, &whole(), p).unwrap()];
    all.extend(views(&image, &whole(), 12, p, seed));
    learn(LandmarkId(id), &all, &[], p).unwrap()
}

/// Posters 1 to `count` as landmarks 1 to `count`, thresholds fitted against each other.
pub(crate) fn trained_models(count: u64, p: &Params) -> Vec<Arc<LandmarkModel>> {
    let models: Vec<LandmarkModel> = (1..=count).map(|i| trained_model(i, i, p)).collect();
    models
        .iter()
        .map(|m| {
            let others = models.iter().filter(|o| o.id != m.id);
            let negatives: Vec<_> = others.map(|o| o.exemplars[0].features(&p.recognise)).collect();
            Arc::new(refit_thresholds(m, &negatives, p))
        })
        .collect()
}

pub(crate) fn model_set(count: u64, p: &Params) -> ModelSet {
    ModelSet::new(trained_models(count, p), p).unwrap()
}
