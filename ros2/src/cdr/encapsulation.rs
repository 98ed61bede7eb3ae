//! The four bytes before every message: representation and options.

use super::error::{CdrError, CdrFault};

/// Length of the header, bytes.
pub const HEADER_BYTES: usize = 4;

/// Order of the bytes of a scalar.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ByteOrder {
    /// `CDR_BE`, header `00 00`.
    Big,
    /// `CDR_LE`, header `00 01`: what every current implementation writes.
    Little,
}

impl ByteOrder {
    /// Reads the header. The two bytes of options say nothing about the fields and may have any
    /// value.
    pub(super) fn of_header(payload: &[u8]) -> Result<Self, CdrError> {
        let fault = match payload {
            [0, 0, _, _, ..] => return Ok(Self::Big),
            [0, 1, _, _, ..] => return Ok(Self::Little),
            [a, b, _, _, ..] => CdrFault::Encapsulation([*a, *b]),
            _ => CdrFault::Truncated { needed: HEADER_BYTES, left: payload.len() },
        };
        Err(CdrError::new("header", 0, fault))
    }

    /// The header of a message in this order, without options.
    pub(super) fn header(self) -> [u8; HEADER_BYTES] {
        [0, u8::from(self == Self::Little), 0, 0]
    }
}
