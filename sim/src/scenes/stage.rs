//! A scene during painting: the painter, the random numbers, and the listed quads. Objects and
//! clutter are painted onto it.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use vision::geometry::Corners;

use super::paint::{Painter, Plane, Rect, corners};
use super::pictures;
use crate::building::LandmarkKind;
use crate::texture::{Footprint, Texture};

/// A labelled quad that a detector must find.
#[derive(Debug, Clone)]
pub(super) struct Listed {
    pub(super) corners: Corners,
    pub(super) kind: LandmarkKind,
    pub(super) layer: u16,
    pub(super) view_angle_rad: f64,
    pub(super) distance_m: f64,
}

/// A scene during painting.
pub(super) struct Stage<'a> {
    pub(super) painter: Painter,
    pub(super) rng: ChaCha8Rng,
    pub(super) quads: Vec<Listed>,
    pub(super) others: Vec<Corners>,
    pictures: &'a [Texture],
}

impl<'a> Stage<'a> {
    pub(super) fn new(painter: Painter, rng: ChaCha8Rng, pictures: &'a [Texture]) -> Self {
        Self { painter, rng, quads: vec![], others: vec![], pictures }
    }

    /// A number between two.
    pub(super) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.rng.random::<f64>()
    }

    /// A grey between two.
    pub(super) fn grey(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.rng.random::<f32>()
    }

    /// True with probability `share`.
    pub(super) fn chance(&mut self, share: f64) -> bool {
        self.rng.random_bool(share)
    }

    /// A grey that differs from another by at least `least`, often by little.
    pub(super) fn other_than(&mut self, grey: f32, least: f32) -> f32 {
        let step = if self.chance(0.3) { self.grey(least, least + 0.1) } else { self.grey(least, 0.8) };
        let up = self.chance(0.5);
        let signed = if (up && grey + step <= 0.97) || grey - step < 0.02 { step } else { -step };
        (grey + signed).clamp(0.02, 0.97)
    }

    /// Lists an object that a detector must find.
    pub(super) fn list(&mut self, plane: &Plane, rect: Rect, kind: LandmarkKind) {
        let Some(corners) = self.painter.corners(plane, rect) else { return };
        let centre = plane.at([0.5 * (rect[0] + rect[2]), 0.5 * (rect[1] + rect[3])]);
        let normal = plane.right.cross(&plane.down);
        let (distance_m, layer) = (centre.norm(), self.painter.layer());
        let view_angle_rad = (normal.dot(&centre) / distance_m).clamp(-1.0, 1.0).acos();
        self.quads.push(Listed { corners, kind, layer, view_angle_rad, distance_m });
    }

    /// Lists a quad that is neither missed nor false.
    pub(super) fn other(&mut self, plane: &Plane, rect: Rect) {
        self.others.extend(self.painter.corners(plane, rect));
    }

    /// A given picture, or a generated one.
    pub(super) fn picture(&mut self, rect: Rect) -> Texture {
        if !self.pictures.is_empty() && self.chance(0.6) {
            return self.pictures[self.rng.random_range(0..self.pictures.len())].clone();
        }
        let aspect = (rect[3] - rect[1]) / (rect[2] - rect[0]).max(1e-6);
        pictures::picture(&mut self.rng, aspect)
    }

    /// A rectangle of one grey.
    pub(super) fn rect(&mut self, plane: &Plane, rect: Rect, grey: f32) {
        self.painter.fill(plane, &corners(rect), grey);
    }

    /// A texture over a rectangle, between two reflectances.
    pub(super) fn texture(&mut self, plane: &Plane, rect: Rect, texture: &Texture, [low, high]: [f32; 2]) {
        self.painter.paint(plane, &corners(rect), spread(rect, texture, [low, high]));
    }

    /// The same, emitting light.
    pub(super) fn shining(&mut self, plane: &Plane, rect: Rect, texture: &Texture, [low, high]: [f32; 2]) {
        self.painter.glow(plane, &corners(rect), spread(rect, texture, [low, high]));
    }

    /// The soft shadow of an object in front of the wall: below it and to one side.
    pub(super) fn cast_shadow(&mut self, plane: &Plane, [x0, y0, x1, y1]: Rect) {
        let reach = 0.5 * ((x1 - x0) + (y1 - y0));
        for _ in 0..self.rng.random_range(1..=2) {
            let down = reach * self.between(-0.005, 0.09);
            let aside = reach * self.between(-0.06, 0.06);
            let soft = reach * self.between(0.003, 0.05);
            let grow = reach * self.between(-0.01, 0.02);
            let factor = self.grey(0.4, 0.92);
            let shadow = [x0 + aside - grow, y0 + down - grow, x1 + aside + grow, y1 + down + grow];
            self.painter.shade(plane, &corners(shadow), soft, factor);
        }
    }
}

/// The ink of a texture over a rectangle, between two reflectances.
pub(super) fn spread(
    rect: Rect,
    texture: &Texture,
    [low, high]: [f32; 2],
) -> impl Fn([f32; 2], &Footprint) -> f32 {
    let [x0, y0, x1, y1] = rect.map(|x| x as f32);
    let (w, h) = ((x1 - x0).max(1e-6), (y1 - y0).max(1e-6));
    move |[x, y], f| {
        let within = |d: [f32; 2]| [d[0] / w, d[1] / h];
        let footprint = Footprint { du: within(f.du), dv: within(f.dv) };
        low + (high - low) * texture.sample((x - x0) / w, (y - y0) / h, &footprint) / 255.0
    }
}
