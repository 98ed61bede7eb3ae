//! Icon in, signature out: the directions of its grey-level slopes on a coarse grid, in a few
//! hundred bytes. The inner product of two signatures ranks the landmarks for the short list, also
//! where the detected border is a little beside the learnt one. Later stages verify the short list.
//!
//! Beyond the method (its section 6.3 asks for a global descriptor where there are many landmarks).

use crate::icon::Icon;

/// Cells along each side of the grid.
pub const GRID: usize = 15;
/// Numbers of a signature: two for each cell, padded with zeros for vector units.
pub const SIGNATURE_BYTES: usize = 464;
/// Slopes below this share of the grid's own contrast are down-weighted: their direction is noise.
const WEAK_SLOPE: f32 = 0.02;
/// An icon whose cells vary by less, in grey levels, has no signature.
const MIN_DEVIATION: f32 = 1.0;
/// A signature's length in steps of its numbers.
const LENGTH: f32 = 480.0;

/// The signature of an icon: whole numbers, of Euclidean length 480 as nearly as rounding lets it;
/// all zeros for a flat icon.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Signature([i8; SIGNATURE_BYTES]);

impl Signature {
    /// The signature of `icon`.
    pub fn new(icon: &Icon) -> Self {
        let cells = cells(icon);
        let mut slopes = [0.0_f32; SIGNATURE_BYTES];
        for (i, slope) in slopes.as_chunks_mut::<2>().0.iter_mut().take(GRID * GRID).enumerate() {
            let (x, y) = (i % GRID, i / GRID);
            let at = |x: usize, y: usize| cells[y * GRID + x];
            let gx = at((x + 1).min(GRID - 1), y) - at(x.saturating_sub(1), y);
            let gy = at(x, (y + 1).min(GRID - 1)) - at(x, y.saturating_sub(1));
            let scale = 1.0 / ((gx * gx + gy * gy).sqrt() + WEAK_SLOPE);
            *slope = [gx * scale, gy * scale];
        }
        let norm = slopes.iter().map(|s| s * s).sum::<f32>().sqrt();
        let scale = if norm > 0.0 { LENGTH / norm } else { 0.0 };
        Self(slopes.map(|s| (s * scale).round().clamp(-127.0, 127.0) as i8))
    }

    /// The numbers.
    pub fn values(&self) -> &[i8; SIGNATURE_BYTES] {
        &self.0
    }
}

/// Likeness of two signatures: the cosine between them, -1 to 1 but for rounding; 0 with a flat
/// icon.
#[expect(
    clippy::inline_always,
    reason = "an instruction set holds only in what is inlined where it was chosen"
)]
#[inline(always)]
pub fn likeness(a: &[i8; SIGNATURE_BYTES], b: &[i8; SIGNATURE_BYTES]) -> f32 {
    let dot: i32 = a.iter().zip(b).map(|(x, y)| i32::from(*x) * i32::from(*y)).sum();
    dot as f32 / (LENGTH * LENGTH)
}

/// Means over the cells, of mean 0 and norm 1 together; all zeros for a flat icon.
fn cells(icon: &Icon) -> [f32; GRID * GRID] {
    let mut cells = [0.0_f32; GRID * GRID];
    if icon.size < GRID {
        return cells;
    }
    let edge = |i: usize| i * icon.size / GRID;
    for (i, cell) in cells.iter_mut().enumerate() {
        let (columns, rows) = (edge(i % GRID)..edge(i % GRID + 1), edge(i / GRID)..edge(i / GRID + 1));
        let count = (columns.len() * rows.len()) as f32;
        let sum: f32 = rows.map(|y| icon.pixels[y * icon.size..][columns.clone()].iter().sum::<f32>()).sum();
        *cell = sum / count;
    }
    let mean = cells.iter().sum::<f32>() / cells.len() as f32;
    let square: f32 = cells.iter().map(|c| (c - mean) * (c - mean)).sum();
    let has_contrast = square.is_finite() && square / cells.len() as f32 >= MIN_DEVIATION * MIN_DEVIATION;
    let scale = if has_contrast { 1.0 / square.sqrt() } else { 0.0 };
    cells.map(|c| if has_contrast { (c - mean) * scale } else { 0.0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn made(size: usize, f: impl Fn(f64, f64) -> f64) -> Icon {
        let at = |i: usize| (i as f64 + 0.5) / size as f64;
        let pixels = (0..size * size).map(|i| f(at(i % size), at(i / size)) as f32).collect();
        Icon { size, pixels, source_scale: 1.0 }
    }

    fn waves(x: f64, y: f64) -> f64 {
        120.0 + 50.0 * (9.0 * x + 3.0 * y * y).sin() + 40.0 * (7.0 * y - 4.0 * x).cos()
    }

    fn between(a: &Icon, b: &Icon) -> f32 {
        likeness(Signature::new(a).values(), Signature::new(b).values())
    }

    #[test]
    fn signatures_are_invariant_to_gain_offset_and_size() {
        let icon = made(75, waves);
        assert!((between(&icon, &icon) - 1.0).abs() < 0.02);
        assert!(between(&icon, &made(75, |x, y| 0.4 * waves(x, y) + 80.0)) > 0.98);
        assert!(between(&icon, &made(60, waves)) > 0.95);
        assert!(between(&icon, &made(75, |x, y| 250.0 - waves(x, y))) < -0.95);
    }

    #[test]
    fn a_shifted_border_has_a_similar_signature() {
        let icon = made(75, waves);
        let inset = made(75, |x, y| waves(0.05 + 0.9 * x, 0.03 + 0.94 * y));
        let other = made(75, |x, y| waves(y, 1.0 - x));
        assert!(between(&icon, &inset) > 0.6, "{}", between(&icon, &inset));
        assert!(between(&icon, &other) < 0.4, "{}", between(&icon, &other));
    }

    #[test]
    fn flat_and_invalid_icons_have_likeness_zero() {
        for flat in [made(75, |_, _| 99.0), made(10, waves), made(75, |_, _| f64::NAN)] {
            assert_eq!(Signature::new(&flat).values(), &[0; SIGNATURE_BYTES]);
        }
    }

    #[test]
    fn every_component_has_its_cell() {
        // A step from dark to bright in the middle: slopes along x only, in the columns beside it.
        let icon = made(75, |x, _| if x < 7.0 / 15.0 { 20.0 } else { 200.0 });
        for (i, [gx, gy]) in Signature::new(&icon).values().as_chunks::<2>().0.iter().enumerate() {
            let steep = i < GRID * GRID && matches!(i % GRID, 6 | 7);
            assert!((*gx > 50) == steep && *gy == 0, "{i}: {gx} {gy}");
        }
    }
}
