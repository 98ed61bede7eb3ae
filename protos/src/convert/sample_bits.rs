//! How many bits samples in 16 have. Cameras of 10, 12 and 14 bits fill 16 from the low end: taken
//! as 16 bits they are black.

/// Bits that a sensor may have.
const BITS: [u32; 4] = [10, 12, 14, 16];

/// The fewest of 10, 12, 14 and 16 bits that hold the largest sample of an image.
pub fn sample_bits(largest: u16) -> u32 {
    BITS.into_iter().find(|bits| u32::from(largest) >> bits == 0).unwrap_or(16)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_sample_decides() {
        let bits = [0, 1023, 1024, 4095, 4096, 16_383, 16_384, u16::MAX].map(sample_bits);
        assert_eq!(bits, [10, 10, 12, 12, 14, 14, 16, 16]);
    }
}
