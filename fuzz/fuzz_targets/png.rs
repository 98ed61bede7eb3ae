//! Any bytes as a PNG image: decoding must not panic or grow. The signature is put in front and
//! checksums of chunks are corrected, so that inputs reach what lies behind them.

#![no_main]

use engine::decode::{ImageLimits, decode_upload};
use libfuzzer_sys::fuzz_target;

const LIMITS: ImageLimits = ImageLimits { bytes: 1 << 16, pixels: 1 << 17 };
const SIGNATURE: &[u8] = b"\x89PNG\r\n\x1a\n";

fuzz_target!(|data: &[u8]| {
    let mut file = SIGNATURE.to_vec();
    file.extend(data.strip_prefix(SIGNATURE).unwrap_or(data));
    correct(&mut file);
    match decode_upload(&file, LIMITS) {
        Ok(image) => assert!((1..=LIMITS.pixels).contains(&(image.width() * image.height()))),
        Err(refusal) => assert!(!refusal.field.is_empty() && !refusal.detail.contains('\n'), "{refusal:?}"),
    }
});

/// Gives each whole chunk the checksum of its bytes.
fn correct(file: &mut [u8]) {
    let mut at = SIGNATURE.len();
    while let Some(head) = file.get(at..at + 8) {
        let length = u32::from_be_bytes([head[0], head[1], head[2], head[3]]) as usize;
        let Some(end) = at.checked_add(8 + length).filter(|end| end + 4 <= file.len()) else { return };
        let sum = crc(&file[at + 4..end]);
        file[end..end + 4].copy_from_slice(&sum.to_be_bytes());
        at = end + 4;
    }
}

/// CRC-32 of PNG.
fn crc(bytes: &[u8]) -> u32 {
    let step = |crc: u32, byte: &u8| {
        (0..8).fold(crc ^ u32::from(*byte), |c, _| if c & 1 == 1 { 0xedb8_8320 ^ (c >> 1) } else { c >> 1 })
    };
    !bytes.iter().fold(!0, step)
}
