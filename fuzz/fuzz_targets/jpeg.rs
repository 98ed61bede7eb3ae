//! Any bytes as a JPEG image, of a frame and uploaded: decoding must not panic or grow, and an
//! image that is accepted has the size of its header. The limit of pixels is lower than that of
//! frames, for more executions; bombs against the real one are tests of `engine`.

#![no_main]

use engine::decode::{ImageLimits, decode_upload};
use libfuzzer_sys::fuzz_target;

const LIMITS: ImageLimits = ImageLimits { bytes: 1 << 16, pixels: 1 << 17 };

fuzz_target!(|data: &[u8]| {
    if data.starts_with(b"\x89PNG") {
        return;
    }
    match decode_upload(data, LIMITS) {
        Ok(image) => assert!((1..=LIMITS.pixels).contains(&(image.width() * image.height()))),
        Err(refusal) => assert!(!refusal.field.is_empty() && !refusal.detail.contains('\n'), "{refusal:?}"),
    }
});
