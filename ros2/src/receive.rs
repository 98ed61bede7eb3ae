//! One sample of a subscriber of `rmw_zenoh` topics: from key, payload and attachment to a message,
//! or why not.
//!
//! A refusal costs a look at the key and at the fields before the fault; no count is believed
//! before it has been compared with the length of the payload. Samples of zenoh-bridge-ros2dds name
//! no type: for those, [`MessageKind::decode`] with the type from the bridge's token.

use crate::{
    cdr::CdrError,
    messages::{AnyMessage, MessageKind},
    rmw_zenoh::{Attachment, AttachmentError, DataKey, DataKeyError, HASH_NOT_SUPPORTED},
};

/// A message and what came with it. Texts and bytes are those of the sample.
#[derive(Debug, Clone, PartialEq)]
pub struct Received<'a> {
    /// Domain, topic and type.
    pub key: DataKey<'a>,
    /// Number, time and sender; absent from programs that are not of ROS.
    pub attachment: Option<Attachment>,
    /// The message.
    pub message: AnyMessage<'a>,
}

/// Why a sample is not used.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Refusal {
    /// The key is not that of a topic.
    #[error("the key is no topic of ROS: {0}")]
    Key(#[from] DataKeyError),
    /// A type without a use here.
    #[error("messages of type {0} are not read")]
    UnknownType(String),
    /// The type has another definition than the one that is read, so its bytes mean something else.
    #[error("{name} has the definition {hash}, {expected} is read")]
    OtherDefinition {
        /// The type.
        name: String,
        /// The hash of the key.
        hash: String,
        /// The hash that is read.
        expected: &'static str,
    },
    /// The attachment is malformed.
    #[error("the attachment is malformed: {0}")]
    Attachment(#[from] AttachmentError),
    /// The payload is malformed.
    #[error("the payload is malformed: {0}")]
    Payload(#[from] CdrError),
}

/// The kind of message that comes with a key, before its payload is looked at. A key without a
/// hash, of Humble, is taken as the known definition.
pub fn kind_of(key: &DataKey<'_>) -> Result<MessageKind, Refusal> {
    let unknown = || Refusal::UnknownType(key.type_name.to_string());
    let kind = MessageKind::of(key.type_name).ok_or_else(unknown)?;
    if [kind.hash(), HASH_NOT_SUPPORTED].contains(&key.hash) {
        return Ok(kind);
    }
    let (name, hash) = (key.type_name.to_string(), key.hash.to_owned());
    Err(Refusal::OtherDefinition { name, hash, expected: kind.hash() })
}

/// Reads one sample. The key is that of the sample without the namespace of its session
/// ([`crate::rmw_zenoh::strip_namespace`]).
pub fn receive<'a>(
    key: &'a str,
    payload: &'a [u8],
    attachment: Option<&[u8]>,
) -> Result<Received<'a>, Refusal> {
    let key = DataKey::parse(key)?;
    let kind = kind_of(&key)?;
    let attachment = attachment.map(Attachment::read).transpose()?;
    Ok(Received { key, attachment, message: kind.decode(payload)? })
}
