//! Liveliness tokens: which nodes there are, and what they publish and subscribe to.
//!
//! `@ros2_lv/<domain>/<zid>/<node id>/<entity id>/<kind>/<enclave>/<namespace>/<node>`, and for an
//! endpoint `/<topic>/<type>/<hash>/<qos>`, since Lyrical perhaps `/backends:...`. `/` inside of a
//! part is `%`. So there are 9, 13 or 14 parts. Source: `liveliness_utils.cpp` (`Entity`), and the
//! design document.

use super::{
    domain,
    qos::{Qos, QosError},
};
use crate::type_name::{TypeName, TypeNameError};

/// Longest token that is read, in bytes.
pub const MAX_TOKEN_BYTES: usize = 4096;
/// First part of every token.
const ADMIN: &str = "@ros2_lv";
/// Before the backends of a subscription.
const BACKENDS: &str = "backends:";
/// Parts of a node's token.
const NODE_PARTS: usize = 9;
/// Parts of an endpoint's token without backends.
const ENDPOINT_PARTS: usize = 13;

/// What a token stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum EntityKind {
    /// `NN`.
    Node,
    /// `MP`.
    Publisher,
    /// `MS`.
    Subscription,
    /// `SS`.
    Service,
    /// `SC`.
    Client,
}

/// Every kind with its letters.
const KINDS: [(EntityKind, &str); 5] = [
    (EntityKind::Node, "NN"),
    (EntityKind::Publisher, "MP"),
    (EntityKind::Subscription, "MS"),
    (EntityKind::Service, "SS"),
    (EntityKind::Client, "SC"),
];

/// A node, or an endpoint of one.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Token {
    /// `ROS_DOMAIN_ID`.
    pub domain: u32,
    /// Identity of the zenoh session, as zenoh prints it.
    pub zid: String,
    /// The node in its session.
    pub node_id: String,
    /// The entity in its session: counted from 0 over all; that of the node for a node.
    pub entity_id: String,
    /// What it is.
    pub kind: EntityKind,
    /// Security enclave, `/` for none.
    pub enclave: String,
    /// Namespace of the node, `/` for the root.
    pub namespace: String,
    /// Name of the node.
    pub node: String,
    /// What is published, subscribed to or served; of every kind but a node.
    pub endpoint: Option<Endpoint>,
}

/// A topic or service of a node.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Endpoint {
    /// Its name with a leading slash.
    pub topic: String,
    /// Its type in the form of DDS; services have other types than topics.
    pub dds_type: String,
    /// Hash of the type's definition.
    pub hash: String,
    /// Quality of service.
    pub qos: Qos,
    /// Where a subscription takes buffers: [`super::CPU_BACKEND`] for plain CDR. `None` for nodes
    /// before Lyrical.
    pub backends: Option<String>,
}

impl Endpoint {
    /// The type of a topic's messages.
    pub fn type_name(&self) -> Result<TypeName<'_>, TypeNameError> {
        TypeName::from_dds(&self.dds_type)
    }
}

/// Why a text is no token, or parts make none.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum TokenError {
    /// Longer than [`MAX_TOKEN_BYTES`].
    #[error("the token has {0} bytes, at most {MAX_TOKEN_BYTES} are read")]
    TooLong(usize),
    /// Another first part.
    #[error("the token does not begin with {ADMIN}")]
    Admin,
    /// Too few parts for its kind.
    #[error("the token has {0} parts, too few for its kind")]
    Parts(usize),
    /// A part that is empty or has a character with a meaning in keys.
    #[error("`{0}` of the token is empty or has one of `*$?#%@`")]
    Part(&'static str),
    /// The second part is not a domain.
    #[error("the token names no domain")]
    Domain,
    /// None of the five kinds.
    #[error("the token is of no known kind")]
    Kind,
    /// A node with an endpoint, or something else without one.
    #[error("a node has no endpoint, and everything else has one")]
    Endpoint,
    /// The quality of service.
    #[error(transparent)]
    Qos(#[from] QosError),
}

/// Names of the parts, in their order.
const PARTS: [&str; ENDPOINT_PARTS] = [
    "admin",
    "domain",
    "zid",
    "node_id",
    "entity_id",
    "kind",
    "enclave",
    "namespace",
    "node",
    "topic",
    "dds_type",
    "hash",
    "qos",
];

impl Token {
    /// What to subscribe to for the tokens of a domain.
    pub fn every(domain: u32) -> String {
        format!("{ADMIN}/{domain}/**")
    }

    /// Reads a token. Parts that are not known are passed over, as ROS does.
    pub fn parse(text: &str) -> Result<Self, TokenError> {
        if text.len() > MAX_TOKEN_BYTES {
            return Err(TokenError::TooLong(text.len()));
        }
        let parts: Vec<&str> = text.split('/').collect();
        if parts[0] != ADMIN {
            return Err(TokenError::Admin);
        }
        let needed =
            |count: usize| if parts.len() < count { Err(TokenError::Parts(parts.len())) } else { Ok(()) };
        needed(NODE_PARTS)?;
        if let Some(empty) = parts.iter().position(|part| part.is_empty()) {
            return Err(TokenError::Part(PARTS.get(empty).copied().unwrap_or(BACKENDS)));
        }
        let kind = KINDS.iter().find(|(_, letters)| *letters == parts[5]).ok_or(TokenError::Kind)?.0;
        let endpoint = if kind == EntityKind::Node {
            None
        } else {
            needed(ENDPOINT_PARTS)?;
            Some(Endpoint {
                topic: demangled(parts[9]),
                dds_type: demangled(parts[10]),
                hash: demangled(parts[11]),
                qos: Qos::parse(parts[12])?,
                backends: parts[ENDPOINT_PARTS..]
                    .iter()
                    .find_map(|part| part.strip_prefix(BACKENDS))
                    .filter(|backends| !backends.is_empty())
                    .map(demangled),
            })
        };
        Ok(Self {
            domain: domain::parse(parts[1]).ok_or(TokenError::Domain)?,
            zid: parts[2].to_owned(),
            node_id: parts[3].to_owned(),
            entity_id: parts[4].to_owned(),
            kind,
            enclave: demangled(parts[6]),
            namespace: demangled(parts[7]),
            node: demangled(parts[8]),
            endpoint,
        })
    }

    /// The key to declare. The same text gives the entity's [`super::Gid`].
    pub fn to_key(&self) -> Result<String, TokenError> {
        if self.endpoint.is_some() == (self.kind == EntityKind::Node) {
            return Err(TokenError::Endpoint);
        }
        let letters = KINDS.iter().find(|(kind, _)| *kind == self.kind).ok_or(TokenError::Kind)?.1;
        let domain = self.domain.to_string();
        let mut parts = vec![domain.as_str(), &self.zid, &self.node_id, &self.entity_id, letters];
        parts.extend([self.enclave.as_str(), &self.namespace, &self.node]);
        let qos = self.endpoint.as_ref().map(|endpoint| endpoint.qos.to_string()).unwrap_or_default();
        if let Some(endpoint) = &self.endpoint {
            parts.extend([endpoint.topic.as_str(), &endpoint.dds_type, &endpoint.hash, &qos]);
        }
        let mut key = ADMIN.to_owned();
        for (part, name) in parts.into_iter().zip(&PARTS[1..]) {
            check(part, name)?;
            key.push('/');
            key.extend(part.chars().map(|c| if c == '/' { '%' } else { c }));
        }
        if let Some(backends) = self.endpoint.as_ref().and_then(|endpoint| endpoint.backends.as_ref()) {
            check(backends, "backends")?;
            key.push('/');
            key.push_str(BACKENDS);
            key.extend(backends.chars().map(|c| if c == '/' { '%' } else { c }));
        }
        if key.len() > MAX_TOKEN_BYTES { Err(TokenError::TooLong(key.len())) } else { Ok(key) }
    }
}

fn check(part: &str, name: &'static str) -> Result<(), TokenError> {
    let is_plain = !part.is_empty() && !part.contains(['*', '$', '?', '#', '%', '@']);
    if is_plain { Ok(()) } else { Err(TokenError::Part(name)) }
}

fn demangled(part: &str) -> String {
    part.replace('%', "/")
}
