//! Fully qualified names of topics: `/robot1/scan` in ROS, `robot1/scan` in keys.
//!
//! Source: `ros2/design articles/140_topic_and_service_name_mapping.md`; `ros2/rmw_zenoh
//! rmw_zenoh_cpp/src/detail/liveliness_utils.cpp` (`strip_slashes`).

use std::fmt;

/// Longest name, in bytes, slash included.
pub const MAX_TOPIC_BYTES: usize = 255;

/// A checked name. None of its characters has a meaning in keys but `/`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct TopicName<'a>(&'a str);

/// Why a text is no name of a topic.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum TopicNameError {
    /// Empty, or longer than [`MAX_TOPIC_BYTES`].
    #[error("the name of a topic has 2 to {MAX_TOPIC_BYTES} bytes with its slash, this one has {0}")]
    Length(usize),
    /// It does not begin with a slash: it depends on a namespace that is not given.
    #[error("the name of a topic begins with `/`")]
    NotAbsolute,
    /// A part that is empty, begins with a digit or has another character.
    #[error("part {0} of the topic's name is not of letters, digits and `_`, beginning with no digit")]
    Part(usize),
}

impl<'a> TopicName<'a> {
    /// From the form of ROS, with a leading slash.
    pub fn from_ros(text: &'a str) -> Result<Self, TopicNameError> {
        Self::from_key(text.strip_prefix('/').ok_or(TopicNameError::NotAbsolute)?)
    }

    /// From the form of keys, without slashes around it.
    pub fn from_key(text: &'a str) -> Result<Self, TopicNameError> {
        let length = text.len() + 1;
        if !(2..=MAX_TOPIC_BYTES).contains(&length) {
            return Err(TopicNameError::Length(length));
        }
        let is_part = |part: &str| {
            part.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_')
                && part.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_')
        };
        match text.split('/').position(|part| !is_part(part)) {
            Some(part) => Err(TopicNameError::Part(part)),
            None => Ok(Self(text)),
        }
    }

    /// The form of keys.
    pub fn as_key(&self) -> &'a str {
        self.0
    }
}

impl fmt::Display for TopicName<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "/{}", self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_forms_name_the_same_topic() {
        let topic = TopicName::from_ros("/robot1/_camera/image_raw").unwrap();
        assert_eq!(topic.as_key(), "robot1/_camera/image_raw");
        assert_eq!(TopicName::from_key(topic.as_key()), Ok(topic));
        assert_eq!(topic.to_string(), "/robot1/_camera/image_raw");
    }

    #[test]
    fn other_texts_are_refused() {
        assert_eq!(TopicName::from_ros("scan"), Err(TopicNameError::NotAbsolute));
        assert_eq!(TopicName::from_ros("/"), Err(TopicNameError::Length(1)));
        for (text, part) in [("/a//b", 1), ("/a/", 1), ("/1a", 0), ("/a/*", 1), ("/a/b%c", 1), ("/~/a", 0)] {
            assert_eq!(TopicName::from_ros(text), Err(TopicNameError::Part(part)), "{text}");
        }
        let long = format!("/{}", "a".repeat(MAX_TOPIC_BYTES - 1));
        assert!(TopicName::from_ros(&long).is_ok());
        assert!(TopicName::from_ros(&format!("{long}a")).is_err());
    }
}
