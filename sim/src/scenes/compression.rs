//! Processing in a camera after exposure: sharpening and JPEG compression. Grey picture in, grey
//! picture out.

use std::f32::consts::PI;
use vision::frame::GrayImage;

/// Side of a block of JPEG.
const BLOCK: usize = 8;
/// Quantisation of brightness at quality 50 (ITU T.81, table K.1).
const STEPS: [[u8; BLOCK]; BLOCK] = [
    [16, 11, 10, 16, 24, 40, 51, 61],
    [12, 12, 14, 19, 26, 58, 60, 55],
    [14, 13, 16, 24, 40, 57, 69, 56],
    [14, 17, 22, 29, 51, 87, 80, 62],
    [18, 22, 37, 56, 68, 109, 103, 77],
    [24, 35, 55, 64, 81, 104, 113, 92],
    [49, 64, 78, 87, 103, 121, 120, 101],
    [72, 92, 95, 98, 112, 100, 103, 99],
];

/// The picture after JPEG compression with `quality`, 1 to 100 (clamped). Columns and rows beyond
/// the last whole block are unchanged.
pub(crate) fn jpeg(image: &GrayImage, quality: u8) -> GrayImage {
    let quality = f32::from(quality.clamp(1, 100));
    let scale = if quality < 50.0 { 50.0 / quality } else { 2.0 - 0.02 * quality };
    let basis = basis();
    let (width, height) = (image.width(), image.height());
    let mut data = image.data().to_vec();
    for v0 in (0..height - height % BLOCK).step_by(BLOCK) {
        for u0 in (0..width - width % BLOCK).step_by(BLOCK) {
            let block = std::array::from_fn(|i| {
                std::array::from_fn(|j| f32::from(data[(v0 + i) * width + u0 + j]) - 128.0)
            });
            let mut waves = times(&times(&basis, &block), &transposed(&basis));
            for (row, steps) in waves.iter_mut().zip(&STEPS) {
                for (wave, step) in row.iter_mut().zip(steps) {
                    let step = (f32::from(*step) * scale).round().max(1.0);
                    *wave = (*wave / step).round() * step;
                }
            }
            let block = times(&times(&transposed(&basis), &waves), &basis);
            for (i, row) in block.iter().enumerate() {
                for (j, grey) in row.iter().enumerate() {
                    data[(v0 + i) * width + u0 + j] = (grey + 128.5).clamp(0.0, 255.0) as u8;
                }
            }
        }
    }
    GrayImage::new(width, height, data).unwrap_or_else(|_| image.clone())
}

/// Adds `amount` times the difference from the mean of the 3 x 3 neighbourhood: edges overshoot.
pub(crate) fn sharpen(light: &mut [f32], width: usize, amount: f32) {
    let source = light.to_vec();
    let height = source.len() / width.max(1);
    for v in 1..height.saturating_sub(1) {
        for u in 1..width - 1 {
            let row = |v: usize| source[v * width + u - 1..v * width + u + 2].iter().sum::<f32>();
            let mean = (row(v - 1) + row(v) + row(v + 1)) / 9.0;
            let here = source[v * width + u];
            light[v * width + u] = here + amount * (here - mean);
        }
    }
}

type Block = [[f32; BLOCK]; BLOCK];

/// The orthonormal cosine transform: rows are frequencies.
fn basis() -> Block {
    std::array::from_fn(|k| {
        let norm = if k == 0 { (1.0 / BLOCK as f32).sqrt() } else { (2.0 / BLOCK as f32).sqrt() };
        std::array::from_fn(|i| norm * (PI * (i as f32 + 0.5) * k as f32 / BLOCK as f32).cos())
    })
}

fn times(a: &Block, b: &Block) -> Block {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..BLOCK).map(|k| a[i][k] * b[k][j]).sum()))
}

fn transposed(a: &Block) -> Block {
    std::array::from_fn(|i| std::array::from_fn(|j| a[j][i]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_best_quality_loses_little_and_a_poor_one_more() {
        let image = GrayImage::from_fn(36, 20, |u, v| ((u * 7 + v * v * 3) % 200 + 20) as u8);
        let off = |quality| {
            let back = jpeg(&image, quality);
            let off = |(a, b): (&u8, &u8)| f64::from(a.abs_diff(*b));
            back.data().iter().zip(image.data()).map(off).sum::<f64>() / (36.0 * 20.0)
        };
        assert!(off(100) < 0.6, "{}", off(100));
        assert!(off(20) > 4.0 && off(20) > 2.0 * off(90), "{} {}", off(20), off(90));
        // Beyond the last whole block nothing changes.
        assert!((32..36).all(|u| jpeg(&image, 5).at(u, 19) == image.at(u, 19)));
        assert_eq!(jpeg(&image, 0), jpeg(&image, 1));
    }

    #[test]
    fn an_even_picture_stays_and_an_edge_overshoots() {
        let even = GrayImage::from_fn(16, 16, |_, _| 77);
        assert!(jpeg(&even, 60).data().iter().all(|g| g.abs_diff(77) <= 1));
        let mut light: Vec<f32> = (0..80).map(|i| if i % 10 < 5 { 50.0 } else { 100.0 }).collect();
        sharpen(&mut light, 10, 0.6);
        assert!((light[34] - 40.0).abs() < 1e-3 && (light[35] - 110.0).abs() < 1e-3 && light[32] >= 50.0);
    }
}
