//! A picture and two kernels in, the picture correlated with one along its rows and with the other
//! along its columns out; the border is replicated.

use fearless_simd::{Level, dispatch};

/// Bucket lengths are padded with zeros to a multiple of this, for vector units.
pub(crate) const LANES: usize = 16;

/// `pixels` in rows of `width`, correlated with `across` along x and `down` along y. Kernels of odd
/// length.
pub(crate) fn filtered(pixels: &[f32], width: usize, across: &[f32], down: &[f32]) -> Vec<f32> {
    dispatch!(Level::new(), _s => columns(&rows(pixels, width, across), width, down))
}

/// Row length padded to whole vectors; values beyond `width` are unused.
fn stride(width: usize) -> usize {
    width.next_multiple_of(LANES)
}

/// Vectors summed at a time, to hide the latency of dependent sums.
const ABREAST: usize = 4;

/// Correlates every row with `kernel`; rows of [`stride`].
#[expect(
    clippy::inline_always,
    reason = "an instruction set holds only in what is inlined where it was chosen"
)]
#[inline(always)]
fn rows(image: &[f32], width: usize, kernel: &[f32]) -> Vec<f32> {
    let (r, stride) = (kernel.len() / 2, stride(width));
    let mut out = vec![0.0; stride * (image.len() / width.max(1))];
    let mut padded = vec![0.0; stride + 2 * r];
    let offsets: Vec<usize> = (0..kernel.len()).collect();
    for (row, line) in image.chunks_exact(width.max(1)).zip(out.chunks_exact_mut(stride.max(1))) {
        padded[..r].fill(row[0]);
        padded[r..r + width].copy_from_slice(row);
        padded[r + width..width + 2 * r].fill(row[width - 1]);
        weighted(&padded, &offsets, kernel, line);
    }
    out
}

/// Correlates every column of rows of [`stride`] with `kernel`.
#[expect(clippy::inline_always, reason = "as above")]
#[inline(always)]
fn columns(image: &[f32], width: usize, kernel: &[f32]) -> Vec<f32> {
    let (r, stride) = (kernel.len() / 2, stride(width));
    let height = image.len() / stride.max(1);
    let mut out = vec![0.0; width * height];
    let mut line = vec![0.0; stride];
    let mut offsets = vec![0; kernel.len()];
    for (row, out) in out.chunks_exact_mut(width.max(1)).enumerate() {
        for (i, offset) in offsets.iter_mut().enumerate() {
            *offset = (row + i).saturating_sub(r).min(height - 1) * stride;
        }
        weighted(image, &offsets, kernel, &mut line);
        out.copy_from_slice(&line[..width]);
    }
    out
}

/// Fills a line of whole vectors with the sums of the parts of `source` that begin at `offsets`,
/// each times its weight.
#[expect(clippy::inline_always, reason = "as above")]
#[inline(always)]
fn weighted(source: &[f32], offsets: &[usize], weights: &[f32], line: &mut [f32]) {
    let (many, rest) = line.as_chunks_mut::<{ ABREAST * LANES }>();
    let done = many.len() * ABREAST * LANES;
    for (i, out) in many.iter_mut().enumerate() {
        sum(source, offsets, weights, i * ABREAST * LANES, out);
    }
    for (i, out) in rest.as_chunks_mut::<LANES>().0.iter_mut().enumerate() {
        sum(source, offsets, weights, done + i * LANES, out);
    }
}

#[expect(clippy::inline_always, reason = "as above")]
#[inline(always)]
fn sum<const N: usize>(source: &[f32], offsets: &[usize], weights: &[f32], start: usize, out: &mut [f32; N]) {
    let mut sum = [0.0; N];
    for (offset, w) in offsets.iter().zip(weights) {
        let Some(greys) = source.get(offset + start..).and_then(<[f32]>::first_chunk::<N>) else { break };
        for k in 0..N {
            sum[k] += w * greys[k];
        }
    }
    *out = sum;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pixel_is_the_weighted_sum_of_its_neighbours() {
        let (across, down) = ([0.1, 0.5, 0.2, -0.3, 0.4], [0.25, 0.5, -0.125]);
        let sizes = [1, 2, 15, 16, 17, 40, 75].map(|size| [size, size]);
        for [width, height] in sizes.into_iter().chain([[1, 9], [9, 1], [33, 20], [20, 33]]) {
            let at = |x: i32, y: i32| {
                let (x, y) = (x.clamp(0, width - 1), y.clamp(0, height - 1));
                ((x * 37 + y * 101) % 256) as f32
            };
            let pixels: Vec<f32> = (0..width * height).map(|i| at(i % width, i / width)).collect();
            let found = filtered(&pixels, width as usize, &across, &down);
            assert_eq!(found.len(), pixels.len());
            for (i, found) in (0..).zip(found) {
                let (x, y) = (i % width, i / width);
                let row = |y: i32| (-2..).zip(across).map(|(d, w)| w * at(x + d, y)).sum::<f32>();
                let wanted: f32 = (-1..).zip(down).map(|(d, w)| w * row(y + d)).sum();
                assert!((found - wanted).abs() < 1e-3, "{width} {height} {x} {y}: {found} for {wanted}");
            }
        }
        assert!(filtered(&[], 0, &across, &down).is_empty());
    }
}
