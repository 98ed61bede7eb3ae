//! Liveliness tokens of bridges: which bridges there are, and which topics their robots publish and
//! subscribe to.
//!
//! `@/<zid>/@ros2_lv` for a bridge; `@/<zid>/@ros2_lv/MP|MS/<key>/<type>/<qos>` for a topic, and
//! with `SS`, `SC`, `AS`, `AC` and no quality of service for services and actions. `/` inside of a
//! part is `§`. Source: `eclipse-zenoh/zenoh-plugin-ros2dds src/liveliness_mgt.rs`.

use super::qos::{DdsQos, DdsQosError};
use crate::type_name::{TypeName, TypeNameError};

/// Longest token that is read, in bytes.
pub const MAX_BRIDGE_TOKEN_BYTES: usize = 4096;
/// In place of `/` inside of a part.
const SLASH: &str = "§";

/// What the robot behind a bridge has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum BridgeKind {
    /// `MP`.
    Publisher,
    /// `MS`.
    Subscription,
    /// `SS`.
    Service,
    /// `SC`.
    ServiceClient,
    /// `AS`.
    Action,
    /// `AC`.
    ActionClient,
}

/// Every kind with its letters.
const KINDS: [(BridgeKind, &str); 6] = [
    (BridgeKind::Publisher, "MP"),
    (BridgeKind::Subscription, "MS"),
    (BridgeKind::Service, "SS"),
    (BridgeKind::ServiceClient, "SC"),
    (BridgeKind::Action, "AS"),
    (BridgeKind::ActionClient, "AC"),
];

impl BridgeKind {
    fn has_qos(self) -> bool {
        matches!(self, Self::Publisher | Self::Subscription)
    }
}

/// A token of a bridge.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub enum BridgeToken {
    /// The bridge itself.
    Bridge {
        /// Identity of its zenoh session.
        zid: String,
    },
    /// An endpoint behind it.
    Endpoint(BridgeEndpoint),
}

/// An endpoint of a robot behind a bridge.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct BridgeEndpoint {
    /// Identity of the bridge's zenoh session.
    pub zid: String,
    /// What it is.
    pub kind: BridgeKind,
    /// The key of its data: see [`super::key_of`].
    pub key: String,
    /// Its type in the form of ROS; services and actions have other types than topics.
    pub ros_type: String,
    /// Quality of service of a topic; the default for services and actions.
    pub qos: DdsQos,
}

impl BridgeEndpoint {
    /// The type of a topic's messages.
    pub fn type_name(&self) -> Result<TypeName<'_>, TypeNameError> {
        TypeName::from_ros(&self.ros_type)
    }
}

/// Why a text is no token of a bridge.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum BridgeTokenError {
    /// Longer than [`MAX_BRIDGE_TOKEN_BYTES`].
    #[error("the token has {0} bytes, at most {MAX_BRIDGE_TOKEN_BYTES} are read")]
    TooLong(usize),
    /// Another beginning, or a wrong number of parts.
    #[error("the token is not `@/<zid>/@ros2_lv` with the parts of an endpoint")]
    Parts,
    /// An empty part.
    #[error("`{0}` of the token is empty")]
    Empty(&'static str),
    /// None of the six kinds.
    #[error("the token is of no known kind")]
    Kind,
    /// The quality of service.
    #[error(transparent)]
    Qos(#[from] DdsQosError),
}

impl BridgeToken {
    /// What to subscribe to for the tokens of every bridge.
    pub const EVERY: &'static str = "@/*/@ros2_lv/**";

    /// Reads a token.
    pub fn parse(text: &str) -> Result<Self, BridgeTokenError> {
        if text.len() > MAX_BRIDGE_TOKEN_BYTES {
            return Err(BridgeTokenError::TooLong(text.len()));
        }
        let parts: Vec<&str> = text.split('/').collect();
        let (zid, rest) = match parts.as_slice() {
            ["@", zid, "@ros2_lv", rest @ ..] => (*zid, rest),
            _ => return Err(BridgeTokenError::Parts),
        };
        filled("zid", zid)?;
        let (letters, key, ros_type, qos) = match rest {
            [] => return Ok(Self::Bridge { zid: zid.to_owned() }),
            [letters, key, ros_type] => (*letters, *key, *ros_type, None),
            [letters, key, ros_type, qos] => (*letters, *key, *ros_type, Some(*qos)),
            _ => return Err(BridgeTokenError::Parts),
        };
        let kind = KINDS.iter().find(|(_, known)| *known == letters).ok_or(BridgeTokenError::Kind)?.0;
        if kind.has_qos() != qos.is_some() {
            return Err(BridgeTokenError::Parts);
        }
        Ok(Self::Endpoint(BridgeEndpoint {
            zid: zid.to_owned(),
            kind,
            key: filled("key", key)?.replace(SLASH, "/"),
            ros_type: filled("type", ros_type)?.replace(SLASH, "/"),
            qos: qos.map(DdsQos::parse).transpose()?.unwrap_or_default(),
        }))
    }

    /// The key that the bridge declares.
    pub fn to_key(&self) -> String {
        match self {
            Self::Bridge { zid } => format!("@/{zid}/@ros2_lv"),
            Self::Endpoint(endpoint) => endpoint.to_key(),
        }
    }
}

impl BridgeEndpoint {
    fn to_key(&self) -> String {
        let letters = KINDS.iter().find(|(kind, _)| *kind == self.kind).map_or("", |(_, letters)| *letters);
        let (key, ros_type) = (self.key.replace('/', SLASH), self.ros_type.replace('/', SLASH));
        let token = format!("@/{}/@ros2_lv/{letters}/{key}/{ros_type}", self.zid);
        if self.kind.has_qos() { format!("{token}/{}", self.qos) } else { token }
    }
}

fn filled<'a>(name: &'static str, part: &'a str) -> Result<&'a str, BridgeTokenError> {
    if part.is_empty() { Err(BridgeTokenError::Empty(name)) } else { Ok(part) }
}
