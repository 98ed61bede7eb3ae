//! Objects that a detector must find: framed pictures, posters, doors, windows, signs, boards. Each
//! is painted onto a rectangle of a plane and listed; its inner borders and parts are listed as
//! neither missed nor false.

use rand::RngExt;

use super::paint::{Plane, Rect, corners, inset, part};
use super::pictures;
use super::stage::Stage;
use crate::building::LandmarkKind;

/// Kind of an object on a wall.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum SceneObject {
    Picture,
    Poster,
    Door,
    Window,
    Sign,
    Board,
}

/// Paints an object on a wall of the grey `wall`, and lists it.
pub(super) fn paint(stage: &mut Stage, plane: &Plane, rect: Rect, object: SceneObject, wall: f32) {
    match object {
        SceneObject::Picture => picture(stage, plane, rect, wall),
        SceneObject::Poster => poster(stage, plane, rect, wall),
        SceneObject::Door => door(stage, plane, rect, wall),
        SceneObject::Window => window(stage, plane, rect, wall),
        SceneObject::Sign => sign(stage, plane, rect, wall),
        SceneObject::Board => board(stage, plane, rect, wall),
    }
}

fn short(rect: Rect) -> f64 {
    (rect[2] - rect[0]).min(rect[3] - rect[1])
}

/// A frame of bands, or a bare canvas, with or without a mat.
fn picture(stage: &mut Stage, plane: &Plane, rect: Rect, wall: f32) {
    if stage.chance(0.65) {
        stage.cast_shadow(plane, rect);
    }
    let mut inner = rect;
    let framed = stage.chance(0.75);
    if framed {
        let grey = stage.other_than(wall, 0.03);
        let width = short(rect) * stage.between(0.015, 0.16);
        inner = frame(stage, plane, rect, width, grey);
    }
    let matted = stage.chance(0.35);
    if matted {
        let mat = if stage.chance(0.7) { stage.grey(0.7, 0.97) } else { stage.other_than(wall, 0.02) };
        stage.rect(plane, inner, mat);
        if framed {
            stage.other(plane, inner);
        }
        let width = short(inner) * stage.between(0.05, 0.3);
        let bevel = stage.grey(0.0, 1.0);
        stage.rect(plane, inset(inner, width), bevel);
        inner = inset(inner, width + short(rect) * stage.between(0.0, 0.012));
    }
    let texture = stage.picture(inner);
    let range = tones(stage);
    stage.texture(plane, inner, &texture, range);
    if framed || matted {
        stage.other(plane, inner);
        if stage.chance(0.4) {
            inner_shadow(stage, plane, inner);
        }
    }
    if stage.chance(0.12) {
        reflection(stage, plane, inner);
    }
    stage.list(plane, rect, LandmarkKind::Picture);
}

/// Darkest and brightest reflectance of a picture.
fn tones(stage: &mut Stage) -> [f32; 2] {
    let (low, high) = (stage.grey(0.02, 0.3), stage.grey(0.4, 0.95));
    [low, high]
}

/// Bands from the outside in, each lit from one side; returns the rectangle within.
fn frame(stage: &mut Stage, plane: &Plane, rect: Rect, width: f64, grey: f32) -> Rect {
    let bands = stage.rng.random_range(1..=4);
    let lit = [0; 4].map(|_| stage.grey(0.8, 1.2));
    let even = stage.chance(0.4);
    let (mut outer, mut grey) = (rect, grey);
    for band in 0..bands {
        let inner = inset(rect, width * f64::from(band + 1) / f64::from(bands));
        let (o, i) = (corners(outer), corners(inner));
        for side in 0..4 {
            let next = (side + 1) % 4;
            let grey = if even { grey } else { (grey * lit[side]).clamp(0.02, 0.98) };
            stage.painter.fill(plane, &[o[side], o[next], i[next], i[side]], grey);
        }
        if band > 0 {
            stage.other(plane, outer);
        }
        outer = inner;
        grey = stage.other_than(grey, 0.01);
    }
    outer
}

/// The frame's shadow on the picture, along the upper and one other side.
fn inner_shadow(stage: &mut Stage, plane: &Plane, [x0, y0, x1, y1]: Rect) {
    let deep = (x1 - x0).min(y1 - y0) * stage.between(0.01, 0.05);
    let (soft, factor) = (0.4 * deep, stage.grey(0.4, 0.85));
    stage.painter.shade(plane, &corners([x0, y0, x1, y0 + deep]), soft, factor);
    let left = stage.chance(0.5);
    let side = if left { [x0, y0, x0 + deep, y1] } else { [x1 - deep, y0, x1, y1] };
    stage.painter.shade(plane, &corners(side), soft, factor);
}

/// A slanted bright strip, as on glass.
fn reflection(stage: &mut Stage, plane: &Plane, rect: Rect) {
    let (left, wide, slant) = (stage.between(0.1, 0.5), stage.between(0.05, 0.25), stage.between(0.0, 0.2));
    let [x0, y0, x1, y1] = part(rect, [left, 0.02, left + wide, 0.98]);
    let shift = slant * (rect[2] - rect[0]);
    let strip = [[x0 + shift, y0], [x1 + shift, y0], [x1, y1], [x0, y1]];
    let factor = stage.grey(1.1, 1.9);
    stage.painter.shade(plane, &strip, 0.1 * (x1 - x0), factor);
}

/// Paper without a frame; one of three is nearly of the wall's grey.
fn poster(stage: &mut Stage, plane: &Plane, rect: Rect, wall: f32) {
    if stage.chance(0.2) {
        stage.cast_shadow(plane, rect);
    }
    if stage.chance(0.35) {
        let step = stage.grey(0.02, 0.09);
        let ground =
            if stage.chance(0.5) && wall + step < 0.97 { wall + step } else { (wall - step).max(0.03) };
        let texture = pictures::sheet(&mut stage.rng, (rect[3] - rect[1]) / (rect[2] - rect[0]), ground);
        stage.texture(plane, rect, &texture, [0.0, 1.0]);
        if stage.chance(0.6) {
            let at = part(
                rect,
                [stage.between(0.05, 0.3), 0.1, stage.between(0.6, 0.95), stage.between(0.4, 0.9)],
            );
            let (texture, range) = (stage.picture(at), tones(stage));
            stage.texture(plane, at, &texture, range);
            stage.other(plane, at);
        }
    } else {
        let (texture, range) = (stage.picture(rect), tones(stage));
        stage.texture(plane, rect, &texture, range);
        if stage.chance(0.3) {
            let (margin, grey) = (short(rect) * stage.between(0.02, 0.1), stage.grey(0.5, 0.97));
            frame_of(stage, plane, rect, margin, grey);
            stage.other(plane, inset(rect, margin));
        }
    }
    stage.list(plane, rect, LandmarkKind::Poster);
}

/// Four strips of one grey along the inside of a rectangle.
fn frame_of(stage: &mut Stage, plane: &Plane, rect: Rect, width: f64, grey: f32) {
    let (o, i) = (corners(rect), corners(inset(rect, width)));
    for side in 0..4 {
        let next = (side + 1) % 4;
        stage.painter.fill(plane, &[o[side], o[next], i[next], i[side]], grey);
    }
}

/// A frame, one leaf or two, panels or a pane, handle and plate. The lower side is the floor.
fn door(stage: &mut Stage, plane: &Plane, rect: Rect, wall: f32) {
    let jamb = if stage.chance(0.8) { stage.other_than(wall, 0.03) } else { wall };
    let width = stage.between(0.03, 0.12);
    stage.rect(plane, rect, jamb);
    let inner = [rect[0] + width, rect[1] + width, rect[2] - width, rect[3]];
    let tone = stage.other_than(jamb, 0.03);
    let leaves = if rect[2] - rect[0] > 1.3 { 2 } else { 1 };
    let kind = stage.rng.random_range(0..5);
    for leaf in 0..leaves {
        let (a, b) = (f64::from(leaf) / f64::from(leaves), f64::from(leaf + 1) / f64::from(leaves));
        let gap = 0.004 / (inner[2] - inner[0]);
        let rect = part(inner, [a + gap, 0.0, b - gap, 1.0]);
        stage.rect(plane, rect, tone);
        stage.other(plane, rect);
        panels(stage, plane, rect, kind, tone);
        let x = if leaf == 1 { 0.06 } else { 0.84 };
        let handle = stage.other_than(tone, 0.15);
        stage.rect(plane, part(rect, [x, 0.5, x + 0.1, 0.512]), handle);
    }
    if stage.chance(0.5) {
        let (deep, factor) = (stage.between(0.02, 0.08), stage.grey(0.5, 0.9));
        let strip = [inner[0], inner[1], inner[2], inner[1] + deep];
        stage.painter.shade(plane, &corners(strip), 0.3 * deep, factor);
    }
    stage.list(plane, rect, LandmarkKind::Door);
}

fn panels(stage: &mut Stage, plane: &Plane, leaf: Rect, kind: u32, tone: f32) {
    match kind {
        0 | 1 => {
            let rows = 1 + kind as usize + usize::from(stage.chance(0.5));
            let line = stage.other_than(tone, 0.03);
            for row in 0..rows {
                let (a, b) = (row as f64 / rows as f64, (row + 1) as f64 / rows as f64);
                let panel = part(leaf, [0.14, a + 0.05, 0.86, b - 0.05]);
                frame_of(stage, plane, panel, 0.015, line);
                stage.other(plane, panel);
            }
        }
        2 => {
            let pane = part(leaf, [stage.between(0.15, 0.4), 0.1, 0.85, stage.between(0.3, 0.6)]);
            let grey = stage.other_than(tone, 0.1);
            stage.rect(plane, pane, grey);
            stage.other(plane, pane);
        }
        3 => {
            let plate = part(leaf, [0.02, 0.85, 0.98, 0.98]);
            let grey = stage.other_than(tone, 0.03);
            stage.rect(plane, plate, grey);
        }
        _ => {}
    }
}

/// A frame with panes, bars between them, and what is outside; sometimes a sill or a grating.
fn window(stage: &mut Stage, plane: &Plane, rect: Rect, wall: f32) {
    let grey = stage.other_than(wall, 0.04);
    if stage.chance(0.3) {
        stage.cast_shadow(plane, rect);
    }
    stage.rect(plane, rect, grey);
    let bar = short(rect) * stage.between(0.02, 0.08);
    let inner = inset(rect, bar);
    let (columns, rows) = (stage.rng.random_range(1..=4), stage.rng.random_range(1..=3));
    let bright = stage.chance(0.6);
    let range =
        if bright { [stage.grey(0.4, 0.9), stage.grey(0.9, 1.6)] } else { [0.02, stage.grey(0.1, 0.5)] };
    let outside = stage.picture(inner);
    stage.shining(plane, inner, &outside, range);
    let (w, h) = ((inner[2] - inner[0]) / f64::from(columns), (inner[3] - inner[1]) / f64::from(rows));
    let half = 0.5 * bar * stage.between(0.4, 1.0);
    for i in 1..columns {
        let x = inner[0] + w * f64::from(i);
        stage.rect(plane, [x - half, inner[1], x + half, inner[3]], grey);
    }
    for j in 1..rows {
        let y = inner[1] + h * f64::from(j);
        stage.rect(plane, [inner[0], y - half, inner[2], y + half], grey);
    }
    for (i, j) in (0..columns).flat_map(|i| (0..rows).map(move |j| (i, j))) {
        let (x, y) = (inner[0] + w * f64::from(i), inner[1] + h * f64::from(j));
        stage.other(plane, [x + half, y + half, x + w - half, y + h - half]);
    }
    if stage.chance(0.4) {
        let sill = [rect[0] - 0.05, rect[3], rect[2] + 0.05, rect[3] + stage.between(0.03, 0.08)];
        let tone = stage.other_than(wall, 0.05);
        stage.cast_shadow(plane, sill);
        stage.rect(plane, sill, tone);
    }
    stage.list(plane, rect, LandmarkKind::Window);
}

/// A sign: lit from within, a clear plate nearly of the wall's grey, or a painted one; sometimes
/// under a lamp box.
pub(super) fn sign(stage: &mut Stage, plane: &Plane, rect: Rect, wall: f32) {
    let aspect = (rect[3] - rect[1]) / (rect[2] - rect[0]);
    let style = stage.rng.random_range(0..4);
    let tones = match style {
        0 => [stage.grey(0.6, 1.1), stage.grey(0.1, 0.5)],
        1 => [stage.grey(0.1, 0.4), stage.grey(0.8, 1.3)],
        2 => {
            let ground = (wall + stage.grey(-0.1, 0.1)).clamp(0.03, 0.95);
            [ground, stage.other_than(ground, 0.25)]
        }
        _ => {
            let ground = stage.other_than(wall, 0.08);
            [ground, stage.other_than(ground, 0.3)]
        }
    };
    if stage.chance(0.3) {
        stage.cast_shadow(plane, rect);
    }
    let texture = pictures::sign(&mut stage.rng, aspect, tones.map(|t| t / 1.4));
    if style < 2 {
        stage.shining(plane, rect, &texture, [0.0, 1.4]);
    } else {
        stage.texture(plane, rect, &texture, [0.0, 1.4]);
    }
    if stage.chance(0.25) {
        let (edge, grey) = (short(rect) * stage.between(0.02, 0.08), stage.other_than(wall, 0.05));
        frame_of(stage, plane, rect, edge, grey);
        stage.other(plane, inset(rect, edge));
    }
    if stage.chance(0.3) {
        let high = (rect[3] - rect[1]) * stage.between(0.1, 0.35);
        let grey = stage.grey(0.3, 0.95);
        let aside = (rect[2] - rect[0]) * stage.between(-0.05, 0.05);
        stage.rect(plane, [rect[0] - aside, rect[1] - high, rect[2] + aside, rect[1]], grey);
    }
    stage.list(plane, rect, LandmarkKind::Sign);
}

/// A board with papers on it.
fn board(stage: &mut Stage, plane: &Plane, rect: Rect, wall: f32) {
    if stage.chance(0.4) {
        stage.cast_shadow(plane, rect);
    }
    let rim = stage.other_than(wall, 0.03);
    stage.rect(plane, rect, rim);
    let inner = inset(rect, short(rect) * stage.between(0.01, 0.05));
    let ground = stage.other_than(rim, 0.02);
    stage.rect(plane, inner, ground);
    stage.other(plane, inner);
    let papers = stage.rng.random_range(0..9);
    for _ in 0..papers {
        let (w, h) = (stage.between(0.08, 0.25), stage.between(0.15, 0.45));
        let (x, y) = (stage.between(0.02, 0.97 - w), stage.between(0.03, 0.96 - h));
        let at = part(inner, [x, y, x + w, y + h]);
        let grey = stage.grey(0.5, 0.97);
        let sheet = pictures::sheet(&mut stage.rng, (at[3] - at[1]) / (at[2] - at[0]), grey);
        stage.texture(plane, at, &sheet, [0.0, 1.0]);
        stage.other(plane, at);
    }
    stage.list(plane, rect, LandmarkKind::Board);
}
