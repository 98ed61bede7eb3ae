//! A robot of ROS 2 without ROS: its router and one of its nodes as zenoh sessions, with keys,
//! tokens and attachments as `rmw_zenoh` and zenoh-bridge-ros2dds write them. They are written here
//! as text, not by the crate that reads them.
//!
//! Sources: the design document of `ros2/rmw_zenoh`,
//! `rmw_zenoh_cpp/src/detail/liveliness_utils.cpp` and `attachment_helpers.cpp` beside it;
//! `eclipse-zenoh/zenoh-plugin-ros2dds src/liveliness_mgt.rs`; hashes of rosbags' type stores.

use crate::{SOON, documents::root, eventually};
use std::{
    collections::BTreeMap,
    net::TcpListener,
    path::Path,
    sync::{Arc, Mutex},
};
use zenoh::{
    Config, Session, Wait, liveliness::LivelinessToken, pubsub::Subscriber, query::Queryable,
    sample::SampleKind,
};

/// A type with the hash of its definition.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Type {
    /// Package and name: `sensor_msgs/Image`.
    pub name: &'static str,
    /// `RIHS01_` and 64 digits.
    pub hash: &'static str,
}

macro_rules! types {
    ($($constant:ident = $name:literal, $hash:literal;)*) => {
        $(#[doc = concat!("`", $name, "`")] pub const $constant: Type = Type { name: $name, hash: concat!("RIHS01_", $hash) };)*
    };
}

types! {
    IMAGE = "sensor_msgs/Image", "d31d41a9a4c4bc8eae9be757b0beed306564f7526c88ea6a4588fb9582527d47";
    COMPRESSED_IMAGE = "sensor_msgs/CompressedImage",
        "15640771531571185e2efc8a100baf923961a4d15d5569652e6cb6691e8e371a";
    CAMERA_INFO = "sensor_msgs/CameraInfo", "b3dfd68ff46c9d56c80fd3bd4ed22c7a4ddce8c8348f2f59c299e73118e7e275";
    LASER_SCAN = "sensor_msgs/LaserScan", "64c191398013af96509d518dac71d5164f9382553fce5c1f8cca5be7924bd828";
    ODOMETRY = "nav_msgs/Odometry", "3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0";
    TF_MESSAGE = "tf2_msgs/TFMessage", "e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087";
    POSE = "geometry_msgs/PoseWithCovarianceStamped",
        "26432f9803e43727d3c8f668d1fdb3c630f548af631e2f4e31382371bfea3b6e";
    DETECTIONS = "vision_msgs/Detection2DArray",
        "214274120007f4a683866481336b70310268cfa107aebe9d594a6acf75bda968";
}

impl Type {
    fn dds(self) -> String {
        let (package, name) = self.name.split_once('/').expect("package and name");
        format!("{package}::msg::dds_::{name}_")
    }
}

/// How a robot speaks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Speech {
    /// `rmw_zenoh` in this domain.
    Rmw(u32),
    /// zenoh-bridge-ros2dds in this namespace.
    Bridge(&'static str),
}

/// A message that the robot got.
#[derive(Debug, Clone)]
pub struct Heard {
    /// The payload.
    pub payload: Vec<u8>,
    /// What came beside it.
    pub attachment: Option<Vec<u8>>,
}

/// Messages by topic.
type Messages = Arc<Mutex<BTreeMap<String, Vec<Heard>>>>;

/// A robot whose router is connected to a server.
#[derive(Debug)]
pub struct RosRobot {
    speech: Speech,
    node: Session,
    router: Session,
    tokens: Vec<LivelinessToken>,
    caches: Vec<Queryable<()>>,
    subscribers: Vec<Subscriber<()>>,
    /// Tokens of others that are there now.
    graph: Arc<Mutex<BTreeMap<String, bool>>>,
    heard: Messages,
    sent: BTreeMap<String, i64>,
}

impl RosRobot {
    /// Starts router and node, and connects the router to the server's endpoint.
    pub async fn start(server: &str, speech: Speech) -> Self {
        let own = free_endpoint();
        let router = open(settings("router", server, Some(&own))).await;
        Self::behind(router, settings("client", &own, None), speech).await
    }

    /// The same on an encrypted endpoint, with the certificate in `folder` and the settings that
    /// the guide shows: those of the router, and the namespace of the nodes.
    pub async fn start_encrypted(server: &str, speech: Speech, folder: &Path, namespace: &str) -> Self {
        let own = free_endpoint();
        let router = open(encrypted_router(server, &own, folder)).await;
        let mut node = settings("client", &own, None);
        node.insert_json5("namespace", &format!("\"{namespace}\"")).expect("a namespace");
        Self::behind(router, node, speech).await
    }

    async fn behind(router: Session, node: Config, speech: Speech) -> Self {
        let node = open(node).await;
        let graph: Arc<Mutex<BTreeMap<String, bool>>> = Arc::default();
        let noted = graph.clone();
        let tokens = match speech {
            Speech::Rmw(domain) => format!("@ros2_lv/{domain}/**"),
            Speech::Bridge(_) => "@/*/@ros2_lv/**".to_owned(),
        };
        let watch = node.liveliness().declare_subscriber(tokens).history(true).callback(move |sample| {
            let is_there = sample.kind() == SampleKind::Put;
            noted.lock().expect("not poisoned").insert(sample.key_expr().as_str().to_owned(), is_there);
        });
        let subscribers = vec![watch.await.expect("tokens")];
        let (tokens, caches, sent) = (Vec::new(), Vec::new(), BTreeMap::new());
        Self { speech, node, router, tokens, caches, subscribers, graph, heard: Arc::default(), sent }
    }

    /// The key of a topic.
    pub fn key(&self, topic: &str, kind: Type) -> String {
        match self.speech {
            Speech::Rmw(domain) => format!("{domain}{topic}/{}/{}", kind.dds(), kind.hash),
            Speech::Bridge(namespace) => format!("{namespace}{topic}"),
        }
    }

    /// Declares a publisher (`MP`) or a subscription (`MS`) of a topic.
    pub async fn declare(&mut self, letters: &str, topic: &str, kind: Type) {
        let zid = self.node.zid();
        let key = match self.speech {
            Speech::Rmw(domain) => {
                let (entity, mangled) = (10 + self.tokens.len(), topic.replace('/', "%"));
                let (dds, hash) = (kind.dds(), kind.hash);
                format!(
                    "@ros2_lv/{domain}/{zid}/0/{entity}/{letters}/%/%/robot/{mangled}/{dds}/{hash}/::,10:,:,:,,"
                )
            }
            Speech::Bridge(namespace) => {
                let (package, name) = kind.name.split_once('/').expect("package and name");
                let topic = format!("{namespace}{topic}").replace('/', "§");
                format!("@/{zid}/@ros2_lv/{letters}/{topic}/{package}§msg§{name}/:1:0:0,10")
            }
        };
        self.tokens.push(self.node.liveliness().declare_token(key).await.expect("a token"));
    }

    /// Publishes on a topic's key, or on `suffix` below it.
    pub async fn put(&mut self, topic: &str, kind: Type, suffix: &str, payload: Vec<u8>) {
        let key = self.key(topic, kind);
        let attachment = self.attachment(topic);
        self.put_raw(&format!("{key}{suffix}"), payload, attachment).await;
    }

    /// Publishes on any key.
    pub async fn put_raw(&self, key: &str, payload: Vec<u8>, attachment: Option<Vec<u8>>) {
        let put = self.node.put(key, payload).attachment(attachment);
        // A busy machine may not lose what is compared.
        put.congestion_control(zenoh::qos::CongestionControl::Block).await.expect("sent");
    }

    /// Number, time and a name of the publisher.
    pub fn attachment(&mut self, topic: &str) -> Option<Vec<u8>> {
        if matches!(self.speech, Speech::Bridge(_)) {
            return None;
        }
        let number = self.sent.entry(topic.to_owned()).or_default();
        *number += 1;
        let mut bytes = number.to_le_bytes().to_vec();
        bytes.extend(1_700_000_000_123_456_789_i64.to_le_bytes());
        bytes.push(16);
        bytes.extend([7; 16]);
        Some(bytes)
    }

    /// A publisher that keeps this message for late subscribers, and never sends it otherwise.
    pub async fn keep(&mut self, topic: &str, kind: Type, payload: Vec<u8>) {
        let data_key = self.key(topic, kind);
        let cache = format!("{data_key}/@adv/pub/{}/3/_", self.node.zid());
        let attachment = self.attachment(topic);
        let answer = move |query: zenoh::query::Query| {
            let reply = query.reply(data_key.as_str(), payload.clone()).attachment(attachment.clone());
            reply.wait().expect("a reply");
        };
        let queryable = self.node.declare_queryable(cache.clone()).callback(answer).await;
        self.caches.push(queryable.expect("a cache"));
        self.tokens.push(self.node.liveliness().declare_token(cache).await.expect("a token"));
    }

    /// Listens to a topic.
    pub async fn listen(&mut self, topic: &str, kind: Type) {
        let (heard, name) = (self.heard.clone(), topic.to_owned());
        let subscriber = self.node.declare_subscriber(self.key(topic, kind)).callback(move |sample| {
            let message = Heard {
                payload: sample.payload().to_bytes().into_owned(),
                attachment: sample.attachment().map(|a| a.to_bytes().into_owned()),
            };
            heard.lock().expect("not poisoned").entry(name.clone()).or_default().push(message);
        });
        self.subscribers.push(subscriber.await.expect("a subscription"));
    }

    /// What was heard on a topic.
    pub fn heard(&self, topic: &str) -> Vec<Heard> {
        self.heard.lock().expect("not poisoned").get(topic).cloned().unwrap_or_default()
    }

    /// Waits until that many messages were heard on a topic.
    pub async fn hears(&self, topic: &str, count: usize) -> Vec<Heard> {
        eventually(topic, || async { Some(self.heard(topic)).filter(|heard| heard.len() >= count) }).await
    }

    /// Tokens of others that are there.
    pub fn tokens(&self) -> Vec<String> {
        let own = self.node.zid().to_string();
        let graph = self.graph.lock().expect("not poisoned");
        let there = graph.iter().filter(|(token, is_there)| **is_there && !token.contains(&own));
        there.map(|(token, _)| token.clone()).collect()
    }

    /// Waits for a token of another node with all of these parts.
    pub async fn sees(&self, parts: &[&str]) -> String {
        let with_all = |token: &String| parts.iter().all(|part| token.contains(part));
        eventually(&parts.join(" "), || async { self.tokens().into_iter().find(with_all) }).await
    }

    /// Ends node and router.
    pub async fn stop(self) {
        self.node.close().await.expect("closed");
        self.router.close().await.expect("closed");
    }
}

/// A plain endpoint where nobody listens.
pub fn free_endpoint() -> String {
    let free = TcpListener::bind("127.0.0.1:0").expect("a free port");
    format!("tcp/{}", free.local_addr().expect("its address"))
}

/// The settings of `client/ros2/router.json5`.
fn settings(mode: &str, connect: &str, listen: Option<&str>) -> Config {
    let listen = listen.map_or(String::new(), |endpoint| format!("\"{endpoint}\""));
    let config = Config::from_json5(&format!(
        r#"{{
            mode: "{mode}",
            connect: {{ endpoints: ["{connect}"] }},
            listen: {{ endpoints: [{listen}] }},
            scouting: {{ multicast: {{ enabled: false }} }},
            transport: {{ link: {{ tx: {{ queue: {{ size: {{ interactive_high: 8 }} }} }} }} }},
        }}"#
    ));
    config.expect("settings of zenoh")
}

/// `client/ros2/router_tls.json5` as a person changes it: the address of the server, and where the
/// robot's files are. Besides, the router listens where nobody else does.
pub fn encrypted_router(server: &str, listen: &str, folder: &Path) -> Config {
    let path = root().join("client/ros2/router_tls.json5");
    let shown = std::fs::read_to_string(path).expect("the settings of the guide");
    let changed = shown.replace("tls/maps.example:7447", server);
    let changed = changed.replace("/etc/waymark/r1", folder.to_str().expect("a path"));
    assert!(!changed.contains("maps.example") && !changed.contains("/etc/"), "{changed}");
    let mut config = Config::from_json5(&changed).expect("settings of zenoh");
    config.insert_json5("listen/endpoints", &format!("[\"{listen}\"]")).expect("an endpoint");
    config.insert_json5("scouting/multicast/enabled", "false").expect("a switch");
    config
}

async fn open(config: Config) -> Session {
    let opened = tokio::time::timeout(SOON, zenoh::open(config)).await;
    opened.expect("in time").expect("an open session")
}
