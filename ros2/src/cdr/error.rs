//! Why bytes are not the message that they should be.

/// What is wrong, in which field, at which byte of the payload.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{field} at byte {offset}: {fault}")]
pub struct CdrError {
    /// Path of the field as in the message's definition: `transforms[2].header.frame_id`.
    pub field: String,
    /// Where the field begins, bytes from the start of the payload, header included.
    pub offset: usize,
    /// What is wrong.
    pub fault: CdrFault,
}

/// The kinds of fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum CdrFault {
    /// The payload ends inside the field.
    #[error("{needed} bytes needed, {left} left")]
    Truncated {
        /// Bytes of the field.
        needed: usize,
        /// Bytes from its beginning to the end of the payload.
        left: usize,
    },
    /// More elements are announced than the payload can hold.
    #[error("{count} elements announced, {left} bytes left")]
    Count {
        /// The announced count.
        count: u32,
        /// Bytes after the count.
        left: usize,
    },
    /// The header names another representation: of parameter lists or XCDR2.
    #[error("representation {0:02x?} is neither CDR_BE nor CDR_LE")]
    Encapsulation([u8; 2]),
    /// A text without its NUL.
    #[error("the text does not end with NUL")]
    Unterminated,
    /// A text that is not UTF-8.
    #[error("the text is not UTF-8")]
    NotUtf8,
    /// A bool of another value.
    #[error("{0} is neither 0 nor 1")]
    NotBool(u8),
    /// Bytes after the last field: the message is of another type.
    #[error("{0} bytes follow the message")]
    Trailing(usize),
}

impl CdrError {
    pub(super) fn new(field: &str, offset: usize, fault: CdrFault) -> Self {
        Self { field: field.to_owned(), offset, fault }
    }

    /// The same fault, of a field inside `outer`.
    #[must_use]
    pub(super) fn inside(mut self, outer: &str) -> Self {
        self.field = format!("{outer}.{}", self.field);
        self
    }
}
