//! A square picture and two kernels in, the picture correlated with one along its rows and with the other along its
//! columns out; the border is replicated. Which kernels is the caller's choice.

use super::correlation::LANES;
use fearless_simd::{Level, dispatch};

/// `pixels` of side `size`, row-major, correlated with `across` along x and `down` along y. Kernels of odd length.
pub(crate) fn filtered(pixels: &[f32], size: usize, across: &[f32], down: &[f32]) -> Vec<f32> {
    dispatch!(Level::new(), _s => columns(&rows(pixels, size, across), size, down))
}

/// Rows are as long as whole vectors from here on: what is beyond `size` means nothing.
fn stride(size: usize) -> usize {
    size.next_multiple_of(LANES)
}

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
    for (row, line) in image.chunks_exact(size.max(1)).zip(out.chunks_exact_mut(stride.max(1))) {
        padded[..r].fill(row[0]);
        padded[r..r + size].copy_from_slice(row);
        padded[r + size..size + 2 * r].fill(row[size - 1]);
        for (start, out) in (0..).step_by(LANES).zip(line.as_chunks_mut::<LANES>().0) {
            let mut sum = [0.0; LANES];
            for (i, w) in (start..).zip(kernel) {
                let Some(greys) = padded.get(i..).and_then(<[f32]>::first_chunk::<LANES>) else { break };
                for k in 0..LANES {
                    sum[k] += w * greys[k];
                }
            }
            *out = sum;
        }
    }
    out
}

/// Correlates every column of rows of [`stride`] with `kernel`.
#[expect(clippy::inline_always, reason = "as above")]
#[inline(always)]
fn columns(image: &[f32], size: usize, kernel: &[f32]) -> Vec<f32> {
    let (r, stride) = (kernel.len() / 2, stride(size));
    let mut out = vec![0.0; size * size];
    for (row, line) in out.chunks_exact_mut(size.max(1)).enumerate() {
        for (start, out) in (0..).step_by(LANES).zip(line.chunks_mut(LANES)) {
            let mut sum = [0.0; LANES];
            for (i, w) in kernel.iter().enumerate() {
                let source = (row + i).saturating_sub(r).min(size - 1) * stride + start;
                let Some(greys) = image.get(source..).and_then(<[f32]>::first_chunk::<LANES>) else { break };
                for k in 0..LANES {
                    sum[k] += w * greys[k];
                }
            }
            match out.first_chunk_mut::<LANES>() {
                Some(whole) => *whole = sum,
                None => out.copy_from_slice(&sum[..out.len()]),
            }
        }
    }
    out
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
