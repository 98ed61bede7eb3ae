//! Drawing for the texture generators: flat fills, discs, polygons, noise and block letters on a
//! grey canvas. Units are canvas widths (x 0 to 1, y 0 to height/width), so that a drawing does not
//! depend on its resolution; greys run from 0 to 1. It has what the posters need.

use crate::font;
use crate::texture::{Edge, Texture};

/// Most rectangles that a drawing lists.
const MAX_PARTS: usize = 256;

/// A grey drawing under way.
pub(crate) struct Canvas {
    width: usize,
    height: usize,
    grey: Vec<f32>,
    parts: Vec<Area>,
}

/// A rectangle in canvas units.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Area {
    pub(crate) x0: f32,
    pub(crate) y0: f32,
    pub(crate) x1: f32,
    pub(crate) y1: f32,
}

impl Area {
    pub(crate) fn new(x0: f32, y0: f32, x1: f32, y1: f32) -> Self {
        Self { x0, y0, x1, y1 }
    }

    pub(crate) fn width(&self) -> f32 {
        self.x1 - self.x0
    }

    pub(crate) fn height(&self) -> f32 {
        self.y1 - self.y0
    }

    pub(crate) fn inset(&self, by: f32) -> Self {
        Self::new(self.x0 + by, self.y0 + by, self.x1 - by, self.y1 - by)
    }

    /// The part between the relative positions (0 to 1) of this area.
    pub(crate) fn part(&self, x0: f32, y0: f32, x1: f32, y1: f32) -> Self {
        let (w, h) = (self.width(), self.height());
        Self::new(self.x0 + x0 * w, self.y0 + y0 * h, self.x0 + x1 * w, self.y0 + y1 * h)
    }

    pub(crate) fn centre(&self) -> [f32; 2] {
        [0.5 * (self.x0 + self.x1), 0.5 * (self.y0 + self.y1)]
    }
}

impl Canvas {
    pub(crate) fn new(width: usize, height: usize, grey: f32) -> Self {
        Self { width, height, grey: vec![grey; width * height], parts: vec![] }
    }

    /// A canvas with the content of a picture.
    pub(crate) fn of(picture: &Texture) -> Self {
        let grey = picture.data().iter().map(|g| f32::from(*g) / 255.0).collect();
        Self { width: picture.width(), height: picture.height(), grey, parts: vec![] }
    }

    /// Grey at a place, 0 to 1 across and down.
    pub(crate) fn grey_at(&self, s: f32, t: f32) -> f32 {
        let texel = |x: f32, size: usize| ((x * size as f32).max(0.0) as usize).min(size - 1);
        self.grey[texel(t, self.height) * self.width + texel(s, self.width)]
    }

    /// The whole canvas.
    pub(crate) fn area(&self) -> Area {
        Area::new(0.0, 0.0, 1.0, self.height as f32 / self.width as f32)
    }

    pub(crate) fn into_texture(self, edge: Edge) -> Texture {
        let data = self.grey.iter().map(|g| (g.clamp(0.0, 1.0) * 255.0 + 0.5) as u8).collect();
        let all = self.area();
        let relative = |a: &Area| [a.x0, a.y0 / all.y1, a.x1, a.y1 / all.y1].map(|x| x.clamp(0.0, 1.0));
        let parts = self.parts.iter().map(relative).filter(|p| p[2] > p[0] && p[3] > p[1]).collect();
        Texture::new(self.width, self.height, data, edge).with_parts(parts)
    }

    /// Lists the area as a visible rectangle, up to [`MAX_PARTS`].
    pub(crate) fn note(&mut self, area: Area) {
        if self.parts.len() < MAX_PARTS {
            self.parts.push(area);
        }
    }

    /// Sets every texel with its centre in `area` to `f(x, y, present grey)`.
    pub(crate) fn paint(&mut self, area: Area, mut f: impl FnMut(f32, f32, f32) -> f32) {
        let unit = self.width as f32;
        let range = |low: f32, high: f32, size: usize| {
            let clamp = |x: f32| (x * unit + 0.5).clamp(0.0, size as f32) as usize;
            clamp(low)..clamp(high)
        };
        for v in range(area.y0, area.y1, self.height) {
            for u in range(area.x0, area.x1, self.width) {
                let grey = &mut self.grey[v * self.width + u];
                *grey = f((u as f32 + 0.5) / unit, (v as f32 + 0.5) / unit, *grey);
            }
        }
    }

    /// Paints `grey` where the signed distance `d(x, y)` is negative, with soft edges of one texel.
    pub(crate) fn shape(&mut self, area: Area, grey: f32, d: impl Fn(f32, f32) -> f32) {
        let unit = self.width as f32;
        self.paint(area, |x, y, under| under + (0.5 - d(x, y) * unit).clamp(0.0, 1.0) * (grey - under));
    }

    pub(crate) fn rect(&mut self, area: Area, grey: f32) {
        self.note(area);
        self.paint(area, |_, _, _| grey);
    }

    /// A frame of the given thickness along the inside of `area`.
    pub(crate) fn frame(&mut self, area: Area, thickness: f32, grey: f32) {
        let inner = area.inset(thickness);
        self.note(area);
        self.note(inner);
        self.paint(area, |x, y, under| {
            let inside = x > inner.x0 && x < inner.x1 && y > inner.y0 && y < inner.y1;
            if inside { under } else { grey }
        });
    }

    /// An ellipse with half axes `a` and `b`.
    pub(crate) fn ellipse(&mut self, [cx, cy]: [f32; 2], a: f32, b: f32, grey: f32) {
        let area = Area::new(cx - 1.1 * a, cy - 1.1 * b, cx + 1.1 * a, cy + 1.1 * b);
        self.shape(area, grey, |x, y| {
            let r = ((x - cx) / a).hypot((y - cy) / b);
            (r - 1.0) * a.min(b)
        });
    }

    /// A convex polygon, either orientation.
    pub(crate) fn polygon(&mut self, points: &[[f32; 2]], grey: f32) {
        let bound = |i: usize, f: fn(f32, f32) -> f32| points.iter().map(|p| p[i]).reduce(f).unwrap_or(0.0);
        let area = Area::new(bound(0, f32::min), bound(1, f32::min), bound(0, f32::max), bound(1, f32::max));
        let edges: Vec<[f32; 4]> = points
            .iter()
            .zip(points.iter().cycle().skip(1))
            .map(|(p, q)| {
                let (dx, dy) = (q[0] - p[0], q[1] - p[1]);
                let length = dx.hypot(dy).max(1e-6);
                [p[0], p[1], dy / length, -dx / length]
            })
            .collect();
        let distance = |e: &[f32; 4], x: f32, y: f32| (x - e[0]) * e[2] + (y - e[1]) * e[3];
        let [cx, cy] = area.centre();
        let side = if edges.iter().map(|e| distance(e, cx, cy)).sum::<f32>() > 0.0 { -1.0 } else { 1.0 };
        self.shape(area, grey, |x, y| {
            edges.iter().map(|e| side * distance(e, x, y)).fold(f32::MIN, f32::max)
        });
    }

    /// Clouds: `octaves` of value noise, `cells` lattice cells per canvas width at the coarsest,
    /// blended over the canvas with `strength` (0 to 1). Repeats with the canvas when that is
    /// square.
    pub(crate) fn clouds(&mut self, area: Area, noise: &Noise, strength: f32) {
        self.paint(area, |x, y, under| under + strength * (noise.at(x, y) - 0.5));
    }

    /// Block letters, `height` tall, top left corner at (x, y); unknown letters are blank. Returns
    /// the width.
    pub(crate) fn text(&mut self, [x, y]: [f32; 2], height: f32, text: &str, grey: f32) -> f32 {
        let dot = height / font::ROWS as f32;
        for (i, letter) in text.chars().enumerate() {
            let left = x + (i * (font::COLUMNS + 1)) as f32 * dot;
            let rows = font::glyph(letter);
            let area = Area::new(left, y, left + font::COLUMNS as f32 * dot, y + height);
            self.paint(area, |px, py, under| {
                let column = (((px - left) / dot) as usize).min(font::COLUMNS - 1);
                let row = (((py - y) / dot) as usize).min(font::ROWS - 1);
                if rows[row] >> (font::COLUMNS - 1 - column) & 1 == 1 { grey } else { under }
            });
        }
        (text.chars().count() * (font::COLUMNS + 1)) as f32 * dot
    }
}

/// Value noise on lattices that repeat: `cells` a canvas width at the coarsest octave, twice as
/// many at each next.
#[derive(Debug, Clone)]
pub(crate) struct Noise {
    octaves: Vec<Lattice>,
}

#[derive(Debug, Clone)]
struct Lattice {
    cells: usize,
    values: Vec<f32>,
}

impl Noise {
    pub(crate) fn new(seed: u64, cells: usize, octaves: u32) -> Self {
        let lattice = |octave: u32| {
            let cells = cells << octave;
            let key = seed ^ u64::from(octave) << 56;
            Lattice { cells, values: (0..cells * cells).map(|i| hash(key ^ i as u64)).collect() }
        };
        Self { octaves: (0..octaves).map(lattice).collect() }
    }

    /// 0 to 1, mean about one half.
    pub(crate) fn at(&self, x: f32, y: f32) -> f32 {
        let (mut sum, mut weight, mut total) = (0.0, 0.5, 0.0);
        for lattice in &self.octaves {
            sum += weight * lattice.at(x, y);
            total += weight;
            weight *= 0.5;
        }
        sum / total
    }
}

impl Lattice {
    fn at(&self, x: f32, y: f32) -> f32 {
        let (i0, i1, a) = self.around(x);
        let (j0, j1, b) = self.around(y);
        let at = |i: usize, j: usize| self.values[j * self.cells + i];
        let upper = at(i0, j0) + a * (at(i1, j0) - at(i0, j0));
        let lower = at(i0, j1) + a * (at(i1, j1) - at(i0, j1));
        upper + b * (lower - upper)
    }

    /// The two lattice points around a position that is not negative, and a smooth step from the
    /// first to the second.
    fn around(&self, x: f32) -> (usize, usize, f32) {
        let x = (x * self.cells as f32).max(0.0);
        let i = x as usize;
        let f = x - i as f32;
        (i % self.cells, (i + 1) % self.cells, f * f * (3.0 - 2.0 * f))
    }
}

fn hash(key: u64) -> f32 {
    (crate::seed::mix(key) >> 40) as f32 / (1_u64 << 24) as f32
}
