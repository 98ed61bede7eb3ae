//! CDR, the serialisation of DDS: plain XCDR1 of both byte orders. In: a payload. Out: values, or a
//! [`CdrError`] with field and offset; and values back to bytes.
//!
//! Source: OMG DDS-RTPS 2.5, 10.5 (encapsulation) and DDS-XTypes 1.3, 7.4 (XCDR1);
//! `eProsima/Fast-CDR src/cpp/Cdr.cpp`. After four bytes of header, every scalar is aligned to its
//! size, counted from the end of the header. Structures and fixed arrays add nothing. A string is a
//! u32 length with its NUL, then the bytes. A sequence is a u32 count, then the elements; an empty
//! one has no padding of elements.
//!
//! Fast-CDR leaves padding bytes as they were in memory, so they are read past and never compared;
//! the writer makes them zero. CycloneDDS puts the number of padding bytes at the end into the
//! header's options: those are ignored, and up to three bytes may follow the message.

mod encapsulation;
mod error;
mod scalar;
mod reader;
mod writer;

pub use encapsulation::{ByteOrder, HEADER_BYTES};
pub use error::{CdrError, CdrFault};
pub use reader::{MAX_END_PADDING_BYTES, Reader};
pub use scalar::Scalar;
pub use writer::Writer;

/// A structure that CDR carries.
pub trait Value<'a>: Sized {
    /// Fewest bytes that one takes, padding left out; bounds the count of a sequence. At least 1.
    const MIN_BYTES: usize;

    /// Reads the fields in their order.
    fn read(reader: &mut Reader<'a>) -> Result<Self, CdrError>;

    /// Writes the fields in their order.
    fn write(&self, writer: &mut Writer);
}
