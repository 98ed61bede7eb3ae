//! A picture without the noise of single pixels: median of nine, then a binomial filter of five
//! (standard deviation 1 px). Such noise says nothing of the place of an edge or a window.

use crate::frame::GrayImage;

/// Weights of the binomial filter; their sum is 16.
const TAPS: [u32; 5] = [1, 4, 6, 4, 1];

/// The picture without the noise of single pixels.
pub(crate) fn denoised(image: &GrayImage) -> GrayImage {
    let image = median(image);
    let (w, h) = (image.width(), image.height());
    let clamped = |x: usize, k: usize, n: usize| (x + k).saturating_sub(2).min(n - 1);
    let mut rows = vec![0_u32; w * h];
    for (i, sum) in rows.iter_mut().enumerate() {
        *sum =
            TAPS.iter().enumerate().map(|(k, t)| t * u32::from(image.at(clamped(i % w, k, w), i / w))).sum();
    }
    GrayImage::from_fn(w, h, |x, y| {
        let sum: u32 = TAPS.iter().enumerate().map(|(k, t)| t * rows[clamped(y, k, h) * w + x]).sum();
        ((sum + 128) / 256) as u8
    })
}

/// Median of nine pixels.
fn median(image: &GrayImage) -> GrayImage {
    let (w, h) = (image.width(), image.height());
    let near = |x: usize, k: usize, n: usize| (x + k).saturating_sub(1).min(n - 1);
    GrayImage::from_fn(w, h, |x, y| {
        let mut all: [u8; 9] = std::array::from_fn(|k| image.at(near(x, k % 3, w), near(y, k / 3, h)));
        all.sort_unstable();
        all[4]
    })
}
