//! Reads MCAP files in the order of time. In: the bytes of a file. Out: messages of the wire, or of
//! any kind.
//!
//! ```text
//! parts (a walk over the records, chunks unread) -> ordered (messages by log time) -> drive (messages of the wire)
//! ```
//!
//! `mcap` parses the records. Its readers are not used: `LinearReader` panics on a record that ends
//! after its chunk, `IndexedReader` checks no checksum and keeps the memory of every chunk slot.

mod chunk;
mod drive;
mod error;
mod ordered;
mod parts;

pub use drive::DriveReader;
pub use error::{ReadError, ReadFault};
pub use ordered::{ChannelInfo, MessageReader, RawMessage};

/// Longest schema, channel or single message outside of chunks, bytes.
pub const MAX_RECORD_BYTES: u64 = 64 << 20;
/// Largest chunk, packed and unpacked, bytes.
pub const MAX_CHUNK_BYTES: u64 = 256 << 20;
/// Most messages of a chunk.
pub const MAX_CHUNK_MESSAGES: usize = 1 << 20;
/// Most chunks of a file.
pub const MAX_PARTS: usize = 1 << 22;
/// Most bytes of chunks whose times overlap: they are open together.
pub const MAX_OPEN_BYTES: u64 = 512 << 20;
