//! Distractors of a scene: the surfaces of the room with their patterns and joints, columns, rails,
//! radiators, shelves, pipes, patches of light, people. Whole walls, floors and columns are not
//! listed: their lines meet by chance. Objects that are quads (cupboards, plates, lamps) are listed
//! as neither missed nor false.

use nalgebra::Vector3;
use rand::RngExt;

use super::paint::{Plane, Rect, corners, inset, part};
use super::pictures;
use super::room::Room;
use super::stage::{Stage, spread};
use crate::canvas::Noise;
use crate::seed;

/// Grey, roughness and pattern of a surface.
#[derive(Debug, Clone, Copy)]
pub(super) struct Finish {
    pub(super) grey: f32,
    rough: f32,
    pattern: Pattern,
}

/// Joints and the like: sizes in metres, then the difference in grey of the joint.
#[derive(Debug, Clone, Copy)]
enum Pattern {
    Plain,
    Bricks([f32; 2], f32),
    Tiles([f32; 2], f32),
    Checks(f32, f32),
    Stripes(f32, f32),
    Boards(f32, f32),
    Carpet(f32, f32),
}

impl Finish {
    pub(super) fn wall(stage: &mut Stage) -> Self {
        let grey = if stage.chance(0.6) { stage.grey(0.5, 0.92) } else { stage.grey(0.08, 0.6) };
        let (size, joint) = (stage.grey(0.5, 1.5), stage.grey(-0.2, 0.1));
        let pattern = match stage.rng.random_range(0..14) {
            0 => Pattern::Bricks([stage.grey(0.2, 0.4), stage.grey(0.06, 0.2)], joint),
            1 => Pattern::Tiles([stage.grey(0.1, 0.3), stage.grey(0.1, 0.3)], joint),
            2 => Pattern::Tiles([size, stage.grey(0.6, 2.0)], joint),
            3 => Pattern::Stripes(stage.grey(0.05, 0.3), 0.5 * joint),
            4 => Pattern::Boards(stage.grey(0.1, 0.3), joint),
            _ => Pattern::Plain,
        };
        let rough = if stage.chance(0.5) { 0.0 } else { stage.grey(0.0, 0.1) };
        Self { grey, rough, pattern }
    }

    pub(super) fn floor(stage: &mut Stage) -> Self {
        let (grey, joint) = (stage.grey(0.08, 0.7), stage.grey(-0.2, 0.15));
        let size = stage.grey(0.2, 0.8);
        let pattern = match stage.rng.random_range(0..6) {
            0 | 1 => Pattern::Tiles([size, size], joint),
            2 => Pattern::Checks(size, 2.0 * joint),
            3 => Pattern::Boards(stage.grey(0.08, 0.25), joint),
            4 => Pattern::Carpet(size, joint),
            _ => Pattern::Plain,
        };
        Self { grey, rough: stage.grey(0.0, 0.12), pattern }
    }

    pub(super) fn ceiling(stage: &mut Stage) -> Self {
        let pattern = if stage.chance(0.5) {
            Pattern::Tiles([0.6, 0.6], stage.grey(-0.2, -0.02))
        } else {
            Pattern::Plain
        };
        Self { grey: stage.grey(0.5, 0.97), rough: 0.02, pattern }
    }

    /// Paints a rectangle of a plane, and `over` metres beyond it.
    pub(super) fn paint(&self, stage: &mut Stage, plane: &Plane, rect: Rect, over: f64) {
        let noise = Noise::new(stage.rng.random(), 3, 4);
        let key: u64 = stage.rng.random();
        let finish = *self;
        stage.painter.paint(plane, &corners(inset(rect, -over)), |[x, y], f| {
            let blur = f.du[0].abs() + f.dv[0].abs() + f.du[1].abs() + f.dv[1].abs();
            let far = (0.02 / blur.max(1e-6)).min(1.0);
            let rough =
                if finish.rough > 0.0 { noise.at(0.2 * (x + 50.0), 0.2 * (y + 50.0)) - 0.5 } else { 0.0 };
            (finish.grey + finish.rough * rough + far * finish.pattern.at(x, y, blur, key)).clamp(0.01, 1.2)
        });
    }
}

/// Share of a pixel of size `blur` that lies within `half` of a multiple of `size`.
fn joint(x: f32, size: f32, half: f32, blur: f32) -> f32 {
    let off = ((x / size).rem_euclid(1.0) - 0.5).abs();
    let to_line = (0.5 - off) * size;
    let soft = (0.5 * blur).max(1e-4);
    ((half - to_line) / soft + 0.5).clamp(0.0, 1.0) * (2.0 * half / soft).min(1.0)
}

fn shade_of(key: u64, i: f32, j: f32) -> f32 {
    let cell = (i as i64 as u64).wrapping_mul(0x9E37) ^ (j as i64 as u64).wrapping_mul(0x85EB_CA6B);
    (seed::mix(key ^ cell) >> 40) as f32 / (1_u64 << 24) as f32 - 0.5
}

impl Pattern {
    fn at(self, x: f32, y: f32, blur: f32, key: u64) -> f32 {
        match self {
            Self::Plain => 0.0,
            Self::Bricks([w, h], depth) => {
                let shift = if (y / h).floor().rem_euclid(2.0) < 0.5 { 0.0 } else { 0.5 * w };
                let line = joint(x + shift, w, 0.005, blur).max(joint(y, h, 0.005, blur));
                depth * line + 0.08 * shade_of(key, ((x + shift) / w).floor(), (y / h).floor())
            }
            Self::Tiles([w, h], depth) => {
                let line = joint(x, w, 0.003, blur).max(joint(y, h, 0.003, blur));
                depth * line + 0.04 * shade_of(key, (x / w).floor(), (y / h).floor())
            }
            Self::Checks(size, depth) => {
                let odd = ((x / size).floor() + (y / size).floor()).rem_euclid(2.0);
                depth * (odd - 0.5)
            }
            Self::Stripes(size, depth) => depth * ((x / size).rem_euclid(1.0) - 0.5).signum(),
            Self::Boards(size, depth) => {
                depth * joint(x, size, 0.003, blur) + 0.08 * shade_of(key, (x / size).floor(), 0.0)
            }
            Self::Carpet(size, depth) => {
                let turn = std::f32::consts::TAU / size;
                let wave = (x * turn).sin() * (y * turn).sin();
                let figure = if wave > 0.3 {
                    1.0
                } else if wave < -0.6 {
                    -1.0
                } else {
                    0.0
                };
                depth * figure
            }
        }
    }
}

/// Skirting, cornice, rails, wainscot: strips along a whole wall.
pub(super) fn strips(stage: &mut Stage, plane: &Plane, [x0, y0, x1, y1]: Rect, wall: f32) {
    if stage.chance(0.2) {
        let (top, grey) = (y1 - stage.between(0.6, 1.3), stage.other_than(wall, 0.03));
        stage.rect(plane, [x0, top, x1, y1], grey);
    }
    if stage.chance(0.7) {
        let (high, grey) = (stage.between(0.05, 0.22), stage.other_than(wall, 0.05));
        stage.rect(plane, [x0, y1 - high, x1, y1], grey);
        if stage.chance(0.4) {
            let lip = stage.other_than(grey, 0.05);
            stage.rect(plane, [x0, y1 - high, x1, y1 - 0.85 * high], lip);
        }
    }
    if stage.chance(0.3) {
        let (high, grey) = (stage.between(0.03, 0.25), stage.other_than(wall, 0.04));
        stage.rect(plane, [x0, y0, x1, y0 + high], grey);
    }
    if stage.chance(0.2) {
        let (y, high, grey) =
            (stage.between(0.2, y1 - 0.3), stage.between(0.02, 0.15), stage.other_than(wall, 0.06));
        let rail = [x0, y, x1, y + high];
        if stage.chance(0.5) {
            stage.cast_shadow(plane, rail);
        }
        stage.rect(plane, rail, grey);
    }
    if stage.chance(0.15) {
        let (x, wide, grey) =
            (stage.between(x0, x1), stage.between(0.02, 0.12), stage.other_than(wall, 0.06));
        stage.rect(plane, [x, y0, x + wide, y1], grey);
    }
}

/// Radiators, shelves, plates, patches of light at free places.
pub(super) fn fittings(stage: &mut Stage, plane: &Plane, all: Rect, taken: &[Rect], wall: f32) {
    let tries = stage.rng.random_range(0..=4);
    for _ in 0..tries {
        let (w, h) = (stage.between(0.1, 1.4), stage.between(0.1, 1.2));
        let (x, y) = (stage.between(all[0], all[2] - w), stage.between(all[1], all[3] - h));
        let kind = stage.rng.random_range(0..6);
        let rect = match kind {
            0 => [x, all[3] - 0.15 - 0.5 * h.max(0.6), x + w.max(0.5), all[3] - 0.12],
            1 => [x, all[3] - 1.5 * h, x + w, all[3]],
            2 | 3 => [x, y, x + 0.1 + 0.15 * w, y + 0.06 + 0.15 * h],
            _ => [x, y, x + w, y + h],
        };
        let free = |o: &Rect| rect[2] < o[0] || o[2] < rect[0] || rect[3] < o[1] || o[3] < rect[1];
        if !taken.iter().all(free) {
            continue;
        }
        match kind {
            0 => radiator(stage, plane, rect, wall),
            1 => shelves(stage, plane, rect, wall),
            2 | 3 => plate(stage, plane, rect, wall),
            4 => letters(stage, plane, rect, wall),
            _ => pipe(stage, plane, rect, wall),
        }
    }
    let patches = if stage.chance(0.15) { stage.rng.random_range(1..=2) } else { 0 };
    for _ in 0..patches {
        light_patch(stage, plane, all);
    }
}

fn radiator(stage: &mut Stage, plane: &Plane, rect: Rect, wall: f32) {
    let (base, dark) = (stage.other_than(wall, 0.03), stage.grey(0.03, 0.3));
    stage.cast_shadow(plane, rect);
    stage.rect(plane, rect, base);
    let ribs = stage.rng.random_range(6..30);
    for rib in 0..ribs {
        let a = (f64::from(rib) + 0.35) / f64::from(ribs);
        stage.rect(plane, part(rect, [a, 0.06, a + 0.3 / f64::from(ribs), 0.94]), (base - dark).max(0.02));
    }
    stage.other(plane, rect);
}

fn shelves(stage: &mut Stage, plane: &Plane, rect: Rect, wall: f32) {
    let (body, back) = (stage.other_than(wall, 0.04), stage.grey(0.03, 0.5));
    stage.rect(plane, rect, body);
    let rows = stage.rng.random_range(2..6);
    for row in 0..rows {
        let (a, b) = (f64::from(row) / f64::from(rows) + 0.02, f64::from(row + 1) / f64::from(rows) - 0.02);
        let space = part(rect, [0.03, a, 0.97, b]);
        stage.rect(plane, space, back);
        let mut x = stage.between(0.0, 0.3);
        while x < 0.95 {
            let (wide, high, grey) =
                (stage.between(0.02, 0.07), stage.between(0.05, 0.4), stage.grey(0.05, 0.95));
            stage.rect(plane, part(space, [x, high, (x + wide).min(1.0), 1.0]), grey);
            x += wide + if stage.chance(0.15) { 0.1 } else { 0.003 };
        }
        stage.other(plane, space);
    }
    stage.other(plane, rect);
}

/// A switch, a socket, a name plate.
fn plate(stage: &mut Stage, plane: &Plane, rect: Rect, wall: f32) {
    let grey = stage.other_than(wall, 0.04);
    if stage.chance(0.5) {
        let texture = pictures::sheet(&mut stage.rng, (rect[3] - rect[1]) / (rect[2] - rect[0]), grey);
        stage.texture(plane, rect, &texture, [0.0, 1.0]);
    } else {
        stage.rect(plane, rect, grey);
        let knob = stage.other_than(grey, 0.05);
        stage.rect(plane, part(rect, [0.3, 0.25, 0.7, 0.75]), knob);
    }
    stage.other(plane, rect);
}

/// Lines of type on the bare wall: no quad of its own.
fn letters(stage: &mut Stage, plane: &Plane, rect: Rect, wall: f32) {
    let (w, h) = (rect[2] - rect[0], rect[3] - rect[1]);
    let sheet = pictures::sheet(&mut stage.rng, h / w, wall);
    // Only the letters are painted: the ground is the wall itself.
    let ground = (wall * 255.0 + 0.5).floor() / 255.0;
    let type_of = spread(rect, &sheet, [0.0, 1.0]);
    stage.painter.tint(plane, &corners(rect), |at, f| type_of(at, f) - ground);
}

fn pipe(stage: &mut Stage, plane: &Plane, rect: Rect, wall: f32) {
    let wide = stage.between(0.01, 0.06);
    let grey = stage.other_than(wall, 0.05);
    let upright = [rect[0], rect[1], rect[0] + wide, rect[3]];
    let level = [rect[0], rect[1], rect[2], rect[1] + wide];
    for run in [upright, level] {
        if stage.chance(0.6) {
            stage.cast_shadow(plane, run);
        }
        stage.rect(plane, run, grey);
    }
}

/// Light that falls through a window of panes, slanted.
fn light_patch(stage: &mut Stage, plane: &Plane, all: Rect) {
    let (w, h) = (stage.between(0.4, 1.5), stage.between(0.4, 1.6));
    let (x, y) = (stage.between(all[0], all[2]), stage.between(all[1], all[3]));
    let (slant, soft) = (stage.between(-0.5, 0.5), stage.between(0.005, 0.06));
    let factor = stage.grey(1.15, 2.2);
    let (columns, rows) = (stage.rng.random_range(1..=3), stage.rng.random_range(1..=3));
    let (cw, ch) = (w / f64::from(columns), h / f64::from(rows));
    for (i, j) in (0..columns).flat_map(|i| (0..rows).map(move |j| (i, j))) {
        let (x0, y0) = (x + cw * f64::from(i), y + ch * f64::from(j));
        let rect = inset([x0, y0, x0 + cw, y0 + ch], 0.02);
        let skewed = corners(rect).map(|[px, py]| [px, py + slant * (px - x)]);
        stage.painter.shade(plane, &skewed, soft, factor);
    }
}

/// A pillar before the main wall, floor to ceiling: two faces.
pub(super) fn column(stage: &mut Stage, room: &Room, planes: &[Plane; 6], finish: &Finish) {
    let [width, high, deep] = room.size_m;
    let (w, d) = (stage.between(0.15, 0.6), stage.between(0.1, 0.5).min(0.2 * deep));
    let x = stage.between(0.1, width - w - 0.1);
    let front = planes[0].raised(d);
    if front.at([x, 0.0]).norm() < 0.8 {
        return;
    }
    stage.painter.next_layer();
    let ahead = planes[0].right.cross(&planes[0].down);
    let side = |x: f64, depth: f64, right: Vector3<f64>, dim: f32| {
        let mut plane = Plane { origin: planes[0].at([x, 0.0]) - ahead * depth, right, ..planes[0].clone() };
        plane.light.base *= dim;
        plane
    };
    let left = side(x, 0.0, -ahead, stage.grey(0.6, 1.1));
    let right = side(x + w, d, ahead, stage.grey(0.6, 1.1));
    for plane in [&left, &right] {
        if plane.faces_camera() {
            finish.paint(stage, plane, [0.0, 0.0, d, high], 0.0);
        }
    }
    finish.paint(stage, &front, [x, 0.0, x + w, high], 0.0);
    strips(stage, &front, [x, 0.0, x + w, high], finish.grey);
}

/// Lamps in the ceiling, which shine.
pub(super) fn lamps(stage: &mut Stage, plane: &Plane, [width, _, deep]: [f64; 3]) {
    let (w, h) = (stage.between(0.2, 1.3), stage.between(0.15, 0.6));
    let count = stage.rng.random_range(0..4);
    let y = stage.between(0.0, deep);
    for i in 0..count {
        let x = width * (f64::from(i) + 0.5) / f64::from(count) - 0.5 * w;
        let rect = [x, y, x + w, y + h];
        let grey = stage.grey(0.9, 1.5);
        stage.painter.glow(plane, &corners(rect), |_, _| grey);
        stage.other(plane, rect);
    }
}

/// A round object or a person between the camera and the wall.
pub(super) fn occluder(stage: &mut Stage, room: &Room, planes: &[Plane; 6]) {
    let depth = stage.between(0.15, 0.6) * room.size_m[2].min(3.0);
    let plane = planes[0].raised(depth);
    let [width, high, _] = room.size_m;
    let x = stage.between(0.0, width);
    if plane.at([x, high - 1.0]).z < 0.7 {
        return;
    }
    stage.painter.next_layer();
    let (coat, legs, head) = (stage.grey(0.03, 0.8), stage.grey(0.03, 0.5), stage.grey(0.15, 0.8));
    let tall = stage.between(1.5, 1.9);
    let foot = high;
    let at = |dx: f64, up: f64| [x + dx * tall, foot - up * tall];
    let round = |c: [f64; 2], a: f64, b: f64| -> Vec<[f64; 2]> {
        let angle = |i: i32| f64::from(i) / 20.0 * std::f64::consts::TAU;
        (0..20).map(|i| [c[0] + a * angle(i).cos(), c[1] + b * angle(i).sin()]).collect()
    };
    if stage.chance(0.6) {
        for side in [-1.0, 1.0] {
            stage.painter.fill(
                &plane,
                &[at(side * 0.02, 0.5), at(side * 0.11, 0.5), at(side * 0.1, 0.0), at(side * 0.03, 0.0)],
                legs,
            );
        }
        stage.painter.fill(&plane, &[at(-0.13, 0.82), at(0.13, 0.82), at(0.12, 0.45), at(-0.12, 0.45)], coat);
        stage.painter.fill(&plane, &round(at(0.0, 0.8), 0.12 * tall, 0.05 * tall), coat);
        stage.painter.fill(&plane, &round(at(0.0, 0.92), 0.055 * tall, 0.075 * tall), head);
    } else {
        // A plant: leaves around a stem.
        for _ in 0..stage.rng.random_range(8..30) {
            let (dx, up) = (stage.between(-0.2, 0.2), stage.between(0.1, 0.7));
            let (a, b, grey) = (stage.between(0.02, 0.08), stage.between(0.02, 0.12), stage.grey(0.05, 0.5));
            stage.painter.fill(&plane, &round(at(dx, up), a, b), grey);
        }
    }
}
