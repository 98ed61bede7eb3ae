//! A square picture and two kernels in, the picture correlated with one along its rows and with the other along its
//! columns out; the border is replicated.

use fearless_simd::{Level, dispatch};

/// Bucket lengths are padded with zeros to a multiple of this, for vector units.
pub(crate) const LANES: usize = 16;

/// `pixels` of side `size`, row-major, correlated with `across` along x and `down` along y. Kernels of odd length.
pub(crate) fn filtered(pixels: &[f32], size: usize, across: &[f32], down: &[f32]) -> Vec<f32> {
    dispatch!(Level::new(), _s => columns(&rows(pixels, size, across), size, down))
}

/// Row length padded to whole vectors; values beyond `size` are unused.
fn stride(size: usize) -> usize {
    size.next_multiple_of(LANES)
}

/// Vectors summed at a time, to hide the latency of dependent sums.
const ABREAST: usize = 4;

/// Correlates every row with `kernel`; rows of [`stride`].
#[expect(
    clippy::inline_always,
    reason = "an instruction set holds only in what is inlined where it was chosen"
)]
#[inline(always)]
fn rows(image: &[f32], size: usize, kernel: &[f32]) -> Vec<f32> {
    let (r, stride) = (kernel.len() / 2, stride(size));
    let mut out = vec![0.0; stride * size];
    let mut padded = vec![0.0; stride + 2 * r];
    let offsets: Vec<usize> = (0..kernel.len()).collect();
    for (row, line) in image.chunks_exact(size.max(1)).zip(out.chunks_exact_mut(stride.max(1))) {
        padded[..r].fill(row[0]);
        padded[r..r + size].copy_from_slice(row);
        padded[r + size..size + 2 * r].fill(row[size - 1]);
        weighted(&padded, &offsets, kernel, line);
    }
    out
}

/// Correlates every column of rows of [`stride`] with `kernel`.
#[expect(clippy::inline_always, reason = "as above")]
#[inline(always)]
fn columns(image: &[f32], size: usize, kernel: &[f32]) -> Vec<f32> {
    let (r, stride) = (kernel.len() / 2, stride(size));
    let mut out = vec![0.0; size * size];
    let mut line = vec![0.0; stride];
    let mut offsets = vec![0; kernel.len()];
    for (row, out) in out.chunks_exact_mut(size.max(1)).enumerate() {
        for (i, offset) in offsets.iter_mut().enumerate() {
            *offset = (row + i).saturating_sub(r).min(size - 1) * stride;
        }
        weighted(image, &offsets, kernel, &mut line);
        out.copy_from_slice(&line[..size]);
    }
    out
}

/// Fills a line of whole vectors with the sums of the parts of `source` that begin at `offsets`, each times its
/// weight.
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
        for size in [1, 2, 15, 16, 17, 40, 75] {
            let at = |x: i32, y: i32| {
                let [x, y] = [x, y].map(|c| c.clamp(0, size - 1));
                ((x * 37 + y * 101) % 256) as f32
            };
            let pixels: Vec<f32> = (0..size * size).map(|i| at(i % size, i / size)).collect();
            let found = filtered(&pixels, size as usize, &across, &down);
            assert_eq!(found.len(), pixels.len());
            for (i, found) in (0..).zip(found) {
                let (x, y) = (i % size, i / size);
                let row = |y: i32| (-2..).zip(across).map(|(d, w)| w * at(x + d, y)).sum::<f32>();
                let wanted: f32 = (-1..).zip(down).map(|(d, w)| w * row(y + d)).sum();
                assert!((found - wanted).abs() < 1e-3, "{size} {x} {y}: {found} for {wanted}");
            }
        }
        assert!(filtered(&[], 0, &across, &down).is_empty());
    }
}
