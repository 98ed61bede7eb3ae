//! Content of frames and boards: generated paintings, prints, photographs, papers and signs. A
//! generator in, a texture out. Posters with letters and a border are `posters`'.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::canvas::{Area, Canvas, Noise};
use crate::posters;
use crate::texture::{Edge, Texture};

/// Width of a generated picture in texels.
const WIDTH_TEXELS: usize = 200;
/// Words of signs.
const WORDS: [&str; 12] = [
    "EXIT",
    "SORTIE",
    "USCITA",
    "NOTAUSGANG",
    "AUSGANG",
    "SALIDA",
    "EXIT 2",
    "FIRE EXIT",
    "WC",
    "PUSH",
    "101",
    "B 24",
];

/// A picture of a height over width from 0.25 to 4.
pub(super) fn picture(rng: &mut ChaCha8Rng, aspect: f64) -> Texture {
    let aspect = aspect.clamp(0.25, 4.0) as f32;
    if rng.random_bool(0.2) {
        return posters::poster_of_size(rng.random(), WIDTH_TEXELS, aspect);
    }
    let ground = rng.random_range(0.05..0.95);
    let mut canvas = Canvas::new(WIDTH_TEXELS, (WIDTH_TEXELS as f32 * aspect) as usize, ground);
    match rng.random_range(0..8) {
        0 => landscape(&mut canvas, rng),
        1 => fields(&mut canvas, rng),
        2 => strokes(&mut canvas, rng, 14, 0.5),
        3 => strokes(&mut canvas, rng, 90, 0.15),
        4 => still_life(&mut canvas, rng),
        5 => mondrian(&mut canvas, rng),
        6 => photograph(&mut canvas, rng),
        // Nearly blank.
        _ => strokes(&mut canvas, rng, 2, 0.1),
    }
    let grain = Noise::new(rng.random(), rng.random_range(20..90), 2);
    canvas.clouds(canvas.area(), &grain, rng.random_range(0.0..0.15));
    canvas.into_texture(Edge::Clamp)
}

/// A sheet with lines of type on `ground`.
pub(super) fn sheet(rng: &mut ChaCha8Rng, aspect: f64, ground: f32) -> Texture {
    let aspect = aspect.clamp(0.25, 4.0) as f32;
    let mut canvas = Canvas::new(WIDTH_TEXELS, (WIDTH_TEXELS as f32 * aspect) as usize, ground);
    let ink = if ground > 0.4 {
        ground - rng.random_range(0.15..0.4)
    } else {
        ground + rng.random_range(0.15..0.5)
    };
    let all = canvas.area();
    let (mut y, size) = (all.y1 * rng.random_range(0.06..0.3), rng.random_range(0.03..0.12_f32));
    let end = all.y1 * rng.random_range(0.4..0.95);
    while y + size < end {
        let letters = ((0.85 / size) as usize).clamp(2, 40);
        let count = rng.random_range(1..=letters);
        let text: String = (0..count).map(|_| char::from(b'A' + rng.random_range(0..26_u8))).collect();
        canvas.text([0.08, y], size, &text, ink);
        y += size * rng.random_range(1.3..2.2);
    }
    canvas.into_texture(Edge::Clamp)
}

/// A sign of `ground` with a word or a figure and an arrow in `ink`.
pub(super) fn sign(rng: &mut ChaCha8Rng, aspect: f64, [ground, ink]: [f32; 2]) -> Texture {
    let aspect = aspect.clamp(0.25, 2.0) as f32;
    let mut canvas = Canvas::new(WIDTH_TEXELS, (WIDTH_TEXELS as f32 * aspect) as usize, ground);
    let all = canvas.area();
    if rng.random_bool(0.35) {
        canvas.frame(all.inset(rng.random_range(0.0..0.04)), rng.random_range(0.01..0.04), ink);
    }
    if rng.random_bool(0.55) {
        let word = WORDS[rng.random_range(0..WORDS.len())];
        let wide = 0.9 * 7.0 / (6.0 * word.len() as f32);
        let height = wide.min(0.8 * all.y1) * rng.random_range(0.6..1.0_f32);
        let left = 0.5 * (1.0 - height * 6.0 / 7.0 * word.len() as f32);
        canvas.text([left, 0.5 * (all.y1 - height)], height, word, ink);
    } else {
        let turned = rng.random_bool(0.5);
        figure(
            &mut canvas,
            all.part(if turned { 0.55 } else { 0.1 }, 0.1, if turned { 0.9 } else { 0.45 }, 0.9),
            ink,
        );
        arrow(
            &mut canvas,
            all.part(if turned { 0.08 } else { 0.52 }, 0.2, if turned { 0.48 } else { 0.92 }, 0.8),
            ink,
            turned,
        );
    }
    canvas.into_texture(Edge::Clamp)
}

fn figure(canvas: &mut Canvas, at: Area, ink: f32) {
    let r = 0.1 * at.height();
    let point = |x: f32, y: f32| [at.x0 + x * at.width(), at.y0 + y * at.height()];
    canvas.ellipse(point(0.6, 0.12), r, r, ink);
    canvas.polygon(&[point(0.4, 0.25), point(0.65, 0.28), point(0.55, 0.6), point(0.35, 0.58)], ink);
    canvas.polygon(&[point(0.4, 0.55), point(0.55, 0.58), point(0.85, 0.95), point(0.7, 0.98)], ink);
    canvas.polygon(&[point(0.35, 0.55), point(0.48, 0.6), point(0.2, 0.98), point(0.05, 0.9)], ink);
    canvas.polygon(&[point(0.6, 0.3), point(0.95, 0.4), point(0.95, 0.5), point(0.58, 0.42)], ink);
}

fn arrow(canvas: &mut Canvas, at: Area, ink: f32, left: bool) {
    let point = |x: f32, y: f32| {
        let x = if left { 1.0 - x } else { x };
        [at.x0 + x * at.width(), at.y0 + y * at.height()]
    };
    canvas.polygon(&[point(0.0, 0.35), point(0.6, 0.35), point(0.6, 0.65), point(0.0, 0.65)], ink);
    canvas.polygon(&[point(0.55, 0.05), point(1.0, 0.5), point(0.55, 0.95)], ink);
}

fn landscape(canvas: &mut Canvas, rng: &mut ChaCha8Rng) {
    let all = canvas.area();
    let sky: f32 = rng.random_range(0.3..0.95);
    let noise = Noise::new(rng.random(), rng.random_range(2..6), 5);
    canvas.paint(all, |x, y, _| sky + 0.4 * (noise.at(x, y) - 0.5));
    for _ in 0..rng.random_range(1..5) {
        let (horizon, grey) = (all.y1 * rng.random_range(0.3..0.9), rng.random_range(0.05..0.7));
        let ridge = Noise::new(rng.random(), rng.random_range(2..8), 4);
        canvas.paint(all, |x, y, under| {
            let below = y > horizon + 0.4 * (ridge.at(x, 0.3) - 0.5);
            if below { grey + 0.3 * (noise.at(y, x) - 0.5) } else { under }
        });
    }
}

fn fields(canvas: &mut Canvas, rng: &mut ChaCha8Rng) {
    let all = canvas.area();
    let mut top = rng.random_range(0.0..0.15);
    while top < 0.95 {
        let bottom = top + rng.random_range(0.1..0.6);
        let edge = rng.random_range(0.0..0.1);
        let band = all.part(edge, top, 1.0 - edge, f32::min(bottom, 1.0));
        let (grey, noise) = (rng.random_range(0.05..0.95), Noise::new(rng.random(), 6, 3));
        canvas.paint(band, |x, y, _| grey + 0.12 * (noise.at(x, y) - 0.5));
        top = bottom + rng.random_range(0.0..0.06);
    }
}

fn strokes(canvas: &mut Canvas, rng: &mut ChaCha8Rng, count: usize, size: f32) {
    let all = canvas.area();
    let base: f32 = rng.random_range(0.0..1.0);
    for _ in 0..rng.random_range(1..=count) {
        let (x, y) = (rng.random_range(0.0..1.0), all.y1 * rng.random_range(0.0..1.0_f32));
        let (turn, long) = (rng.random_range(0.0..3.1_f32), size * rng.random_range(0.2..1.0_f32));
        let wide = long * rng.random_range(0.05..0.6_f32);
        let (c, s) = (turn.cos(), turn.sin());
        let grey = (base + rng.random_range(-0.5..0.5_f32)).clamp(0.0, 1.0);
        if rng.random_bool(0.3) {
            canvas.ellipse([x, y], 0.5 * long, 0.5 * wide, grey);
        } else {
            let point = |a: f32, b: f32| [x + a * long * c - b * wide * s, y + a * long * s + b * wide * c];
            canvas.polygon(&[point(-0.5, -0.5), point(0.5, -0.5), point(0.5, 0.5), point(-0.5, 0.5)], grey);
        }
    }
}

/// Round things on a table, or a head before a ground.
fn still_life(canvas: &mut Canvas, rng: &mut ChaCha8Rng) {
    let all = canvas.area();
    let (back, table): (f32, f32) = (rng.random_range(0.05..0.6), rng.random_range(0.1..0.9));
    let noise = Noise::new(rng.random(), 3, 4);
    canvas.paint(all, |x, y, _| back + 0.3 * (noise.at(x, y) - 0.5));
    canvas.rect(all.part(0.0, rng.random_range(0.5..0.8), 1.0, 1.0), table);
    for _ in 0..rng.random_range(1..9) {
        let centre = [rng.random_range(0.1..0.9), all.y1 * rng.random_range(0.3..0.85_f32)];
        let (a, b) = (rng.random_range(0.04..0.3), rng.random_range(0.04..0.3_f32));
        let (grey, shine) = (rng.random_range(0.05..0.9_f32), rng.random_range(0.0..0.3));
        canvas.ellipse(centre, a, b, grey);
        canvas.ellipse([centre[0] - 0.3 * a, centre[1] - 0.3 * b], 0.4 * a, 0.4 * b, (grey + shine).min(1.0));
    }
}

fn mondrian(canvas: &mut Canvas, rng: &mut ChaCha8Rng) {
    let all = canvas.area();
    let line = rng.random_range(0.0..0.03);
    canvas.paint(all, |_, _, _| 0.08);
    let mut left = 0.0;
    while left < 1.0 {
        let right = f32::min(left + rng.random_range(0.1..0.5), 1.0);
        let mut top = 0.0;
        while top < 1.0 {
            let bottom = f32::min(top + rng.random_range(0.1..0.6), 1.0);
            let grey = rng.random_range(0.1..1.0);
            canvas.rect(all.part(left, top, right, bottom).inset(line), grey);
            top = bottom;
        }
        left = right;
    }
}

fn photograph(canvas: &mut Canvas, rng: &mut ChaCha8Rng) {
    let noise = Noise::new(rng.random(), rng.random_range(3..9), 5);
    let gain = rng.random_range(1.0..3.0);
    canvas.paint(canvas.area(), |x, y, _| 0.5 + gain * (noise.at(x, y) - 0.5));
    strokes(canvas, rng, 12, 0.35);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed;

    #[test]
    fn pictures_differ_and_repeat() {
        let of = |s: u64| picture(&mut seed::stream(s, 1), 0.8);
        for s in 0..30 {
            assert_eq!(of(s), of(s));
            assert_ne!(of(s).data(), of(s + 1).data());
        }
        let mut rng = seed::stream(1, 2);
        assert_eq!(picture(&mut rng, f64::MAX).height(), 4 * WIDTH_TEXELS);
    }

    #[test]
    fn signs_and_sheets_show_their_ink() {
        for s in 0..20 {
            let mut rng = seed::stream(s, 1);
            let sign = sign(&mut rng, 0.5, [0.2, 0.9]);
            let share = |t: &Texture, grey: u8| {
                t.data().iter().filter(|g| g.abs_diff(grey) < 3).count() as f64 / t.data().len() as f64
            };
            assert!(share(&sign, 51) > 0.3 && share(&sign, 230) > 0.005, "{s}");
            let sheet = sheet(&mut rng, 1.4, 0.9);
            let ground = share(&sheet, 230);
            assert!(ground > 0.4 && ground < 1.0, "{s}: {ground}");
        }
    }
}
