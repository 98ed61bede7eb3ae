//! The 16 bytes that name an entity in attachments.
//!
//! Source: `liveliness_utils.cpp` (`Entity`) and `simplified_xxhash3.cpp`: XXH3 of 128 bits over
//! the whole token, seed 0, low half first.

use std::fmt;
use xxhash_rust::xxh3::xxh3_128;

/// Name of an entity. Its text form is 32 hexadecimal digits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Gid(pub [u8; 16]);

impl Gid {
    /// Of the entity with this liveliness token, as received or declared: one byte more gives
    /// another name.
    pub fn of_token(token: &str) -> Self {
        Self(xxh3_128(token.as_bytes()).to_le_bytes())
    }
}

impl fmt::Display for Gid {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}
