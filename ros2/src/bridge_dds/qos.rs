//! Quality of service as the bridge's tokens write it: in the numbers of DDS, which are others than
//! those of ROS.
//!
//! `[K]:<reliability>:<durability>:<history>,<depth>[:<user data>]`; what is absent has the default
//! of DDS. Source: `eclipse-zenoh/zenoh-plugin-ros2dds src/liveliness_mgt.rs` (`qos_to_key_expr`).
//! The user data of publishers since Iron holds `typehash=RIHS01_...;`.

use std::fmt;

/// Why a text is no quality of service.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` of the bridge's quality of service is malformed")]
pub struct DdsQosError(pub &'static str);

/// Whether lost samples are sent again.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum DdsReliability {
    /// They are not.
    BestEffort = 0,
    /// They are.
    Reliable = 1,
}

/// Whether late subscribers get earlier samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum DdsDurability {
    /// They do not.
    Volatile = 0,
    /// They do, while the publisher lives.
    TransientLocal = 1,
    /// They do, while a service of DDS runs.
    Transient = 2,
    /// They do, for ever.
    Persistent = 3,
}

/// Which samples wait.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum DdsHistoryKind {
    /// The newest.
    KeepLast = 0,
    /// All.
    KeepAll = 1,
}

/// Which and how many samples wait.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct DdsHistory {
    /// Which.
    pub kind: DdsHistoryKind,
    /// How many; -1 for no bound.
    pub depth: i32,
}

impl DdsHistory {
    fn parse(text: &str) -> Option<Self> {
        let (kind, depth) = text.split_once(',')?;
        let kind = match kind {
            "0" => DdsHistoryKind::KeepLast,
            "1" => DdsHistoryKind::KeepAll,
            _ => return None,
        };
        Some(Self { kind, depth: depth.parse().ok()? })
    }
}

/// The quality of service of an endpoint. `None` is the default of DDS.
#[derive(Debug, Clone, PartialEq, Eq, Hash, Default)]
pub struct DdsQos {
    /// Whether the type has a key.
    pub is_keyed: bool,
    /// Whether lost samples are sent again.
    pub reliability: Option<DdsReliability>,
    /// Whether late subscribers get earlier samples.
    pub durability: Option<DdsDurability>,
    /// Which and how many samples wait.
    pub history: Option<DdsHistory>,
    /// `name=value;` of the endpoint; empty before Iron.
    pub user_data: String,
}

impl DdsQos {
    /// Reads the last part of a token.
    pub fn parse(text: &str) -> Result<Self, DdsQosError> {
        let mut parts = text.splitn(5, ':');
        let mut part = |field| parts.next().ok_or(DdsQosError(field));
        let is_keyed = match part("key")? {
            "" => false,
            "K" => true,
            _ => return Err(DdsQosError("key")),
        };
        let reliability = match part("reliability")? {
            "" => None,
            "0" => Some(DdsReliability::BestEffort),
            "1" => Some(DdsReliability::Reliable),
            _ => return Err(DdsQosError("reliability")),
        };
        let durability = match part("durability")? {
            "" => None,
            "0" => Some(DdsDurability::Volatile),
            "1" => Some(DdsDurability::TransientLocal),
            "2" => Some(DdsDurability::Transient),
            "3" => Some(DdsDurability::Persistent),
            _ => return Err(DdsQosError("durability")),
        };
        let history = match part("history")? {
            "" => None,
            text => Some(DdsHistory::parse(text).ok_or(DdsQosError("history"))?),
        };
        let user_data = parts.next().unwrap_or_default().to_owned();
        Ok(Self { is_keyed, reliability, durability, history, user_data })
    }
}

impl fmt::Display for DdsQos {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if self.is_keyed { "K:" } else { ":" })?;
        if let Some(reliability) = self.reliability {
            write!(f, "{}", reliability as u8)?;
        }
        f.write_str(":")?;
        if let Some(durability) = self.durability {
            write!(f, "{}", durability as u8)?;
        }
        f.write_str(":")?;
        if let Some(DdsHistory { kind, depth }) = self.history {
            write!(f, "{},{depth}", kind as u8)?;
        }
        if self.user_data.is_empty() { Ok(()) } else { write!(f, ":{}", self.user_data) }
    }
}
