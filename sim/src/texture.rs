//! A grey picture for rendering from any distance and angle: a pyramid of halved levels, sampled
//! over the area that a pixel covers on the surface (trilinear, several taps along the longer axis
//! of that area). Coordinates run from 0 to 1 across the picture, s right and t down.

/// What lies beyond the border of a texture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Edge {
    /// The outermost texel is repeated.
    Clamp,
    /// The texture repeats, as tiles do.
    Repeat,
}

/// Most taps along the longer axis of a pixel's footprint.
const MAX_TAPS: f32 = 16.0;
/// A footprint less elongated than this counts as round and takes one tap: its axis would depend on
/// rounding.
const ROUND: f32 = 1.15;
/// From sqrt(2) texels on, the next level is the nearer one.
const NEXT_LEVEL: f32 = 0.414;

#[derive(Debug, Clone, PartialEq)]
struct Level {
    width: usize,
    height: usize,
    data: Vec<u8>,
}

/// A grey texture with its pyramid; level 0 is the full picture, each next one half as wide and
/// high.
#[derive(Debug, Clone, PartialEq)]
pub struct Texture {
    levels: Vec<Level>,
    edge: Edge,
    parts: Vec<[f32; 4]>,
}

/// How (s, t) change over one pixel to the right (`du`) and one pixel down (`dv`).
#[derive(Debug, Clone, Copy, Default)]
pub struct Footprint {
    /// d(s, t) per pixel along u.
    pub du: [f32; 2],
    /// d(s, t) per pixel along v.
    pub dv: [f32; 2],
}

impl Texture {
    /// Builds the pyramid of a row-major picture of `width * height` bytes. Missing bytes are
    /// black, surplus ones are dropped, an empty side becomes one texel: for generated pictures.
    pub fn new(width: usize, height: usize, mut data: Vec<u8>, edge: Edge) -> Self {
        let (width, height) = (width.max(1), height.max(1));
        data.resize(width * height, 0);
        let mut levels = vec![Level { width, height, data }];
        while let Some(last) = levels.last().filter(|l| l.width > 1 || l.height > 1) {
            levels.push(last.halved());
        }
        Self { levels, edge, parts: Vec::new() }
    }

    /// The same with the rectangles that are drawn in it: left, top, right, bottom, each 0 to 1.
    #[must_use]
    pub(crate) fn with_parts(self, parts: Vec<[f32; 4]>) -> Self {
        Self { parts, ..self }
    }

    /// Rectangles drawn in it (frames, panes, panels, patches), left, top, right, bottom from 0 to
    /// 1: real quads within the picture. Later shapes may cover one.
    pub fn parts(&self) -> &[[f32; 4]] {
        &self.parts
    }

    /// Width of the full picture in texels.
    pub fn width(&self) -> usize {
        self.levels[0].width
    }

    /// Height of the full picture in texels.
    pub fn height(&self) -> usize {
        self.levels[0].height
    }

    /// The full picture, row-major.
    pub fn data(&self) -> &[u8] {
        &self.levels[0].data
    }

    /// Mean grey level over the footprint of a pixel around (s, t), 0 to 255.
    pub fn sample(&self, s: f32, t: f32, footprint: &Footprint) -> f32 {
        let (w, h) = (self.levels[0].width as f32, self.levels[0].height as f32);
        let a = [footprint.du[0] * w, footprint.du[1] * h];
        let b = [footprint.dv[0] * w, footprint.dv[1] * h];
        // Axes of the ellipse J J^T in texels.
        let (xx, yy) = (a[0] * a[0] + b[0] * b[0], a[1] * a[1] + b[1] * b[1]);
        let xy = a[0] * a[1] + b[0] * b[1];
        let (sum, det) = (xx + yy, (a[0] * b[1] - a[1] * b[0]).abs());
        if sum <= 1.0 {
            return self.bilinear(0, s, t);
        }
        let long2 = 0.5 * (sum + (sum * sum - 4.0 * det * det).max(0.0).sqrt());
        if !(long2 > 1.0 && long2.is_finite()) {
            return self.bilinear(0, s, t);
        }
        let long = long2.sqrt();
        let short = (det / long).max(1.0);
        let ratio = long / short;
        if ratio < ROUND {
            let (level, fraction) = lod(long);
            return self.trilinear(level, fraction, s, t);
        }
        let taps = ((ratio - 1e-3).min(MAX_TAPS - 1.0) as usize + 1) as f32;
        let (level, fraction) = lod(short.max(long / taps));
        let axis = if xx > yy { [long2 - yy, xy] } else { [xy, long2 - xx] };
        let scale = long / (axis[0] * axis[0] + axis[1] * axis[1]).sqrt().max(f32::MIN_POSITIVE);
        let step = [axis[0] * scale / w / taps, axis[1] * scale / h / taps];
        // The nearest level will do: several taps blend their levels' texels anyway.
        let level = (level + usize::from(fraction > NEXT_LEVEL)).min(self.levels.len() - 1);
        let (mut s, mut t) = (s - 0.5 * (taps - 1.0) * step[0], t - 0.5 * (taps - 1.0) * step[1]);
        let mut mean = 0.0;
        for _ in 0..taps as usize {
            mean += self.bilinear(level, s, t);
            (s, t) = (s + step[0], t + step[1]);
        }
        mean / taps
    }

    fn trilinear(&self, level: usize, fraction: f32, s: f32, t: f32) -> f32 {
        let last = self.levels.len() - 1;
        if level >= last {
            return self.bilinear(last, s, t);
        }
        let fine = self.bilinear(level, s, t);
        if fraction < 0.02 {
            return fine;
        }
        fine + fraction * (self.bilinear(level + 1, s, t) - fine)
    }

    #[inline]
    fn bilinear(&self, level: usize, s: f32, t: f32) -> f32 {
        let l = &self.levels[level];
        let (s, t) = match self.edge {
            Edge::Clamp => (s, t),
            Edge::Repeat => (fraction_of(s), fraction_of(t)),
        };
        let (x, y) = (s * l.width as f32 - 0.5, t * l.height as f32 - 0.5);
        let (u, v) = (x as i32, y as i32);
        let inside = x >= 0.0 && y >= 0.0 && u + 1 < l.width as i32 && v + 1 < l.height as i32;
        if !inside {
            return l.bilinear_at_border(x, y, self.edge);
        }
        let (a, b) = (x - u as f32, y - v as f32);
        let from = v as usize * l.width + u as usize;
        let (top, bottom) = (&l.data[from..from + 2], &l.data[from + l.width..from + l.width + 2]);
        mix([top[0], top[1], bottom[0], bottom[1]], a, b)
    }
}

/// Bilinear mean of top left, top right, bottom left, bottom right.
#[inline]
fn mix(texels: [u8; 4], a: f32, b: f32) -> f32 {
    let [tl, tr, bl, br] = texels.map(f32::from);
    let (upper, lower) = (tl + a * (tr - tl), bl + a * (br - bl));
    upper + b * (lower - upper)
}

/// `x` minus the next lower integer; quicker than `floor` where the processor has no instruction
/// for it.
fn fraction_of(x: f32) -> f32 {
    let rest = x - x as i32 as f32;
    if rest < 0.0 { rest + 1.0 } else { rest }
}

/// The two texels around `x` and how far towards the second.
fn neighbours(x: f32, size: usize, edge: Edge) -> (usize, usize, f32) {
    let x = match edge {
        Edge::Clamp => x.clamp(0.0, (size - 1) as f32),
        Edge::Repeat if x < 0.0 => x + size as f32,
        Edge::Repeat => x,
    };
    let first = (x as usize).min(size - 1);
    let second = match edge {
        _ if first + 1 < size => first + 1,
        Edge::Clamp => first,
        Edge::Repeat => 0,
    };
    (first, second, x - first as f32)
}

/// Pyramid level of a footprint of `texels` (at least 1): the exponent, and the mantissa as a
/// linear stand-in for the fraction of the logarithm.
fn lod(texels: f32) -> (usize, f32) {
    let texels = texels.clamp(1.0, 1e6);
    let exponent = (texels.to_bits() >> 23) - 127;
    (exponent as usize, texels / (1_u32 << exponent) as f32 - 1.0)
}

impl Level {
    #[cold]
    fn bilinear_at_border(&self, x: f32, y: f32, edge: Edge) -> f32 {
        let (u0, u1, a) = neighbours(x, self.width, edge);
        let (v0, v1, b) = neighbours(y, self.height, edge);
        let at = |u: usize, v: usize| self.data[v * self.width + u];
        mix([at(u0, v0), at(u1, v0), at(u0, v1), at(u1, v1)], a, b)
    }

    /// Half the size by area; an odd side is weighted exactly, so that nothing shifts.
    fn halved(&self) -> Self {
        let (width, height) = ((self.width / 2).max(1), (self.height / 2).max(1));
        let columns = shares(self.width, width);
        let rows = shares(self.height, height);
        let mut data = Vec::with_capacity(width * height);
        for row in &rows {
            for column in &columns {
                let mut sum = 0.0;
                for &(v, weight_v) in row {
                    for &(u, weight_u) in column {
                        sum += weight_v * weight_u * f32::from(self.data[v * self.width + u]);
                    }
                }
                data.push((sum + 0.5) as u8);
            }
        }
        Self { width, height, data }
    }
}

/// For each of `to` cells, which of `from` cells it covers and with what share.
fn shares(from: usize, to: usize) -> Vec<Vec<(usize, f32)>> {
    let ratio = from as f32 / to as f32;
    let share = |i: usize| {
        let (low, high) = (i as f32 * ratio, (i + 1) as f32 * ratio);
        let overlap = |j: usize| (high.min((j + 1) as f32) - low.max(j as f32)).max(0.0) / ratio;
        (low as usize..from.min(high.ceil() as usize))
            .map(|j| (j, overlap(j)))
            .filter(|s| s.1 > 0.0)
            .collect()
    };
    (0..to).map(share).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp(width: usize, height: usize) -> Texture {
        let data = (0..width * height).map(|i| (i % width * 7 + i / width * 3) as u8).collect();
        Texture::new(width, height, data, Edge::Clamp)
    }

    #[test]
    fn texel_centres_come_back_unchanged() {
        let texture = ramp(16, 12);
        for (v, u) in (0..12).flat_map(|v| (0..16).map(move |u| (v, u))) {
            let grey =
                texture.sample((u as f32 + 0.5) / 16.0, (v as f32 + 0.5) / 12.0, &Footprint::default());
            assert!((grey - f32::from(texture.data()[v * 16 + u])).abs() < 1e-3);
        }
    }

    #[test]
    fn a_footprint_of_two_texels_is_their_box_mean() {
        let texture = ramp(16, 16);
        let footprint = Footprint { du: [2.0 / 16.0, 0.0], dv: [0.0, 2.0 / 16.0] };
        let grey = texture.sample(5.0 / 16.0, 7.0 / 16.0, &footprint);
        let at = |u: usize, v: usize| f32::from(texture.data()[v * 16 + u]);
        let expected = (at(4, 6) + at(5, 6) + at(4, 7) + at(5, 7)) / 4.0;
        assert!((grey - expected).abs() <= 0.5, "{grey} {expected}");
    }

    #[test]
    fn a_long_footprint_averages_along_its_axis_only() {
        // Columns alternate black and white every 16 texels, rows carry one white line.
        let data = (0..64 * 64).map(|i| if i / 64 == 20 { 255 } else { 0 }).collect();
        let texture = Texture::new(64, 64, data, Edge::Clamp);
        let along = Footprint { du: [16.0 / 64.0, 0.0], dv: [0.0, 1.0 / 64.0] };
        let across = Footprint { du: [1.0 / 64.0, 0.0], dv: [0.0, 16.0 / 64.0] };
        assert!(texture.sample(0.5, 20.5 / 64.0, &along) > 250.0);
        let blurred = texture.sample(0.5, 20.5 / 64.0, &across);
        assert!((blurred - 255.0 / 16.0).abs() < 6.0, "{blurred}");
    }

    #[test]
    fn odd_sizes_keep_their_mean_and_repeat_wraps() {
        let texture = ramp(15, 9);
        let mean = texture.data().iter().map(|&g| f32::from(g)).sum::<f32>() / 135.0;
        let whole = Footprint { du: [1.0, 0.0], dv: [0.0, 1.0] };
        assert!((texture.sample(0.5, 0.5, &whole) - mean).abs() < 3.0);
        let tiles = Texture::new(2, 1, vec![0, 200], Edge::Repeat);
        assert!((tiles.sample(0.0, 0.5, &Footprint::default()) - 100.0).abs() < 1e-3);
        assert!((tiles.sample(7.25, 0.5, &Footprint::default())).abs() < 1e-3);
        assert!((tiles.sample(-0.25, 3.5, &Footprint::default()) - 200.0).abs() < 1e-3);
    }
}
