//! The rendered set for training: rooms from all viewpoints, with framed pictures, posters, doors,
//! windows, signs and boards on their walls, and with clutter that makes lines. Seed in, pictures
//! with exact truth out; the same parameters and pictures give the same bytes. Writes no files.
//!
//! Unlike `views`, rooms vary widely and are not realistic. Planes are painted over each other
//! without ray casting, so shadows are painted, too.

mod clutter;
pub(crate) mod compression;
mod paint;
mod pictures;
mod room;
mod stage;
mod objects;

use nalgebra::{Point2, Vector3};
use rand::RngExt;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use vision::frame::GrayImage;

use crate::export::{DataSet, ImageEntry, QuadEntry, QuadState};
use crate::seed;
use crate::sensor::{SensorParams, expose};
use crate::texture::Texture;
use clutter::Finish;
use paint::{Light, Painter, Plane, Rect};
use room::{Room, View};
use stage::{Listed, Stage};

/// Most scenes of a set.
pub const MAX_SCENES: usize = 10_000;
/// Most given pictures that are hung beside generated ones; further ones are not used.
pub const MAX_PICTURES: usize = 2_000;
/// Width of every picture.
const WIDTH_PX: usize = 640;
/// A quad of which more is hidden does not count.
const MAX_HIDDEN: f64 = 0.02;
/// Shortest side of other quads that are listed.
const MIN_OTHER_SIDE_PX: f64 = 6.0;

/// Contents of the set, and which quads count.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ScenesParams {
    /// Seed of the whole set.
    pub seed: u64,
    /// Pictures, at most [`MAX_SCENES`].
    pub scenes: usize,
    /// A quad counts if each of its sides is at least this long.
    pub min_side_px: f64,
    /// And if its view angle is at most this.
    pub max_view_angle_rad: f64,
}

impl Default for ScenesParams {
    fn default() -> Self {
        Self {
            seed: 1,
            scenes: 600,
            min_side_px: 18.0,
            max_view_angle_rad: 70.0 / 180.0 * std::f64::consts::PI,
        }
    }
}

/// A picture with its entry in the set.
#[derive(Debug, Clone)]
pub struct LabelledScene {
    /// 640 wide, 360 to 480 high.
    pub image: GrayImage,
    /// Its labelled quads and other real quads.
    pub entry: ImageEntry,
}

/// The scenes of a set, one after the other.
#[derive(Debug)]
pub struct Scenes {
    params: ScenesParams,
    pictures: Vec<Texture>,
    next: usize,
}

impl Scenes {
    /// Nothing is rendered yet. `pictures` hang in frames beside generated ones.
    pub fn new(params: &ScenesParams, mut pictures: Vec<Texture>) -> Self {
        pictures.truncate(MAX_PICTURES);
        let params = ScenesParams { scenes: params.scenes.min(MAX_SCENES), ..params.clone() };
        Self { params, pictures, next: 0 }
    }

    /// The data set of these entries.
    pub fn data_set(images: Vec<ImageEntry>) -> DataSet {
        let (name, sizes_m) = ("scenes".into(), BTreeMap::new());
        DataSet { name, camera: None, sizes_m, teach: vec![], same: vec![], images }
    }

    fn render(&self, number: usize) -> LabelledScene {
        let mut rng = seed::stream(seed::mix(self.params.seed) ^ number as u64, 93);
        let room = Room::new(&mut rng);
        let view = room.view(&mut rng);
        let height = [480, 480, 427, 360][rng.random_range(0..4)];
        let painter = Painter::new(WIDTH_PX, height, 350.0 * f64::powf(2.6, rng.random()));
        let mut stage = Stage::new(painter, rng, &self.pictures);
        draw(&mut stage, &room, &view);
        let image = develop(&mut stage);
        let entry = self.entry(&stage, &view, number);
        LabelledScene { image, entry }
    }

    fn entry(&self, stage: &Stage, view: &View, number: usize) -> ImageEntry {
        let quad = |listed: &Listed| self.quad(stage, listed);
        let quads: Vec<QuadEntry> = stage.quads.iter().filter_map(quad).collect();
        let size = [stage.painter.width, stage.painter.height];
        let large = |c: &&vision::geometry::Corners| {
            c.min_side_px() >= MIN_OTHER_SIDE_PX && c.points().iter().any(|p| within(p, size))
        };
        ImageEntry {
            file: format!("scene-{number:04}.png"),
            stratum: None,
            quads,
            others: stage.others.iter().filter(large).copied().collect(),
            quads_complete: true,
            map_from_camera: view.map_from_camera(),
        }
    }

    /// `None` for a quad wholly outside the picture.
    fn quad(&self, stage: &Stage, listed: &Listed) -> Option<QuadEntry> {
        let size = [stage.painter.width, stage.painter.height];
        let inside = listed.corners.points().iter().filter(|p| within(p, size)).count();
        if inside == 0 {
            return None;
        }
        let occluded_share = stage.painter.hidden_share(&listed.corners, listed.layer);
        let state = match inside {
            4 if occluded_share <= MAX_HIDDEN => QuadState::Full,
            4 => QuadState::Occluded,
            _ => QuadState::Truncated,
        };
        let p = &self.params;
        Some(QuadEntry {
            corners: listed.corners,
            landmark: None,
            state,
            counted: state == QuadState::Full
                && listed.corners.min_side_px() >= p.min_side_px
                && listed.view_angle_rad <= p.max_view_angle_rad,
            kind: listed.kind,
            occluded_share,
            view_angle_rad: listed.view_angle_rad,
            distance_m: listed.distance_m,
        })
    }
}

impl Iterator for Scenes {
    type Item = LabelledScene;

    fn next(&mut self) -> Option<LabelledScene> {
        let number = self.next;
        if number >= self.params.scenes {
            return None;
        }
        self.next += 1;
        Some(self.render(number))
    }

    fn size_hint(&self) -> (usize, Option<usize>) {
        let left = self.params.scenes - self.next;
        (left, Some(left))
    }
}

fn within(p: &Point2<f64>, [width, height]: [usize; 2]) -> bool {
    p.x >= 1.0 && p.y >= 1.0 && p.x <= width as f64 - 2.0 && p.y <= height as f64 - 2.0
}

/// From the back to the front.
fn draw(stage: &mut Stage, room: &Room, view: &View) {
    let [width, high, deep] = room.size_m;
    let light: [Light; 6] =
        std::array::from_fn(|i| light(stage, if i == 1 || i == 2 { deep } else { width }));
    let planes = room.planes(view, &light);
    let main = Finish::wall(stage);
    let other = if stage.chance(0.7) { main } else { Finish::wall(stage) };
    let sizes = [width, deep, deep, width];
    for (i, wall) in room.walls.iter().enumerate() {
        let (finish, rect) = (if i == 0 { main } else { other }, [0.0, 0.0, sizes[i], high]);
        finish.paint(stage, &planes[i], rect, if i == 0 { 0.05 } else { 0.0 });
        clutter::strips(stage, &planes[i], rect, finish.grey);
        let taken: Vec<Rect> = wall.objects.iter().map(|t| t.1).collect();
        clutter::fittings(stage, &planes[i], rect, &taken, finish.grey);
        for (object, rect) in &wall.objects {
            objects::paint(stage, &planes[i], *rect, *object, finish.grey);
        }
    }
    let (floor, ceiling) = (Finish::floor(stage), Finish::ceiling(stage));
    floor.paint(stage, &planes[4], [0.0, 0.0, width, deep], 0.0);
    ceiling.paint(stage, &planes[5], [0.0, 0.0, width, deep], 0.0);
    clutter::lamps(stage, &planes[5], room.size_m);
    for _ in 0..2 {
        if stage.chance(0.15) {
            clutter::column(stage, room, &planes, &main);
        }
    }
    if stage.chance(0.25) {
        hanging_sign(stage, room, view, &light[0], main.grey);
    }
    if stage.chance(0.15) {
        clutter::occluder(stage, room, &planes);
    }
}

/// Even light, or light from one side, sometimes with spots on the wall.
fn light(stage: &mut Stage, width: f64) -> Light {
    let mut base = stage.grey(0.55, 1.05);
    let mut slope = [0.0; 2];
    if stage.chance(0.6) {
        slope = [stage.grey(-0.5, 0.5) / width as f32, stage.grey(-0.12, 0.12)];
        base -= 0.5 * slope[0] * width as f32 + 1.3 * slope[1];
    }
    let mut spots = vec![];
    if stage.chance(0.3) {
        for _ in 0..stage.rng.random_range(1..=4) {
            let at = [stage.between(0.0, width) as f32, stage.grey(0.0, 2.5)];
            spots.push((at, stage.grey(0.4, 1.5), stage.grey(0.05, 0.4)));
        }
    }
    Light { base, slope, spots }
}

/// A sign before the wall, turned about the vertical.
fn hanging_sign(stage: &mut Stage, room: &Room, view: &View, light: &Light, wall: f32) {
    let [width, high, deep] = room.size_m;
    let place = Vector3::new(
        stage.between(0.5, width - 0.5),
        stage.between(0.1, 0.5),
        -stage.between(0.2, 0.6 * deep),
    );
    let turn = if stage.chance(0.5) { 0.5 * std::f64::consts::PI } else { stage.between(-1.3, 1.3) };
    let (w, h) = (stage.between(0.2, 0.6), stage.between(0.1, 0.3));
    let right = Vector3::new(turn.cos(), 0.0, turn.sin());
    let flat = Light { spots: vec![], slope: [0.0; 2], ..light.clone() };
    let mut plane = view.plane(&[place, right, Vector3::y()], &flat);
    if !plane.faces_camera() {
        plane = Plane { right: -plane.right, ..plane };
    }
    let near = [[0.0, 0.0], [w, 0.0], [0.0, h], [w, h]].iter().any(|p| plane.at(*p).z < 0.5);
    if near || place.y + h > high {
        return;
    }
    stage.painter.next_layer();
    for x in [0.15 * w, 0.85 * w] {
        stage.rect(&plane, [x - 0.006, -place.y, x + 0.006, 0.0], 0.3);
    }
    objects::paint(stage, &plane, [0.0, 0.0, w, h], objects::SceneObject::Sign, wall);
}

/// Lens, sensor and processing of the camera.
fn develop(stage: &mut Stage) -> GrayImage {
    let width = stage.painter.width;
    let dark = stage.chance(0.2);
    let moving = stage.chance(0.2);
    let motion = if moving { [stage.between(-4.0, 4.0), stage.between(-1.5, 1.5)] } else { [0.0; 2] };
    // Cameras expose for the mean, some for the brightest, and too little in the dark.
    let mean = stage.painter.light.iter().sum::<f32>() / stage.painter.light.len().max(1) as f32;
    let wanted = if dark { stage.between(25.0, 60.0) } else { stage.between(75.0, 170.0) };
    let exposure = (wanted / f64::from(mean.max(1.0))).clamp(0.2, 4.0);
    let sensor = SensorParams {
        exposure,
        offset: stage.between(0.0, 18.0),
        vignetting: stage.between(0.0, 0.35),
        blur_sigma_px: if stage.chance(0.25) { stage.between(0.8, 1.8) } else { stage.between(0.35, 0.8) },
        motion_px: motion,
        read_noise: if stage.chance(0.3) { stage.between(1.5, 4.0) } else { stage.between(0.2, 1.5) },
        shot_noise: stage.between(0.0, 0.02),
    };
    let seed = stage.rng.random();
    if stage.chance(0.3) {
        let amount = stage.grey(0.3, 1.2);
        compression::sharpen(&mut stage.painter.light, width, amount);
    }
    let image = expose(&mut stage.painter.light, width, &sensor, seed);
    if stage.chance(0.6) { compression::jpeg(&image, stage.rng.random_range(30..95)) } else { image }
}

#[cfg(test)]
mod tests;
