//! Claim: data keys are those that rmw_zenoh declares, and every other key is refused with a
//! reason.

use ros2::{
    rmw_zenoh::{Channel, DataKey, DataKeyError, HASH_NOT_SUPPORTED, MAX_KEY_BYTES, cpu_buffers_of},
    topic_name::{TopicName, TopicNameError},
    type_name::TypeName,
};

/// The example of rmw_zenoh's design document.
const CHATTER: &str = concat!(
    "0/robot1/chatter/std_msgs::msg::dds_::String_/",
    "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18",
);

#[test]
fn the_key_of_the_design_document() {
    let key = DataKey::parse(CHATTER).unwrap();
    assert_eq!(key.domain, 0);
    assert_eq!(key.topic.to_string(), "/robot1/chatter");
    assert_eq!(key.type_name.to_string(), "std_msgs/msg/String");
    assert_eq!(key.hash, "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18");
    assert_eq!(key.channel, Channel::Topic);
    assert_eq!(key.to_string(), CHATTER);

    let topic = TopicName::from_ros("/robot1/chatter").unwrap();
    let name = TypeName::from_ros("std_msgs/msg/String").unwrap();
    assert_eq!(DataKey::new(0, topic, name, key.hash), key);
}

#[test]
fn humble_has_a_word_in_place_of_the_hash() {
    let text = format!("7/scan/sensor_msgs::msg::dds_::LaserScan_/{HASH_NOT_SUPPORTED}");
    assert_eq!(HASH_NOT_SUPPORTED, "TypeHashNotSupported");
    let key = DataKey::parse(&text).unwrap();
    assert_eq!((key.domain, key.hash), (7, HASH_NOT_SUPPORTED));
    assert_eq!(key.to_string(), text);
}

#[test]
fn keys_of_buffers_are_told_from_topics() {
    let plain = cpu_buffers_of(CHATTER);
    assert_eq!(plain, format!("{CHATTER}/_buf_cpu"));
    let key = DataKey::parse(&plain).unwrap();
    assert_eq!((key.channel, key.topic.as_key()), (Channel::CpuBuffers, "robot1/chatter"));
    assert_eq!(key.to_string(), plain);
    let device = format!("{CHATTER}/_buf/15cd853dfe9c971710eb85fa883b7846");
    assert_eq!(DataKey::parse(&device), Err(DataKeyError::DeviceBuffers));
    // A topic may have such a part.
    let text = "0/a/_buf/std_msgs::msg::dds_::String_/h";
    assert_eq!(DataKey::parse(text).unwrap().topic.as_key(), "a/_buf");
}

#[test]
fn patterns_leave_open_what_is_not_given() {
    let name = TypeName::from_ros("sensor_msgs/msg/LaserScan").unwrap();
    let topic = TopicName::from_ros("/r1/scan").unwrap();
    assert_eq!(DataKey::every_hash(3, topic, name), "3/r1/scan/sensor_msgs::msg::dds_::LaserScan_/*");
}

#[test]
fn other_keys_are_refused_with_a_reason() {
    let string = "std_msgs::msg::dds_::String_";
    let refused = |key: &str| DataKey::parse(key).expect_err(key);
    assert_eq!(refused(""), DataKeyError::Parts);
    assert_eq!(refused("0"), DataKeyError::Parts);
    assert_eq!(refused(&format!("0/{string}/h")), DataKeyError::Parts);
    assert_eq!(refused(&format!("0/a/{string}/")), DataKeyError::Parts);
    for domain in ["x", "", "-1", "+1", "00", "99999999999", "@ros2_lv"] {
        assert_eq!(refused(&format!("{domain}/a/{string}/h")), DataKeyError::Domain);
    }
    assert_eq!(refused(&format!("0/a//b/{string}/h")), DataKeyError::Topic(TopicNameError::Part(1)));
    assert_eq!(refused(&format!("0/*/{string}/h")), DataKeyError::Topic(TopicNameError::Part(0)));
    for other in ["std_srvs::srv::dds_::Trigger_", "a", "String", "std_msgs/msg/String"] {
        assert!(matches!(refused(&format!("0/a/{other}/h")), DataKeyError::Type(_)), "{other}");
    }
    // What advanced publishers declare beside a topic.
    assert!(matches!(refused(&format!("{CHATTER}/@adv/pub/8b20/1/_")), DataKeyError::Type(_)));
    let long = format!("0/a/{string}/{}", "h".repeat(MAX_KEY_BYTES - 5 - string.len()));
    assert!(DataKey::parse(&long).is_ok());
    assert_eq!(refused(&format!("{long}h")), DataKeyError::TooLong(MAX_KEY_BYTES + 1));
}
