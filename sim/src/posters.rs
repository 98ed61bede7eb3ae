//! Posters: a different picture for every seed, with a ground, two or three motifs, block letters,
//! and a border or none. The picture fills the quad, frame included. `corridor` hangs them;
//! `surfaces` draws the building itself.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::canvas::{Area, Canvas, Noise};
use crate::seed;
use crate::texture::{Edge, Texture};

/// Width of a poster's texture in texels; at 0.6 m that is 800 texels per metre.
pub const POSTER_WIDTH_TEXELS: usize = 480;
/// Widest poster texture that is drawn.
pub const MAX_POSTER_WIDTH_TEXELS: usize = 2048;

/// The poster of a seed, in the usual format (5 : 7).
pub fn poster(seed: u64) -> Texture {
    poster_of_size(seed, POSTER_WIDTH_TEXELS, 1.4)
}

/// The poster of a seed at another resolution (8 to 2048 texels wide, clamped) and height/width
/// (0.25 to 4, clamped).
pub fn poster_of_size(seed: u64, width_texels: usize, aspect: f32) -> Texture {
    let width = width_texels.clamp(8, MAX_POSTER_WIDTH_TEXELS);
    let aspect = if aspect.is_finite() { aspect.clamp(0.25, 4.0) } else { 1.0 };
    let height = (width as f32 * aspect).round() as usize;
    let mut canvas = Canvas::new(width, height, 0.5);
    let mut rng = stream(seed);
    draw(&mut canvas, &mut rng);
    canvas.into_texture(Edge::Clamp)
}

fn draw(canvas: &mut Canvas, rng: &mut ChaCha8Rng) {
    let mut border_rng = rng.clone();
    let area = border(canvas, rng);
    let dark_ground = ground(canvas, area, rng);
    let ink = |rng: &mut ChaCha8Rng| {
        if dark_ground { rng.random_range(0.7..1.0) } else { rng.random_range(0.0..0.3) }
    };
    let title_on_top = rng.random_bool(0.5);
    let title_height = rng.random_range(0.16..0.3);
    let picture = if title_on_top {
        area.part(0.04, title_height, 0.96, 0.97)
    } else {
        area.part(0.04, 0.03, 0.96, 1.0 - title_height)
    };
    for _ in 0..rng.random_range(2..=3) {
        let grey = ink(rng);
        motif(canvas, picture, grey, rng);
    }
    let grey = ink(rng);
    let title = if title_on_top {
        area.part(0.06, 0.04, 0.94, title_height)
    } else {
        area.part(0.06, 1.0 - title_height + 0.02, 0.94, 0.97)
    };
    letters(canvas, title, grey, rng);
    // The border again, over motifs that reached beyond the area.
    border(canvas, &mut border_rng);
    canvas.clouds(canvas.area(), &Noise::new(rng.random(), 60, 2), 0.03);
}

/// Draws the border and returns the area within.
fn border(canvas: &mut Canvas, rng: &mut ChaCha8Rng) -> Area {
    bands(rng).into_iter().fold(canvas.area(), |area, [thickness, grey]| {
        canvas.frame(area, thickness, grey);
        area.inset(thickness)
    })
}

/// Bands of the border from outside in: thickness, as a share of the width, and grey.
fn bands(rng: &mut ChaCha8Rng) -> Vec<[f32; 2]> {
    match rng.random_range(0..5) {
        0 => Vec::new(),
        1 => vec![[rng.random_range(0.02..0.04), 0.05]],
        2 => vec![[rng.random_range(0.02..0.05), 0.97]],
        3 => vec![[0.025, rng.random_range(0.08..0.25)], [rng.random_range(0.04..0.08), 0.93]],
        _ => vec![[0.03, 0.95], [0.015, 0.1]],
    }
}

/// How far each of the poster's borders is from its outer edge, as shares of its width: 0 first.
pub fn borders(seed: u64) -> Vec<f64> {
    let mut inset = 0.0;
    let inner = bands(&mut stream(seed)).into_iter().map(|[thickness, _]| {
        inset += f64::from(thickness);
        inset
    });
    std::iter::once(0.0).chain(inner.collect::<Vec<_>>()).collect()
}

fn stream(seed: u64) -> ChaCha8Rng {
    seed::stream(seed, 0x0070_6F73_7465_7200)
}

/// Fills the ground; true when it is dark.
fn ground(canvas: &mut Canvas, area: Area, rng: &mut ChaCha8Rng) -> bool {
    let dark = rng.random_bool(0.45);
    let base: f32 = if dark { rng.random_range(0.03..0.3) } else { rng.random_range(0.6..0.97) };
    let other: f32 = (base + if dark { 1.0 } else { -1.0 } * rng.random_range(0.1..0.4)).clamp(0.0, 1.0);
    canvas.rect(area, base);
    let blend = move |k: f32| base + k.clamp(0.0, 1.0) * (other - base);
    let (noise_seed, kind) = (rng.random(), rng.random_range(0..6));
    match kind {
        0 => {}
        1 => canvas.paint(area, |_, y, _| blend((y - area.y0) / area.height())),
        2 => {
            let [cx, cy] =
                area.part(0.0, 0.0, rng.random_range(0.2..1.8), rng.random_range(0.2..1.8)).centre();
            canvas.paint(area, |x, y, _| blend((x - cx).hypot(y - cy) / 0.9));
        }
        3 => {
            let noise = Noise::new(noise_seed, rng.random_range(3..8), 5);
            canvas.paint(area, |x, y, _| blend(2.2 * noise.at(x, y) - 0.6));
        }
        4 => {
            let (angle, period) = (rng.random_range(0.0..3.1_f32), rng.random_range(0.08..0.3_f32));
            let (c, s) = (angle.cos() / period, angle.sin() / period);
            canvas
                .paint(area, |x, y, _| blend(if (x * c + y * s).rem_euclid(1.0) < 0.5 { 0.0 } else { 0.7 }));
        }
        _ => {
            let horizon = area.y0 + area.height() * rng.random_range(0.4..0.8);
            let noise = Noise::new(noise_seed, rng.random_range(2..6), 4);
            canvas.paint(area, |x, y, _| {
                let ridge = horizon + 0.5 * (noise.at(x, 0.37) - 0.5);
                if y < ridge { base } else { blend(0.5 + 0.5 * noise.at(x, y)) }
            });
        }
    }
    dark
}

fn motif(canvas: &mut Canvas, area: Area, grey: f32, rng: &mut ChaCha8Rng) {
    let (cx, cy) = (rng.random_range(0.25..0.75), rng.random_range(0.25..0.75));
    let at = area.part(cx - 0.5, cy - 0.5, cx + 0.5, cy + 0.5).centre();
    match rng.random_range(0..9) {
        0 => portrait(canvas, at, grey, rng),
        1 => {
            let r = rng.random_range(0.1..0.32);
            canvas.ellipse(at, r, r, grey);
            if rng.random_bool(0.6) {
                canvas.ellipse(at, r * 0.6, r * 0.6, 1.0 - grey);
            }
        }
        2 => {
            for _ in 0..rng.random_range(2..6) {
                let mut point = || {
                    let (x, y) = (rng.random_range(0.0..1.0), rng.random_range(0.0..1.0));
                    [area.x0 + x * area.width(), area.y0 + y * area.height()]
                };
                let triangle = [point(), point(), point()];
                canvas.polygon(&triangle, (grey + rng.random_range(-0.3..0.3_f32)).clamp(0.0, 1.0));
            }
        }
        3 => sunburst(canvas, area, at, grey, rng.random_range(5..17)),
        4 => skyline(canvas, area, grey, rng),
        5 => mosaic(canvas, area, rng),
        6 => photograph(canvas, area, at, rng),
        7 => paragraph(canvas, area, grey, rng),
        _ => {
            let (dx, dy) = (rng.random_range(0.2..0.5_f32), rng.random_range(-0.4..0.4_f32));
            let t = rng.random_range(0.03..0.1);
            let [x, y] = at;
            canvas.polygon(
                &[[x - dx, y - dy - t], [x + dx, y + dy - t], [x + dx, y + dy + t], [x - dx, y - dy + t]],
                grey,
            );
        }
    }
}

/// A head and shoulders, lit from one side.
fn portrait(canvas: &mut Canvas, [x, y]: [f32; 2], grey: f32, rng: &mut ChaCha8Rng) {
    let r = rng.random_range(0.12..0.22);
    let skin: f32 = rng.random_range(0.35..0.8);
    canvas.ellipse([x, y + 2.4 * r], 1.9 * r, 1.5 * r, grey);
    canvas.ellipse([x, y - 0.1 * r], 1.12 * r, 1.4 * r, 1.0 - skin);
    canvas.ellipse([x, y], 0.85 * r, 1.15 * r, skin);
    let lit = if rng.random_bool(0.5) { 1.0 } else { -1.0 };
    let face = Area::new(x - r, y - 1.2 * r, x + r, y + 1.2 * r);
    canvas.paint(face, |px, py, under| {
        let inside = ((px - x) / (0.85 * r)).hypot((py - y) / (1.15 * r)) < 1.0;
        if inside { (under + 0.25 * lit * (px - x) / r).clamp(0.0, 1.0) } else { under }
    });
    for side in [-1.0, 1.0] {
        canvas.ellipse([x + side * 0.33 * r, y - 0.2 * r], 0.14 * r, 0.09 * r, 0.05);
    }
    canvas.ellipse([x, y + 0.55 * r], 0.3 * r, rng.random_range(0.04..0.12) * r, 0.15);
}

fn sunburst(canvas: &mut Canvas, area: Area, [cx, cy]: [f32; 2], grey: f32, rays: u32) {
    canvas.paint(area, |x, y, under| {
        let turn = (y - cy).atan2(x - cx) / std::f32::consts::TAU + 0.5;
        let lit = (turn * rays as f32).fract() < 0.5;
        if lit { under + 0.6 * (grey - under) } else { under }
    });
    canvas.ellipse([cx, cy], 0.1, 0.1, grey);
}

fn skyline(canvas: &mut Canvas, area: Area, grey: f32, rng: &mut ChaCha8Rng) {
    let count = rng.random_range(5..12);
    for i in 0..count {
        let top = rng.random_range(0.3..0.9);
        let x0 = i as f32 / count as f32;
        let house = area.part(x0, top, x0 + 1.0 / count as f32, 1.0);
        canvas.rect(house, (grey + rng.random_range(-0.15..0.15_f32)).clamp(0.0, 1.0));
        let window = house.width() / 5.0;
        for row in 0..(house.height() / (2.0 * window)) as usize {
            for column in 0..2 {
                if rng.random_bool(0.6) {
                    let (x, y) = (
                        house.x0 + (1 + 2 * column) as f32 * window,
                        house.y0 + (1 + 2 * row) as f32 * window,
                    );
                    canvas.rect(Area::new(x, y, x + window, (y + window).min(house.y1)), 1.0 - grey);
                }
            }
        }
    }
}

fn mosaic(canvas: &mut Canvas, area: Area, rng: &mut ChaCha8Rng) {
    let (columns, rows) = (rng.random_range(2..6), rng.random_range(2..6));
    let part = area.part(rng.random_range(0.0..0.3), rng.random_range(0.0..0.3), 1.0, 1.0);
    for (row, column) in (0..rows).flat_map(|r| (0..columns).map(move |c| (r, c))) {
        let (x, y) = (column as f32 / columns as f32, row as f32 / rows as f32);
        let cell = part.part(x, y, x + 1.0 / columns as f32, y + 1.0 / rows as f32);
        let grey = rng.random_range(0.05..0.95);
        if rng.random_bool(0.6) {
            canvas.rect(cell, grey);
        } else {
            canvas.ellipse(cell.centre(), 0.5 * cell.width(), 0.5 * cell.height(), grey);
        }
    }
}

/// A patch of clouds with dark blobs, as rich in detail as a photograph.
fn photograph(canvas: &mut Canvas, area: Area, [cx, cy]: [f32; 2], rng: &mut ChaCha8Rng) {
    let (w, h) = (rng.random_range(0.2..0.42) * area.width(), rng.random_range(0.2..0.42) * area.height());
    let patch =
        Area::new((cx - w).max(area.x0), (cy - h).max(area.y0), (cx + w).min(area.x1), (cy + h).min(area.y1));
    let noise = Noise::new(rng.random(), rng.random_range(6..14), 5);
    canvas.note(patch);
    canvas.paint(patch, |x, y, _| (2.6 * (noise.at(x, y) - 0.5) + 0.5).clamp(0.02, 0.98));
    for _ in 0..rng.random_range(2..7) {
        let (x, y) = (rng.random_range(0.15..0.85), rng.random_range(0.15..0.85));
        let centre = [patch.x0 + x * patch.width(), patch.y0 + y * patch.height()];
        let (a, b) = (rng.random_range(0.02..0.07), rng.random_range(0.02..0.07));
        canvas.ellipse(centre, a, b, rng.random_range(0.0..1.0));
    }
}

/// Lines of small type.
fn paragraph(canvas: &mut Canvas, area: Area, grey: f32, rng: &mut ChaCha8Rng) {
    let lines = rng.random_range(4..10);
    let height = area.height() / (2.0 * lines as f32);
    let size = height.min(0.035);
    let (indent, width) = (rng.random_range(0.0..0.4_f32), rng.random_range(0.4..1.0_f32));
    let room = area.width() * (width.min(1.0 - indent)) / (size * 6.0 / 7.0);
    for line in 0..lines {
        let text = word(rng, (room as usize).clamp(1, 60));
        canvas.text(
            [area.x0 + indent * area.width(), area.y0 + 2.0 * line as f32 * height],
            size,
            &text,
            grey,
        );
    }
}

/// One or two words as large as the area allows.
fn letters(canvas: &mut Canvas, area: Area, grey: f32, rng: &mut ChaCha8Rng) {
    let lines = rng.random_range(1..=2);
    for line in 0..lines {
        let row = area.part(0.0, line as f32 / lines as f32, 1.0, (line as f32 + 0.9) / lines as f32);
        let count = rng.random_range(3..=9);
        let text = word(rng, count);
        let height = (row.width() * 7.0 / (6.0 * count as f32)).min(row.height());
        let slack = row.width() - height * 6.0 / 7.0 * count as f32;
        canvas.text([row.x0 + slack * rng.random_range(0.0..1.0_f32), row.y0], height, &text, grey);
    }
}

pub(crate) fn word(rng: &mut ChaCha8Rng, length: usize) -> String {
    let vowels = *b"AEIOU";
    let letter = |i: usize| {
        if i % 2 == 1 && rng.random_bool(0.8) {
            char::from(vowels[rng.random_range(0..vowels.len())])
        } else if rng.random_bool(0.08) {
            ' '
        } else {
            char::from(b'A' + rng.random_range(0..26_u8))
        }
    };
    (0..length).map(letter).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mean 0, norm 1, of a 24 x 34 icon.
    fn icon(seed: u64) -> Vec<f32> {
        let texture = poster_of_size(seed, 24, 1.4);
        let mean = texture.data().iter().map(|&g| f32::from(g)).sum::<f32>() / texture.data().len() as f32;
        let centred: Vec<f32> = texture.data().iter().map(|&g| f32::from(g) - mean).collect();
        let norm = centred.iter().map(|g| g * g).sum::<f32>().sqrt();
        centred.iter().map(|g| g / norm).collect()
    }

    #[test]
    fn three_hundred_posters_differ() {
        let icons: Vec<_> = (0..300).map(icon).collect();
        let (mut highest, mut similar, mut pairs) = (-1.0_f32, 0, 0);
        for (i, a) in icons.iter().enumerate() {
            for b in &icons[..i] {
                let zncc: f32 = a.iter().zip(b).map(|(x, y)| x * y).sum();
                highest = highest.max(zncc);
                pairs += 1;
                similar += usize::from(zncc > 0.75);
            }
        }
        assert!(highest < 0.95, "two posters correlate by {highest}");
        assert!(similar * 1000 < pairs, "{similar} of {pairs} pairs above 0.75");
    }

    #[test]
    fn posters_have_contrast_and_repeat() {
        for seed in 0..40 {
            let texture = poster_of_size(seed, 48, 1.4);
            let mean =
                texture.data().iter().map(|&g| f64::from(g)).sum::<f64>() / texture.data().len() as f64;
            let spread = texture.data().iter().map(|&g| (f64::from(g) - mean).powi(2)).sum::<f64>();
            assert!((spread / texture.data().len() as f64).sqrt() > 15.0, "poster {seed} is nearly blank");
            assert_eq!(texture, poster_of_size(seed, 48, 1.4));
        }
        assert_ne!(poster_of_size(1, 48, 1.4), poster_of_size(2, 48, 1.4));
    }

    #[test]
    fn sizes_are_clamped() {
        assert_eq!(poster_of_size(1, 0, f32::NAN).width(), 8);
        assert_eq!(poster_of_size(1, usize::MAX, 0.0).width(), MAX_POSTER_WIDTH_TEXELS);
    }
}
