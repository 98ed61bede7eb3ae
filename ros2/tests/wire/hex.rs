//! Hexadecimal digits as bytes, and back.

use sha2::{Digest, Sha256};
use std::fmt::Write;

/// The bytes of hexadecimal digits; `zN.` stands for N zero bytes.
pub(crate) fn bytes(text: &str) -> Vec<u8> {
    let mut out = Vec::new();
    let mut rest = text;
    while !rest.is_empty() {
        if let Some((zeros, after)) = rest.strip_prefix('z').and_then(|r| r.split_once('.')) {
            out.resize(out.len() + zeros.parse::<usize>().expect("a count"), 0);
            rest = after;
        } else {
            out.push(u8::from_str_radix(&rest[..2], 16).expect("two hexadecimal digits"));
            rest = &rest[2..];
        }
    }
    out
}

/// Length and the first eight bytes of the SHA-256.
pub(crate) fn digest(bytes: &[u8]) -> (usize, String) {
    (bytes.len(), digits(&Sha256::digest(bytes)[..8]))
}

/// Two hexadecimal digits for each byte.
pub(crate) fn digits(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut out, byte| {
        write!(out, "{byte:02x}").expect("a text takes everything");
        out
    })
}
