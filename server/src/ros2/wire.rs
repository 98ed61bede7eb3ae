//! Keys of one robot, of either middleware, with the prefix that they have at the server.

use crate::config::{Middleware, Ros2Robot};
use ros2::{
    bridge_dds::{self, BridgeToken},
    messages::AnyMessage,
    receive::{Received, Refusal, receive},
    rmw_zenoh::{self, DataKey, Token, cpu_buffers_of, publishers_of},
    robot::TopicUse,
    topic_name::TopicName,
};

/// How keys of a robot look.
#[derive(Debug, Clone)]
pub(super) struct Wire {
    pub(super) middleware: Middleware,
    prefix: String,
}

impl Wire {
    pub(super) fn of(robot: &Ros2Robot) -> Self {
        Self { middleware: robot.middleware, prefix: robot.key_prefix.clone() }
    }

    /// A key as the server sees it.
    pub(super) fn with_prefix(&self, key: &str) -> String {
        rmw_zenoh::inside_namespace(key, &self.prefix)
    }

    /// A key as the robot sees it.
    pub(super) fn without_prefix<'a>(&self, key: &'a str) -> Option<&'a str> {
        rmw_zenoh::strip_namespace(key, &self.prefix)
    }

    /// The key of a topic behind a bridge.
    pub(super) fn bridge_key(&self, topic: &str) -> String {
        TopicName::from_ros(topic).map_or_else(|_| String::new(), |t| bridge_dds::key_of(t, &self.prefix))
    }

    /// The key or pattern of a topic.
    fn topic(&self, used: &TopicUse) -> Option<String> {
        match self.middleware {
            Middleware::RmwZenoh { domain } => {
                let topic = TopicName::from_ros(&used.topic).ok()?;
                Some(self.with_prefix(&DataKey::every_hash(domain, topic, used.kind.name())))
            }
            Middleware::BridgeDds => Some(self.bridge_key(&used.topic)),
        }
    }

    /// What to subscribe to for a topic.
    pub(super) fn subscriptions(&self, used: &TopicUse) -> Vec<String> {
        let Some(topic) = self.topic(used) else { return Vec::new() };
        let has_buffers = used.kind.has_bytes() && self.middleware != Middleware::BridgeDds;
        let buffers = has_buffers.then(|| cpu_buffers_of(&topic));
        [Some(topic), buffers].into_iter().flatten().collect()
    }

    /// Where publishers of a topic that keep samples declare themselves.
    pub(super) fn cache_tokens(&self, used: &TopicUse) -> Option<String> {
        used.is_latched.then(|| self.topic(used).map(|topic| publishers_of(&topic))).flatten()
    }

    /// The liveliness tokens of the robot's graph. Those of bridges stand outside of the prefix.
    pub(super) fn tokens(&self) -> String {
        match self.middleware {
            Middleware::RmwZenoh { domain } => self.with_prefix(&Token::every(domain)),
            Middleware::BridgeDds => BridgeToken::EVERY.to_owned(),
        }
    }

    /// A token as the robot declared it.
    pub(super) fn token<'a>(&self, key: &'a str) -> Option<&'a str> {
        match self.middleware {
            Middleware::RmwZenoh { .. } => self.without_prefix(key),
            Middleware::BridgeDds => Some(key),
        }
    }

    /// Reads a message of a topic.
    pub(super) fn read<'a>(
        &self,
        used: &TopicUse,
        key: &'a str,
        (payload, attachment): (&'a [u8], Option<&[u8]>),
    ) -> Result<AnyMessage<'a>, Refusal> {
        match self.middleware {
            Middleware::RmwZenoh { .. } => {
                let key = self.without_prefix(key).unwrap_or(key);
                receive(key, payload, attachment).map(|Received { message, .. }| message)
            }
            Middleware::BridgeDds => Ok(used.kind.decode(payload)?),
        }
    }
}

/// A word for counters.
pub(super) fn refusal_word(refusal: &Refusal) -> &'static str {
    match refusal {
        Refusal::Key(_) => "bad_key",
        Refusal::UnknownType(_) => "unknown_type",
        Refusal::OtherDefinition { .. } => "other_definition",
        Refusal::Attachment(_) => "bad_attachment",
        Refusal::Payload(_) => "bad_payload",
    }
}
