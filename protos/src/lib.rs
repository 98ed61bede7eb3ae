//! The wire: messages, key expressions and checked conversions.
//!
//! Comes in: Protocol Buffers from robots. Goes out: values that every later stage may rely on
//! (finite, in range, bounded), or a [`Rejection`] with a stable code and the field at fault.
//! [`api`] has the bodies of the HTTP interface. Knows no transport: zenoh lives in `client` and in
//! the server's `bus`. README.md lists keys, units, limits and codes.

pub mod api;
pub mod credentials;
pub mod keys;
pub mod rejection;
pub mod convert;
pub mod json;
pub mod named;
pub mod named_map;

// Written by prost-build from waymark/v1/waymark.proto; `tests/generated.rs` keeps the two in step.
#[rustfmt::skip]
#[allow(missing_docs, clippy::pedantic, reason = "generated from the .proto, whose comments are its documentation")]
mod generated;

/// The messages of `waymark/v1/waymark.proto`.
pub mod v1 {
    pub use crate::generated::*;
}

/// The definition of the messages as a `FileDescriptorSet`, for programs that read recordings
/// without the .proto.
pub const FILE_DESCRIPTOR_SET: &[u8] = include_bytes!("descriptors.binpb");

pub use convert::CheckedFrame;
pub use keys::{Key, Keys, Name, NameError, ServerToken};
pub use prost;
pub use rejection::{Code, Rejection};
