//! Pictures with lines, dots and words on them, to show a person the stages of the detector.
//! Colours are RGB, coordinates pixels with (0, 0) the centre of the top-left one. Anything outside
//! is cut off.

use image::{ExtendedColorType, ImageEncoder as _, codecs::png};
use sim::font;
use std::path::Path;
use vision::{
    frame::GrayImage,
    geometry::{Corners, polygon},
};

/// Red, green, blue.
pub type Colour = [u8; 3];

// Colours that are told apart on grey, by colour-blind eyes too.
/// Green.
pub const GREEN: Colour = [60, 220, 90];
/// Red.
pub const RED: Colour = [255, 60, 50];
/// Blue.
pub const BLUE: Colour = [80, 150, 255];
/// Yellow.
pub const YELLOW: Colour = [255, 215, 0];
/// Orange.
pub const ORANGE: Colour = [255, 140, 30];
/// Cyan.
pub const CYAN: Colour = [0, 210, 230];
/// Magenta.
pub const MAGENTA: Colour = [240, 90, 230];
/// White.
pub const WHITE: Colour = [255, 255, 255];

/// Colours of a series; neighbours differ.
pub const SERIES: [Colour; 10] =
    [GREEN, ORANGE, BLUE, YELLOW, MAGENTA, CYAN, RED, [170, 255, 160], [190, 160, 255], [255, 190, 170]];

/// Height of the line of words under a picture.
const LEGEND_PX: usize = 22;
/// Pixels a dot of the letters.
const DOT_PX: usize = 2;

/// A colour picture.
#[derive(Debug, Clone)]
pub struct Picture {
    width: usize,
    height: usize,
    rgb: Vec<u8>,
}

impl Picture {
    /// A black one.
    pub fn black(width: usize, height: usize) -> Self {
        Self { width, height, rgb: vec![0; 3 * width * height] }
    }

    /// A grey image, its contrast times `brightness`.
    pub fn of(image: &GrayImage, brightness: f32) -> Self {
        let rgb = image.data().iter().flat_map(|g| [(f32::from(*g) * brightness) as u8; 3]).collect();
        Self { width: image.width(), height: image.height(), rgb }
    }

    /// Pixels in a row.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Lays `colour` over a pixel, 0 not at all, 1 completely.
    pub fn blend(&mut self, u: i64, v: i64, colour: Colour, share: f64) {
        if u < 0 || v < 0 || u >= self.width as i64 || v >= self.height as i64 {
            return;
        }
        let at = 3 * (v as usize * self.width + u as usize);
        for (old, new) in self.rgb[at..at + 3].iter_mut().zip(colour) {
            *old =
                (f64::from(*old) + share.clamp(0.0, 1.0) * (f64::from(new) - f64::from(*old))).round() as u8;
        }
    }

    /// A straight line with smooth edges.
    pub fn line(&mut self, from: [f64; 2], to: [f64; 2], width_px: f64, colour: Colour) {
        let Some((from, to)) = self.cut(from, to, width_px + 1.0) else { return };
        let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
        let length = dx.hypot(dy);
        let (ex, ey) = if length > 1e-9 { (dx / length, dy / length) } else { (1.0, 0.0) };
        let reach = 0.5 * width_px + 1.0;
        // Along the longer direction, a short stretch across at every step.
        let steep = dy.abs() > dx.abs();
        let (a, b) = if steep { (1, 0) } else { (0, 1) };
        let (low, high) = if from[a] <= to[a] { (from, to) } else { (to, from) };
        let slope = if high[a] > low[a] { (high[b] - low[b]) / (high[a] - low[a]) } else { 0.0 };
        let spread = reach * (1.0 + slope * slope).sqrt();
        for i in (low[a] - reach).floor() as i64..=(high[a] + reach).ceil() as i64 {
            let middle = low[b] + slope * (i as f64 - low[a]).clamp(0.0, (high[a] - low[a]).max(0.0));
            for j in (middle - spread).floor() as i64..=(middle + spread).ceil() as i64 {
                let (u, v) = if steep { (j, i) } else { (i, j) };
                let (x, y) = (u as f64 - from[0], v as f64 - from[1]);
                let (along, across) = (x * ex + y * ey, x * ey - y * ex);
                let beyond = (-along).max(along - length).max(0.0);
                let share = 0.5 * width_px + 0.5 - across.hypot(beyond);
                if share > 0.0 {
                    self.blend(u, v, colour, share);
                }
            }
        }
    }

    /// The part of a line that can be seen (Liang and Barsky), so that nothing far outside takes
    /// time.
    fn cut(&self, from: [f64; 2], to: [f64; 2], margin: f64) -> Option<([f64; 2], [f64; 2])> {
        if from.iter().chain(&to).any(|x| !x.is_finite()) {
            return None;
        }
        let (mut first, mut last) = (0.0_f64, 1.0_f64);
        for (axis, size) in [self.width, self.height].into_iter().enumerate() {
            let d = to[axis] - from[axis];
            let (low, high) = (-margin - from[axis], size as f64 + margin - from[axis]);
            if d.abs() < 1e-12 {
                if low > 0.0 || high < 0.0 {
                    return None;
                }
                continue;
            }
            first = first.max((low / d).min(high / d));
            last = last.min((low / d).max(high / d));
        }
        let at = |t: f64| [from[0] + t * (to[0] - from[0]), from[1] + t * (to[1] - from[1])];
        (first <= last).then(|| (at(first), at(last)))
    }

    /// A filled disc with a smooth edge.
    pub fn disc(&mut self, [x, y]: [f64; 2], radius_px: f64, colour: Colour) {
        self.line([x, y], [x, y], 2.0 * radius_px, colour);
    }

    /// The outline of a quad.
    pub fn quad(&mut self, corners: &Corners, width_px: f64, colour: Colour) {
        for (i, from) in corners.points().iter().enumerate() {
            let to = corners.points()[(i + 1) % 4];
            self.line([from.x, from.y], [to.x, to.y], width_px, colour);
        }
    }

    /// The inside of a quad, tinted.
    pub fn tint(&mut self, corners: &Corners, colour: Colour, share: f64) {
        let (low, high) = polygon::bounds(corners.points());
        let range = |low: f64, high: f64, size: usize| {
            (low.max(0.0) as usize).min(size)..(high.max(-1.0) + 1.0).min(size as f64) as usize
        };
        for v in range(low.y, high.y, self.height) {
            for u in range(low.x, high.x, self.width) {
                let p = nalgebra::Point2::new(u as f64, v as f64);
                if polygon::contains(corners.points(), &p, 0.0) {
                    self.blend(u as i64, v as i64, colour, share);
                }
            }
        }
    }

    /// Block capitals, `dot` pixels a dot, top left corner given. Gives the width.
    pub fn text(&mut self, [x, y]: [usize; 2], dot: usize, words: &str, colour: Colour) -> usize {
        let advance = (font::COLUMNS + 1) * dot;
        for (i, letter) in words.chars().enumerate() {
            for (row, bits) in font::glyph(letter.to_ascii_uppercase()).iter().enumerate() {
                for column in (0..font::COLUMNS).filter(|c| bits >> (font::COLUMNS - 1 - c) & 1 == 1) {
                    for k in 0..dot * dot {
                        let (u, v) = (x + i * advance + column * dot + k % dot, y + row * dot + k / dot);
                        self.blend(u as i64, v as i64, colour, 1.0);
                    }
                }
            }
        }
        words.chars().count() * advance
    }

    /// The same with a line of words below, each in its colour.
    #[must_use]
    pub fn with_legend(self, words: &[(&str, Colour)]) -> Self {
        let needed: usize = words.iter().map(|(w, _)| (w.chars().count() + 2) * (font::COLUMNS + 1)).sum();
        let dot = if needed * DOT_PX <= self.width { DOT_PX } else { 1 };
        let mut out = Self::black(self.width, self.height + LEGEND_PX);
        out.rgb[..self.rgb.len()].copy_from_slice(&self.rgb);
        let (mut x, y) = (4, self.height + (LEGEND_PX - font::ROWS * dot) / 2);
        for (word, colour) in words {
            x += out.text([x, y], dot, word, *colour) + 2 * (font::COLUMNS + 1) * dot;
        }
        out
    }

    /// Copies another picture in with its top left corner at (u, v).
    pub fn paste(&mut self, other: &Self, [u, v]: [usize; 2]) {
        let width = other.width.min(self.width.saturating_sub(u));
        for row in 0..other.height.min(self.height.saturating_sub(v)) {
            let to = 3 * ((v + row) * self.width + u);
            let from = 3 * row * other.width;
            self.rgb[to..to + 3 * width].copy_from_slice(&other.rgb[from..from + 3 * width]);
        }
    }

    /// Enlarged by a whole factor, every pixel a block.
    #[must_use]
    pub fn enlarged(&self, factor: usize) -> Self {
        let mut out = Self::black(self.width * factor, self.height * factor);
        for v in 0..out.height {
            for u in 0..out.width {
                let from = 3 * (v / factor * self.width + u / factor);
                let to = 3 * (v * out.width + u);
                out.rgb[to..to + 3].copy_from_slice(&self.rgb[from..from + 3]);
            }
        }
        out
    }

    /// The same with each of red, green and blue on one of `levels`: files of it are far smaller.
    #[must_use]
    pub fn posterised(&self, levels: u8) -> Self {
        let steps = f64::from(levels.max(2) - 1);
        let of = |c: &u8| ((f64::from(*c) * steps / 255.0).round() * 255.0 / steps).round() as u8;
        Self { rgb: self.rgb.iter().map(of).collect(), ..*self }
    }

    /// Writes it as a PNG file, quickly.
    pub fn save(&self, path: &Path) -> anyhow::Result<()> {
        self.write(path, png::CompressionType::Fast, png::FilterType::Sub)
    }

    /// Writes it as a PNG file, as small as may be.
    pub fn save_small(&self, path: &Path) -> anyhow::Result<()> {
        self.write(path, png::CompressionType::Best, png::FilterType::NoFilter)
    }

    fn write(&self, path: &Path, packed: png::CompressionType, by: png::FilterType) -> anyhow::Result<()> {
        let mut out = Vec::new();
        png::PngEncoder::new_with_quality(&mut out, packed, by).write_image(
            &self.rgb,
            self.width as u32,
            self.height as u32,
            ExtendedColorType::Rgb8,
        )?;
        anyhow::Context::with_context(std::fs::write(path, out), || {
            format!("cannot write {}", path.display())
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sum of the green channel.
    fn ink(p: &Picture) -> f64 {
        p.rgb.iter().skip(1).step_by(3).map(|x| f64::from(*x) / 255.0).sum()
    }

    #[test]
    fn a_line_has_its_length_and_width_in_any_direction() {
        for (to, length) in
            [([80.0, 20.0], 60.0), ([20.0, 80.0], 60.0), ([62.4, 62.4], 60.0), ([-22.0, 62.0], 59.4)]
        {
            let mut p = Picture::black(100, 100);
            p.line([20.0, 20.0], to, 2.0, WHITE);
            let visible = if to[0] < 0.0 { 28.3 } else { length };
            // The ends are round: about a disc of the width more.
            assert!((ink(&p) - 2.0 * visible - 3.1).abs() < 4.0, "{to:?}: {}", ink(&p));
        }
    }

    #[test]
    fn a_disc_is_round() {
        let mut p = Picture::black(40, 40);
        p.disc([20.0, 20.0], 10.0, WHITE);
        assert!((ink(&p) - std::f64::consts::PI * 100.0).abs() < 3.0, "{}", ink(&p));
    }

    #[test]
    fn what_is_outside_costs_nothing() {
        let mut p = Picture::black(10, 10);
        p.line([-1e12, 5.0], [1e12, 5.0], 1.0, WHITE);
        assert!((ink(&p) - 10.0).abs() < 1e-6, "{}", ink(&p));
        p.line([f64::NAN, 0.0], [3.0, 3.0], 1.0, WHITE);
        p.line([-5.0, -5.0], [-1e300, 3.0], 1.0, WHITE);
        assert!((ink(&p) - 10.0).abs() < 1e-6);
    }

    #[test]
    fn a_tint_covers_the_quad() {
        let mut p = Picture::black(30, 30);
        let quad = Corners::try_from([[5.0, 5.0], [24.0, 5.0], [24.0, 14.0], [5.0, 14.0]]).unwrap();
        p.tint(&quad, WHITE, 1.0);
        assert!((ink(&p) - 200.0).abs() < 1e-6, "{}", ink(&p));
    }

    #[test]
    fn words_leave_ink_and_the_legend_adds_a_line() {
        let mut p = Picture::black(200, 20);
        assert_eq!(p.text([0, 0], 1, "a1", WHITE), 12);
        let word = ink(&p);
        assert!(word > 10.0);
        let tall = p.with_legend(&[("quads", GREEN)]);
        assert!(tall.height() == 20 + LEGEND_PX && ink(&tall) > word);
    }
}
