//! A node of our own: the tokens to declare, so that robots see it and publishers of images begin
//! to publish.
//!
//! Source: `liveliness_utils.cpp` (`Entity`);
//! `ros-perception/image_common image_transport/src/publisher.cpp`, which publishes only while some
//! subscription's token has its topic and type. A subscription therefore repeats topic, type and
//! hash of the publisher's token. What is published has the hash of the robot's own subscription,
//! for a robot may have another definition than this crate; [`crate::messages::Message::HASH`] is
//! for robots without one.

use super::{
    attachment::Attachment,
    buffers::CPU_BACKEND,
    gid::Gid,
    qos::{Durability, Qos},
    token::{Endpoint, EntityKind, Token},
};
use crate::{messages::MessageKind, topic_name::TopicName, type_name::TypeName};

/// Depth of a subscription to transient local topics, that of tf2's listener to `/tf_static`
/// (`ros2/geometry2 tf2_ros/include/tf2_ros/qos.hpp`).
const LATCHED_DEPTH: u64 = 100;

/// A node in a zenoh session, and the counter of the session's entities.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LocalNode {
    token: Token,
    next_id: u64,
}

impl LocalNode {
    /// The first node of a session. `zid` is the session's identity as zenoh prints it; `namespace`
    /// begins with a slash.
    pub fn new(domain: u32, zid: &str, namespace: &str, node: &str) -> Self {
        let token = Token {
            domain,
            zid: zid.to_owned(),
            node_id: "0".to_owned(),
            entity_id: "0".to_owned(),
            kind: EntityKind::Node,
            enclave: "/".to_owned(),
            namespace: namespace.to_owned(),
            node: node.to_owned(),
            endpoint: None,
        };
        Self { token, next_id: 1 }
    }

    /// The same node with numbers from `first` on, for a further node of the session.
    #[must_use]
    pub fn numbered_from(mut self, first: u64) -> Self {
        self.token.node_id = first.to_string();
        self.token.entity_id.clone_from(&self.token.node_id);
        self.next_id = first + 1;
        self
    }

    /// The node's own token.
    pub fn token(&self) -> &Token {
        &self.token
    }

    /// A subscription to what `publisher` publishes: best effort, or reliable with earlier samples
    /// where it keeps them.
    pub fn subscription(&mut self, publisher: &Endpoint) -> Token {
        let qos = match publisher.qos.durability {
            Durability::TransientLocal => Qos::latched(LATCHED_DEPTH),
            _ => Qos::sensor_data(),
        };
        let kind = publisher.type_name().ok().and_then(MessageKind::of);
        let backends = kind.filter(|kind| kind.has_bytes()).map(|_| CPU_BACKEND.to_owned());
        self.entity(EntityKind::Subscription, Endpoint { qos, backends, ..publisher.clone() })
    }

    /// A publisher of a topic.
    pub fn publisher(
        &mut self,
        topic: TopicName<'_>,
        type_name: TypeName<'_>,
        hash: &str,
        qos: Qos,
    ) -> Token {
        let (topic, dds_type, hash) = (topic.to_string(), type_name.to_dds(), hash.to_owned());
        self.entity(EntityKind::Publisher, Endpoint { topic, dds_type, hash, qos, backends: None })
    }

    fn entity(&mut self, kind: EntityKind, endpoint: Endpoint) -> Token {
        let entity_id = self.next_id.to_string();
        self.next_id += 1;
        Token { entity_id, kind, endpoint: Some(endpoint), ..self.token.clone() }
    }
}

/// Numbers the messages of one publisher.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Sender {
    source: Gid,
    sent: i64,
}

impl Sender {
    /// Of the publisher with this declared token.
    pub fn of_token(token: &str) -> Self {
        Self { source: Gid::of_token(token), sent: 0 }
    }

    /// The attachment of the next message, published at `now_ns`, ns since 1970.
    pub fn attachment(&mut self, now_ns: i64) -> Attachment {
        self.sent += 1;
        Attachment { sequence: self.sent, source_ns: now_ns, source: self.source }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::messages::{CompressedImage, Message, TFMessage};

    fn published<'a, M: Message<'a>>(topic: &str, qos: Qos) -> Endpoint {
        let dds_type = M::NAME.to_dds();
        Endpoint { topic: topic.to_owned(), dds_type, hash: "RIHS01_robots".to_owned(), qos, backends: None }
    }

    fn node() -> LocalNode {
        LocalNode::new(3, "8b20", "/", "waymark")
    }

    #[test]
    fn a_subscription_wakes_a_camera() {
        let mut node = node();
        assert_eq!(node.token().to_key().unwrap(), "@ros2_lv/3/8b20/0/0/NN/%/%/waymark");
        let camera = published::<CompressedImage<'_>>("/r1/image/compressed", Qos::reliable(10));
        let token = node.subscription(&camera).to_key().unwrap();
        assert_eq!(
            token,
            "@ros2_lv/3/8b20/0/1/MS/%/%/waymark/%r1%image%compressed/sensor_msgs::msg::dds_::CompressedImage_/\
             RIHS01_robots/2::,5:,:,:,,/backends:cpu:"
        );
    }

    #[test]
    fn nodes_of_one_session_have_their_own_numbers() {
        let mut second = node().numbered_from(1000);
        assert_eq!(second.token().to_key().unwrap(), "@ros2_lv/3/8b20/1000/1000/NN/%/%/waymark");
        let tf = second.subscription(&published::<TFMessage<'_>>("/tf", Qos::reliable(100)));
        assert!(tf.to_key().unwrap().starts_with("@ros2_lv/3/8b20/1000/1001/MS/"));
    }

    #[test]
    fn transforms_are_asked_for_as_tf2_does() {
        let mut node = node();
        let tf = node.subscription(&published::<TFMessage<'_>>("/tf", Qos::reliable(100))).endpoint.unwrap();
        assert_eq!((tf.qos, tf.backends), (Qos::sensor_data(), None));
        let fixed = node.subscription(&published::<TFMessage<'_>>("/tf_static", Qos::latched(1)));
        assert_eq!(fixed.entity_id, "2");
        assert_eq!(fixed.endpoint.unwrap().qos, Qos::latched(100));
    }

    #[test]
    fn what_is_published_is_numbered_from_one() {
        let topic = TopicName::from_ros("/tf").unwrap();
        let token = node().publisher(topic, TFMessage::NAME, TFMessage::HASH, Qos::reliable(100));
        let key = token.to_key().unwrap();
        assert!(key.starts_with(
            "@ros2_lv/3/8b20/0/1/MP/%/%/waymark/%tf/tf2_msgs::msg::dds_::TFMessage_/RIHS01_e369"
        ));
        let mut sender = Sender::of_token(&key);
        let first = Attachment { sequence: 1, source_ns: 50, source: Gid::of_token(&key) };
        assert_eq!(sender.attachment(50), first);
        assert_eq!(sender.attachment(60), Attachment { sequence: 2, source_ns: 60, ..first });
    }
}
