//! Tokens in, tokens and addresses out.

use super::*;
use crate::config::{Config, RawConfig, RawRos2, RawRos2Robot};
use ros2::rmw_zenoh::{Attachment, Gid};

const ZID: &str = "aabb";
const IMAGE_TYPE: &str = "sensor_msgs::msg::dds_::CompressedImage_";

fn settings(change: impl FnOnce(&mut RawRos2Robot)) -> Ros2Robot {
    let mut robot = RawRos2Robot { robot: "r-1".into(), domain: 3, ..RawRos2Robot::default() };
    change(&mut robot);
    let raw = RawConfig { ros2: RawRos2 { robot: vec![robot] }, ..RawConfig::default() };
    Config::try_from(raw).unwrap().ros2.remove(0)
}

fn outputs() -> Vec<(String, MessageKind)> {
    vec![("/initialpose".into(), MessageKind::PoseWithCovarianceStamped)]
}

fn graph() -> (Graph, Vec<String>) {
    Graph::new(&settings(|_| ()), ZID, 0, &outputs())
}

/// The token of a publisher of the robot's images.
fn camera(entity: u32, hash: &str) -> String {
    format!(
        "@ros2_lv/3/cc/0/{entity}/MP/%/%/camera/%camera%image_raw%compressed/{IMAGE_TYPE}/{hash}/::,5:,:,:,,"
    )
}

#[test]
fn the_server_is_a_node_with_a_publisher() {
    let (_, declare) = graph();
    let hash = MessageKind::PoseWithCovarianceStamped.hash();
    let expected = [
        "@ros2_lv/3/aabb/0/0/NN/%/%/waymark_r_1".to_owned(),
        format!(
            "@ros2_lv/3/aabb/0/1/MP/%/%/waymark_r_1/%initialpose/\
             geometry_msgs::msg::dds_::PoseWithCovarianceStamped_/{hash}/::,10:,:,:,,"
        ),
    ];
    assert_eq!(declare, expected);
    let (_, second) = Graph::new(&settings(|_| ()), ZID, 1, &outputs());
    assert!(second[1].starts_with("@ros2_lv/3/aabb/10000/10001/MP/"), "{second:?}");
}

#[test]
fn a_publisher_gets_a_subscription_with_its_type_and_hash() {
    let (mut graph, _) = graph();
    let came = graph.token(&camera(4, "RIHS01_robots"), true);
    let subscription = format!(
        "@ros2_lv/3/aabb/0/2/MS/%/%/waymark_r_1/%camera%image_raw%compressed/{IMAGE_TYPE}/RIHS01_robots/\
         2::,5:,:,:,,/backends:cpu:"
    );
    assert_eq!(came, Follows { declare: vec![subscription], presence: Some(true), other_type: None });
    assert_eq!(graph.token(&camera(5, "RIHS01_robots"), true), Follows::default(), "one a hash");
    assert_eq!(graph.token(&camera(4, "RIHS01_robots"), false), Follows::default());
    assert_eq!(graph.token(&camera(5, "RIHS01_robots"), false).presence, Some(false));
    assert_eq!(graph.token(&camera(6, "RIHS01_robots"), true).presence, Some(true));
}

#[test]
fn other_publishers_and_the_own_ones_mean_nothing() {
    let (mut graph, declared) = graph();
    let own = camera(4, "RIHS01_robots").replace("/cc/", "/aabb/");
    let topic = camera(4, "RIHS01_robots").replace("%camera%", "%other%");
    let node = "@ros2_lv/3/cc/0/0/NN/%/%/camera".to_owned();
    for token in [own, topic, node, declared[0].clone(), "@ros2_lv/3/x".into(), String::new()] {
        assert_eq!(graph.token(&token, true), Follows::default(), "{token}");
    }
    let raw = camera(4, "RIHS01_robots").replace("CompressedImage_", "Image_");
    let place = graph.topics.iter().position(|used| used.camera.is_some()).unwrap();
    let other = Some((place, "sensor_msgs::msg::dds_::Image_".to_owned()));
    assert_eq!(graph.token(&raw, true), Follows { other_type: other, ..Follows::default() });
}

#[test]
fn publishers_are_bounded() {
    let (mut graph, _) = graph();
    let declared: usize = (0..MAX_PUBLISHERS as u32 + 9)
        .map(|i| graph.token(&camera(i, &format!("RIHS01_{i}")), true).declare.len())
        .sum();
    assert_eq!((declared, graph.publishers.len()), (MAX_PUBLISHERS, MAX_PUBLISHERS));
}

#[test]
fn messages_are_numbered_by_publisher_and_humble_gets_its_own_key() {
    let (mut graph, declare) = graph();
    let kind = MessageKind::PoseWithCovarianceStamped;
    let message = Outgoing { topic: "/initialpose".into(), kind, payload: vec![1] };
    let sent = graph.address(&message, 50);
    let key = format!("3/initialpose/geometry_msgs::msg::dds_::PoseWithCovarianceStamped_/{}", kind.hash());
    let attachment = Attachment { sequence: 1, source_ns: 50, source: Gid::of_token(&declare[1]) };
    assert_eq!(sent, [(key, Some(attachment.write().to_vec()))]);

    let amcl = "@ros2_lv/3/cc/0/9/MS/%/%/amcl/%initialpose/geometry_msgs::msg::dds_::PoseWithCovarianceStamped_/\
                TypeHashNotSupported/::,10:,:,:,,";
    let humble = graph.token(amcl, true).declare;
    assert!(humble[0].contains("/MP/") && humble[0].contains("/TypeHashNotSupported/"), "{humble:?}");
    assert_eq!(graph.token(amcl, true), Follows::default());
    let sent = graph.address(&message, 60);
    let numbers = sent.iter().map(|(_, a)| Attachment::read(a.as_ref().unwrap()).unwrap().sequence);
    assert_eq!(numbers.collect::<Vec<_>>(), [2, 1]);
    assert!(sent[1].0.ends_with("/TypeHashNotSupported"));
    let other = Outgoing { topic: "/other".into(), ..message };
    assert_eq!(graph.address(&other, 70), []);
}

#[test]
fn a_bridge_has_plain_keys_and_tokens_of_its_own() {
    let settings = settings(|r| (r.bridge, r.key_prefix) = (true, "bot1".into()));
    let (mut graph, declare) = Graph::new(&settings, ZID, 0, &outputs());
    assert_eq!(declare, [""; 0]);
    let message = Outgoing {
        topic: "/initialpose".into(),
        kind: MessageKind::PoseWithCovarianceStamped,
        payload: vec![],
    };
    assert_eq!(graph.address(&message, 1), [("bot1/initialpose".to_owned(), None)]);
    let scan = "@/cc/@ros2_lv/MP/bot1§scan/sensor_msgs§msg§LaserScan/:1:0:0,10";
    assert_eq!(graph.token(scan, true).presence, Some(true));
    assert_eq!(graph.token(&scan.replace("bot1", "bot2"), true), Follows::default());
    assert_eq!(graph.token(&scan.replace("/MP/", "/MS/"), true), Follows::default());
    let other = graph.token(&scan.replace("LaserScan", "PointCloud2"), true).other_type.unwrap();
    assert_eq!(other.1, "sensor_msgs/msg/PointCloud2");
    assert_eq!(graph.token(scan, false).presence, Some(false));
}

#[test]
fn keys_have_the_prefix_of_the_robot() {
    let robot = settings(|r| r.key_prefix = "robots/r1".into());
    let wire = Wire::of(&robot);
    let topics = robot.inputs.topics();
    let image = topics.iter().find(|used| used.camera.is_some()).unwrap();
    let key = format!("robots/r1/3/camera/image_raw/compressed/{IMAGE_TYPE}/*");
    assert_eq!(wire.subscriptions(image), [key.clone(), format!("{key}/_buf_cpu")]);
    assert_eq!(wire.tokens(), "robots/r1/@ros2_lv/3/**");
    assert_eq!(wire.token("robots/r1/@ros2_lv/3/cc"), Some("@ros2_lv/3/cc"));
    let latched = "robots/r1/3/tf_static/tf2_msgs::msg::dds_::TFMessage_/*/@adv/pub/**";
    assert_eq!(wire.cache_tokens(&topics[0]).as_deref(), Some(latched));
    assert_eq!(wire.cache_tokens(image), None);
    let (mut graph, _) = Graph::new(&robot, ZID, 0, &outputs());
    let message = Outgoing {
        topic: "/initialpose".into(),
        kind: MessageKind::PoseWithCovarianceStamped,
        payload: vec![],
    };
    assert!(graph.address(&message, 1)[0].0.starts_with("robots/r1/3/initialpose/"));
}
