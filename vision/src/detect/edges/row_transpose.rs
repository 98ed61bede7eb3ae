//! Sixteen image rows in, one vector a column out, and back: the transpositions around a filter
//! along rows.

#![expect(
    clippy::inline_always,
    reason = "an instruction set holds only in what is inlined where it was chosen"
)]

use fearless_simd::{Simd, f32x4, f32x16, i32x4, prelude::*, u8x16, u32x4};

/// Rows filtered side by side, and columns transposed at a time.
pub(crate) const LANES: usize = 16;

/// One column of [`LANES`] rows.
#[derive(Debug, Clone, Copy, Default)]
#[repr(align(64))]
pub(crate) struct Column(pub(crate) [f32; LANES]);

/// Columns `u` to `u + LANES` of the rows; lane i of each is row i.
#[inline(always)]
pub(crate) fn columns<S: Simd>(s: S, rows: &[&[u8]; LANES], u: usize) -> [u8x16<S>; LANES] {
    let mut tile = rows.map(|row| u8x16::from_slice(s, &row[u..u + LANES]));
    // Interleaving the halves turns the index of a byte, row then column, by one bit; after four
    // rounds by half.
    for _ in 0..LANES.ilog2() {
        let halves = tile;
        for i in 0..LANES / 2 {
            tile[2 * i] = halves[i].zip_low(halves[i + LANES / 2]);
            tile[2 * i + 1] = halves[i].zip_high(halves[i + LANES / 2]);
        }
    }
    tile
}

#[inline(always)]
pub(crate) fn numbers<S: Simd>(bytes: u8x16<S>) -> f32x16<S> {
    let (low, high) = bytes.widen();
    let ((a, b), (c, d)) = (low.widen(), high.widen());
    let number = |x: u32x4<S>| -> f32x4<S> { x.bitcast::<i32x4<S>>().to_float() };
    number(a).combine(number(b)).combine(number(c).combine(number(d)))
}

/// Writes the columns as [`LANES`] successive rows, as long as there are columns.
#[inline(always)]
pub(crate) fn store_rows<S: Simd>(s: S, columns: &[Column], rows: &mut [f32]) {
    let width = columns.len();
    let (fours, rest) = columns.as_chunks::<4>();
    for (i, four) in fours.iter().enumerate() {
        for r in (0..LANES).step_by(4) {
            let [a, b, c, d] = four.each_ref().map(|column| f32x4::from_slice(s, &column.0[r..r + 4]));
            let (even, odd) = ([a.zip_low(c), a.zip_high(c)], [b.zip_low(d), b.zip_high(d)]);
            for (j, (even, odd)) in even.into_iter().zip(odd).enumerate() {
                let at = (r + 2 * j) * width + 4 * i;
                even.zip_low(odd).store_slice(&mut rows[at..at + 4]);
                even.zip_high(odd).store_slice(&mut rows[at + width..at + width + 4]);
            }
        }
    }
    for (u, column) in (width - rest.len()..).zip(rest) {
        for (r, x) in column.0.iter().enumerate() {
            rows[r * width + u] = *x;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fearless_simd::{Level, dispatch};

    #[test]
    fn there_and_back_is_the_same() {
        for width in [LANES, LANES + 1, 2 * LANES + 3] {
            let bytes: Vec<u8> = (0..LANES * width).map(|i| (i * 7 % 251) as u8).collect();
            let rows: [&[u8]; LANES] = std::array::from_fn(|r| &bytes[r * width..(r + 1) * width]);
            let mut back = vec![0.0; LANES * width];
            dispatch!(Level::new(), s => {
                let mut all = vec![Column::default(); width];
                for u in (0..=width - LANES).step_by(LANES).chain([width - LANES]) {
                    for (to, from) in all[u..].iter_mut().zip(columns(s, &rows, u)) {
                        numbers(from).store_slice(&mut to.0);
                    }
                }
                for (u, column) in all.iter().enumerate() {
                    for (x, row) in column.0.iter().zip(rows) {
                        assert_eq!(x.to_bits(), f32::from(row[u]).to_bits());
                    }
                }
                store_rows(s, &all, &mut back);
            });
            assert!(back.iter().zip(&bytes).all(|(a, b)| a.to_bits() == f32::from(*b).to_bits()));
        }
    }
}
