//! Samples of 16 bits as samples of 8.

use protos::convert::sample_bits;

/// The highest 8 of the bits that the image's colours use. `colours` is how many samples a pixel
/// has, and how many of them, from the first, are colours.
pub(super) fn narrowed(bytes: &[u8], is_big_endian: bool, (samples, used): (usize, usize)) -> Vec<u8> {
    let (pairs, _) = bytes.as_chunks::<2>();
    let sample =
        |pair: &[u8; 2]| if is_big_endian { u16::from_be_bytes(*pair) } else { u16::from_le_bytes(*pair) };
    let most = pairs.chunks(samples).flat_map(|pixel| pixel.iter().take(used)).map(sample).max();
    let shift = sample_bits(most.unwrap_or(0)) - 8;
    // What is no colour may have more bits.
    pairs.iter().map(|pair| (sample(pair) >> shift).min(255) as u8).collect()
}
