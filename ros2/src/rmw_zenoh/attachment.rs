//! What goes beside every payload: number, time and sender.
//!
//! Source: `attachment_helpers.cpp`, `zenoh_utils.cpp`;
//! `eclipse-zenoh/zenoh zenoh-ext/src/serialization.rs`. 33 bytes: i64 number, i64 time, a length
//! of 16, the sender; little endian. Up to Humble 0.1.1, Jazzy 0.2.3 and Rolling 0.5.0 each is
//! preceded by its name as a text with a length byte: 77 bytes. A subscription of ROS drops
//! messages without an attachment, and may end at a malformed one, so one is written to every put.

use super::gid::Gid;

/// Length of an attachment.
const BYTES: usize = 33;
/// Length of the earlier form.
const LABELLED_BYTES: usize = 77;
/// Length of the sender's name.
const GID_BYTES: usize = 16;

/// Number, time and sender of a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Attachment {
    /// Number of the message; a publisher begins with 1.
    pub sequence: i64,
    /// When it was published, ns since 1970 by the clock of the robot's computer, even under
    /// simulated time.
    pub source_ns: i64,
    /// The publisher.
    pub source: Gid,
}

/// Why bytes are no attachment.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum AttachmentError {
    /// Neither 33 nor 77 bytes.
    #[error("an attachment has {BYTES} or {LABELLED_BYTES} bytes, this one has {0}")]
    Length(usize),
    /// Something else stands where a name or the length of the sender belongs.
    #[error("`{0}` of the attachment is malformed")]
    Field(&'static str),
}

impl Attachment {
    /// Reads either form.
    pub fn read(bytes: &[u8]) -> Result<Self, AttachmentError> {
        let is_labelled = match bytes.len() {
            BYTES => false,
            LABELLED_BYTES => true,
            other => return Err(AttachmentError::Length(other)),
        };
        let mut fields = Fields { rest: bytes, is_labelled };
        let sequence = fields.number("sequence_number")?;
        let source_ns = fields.number("source_timestamp")?;
        let source = fields.sender("source_gid")?;
        Ok(Self { sequence, source_ns, source })
    }

    /// The current form.
    pub fn write(&self) -> [u8; BYTES] {
        let mut bytes = [0; BYTES];
        bytes[..8].copy_from_slice(&self.sequence.to_le_bytes());
        bytes[8..16].copy_from_slice(&self.source_ns.to_le_bytes());
        bytes[16] = GID_BYTES as u8;
        bytes[17..].copy_from_slice(&self.source.0);
        bytes
    }
}

/// The fields that are left.
struct Fields<'a> {
    rest: &'a [u8],
    is_labelled: bool,
}

impl Fields<'_> {
    fn number(&mut self, name: &'static str) -> Result<i64, AttachmentError> {
        self.label(name)?;
        self.take(name).map(i64::from_le_bytes)
    }

    fn sender(&mut self, name: &'static str) -> Result<Gid, AttachmentError> {
        self.label(name)?;
        match self.take(name)? {
            [length] if usize::from(length) == GID_BYTES => self.take(name).map(Gid),
            _ => Err(AttachmentError::Field(name)),
        }
    }

    /// Passes over the name, in the earlier form.
    fn label(&mut self, name: &'static str) -> Result<(), AttachmentError> {
        if !self.is_labelled {
            return Ok(());
        }
        let after = match self.rest.split_first() {
            Some((length, text)) if usize::from(*length) == name.len() => text.strip_prefix(name.as_bytes()),
            _ => None,
        };
        self.rest = after.ok_or(AttachmentError::Field(name))?;
        Ok(())
    }

    fn take<const N: usize>(&mut self, name: &'static str) -> Result<[u8; N], AttachmentError> {
        let (taken, rest) = self.rest.split_first_chunk().ok_or(AttachmentError::Field(name))?;
        self.rest = rest;
        Ok(*taken)
    }
}
