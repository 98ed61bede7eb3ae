//! A grey picture that can be looked at from any distance and angle: a pyramid of halved levels, sampled over the
//! area that a pixel covers on the surface (trilinear, several taps along the longer axis of that area).
//! Knows nothing of cameras or metres: coordinates run from 0 to 1 across the picture, s right and t down.

/// What lies beyond the border of a texture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Edge {
    /// The outermost texel goes on for ever.
    Clamp,
    /// The texture repeats, as tiles do.
    Repeat,
}

/// Most taps along the longer axis of a pixel's footprint.
const MAX_TAPS: f32 = 16.0;

#[derive(Debug, Clone, PartialEq)]
struct Level {
    width: usize,
    height: usize,
    data: Vec<u8>,
}

/// A grey texture with its pyramid; level 0 is the full picture, each next one half as wide and high.
#[derive(Debug, Clone, PartialEq)]
pub struct Texture {
    levels: Vec<Level>,
    edge: Edge,
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
    /// Builds the pyramid of a row-major picture of `width * height` bytes. A missing or surplus byte is made up
    /// with black or dropped, an empty side becomes one texel: generated pictures only.
    pub fn new(width: usize, height: usize, mut data: Vec<u8>, edge: Edge) -> Self {
        let (width, height) = (width.max(1), height.max(1));
        data.resize(width * height, 0);
        let mut levels = vec![Level { width, height, data }];
        while let Some(last) = levels.last().filter(|l| l.width > 1 || l.height > 1) {
            levels.push(last.halved());
        }
        Self { levels, edge }
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
        let long2 = 0.5 * (sum + (sum * sum - 4.0 * det * det).max(0.0).sqrt());
        if !(long2 > 1.0 && long2.is_finite()) {
            return self.bilinear(0, s, t);
        }
        let long = long2.sqrt();
        let short = (det / long).max(1.0);
        let taps = (long / short).ceil().clamp(1.0, MAX_TAPS);
        let (level, fraction) = lod(short.max(long / taps));
        if taps < 1.5 {
            return self.trilinear(level, fraction, s, t);
        }
        let axis = if xx > yy { [long2 - yy, xy] } else { [xy, long2 - xx] };
        let scale = long / (axis[0] * axis[0] + axis[1] * axis[1]).sqrt().max(f32::MIN_POSITIVE);
        let step = [axis[0] * scale / w / taps, axis[1] * scale / h / taps];
        let mut mean = 0.0;
        for i in 0..taps as usize {
            let k = i as f32 + 0.5 - 0.5 * taps;
            mean += self.trilinear(level, fraction, s + k * step[0], t + k * step[1]);
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

    fn bilinear(&self, level: usize, s: f32, t: f32) -> f32 {
        let l = &self.levels[level];
        let (s, t) = match self.edge {
            Edge::Clamp => (s.clamp(0.0, 1.0), t.clamp(0.0, 1.0)),
            Edge::Repeat => (s - s.floor(), t - t.floor()),
        };
        let (u0, u1, a) = neighbours(s * l.width as f32 - 0.5, l.width, self.edge);
        let (v0, v1, b) = neighbours(t * l.height as f32 - 0.5, l.height, self.edge);
        let (top, bottom) = (v0 * l.width, v1 * l.width);
        let at = |i: usize| f32::from(l.data[i]);
        let upper = at(top + u0) + a * (at(top + u1) - at(top + u0));
        let lower = at(bottom + u0) + a * (at(bottom + u1) - at(bottom + u0));
        upper + b * (lower - upper)
    }
}

/// The two texels around `x` and how far towards the second.
fn neighbours(x: f32, size: usize, edge: Edge) -> (usize, usize, f32) {
    if x < 0.0 {
        return match edge {
            Edge::Clamp => (0, 0, 0.0),
            Edge::Repeat => (size - 1, 0, x + 1.0),
        };
    }
    let first = (x as usize).min(size - 1);
    let second = match edge {
        _ if first + 1 < size => first + 1,
        Edge::Clamp => first,
        Edge::Repeat => 0,
    };
    (first, second, x - first as f32)
}

/// Pyramid level of a footprint of `texels` (at least 1): the exponent, and the mantissa as a linear stand-in for the
/// fraction of the logarithm.
fn lod(texels: f32) -> (usize, f32) {
    let texels = texels.clamp(1.0, 1e6);
    let exponent = (texels.to_bits() >> 23) - 127;
    (exponent as usize, texels / (1_u32 << exponent) as f32 - 1.0)
}

impl Level {
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
