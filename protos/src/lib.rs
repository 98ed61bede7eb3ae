//! The wire: messages, key expressions and checked conversions.
//!
//! In: Protocol Buffers from robots. Out: values that are finite, in range and bounded, or a [`Rejection`] with a
//! stable code and the field at fault. There is no transport here: zenoh is used by `client` and by the server's
//! `bus`. README.md lists keys, units, limits and codes.

pub mod keys;
pub mod rejection;
pub mod convert;
pub mod json;

// Written by prost-build from waymark/v1/waymark.proto; `tests/generated.rs` keeps the two in step.
#[rustfmt::skip]
#[allow(missing_docs, clippy::pedantic, reason = "generated from the .proto, whose comments are its documentation")]
mod generated;

/// The messages of `waymark/v1/waymark.proto`.
pub mod v1 {
    pub use crate::generated::*;
}

pub use convert::CheckedFrame;
pub use keys::{Key, Keys, Name, NameError};
pub use prost;
pub use rejection::{Code, Rejection};
