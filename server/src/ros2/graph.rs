//! The robot's graph as its liveliness tokens tell it, and the server's node in it. In: tokens that
//! appear and go. Out: tokens to declare, and keys to send on.
//!
//! With `rmw_zenoh` the server is a node: with a subscription for each publisher of a wanted topic,
//! which lets publishers of images begin, and with a publisher for each topic that it sends on.

use super::{outputs::Outgoing, wire::Wire};
use crate::config::{Middleware, Ros2Robot};
use ros2::{
    bridge_dds::{BridgeKind, BridgeToken},
    messages::MessageKind,
    rmw_zenoh::{DataKey, EntityKind, HASH_NOT_SUPPORTED, LocalNode, Qos, Sender, Token},
    robot::TopicUse,
    topic_name::TopicName,
};
use std::collections::{BTreeMap, BTreeSet};

/// Most publishers of wanted topics that are remembered of a robot, and most subscriptions that are
/// declared.
const MAX_PUBLISHERS: usize = 128;
/// Numbers of entities that each robot's node has for itself in the server's session.
const IDS_PER_ROBOT: u64 = 10_000;
/// Depth of `/tf`, as tf2 has it.
const TF_DEPTH: u64 = 100;
/// Depth of the other topics, the default of ROS.
const DEPTH: u64 = 10;

/// What follows from a token.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(super) struct Follows {
    /// Tokens to declare, without the prefix of the robot's keys.
    pub(super) declare: Vec<String>,
    /// The robot came (true) or went.
    pub(super) presence: Option<bool>,
    /// A wanted topic, by its place in the settings, of which a publisher with another type was
    /// seen: that type.
    pub(super) other_type: Option<(usize, String)>,
}

/// The graph of one robot.
#[derive(Debug)]
pub(super) struct Graph {
    wire: Wire,
    own_zid: String,
    node: Option<LocalNode>,
    topics: Vec<TopicUse>,
    /// Tokens of publishers of wanted topics.
    publishers: BTreeSet<String>,
    /// Topic, type and hash of the subscriptions that were declared.
    subscribed: BTreeSet<(String, String, String)>,
    /// By topic and hash.
    senders: BTreeMap<(String, String), (MessageKind, Sender)>,
}

impl Graph {
    /// The graph before any token, with the tokens to declare. `index` is the robot's place among
    /// all of the session.
    pub(super) fn new(
        robot: &Ros2Robot,
        zid: &str,
        index: usize,
        outputs: &[(String, MessageKind)],
    ) -> (Self, Vec<String>) {
        let node = match robot.middleware {
            Middleware::BridgeDds => None,
            Middleware::RmwZenoh { domain } => {
                let name = format!("waymark_{}", robot.robot.as_str().replace('-', "_"));
                let node = LocalNode::new(domain, zid, &robot.namespace, &name);
                Some(node.numbered_from(index as u64 * IDS_PER_ROBOT))
            }
        };
        let mut graph = Self {
            wire: Wire::of(robot),
            own_zid: zid.to_owned(),
            node,
            topics: robot.inputs.topics(),
            publishers: BTreeSet::new(),
            subscribed: BTreeSet::new(),
            senders: BTreeMap::new(),
        };
        let mut declare: Vec<String> =
            graph.node.iter().filter_map(|node| node.token().to_key().ok()).collect();
        for (topic, kind) in outputs {
            declare.extend(graph.advertise(topic, *kind, kind.hash()));
        }
        (graph, declare)
    }

    /// A token appeared or went.
    pub(super) fn token(&mut self, token: &str, has_appeared: bool) -> Follows {
        match self.wire.middleware {
            Middleware::RmwZenoh { .. } => self.rmw_token(token, has_appeared),
            Middleware::BridgeDds => self.bridge_token(token, has_appeared),
        }
    }

    fn rmw_token(&mut self, text: &str, has_appeared: bool) -> Follows {
        let mut follows = Follows::default();
        let Ok(token) = Token::parse(text) else { return follows };
        let Some(endpoint) = token.endpoint.filter(|_| token.zid != self.own_zid) else { return follows };
        let kind = endpoint.type_name().ok().and_then(MessageKind::of);
        match token.kind {
            EntityKind::Publisher => {
                let wanted = self.topics.iter().position(|used| used.topic == endpoint.topic);
                let Some(wanted) = wanted else { return follows };
                if kind != Some(self.topics[wanted].kind) {
                    follows.other_type = has_appeared.then_some((wanted, endpoint.dds_type));
                    return follows;
                }
                follows.presence = self.publisher(text, has_appeared);
                let place = (endpoint.topic.clone(), endpoint.dds_type.clone(), endpoint.hash.clone());
                let is_new = has_appeared && self.subscribed.len() < MAX_PUBLISHERS;
                if is_new && self.subscribed.insert(place) {
                    let token = self.node.as_mut().map(|node| node.subscription(&endpoint));
                    follows.declare.extend(token.and_then(|token| token.to_key().ok()));
                }
            }
            // Humble knows no hashes: its subscriptions get messages on a key of their own.
            EntityKind::Subscription if has_appeared && endpoint.hash == HASH_NOT_SUPPORTED => {
                let sent = |((topic, _), (sent, _)): (&(String, String), &(MessageKind, Sender))| {
                    *topic == endpoint.topic && Some(*sent) == kind
                };
                if let Some(kind) = kind.filter(|_| self.senders.iter().any(sent)) {
                    follows.declare.extend(self.advertise(&endpoint.topic, kind, HASH_NOT_SUPPORTED));
                }
            }
            _ => {}
        }
        follows
    }

    fn bridge_token(&mut self, text: &str, has_appeared: bool) -> Follows {
        let mut follows = Follows::default();
        let Ok(BridgeToken::Endpoint(endpoint)) = BridgeToken::parse(text) else { return follows };
        if endpoint.kind != BridgeKind::Publisher {
            return follows;
        }
        let wanted = self.topics.iter().position(|used| self.wire.bridge_key(&used.topic) == endpoint.key);
        let Some(wanted) = wanted else { return follows };
        if endpoint.type_name().ok().and_then(MessageKind::of) == Some(self.topics[wanted].kind) {
            follows.presence = self.publisher(text, has_appeared);
        } else {
            follows.other_type = has_appeared.then_some((wanted, endpoint.ros_type));
        }
        follows
    }

    /// Notes a publisher of a wanted topic. Returns whether the robot came or went by that.
    fn publisher(&mut self, token: &str, has_appeared: bool) -> Option<bool> {
        let before = self.publishers.len();
        if !has_appeared {
            self.publishers.remove(token);
        } else if before < MAX_PUBLISHERS {
            self.publishers.insert(token.to_owned());
        }
        match (before, self.publishers.len()) {
            (0, 1..) => Some(true),
            (1.., 0) => Some(false),
            _ => None,
        }
    }

    /// A publisher of a topic with this hash: the token to declare, if it is new.
    fn advertise(&mut self, topic: &str, kind: MessageKind, hash: &str) -> Option<String> {
        let place = (topic.to_owned(), hash.to_owned());
        if self.senders.contains_key(&place) {
            return None;
        }
        let name = TopicName::from_ros(topic).ok()?;
        let depth = if kind == MessageKind::TFMessage { TF_DEPTH } else { DEPTH };
        let token = match &mut self.node {
            Some(node) => node.publisher(name, kind.name(), hash, Qos::reliable(depth)).to_key().ok()?,
            None => String::new(),
        };
        self.senders.insert(place, (kind, Sender::of_token(&token)));
        (!token.is_empty()).then_some(token)
    }

    /// Keys, with the robot's prefix, and attachments to send a message on.
    pub(super) fn address(&mut self, message: &Outgoing, now_ns: i64) -> Vec<(String, Option<Vec<u8>>)> {
        let Ok(topic) = TopicName::from_ros(&message.topic) else { return Vec::new() };
        let wire = &self.wire;
        let Middleware::RmwZenoh { domain } = wire.middleware else {
            return vec![(wire.bridge_key(&message.topic), None)];
        };
        let of_topic = self
            .senders
            .iter_mut()
            .filter(|((topic, _), (kind, _))| *topic == message.topic && *kind == message.kind);
        let addressed = of_topic.map(|((_, hash), (kind, sender))| {
            let key = DataKey::new(domain, topic, kind.name(), hash).to_string();
            (wire.with_prefix(&key), Some(sender.attachment(now_ns).write().to_vec()))
        });
        addressed.collect()
    }
}

#[cfg(test)]
mod tests;
