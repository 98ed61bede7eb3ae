//! Grey levels in proportion to light. Cameras store the 2.4th root or so (IEC 61966-2-1, sRGB);
//! between a dark and a bright surface, the middle of a blurred edge then lies towards the dark
//! one, by 0.2 px at a blur of 0.8 px.

use std::sync::LazyLock;

/// Light of each grey level, 0 to 255.
pub(super) static LIGHT: LazyLock<[f32; 256]> = LazyLock::new(|| {
    std::array::from_fn(|level| {
        let stored = level as f64 / 255.0;
        let light = if stored <= 0.040_45 { stored / 12.92 } else { ((stored + 0.055) / 1.055).powf(2.4) };
        (255.0 * light) as f32
    })
});

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_rises_from_none_to_all() {
        assert!(LIGHT[0].abs() < 1e-6 && (LIGHT[255] - 255.0).abs() < 1e-3);
        assert!(LIGHT.windows(2).all(|w| w[0] < w[1]));
        // Half of the light is stored as 188.
        assert!((LIGHT[188] - 127.5).abs() < 1.5, "{}", LIGHT[188]);
    }
}
