//! The pixels around a coordinate, for vectorised linear interpolation.

/// At and above this value an f32 has no fractional bits.
const WHOLE: f32 = 8_388_608.0;

/// The pixel before `u`, as an index and as a number: `u - number` is in [0, 1]. A whole `u` may
/// give the pixel before it, too; interpolation gives the same value. For `u` from 0 to 2^22; pixel
/// 0 for NaN.
///
/// A cast would first have to look for numbers that fit nowhere, which takes longer than all the
/// rest.
#[expect(
    clippy::inline_always,
    reason = "an instruction set holds only in what is inlined where it was chosen"
)]
#[inline(always)]
pub(crate) fn cell(u: f32) -> (u32, f32) {
    let rounded = (u - 0.5).max(0.0) + WHOLE;
    (rounded.to_bits() & (WHOLE.to_bits() ^ u32::MAX), rounded - WHOLE)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cell_holds_its_coordinate() {
        let far = [0.0, 0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 2.5, 74.999, 4095.0, 4095.5, 4_194_303.0];
        for u in far.into_iter().chain((0..5000).map(|i| i as f32 * 0.37)) {
            let (index, before) = cell(u);
            assert!((index as f32 - before).abs() < 1e-9, "{u}");
            assert!((0.0..=1.0).contains(&(u - before)), "{u}: {before}");
        }
        assert_eq!(cell(f32::NAN).0, 0);
    }
}
