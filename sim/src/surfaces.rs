//! Textures of the building itself: plaster, floor tiles, ceiling, baseboard, doors, windows,
//! lamps, concrete. Everything is drawn from a seed; sizes in metres belong to `building`.

use rand::RngExt;

use crate::canvas::{Area, Canvas, Noise};
use crate::seed;
use crate::texture::{Edge, Texture};

/// Painted plaster, 2 m by 2 m, repeating.
pub fn plaster(seed: u64) -> Texture {
    let mut rng = seed::stream(seed, 1);
    let mut canvas = Canvas::new(512, 512, rng.random_range(0.68..0.8));
    canvas.clouds(canvas.area(), &Noise::new(rng.random(), 4, 3), 0.05);
    canvas.clouds(canvas.area(), &Noise::new(rng.random(), 128, 1), 0.03);
    canvas.into_texture(Edge::Repeat)
}

/// Four by four square tiles with dark joints, repeating.
pub fn floor_tiles(seed: u64) -> Texture {
    let mut rng = seed::stream(seed, 2);
    let base: f32 = rng.random_range(0.36..0.5);
    let mut canvas = Canvas::new(512, 512, base - 0.15);
    for (row, column) in (0..4).flat_map(|r| (0..4).map(move |c| (r, c))) {
        let (x, y) = (column as f32 / 4.0, row as f32 / 4.0);
        let tile = Area::new(x, y, x + 0.25, y + 0.25).inset(0.003);
        canvas.rect(tile, base + rng.random_range(-0.035..0.035));
    }
    canvas.clouds(canvas.area(), &Noise::new(rng.random(), 64, 2), 0.08);
    canvas.into_texture(Edge::Repeat)
}

/// Ceiling panels, two by two, repeating.
pub fn ceiling_panels(seed: u64) -> Texture {
    let mut rng = seed::stream(seed, 3);
    let mut canvas = Canvas::new(256, 256, 0.62);
    for (row, column) in (0..2).flat_map(|r| (0..2).map(move |c| (r, c))) {
        let (x, y) = (column as f32 / 2.0, row as f32 / 2.0);
        canvas.rect(Area::new(x, y, x + 0.5, y + 0.5).inset(0.006), 0.85 + rng.random_range(-0.01..0.01));
    }
    canvas.clouds(canvas.area(), &Noise::new(rng.random(), 64, 2), 0.05);
    canvas.into_texture(Edge::Repeat)
}

/// A dark strip with a lighter upper lip.
pub fn baseboard(seed: u64) -> Texture {
    let mut rng = seed::stream(seed, 4);
    let mut canvas = Canvas::new(64, 32, rng.random_range(0.18..0.32));
    canvas.rect(Area::new(0.0, 0.0, 1.0, 0.08), 0.45);
    canvas.into_texture(Edge::Clamp)
}

/// A door with its frame, 0.95 m by 2.1 m: leaf, handle, a number plate, perhaps panels or a pane.
pub fn door(seed: u64) -> Texture {
    door_with(seed, None)
}

/// The same door with another number on its plate.
pub(crate) fn numbered_door(seed: u64, number: u32) -> Texture {
    door_with(seed, Some(number))
}

fn door_with(seed: u64, number: Option<u32>) -> Texture {
    let mut rng = seed::stream(seed, 5);
    let mut canvas = Canvas::new(256, 566, rng.random_range(0.25..0.4));
    let all = canvas.area();
    let leaf = Area::new(all.x0 + 0.06, all.y0 + 0.06, all.x1 - 0.06, all.y1);
    let tone: f32 = rng.random_range(0.45..0.62);
    canvas.rect(leaf, tone);
    canvas.clouds(leaf, &Noise::new(rng.random(), 24, 2), 0.05);
    match rng.random_range(0..3) {
        0 => {
            for (y0, y1) in [(0.06, 0.42), (0.52, 0.94)] {
                let panel = leaf.part(0.14, y0, 0.86, y1);
                canvas.frame(panel, 0.012, tone - 0.14);
                canvas.frame(panel.inset(0.012), 0.012, tone + 0.1);
            }
        }
        1 => canvas.rect(leaf.part(0.32, 0.1, 0.68, 0.38), 0.16),
        _ => {}
    }
    let left = rng.random_bool(0.5);
    let x = if left { 0.1 } else { 0.8 };
    canvas.rect(leaf.part(x, 0.5, x + 0.1, 0.512), 0.9);
    canvas.rect(leaf.part(x, 0.49, x + 0.03, 0.57), 0.8);
    let plate = leaf.part(0.4, 0.03, 0.62, 0.06);
    canvas.rect(plate, 0.92);
    let number = number.unwrap_or_else(|| rng.random_range(100..400)).to_string();
    canvas.text([plate.x0 + 0.02, plate.y0 + 0.012], plate.height() - 0.024, &number, 0.1);
    canvas.into_texture(Edge::Clamp)
}

/// A window with a light frame, four panes and what is outside.
pub fn window(seed: u64) -> Texture {
    let mut rng = seed::stream(seed, 6);
    let mut canvas = Canvas::new(320, 320, 0.38);
    let view = canvas.area().inset(0.05);
    let noise = Noise::new(rng.random(), rng.random_range(3..6), 4);
    let horizon = rng.random_range(0.55..0.75);
    canvas.note(view);
    canvas.paint(view, |x, y, _| {
        if y < horizon + 0.2 * (noise.at(x, 0.5) - 0.5) {
            0.98 - 0.15 * y
        } else {
            0.3 + 0.3 * noise.at(x, y)
        }
    });
    canvas.rect(view.part(0.47, 0.0, 0.53, 1.0), 0.38);
    canvas.rect(view.part(0.0, 0.47, 1.0, 0.53), 0.38);
    for (x, y) in [(0.0, 0.0), (0.53, 0.0), (0.0, 0.53), (0.53, 0.53)] {
        canvas.note(view.part(x, y, x + 0.47, y + 0.47));
    }
    canvas.into_texture(Edge::Clamp)
}

/// A ceiling lamp: a bright diffuser in a narrow rim.
pub fn lamp() -> Texture {
    let mut canvas = Canvas::new(128, 32, 0.55);
    canvas.rect(canvas.area().inset(0.012), 1.0);
    canvas.into_texture(Edge::Clamp)
}

/// Fair-faced concrete, 1 m by 1 m, repeating.
pub fn concrete(seed: u64) -> Texture {
    let mut rng = seed::stream(seed, 7);
    let mut canvas = Canvas::new(256, 256, rng.random_range(0.48..0.58));
    canvas.clouds(canvas.area(), &Noise::new(rng.random(), 4, 5), 0.16);
    canvas.into_texture(Edge::Repeat)
}
