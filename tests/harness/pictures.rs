//! Small pictures to send, all different, without any renderer.

use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};

/// Grey levels of a picture of random blocks: the same seed gives the same picture.
pub fn blocks(seed: u64, width: usize, height: usize) -> Vec<u8> {
    let block = 12;
    let level = |x: usize, y: usize| {
        // splitmix64 of the block's index.
        let mut z =
            seed.wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(((x / block) * 1_009 + y / block) as u64);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z >> 56) as u8
    };
    (0..width * height).map(|i| level(i % width, i / width)).collect()
}

/// Grey levels as a PNG file.
pub fn png(width: usize, height: usize, grey: &[u8]) -> Vec<u8> {
    let mut out = Vec::new();
    PngEncoder::new(&mut out)
        .write_image(grey, width as u32, height as u32, ExtendedColorType::L8)
        .expect("in memory");
    out
}

/// A picture of random blocks as a PNG file.
pub fn picture(seed: u64) -> Vec<u8> {
    png(160, 120, &blocks(seed, 160, 120))
}
