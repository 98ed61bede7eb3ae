//! From light to grey levels: blur by lens and motion, vignetting, exposure, noise, eight bits.

use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};
use vision::frame::GrayImage;

use crate::seed;

/// Widest blur, standard deviation or length.
pub const MAX_BLUR_PX: f64 = 30.0;

/// Parameters of an image sensor. The default is a decent camera in a lit corridor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SensorParams {
    /// Factor on all light; 1 is well exposed.
    pub exposure: f64,
    /// Added to every grey level.
    pub offset: f64,
    /// Loss of light in the corners, 0 to 1; grows with the square of the distance from the centre.
    pub vignetting: f64,
    /// Standard deviation of the lens's blur, 0 to 30 px.
    pub blur_sigma_px: f64,
    /// Movement of the whole picture during exposure (u, v), at most 30 px long.
    pub motion_px: [f64; 2],
    /// Standard deviation of the noise in the dark, in grey levels.
    pub read_noise: f64,
    /// Variance of the noise per grey level of signal.
    pub shot_noise: f64,
}

impl Default for SensorParams {
    fn default() -> Self {
        Self {
            exposure: 1.0,
            offset: 0.0,
            vignetting: 0.2,
            blur_sigma_px: 0.5,
            motion_px: [0.0, 0.0],
            read_noise: 1.2,
            shot_noise: 0.012,
        }
    }
}

impl SensorParams {
    /// A sensor that shows the light as it is: no blur, vignetting or noise.
    pub fn ideal() -> Self {
        Self { vignetting: 0.0, blur_sigma_px: 0.0, read_noise: 0.0, shot_noise: 0.0, ..Self::default() }
    }
}

/// Turns light (grey levels before exposure, row-major) into a picture.
pub(crate) fn expose(light: &mut Vec<f32>, width: usize, p: &SensorParams, seed: u64) -> GrayImage {
    let height = light.len() / width;
    blur(light, width, p.blur_sigma_px);
    smear(light, width, p.motion_px);
    let (cu, cv) = (0.5 * (width as f32 - 1.0), 0.5 * (height as f32 - 1.0));
    let corner2 = cu * cu + cv * cv;
    let (gain, loss) = (p.exposure as f32, p.vignetting as f32 / corner2.max(1.0));
    let (read2, shot, offset) = (p.read_noise.powi(2) as f32, p.shot_noise as f32, p.offset as f32);
    let mut rng = seed::stream(seed, 30);
    let noisy = read2 > 0.0 || shot > 0.0;
    let mut data = Vec::with_capacity(light.len());
    for (v, row) in light.chunks_exact(width).enumerate() {
        let dv2 = (v as f32 - cv).powi(2);
        for (u, l) in row.iter().enumerate() {
            let r2 = (u as f32 - cu).powi(2) + dv2;
            let mut grey = gain * l * (1.0 - loss * r2) + offset;
            if noisy {
                let draw: f32 = StandardNormal.sample(&mut rng);
                grey += draw * (read2 + shot * grey.max(0.0)).sqrt();
            }
            data.push((grey + 0.5).clamp(0.0, 255.0) as u8);
        }
    }
    GrayImage::new(width, height, data).expect("a camera's size is within the limits of an image")
}

/// Gaussian blur, separable; the border is repeated.
fn blur(light: &mut [f32], width: usize, sigma_px: f64) {
    let sigma = sigma_px.min(MAX_BLUR_PX);
    if sigma.is_nan() || sigma <= 0.05 {
        return;
    }
    let reach = (3.0 * sigma).ceil() as usize;
    let weights: Vec<f64> = (0..=reach).map(|i| (-0.5 * (i as f64 / sigma).powi(2)).exp()).collect();
    let total = weights[0] + 2.0 * weights[1..].iter().sum::<f64>();
    let weights: Vec<f32> = weights.iter().map(|w| (w / total) as f32).collect();
    let mut padded = vec![0.0; width + 2 * reach];
    for row in light.chunks_exact_mut(width) {
        padded[..reach].fill(row[0]);
        padded[reach..reach + width].copy_from_slice(row);
        padded[reach + width..].fill(row[width - 1]);
        for (out, centre) in row.iter_mut().zip(&padded[reach..]) {
            *out = weights[0] * centre;
        }
        for (i, w) in weights.iter().enumerate().skip(1) {
            let (before, after) = (&padded[reach - i..], &padded[reach + i..]);
            for ((out, a), b) in row.iter_mut().zip(before).zip(after) {
                *out += w * (a + b);
            }
        }
    }
    let source = light.to_vec();
    let height = light.len() / width;
    let line = |v: usize| &source[v * width..(v + 1) * width];
    for (v, row) in light.chunks_exact_mut(width).enumerate() {
        for l in row.iter_mut() {
            *l *= weights[0];
        }
        for (i, w) in weights.iter().enumerate().skip(1) {
            let (above, below) = (line(v.saturating_sub(i)), line((v + i).min(height - 1)));
            for ((out, a), b) in row.iter_mut().zip(above).zip(below) {
                *out += w * (a + b);
            }
        }
    }
}

/// Mean along a straight line of movement, centred; bilinear between pixels.
fn smear(light: &mut Vec<f32>, width: usize, [du, dv]: [f64; 2]) {
    let length = du.hypot(dv);
    if !length.is_finite() || length <= 0.05 {
        return;
    }
    let scale = length.min(MAX_BLUR_PX) / length;
    let (du, dv) = ((du * scale) as f32, (dv * scale) as f32);
    let taps = (2.0 * length.min(MAX_BLUR_PX)).ceil() as usize + 1;
    let height = light.len() / width;
    let mut sum = vec![0.0; light.len()];
    for tap in 0..taps {
        let k = (tap as f32 + 0.5) / taps as f32 - 0.5;
        let (x, y) = (k * du, k * dv);
        let (ix, iy, a, b) = (x.floor(), y.floor(), x - x.floor(), y - y.floor());
        let column = |u: usize, d: i64| (u as i64 + ix as i64 + d).clamp(0, width as i64 - 1) as usize;
        let row = |v: usize, d: i64| (v as i64 + iy as i64 + d).clamp(0, height as i64 - 1) as usize * width;
        for (v, out) in sum.chunks_exact_mut(width).enumerate() {
            let (r0, r1) = (row(v, 0), row(v, 1));
            for (u, out) in out.iter_mut().enumerate() {
                let (c0, c1) = (column(u, 0), column(u, 1));
                let upper = light[r0 + c0] * (1.0 - a) + light[r0 + c1] * a;
                let lower = light[r1 + c0] * (1.0 - a) + light[r1 + c1] * a;
                *out += upper * (1.0 - b) + lower * b;
            }
        }
    }
    for s in &mut sum {
        *s /= taps as f32;
    }
    *light = sum;
}

#[cfg(test)]
mod tests {
    use super::*;

    fn statistics(data: &[u8]) -> (f64, f64) {
        let mean = data.iter().map(|&g| f64::from(g)).sum::<f64>() / data.len() as f64;
        let variance = data.iter().map(|&g| (f64::from(g) - mean).powi(2)).sum::<f64>() / data.len() as f64;
        (mean, variance)
    }

    #[test]
    fn noise_has_its_variance() {
        for (level, shot) in [(60.0, 0.0), (150.0, 0.05)] {
            let p = SensorParams { read_noise: 2.0, shot_noise: shot, ..SensorParams::ideal() };
            let image = expose(&mut vec![level; 200 * 200], 200, &p, 5);
            let (mean, variance) = statistics(image.data());
            // Rounding to whole grey levels adds 1/12.
            let expected = 4.0 + shot * f64::from(level) + 1.0 / 12.0;
            assert!((mean - f64::from(level)).abs() < 0.06, "{mean}");
            assert!((variance / expected - 1.0).abs() < 0.05, "{variance} {expected}");
        }
    }

    #[test]
    fn same_seed_same_noise() {
        let p = SensorParams::default();
        let picture = |seed| expose(&mut vec![90.0; 32 * 32], 32, &p, seed);
        assert_eq!(picture(1), picture(1));
        assert_ne!(picture(1), picture(2));
    }

    #[test]
    fn blur_widens_a_point_and_keeps_its_light() {
        let mut light = vec![0.0_f32; 65 * 65];
        light[32 * 65 + 32] = 1000.0;
        blur(&mut light, 65, 2.0);
        let sum: f32 = light.iter().sum();
        let variance = (0..65 * 65).map(|i| light[i] * ((i % 65) as f32 - 32.0).powi(2)).sum::<f32>() / sum;
        assert!((sum - 1000.0).abs() < 0.1 && (variance - 4.0).abs() < 0.1, "{sum} {variance}");
    }

    #[test]
    fn motion_smears_along_its_direction_only() {
        let mut light = vec![0.0_f32; 33 * 33];
        light[16 * 33 + 16] = 1000.0;
        smear(&mut light, 33, [6.0, 0.0]);
        let sum: f32 = light.iter().sum();
        let spread =
            |f: fn(usize) -> f32| (0..33 * 33).map(|i| light[i] * (f(i) - 16.0).powi(2)).sum::<f32>() / sum;
        let (across, down) = (spread(|i| (i % 33) as f32), spread(|i| (i / 33) as f32));
        assert!(
            (sum - 1000.0).abs() < 0.5 && down < 1e-3 && (across - 3.0).abs() < 0.4,
            "{sum} {across} {down}"
        );
    }

    #[test]
    fn vignetting_darkens_the_corners_by_its_amount() {
        let p = SensorParams { vignetting: 0.3, ..SensorParams::ideal() };
        let image = expose(&mut vec![200.0; 41 * 31], 41, &p, 0);
        assert_eq!((image.at(20, 15), image.at(0, 0), image.at(40, 30)), (200, 140, 140));
    }
}
