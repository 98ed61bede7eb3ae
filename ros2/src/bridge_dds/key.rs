//! The key of a topic: `[<namespace of the bridge>/]<topic>`.
//!
//! Source: `eclipse-zenoh/zenoh-plugin-ros2dds src/ros2_utils.rs` (`ros2_name_to_key_expr`). The
//! namespace also precedes `/tf` and `/tf_static`, so robots with namespaces do not share them.

use crate::topic_name::TopicName;

/// The key of a topic under a bridge's `namespace`, which is `/` by default.
pub fn key_of(topic: TopicName<'_>, namespace: &str) -> String {
    match namespace.trim_matches('/') {
        "" => topic.as_key().to_owned(),
        namespace => format!("{namespace}/{}", topic.as_key()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_and_topics_belong_to_each_other() {
        let topic = TopicName::from_ros("/tf").unwrap();
        for (namespace, key) in
            [("/", "tf"), ("", "tf"), ("/bot1", "bot1/tf"), ("fleet/bot1", "fleet/bot1/tf")]
        {
            assert_eq!(key_of(topic, namespace), key);
        }
    }
}
