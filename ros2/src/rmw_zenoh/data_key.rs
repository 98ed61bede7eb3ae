//! The key of a topic: `<domain>/<topic>/<pkg>::msg::dds_::<Type>_/<hash>`.
//!
//! Source: `liveliness_utils.cpp` (`TopicInfo`), `buffer_endpoint_helpers.hpp`; the matching,
//! `eclipse-zenoh/zenoh commons/zenoh-keyexpr/src/key_expr`: zenoh matches exact keys; `*` and `**`
//! match no part that begins with `@`.

use super::domain;
use crate::{
    topic_name::{TopicName, TopicNameError},
    type_name::{TypeName, TypeNameError},
};
use std::fmt;

/// What Humble writes in place of a hash, so that it never meets newer distributions.
pub const HASH_NOT_SUPPORTED: &str = "TypeHashNotSupported";
/// Longest key that is read, in bytes.
pub const MAX_KEY_BYTES: usize = 1024;
/// Last part of the key that publishers with buffers use for plain CDR.
pub(super) const CPU_BUFFERS: &str = "_buf_cpu";
/// Last but one part of the key that carries descriptors of device memory.
const DEVICE_BUFFERS: &str = "_buf";

/// The parts of a key, borrowed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct DataKey<'a> {
    /// `ROS_DOMAIN_ID`.
    pub domain: u32,
    /// The topic.
    pub topic: TopicName<'a>,
    /// The type of its messages.
    pub type_name: TypeName<'a>,
    /// Hash of the definition: `RIHS01_` and 64 digits, or [`HASH_NOT_SUPPORTED`].
    pub hash: &'a str,
    /// Which of the topic's keys.
    pub channel: Channel,
}

/// The keys of one topic that carry messages in CDR.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Channel {
    /// The topic's key.
    Topic,
    /// The key with `/_buf_cpu`: types with a `uint8[]` since Lyrical, where all subscribers know
    /// buffers.
    CpuBuffers,
}

/// Why a key is not that of a topic.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum DataKeyError {
    /// Longer than [`MAX_KEY_BYTES`].
    #[error("the key has {0} bytes, at most {MAX_KEY_BYTES} are read")]
    TooLong(usize),
    /// Fewer than four parts, or an empty hash.
    #[error("a key has domain, topic, type and hash")]
    Parts,
    /// The first part is not a domain.
    #[error("the key does not begin with a domain")]
    Domain,
    /// It carries descriptors of device memory, not messages.
    #[error("the key carries descriptors of buffers")]
    DeviceBuffers,
    /// The topic's name.
    #[error(transparent)]
    Topic(#[from] TopicNameError),
    /// The type: of a service or action, or none.
    #[error(transparent)]
    Type(#[from] TypeNameError),
}

impl<'a> DataKey<'a> {
    /// The key of a topic.
    pub fn new(domain: u32, topic: TopicName<'a>, type_name: TypeName<'a>, hash: &'a str) -> Self {
        Self { domain, topic, type_name, hash, channel: Channel::Topic }
    }

    /// Reads the key of a sample.
    pub fn parse(key: &'a str) -> Result<Self, DataKeyError> {
        if key.len() > MAX_KEY_BYTES {
            return Err(DataKeyError::TooLong(key.len()));
        }
        let (domain, rest) = key.split_once('/').ok_or(DataKeyError::Parts)?;
        let domain = domain::parse(domain).ok_or(DataKeyError::Domain)?;
        let (rest, channel) = match rest.rsplit_once('/') {
            Some((rest, CPU_BUFFERS)) => (rest, Channel::CpuBuffers),
            Some((before, _)) if before.rsplit('/').next() == Some(DEVICE_BUFFERS) => {
                return Err(DataKeyError::DeviceBuffers);
            }
            _ => (rest, Channel::Topic),
        };
        let (rest, hash) = rest.rsplit_once('/').ok_or(DataKeyError::Parts)?;
        let (topic, type_text) = rest.rsplit_once('/').ok_or(DataKeyError::Parts)?;
        if hash.is_empty() {
            return Err(DataKeyError::Parts);
        }
        let type_name = TypeName::from_dds(type_text)?;
        Ok(Self { domain, topic: TopicName::from_key(topic)?, type_name, hash, channel })
    }

    /// What to subscribe to for a type on one topic, whatever the hash.
    pub fn every_hash(domain: u32, topic: TopicName<'_>, type_name: TypeName<'_>) -> String {
        format!("{domain}/{}/{}/*", topic.as_key(), type_name.to_dds())
    }
}

impl fmt::Display for DataKey<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { domain, topic, type_name, hash, channel } = self;
        write!(f, "{domain}/{}/{}/{hash}", topic.as_key(), type_name.to_dds())?;
        match channel {
            Channel::Topic => Ok(()),
            Channel::CpuBuffers => write!(f, "/{CPU_BUFFERS}"),
        }
    }
}
