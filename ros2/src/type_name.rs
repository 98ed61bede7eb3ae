//! Names of message types: `sensor_msgs/msg/Image` in ROS, `sensor_msgs::msg::dds_::Image_` in DDS
//! and in keys.
//!
//! Source: `ros2/rmw_zenoh rmw_zenoh_cpp/src/detail/type_support_common.cpp` (`_create_type_name`);
//! `ros2/design articles/140_topic_and_service_name_mapping.md`.

use std::fmt;

/// Longest package or type, in bytes.
pub const MAX_TYPE_PART_BYTES: usize = 128;

/// The name of a message type.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct TypeName<'a> {
    package: &'a str,
    name: &'a str,
}

/// A text names no message type.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is not the name of a message type")]
pub struct TypeNameError(pub String);

impl TypeName<'static> {
    /// Of a type that this crate knows.
    pub(crate) const fn known(package: &'static str, name: &'static str) -> Self {
        Self { package, name }
    }
}

impl<'a> TypeName<'a> {
    /// From the form of ROS, `sensor_msgs/msg/Image`.
    pub fn from_ros(text: &'a str) -> Result<Self, TypeNameError> {
        let parts = text.split_once("/msg/");
        Self::checked(text, parts)
    }

    /// From the form of DDS, `sensor_msgs::msg::dds_::Image_`. Types of services and actions are
    /// refused.
    pub fn from_dds(text: &'a str) -> Result<Self, TypeNameError> {
        let parts = text.split_once("::msg::dds_::");
        Self::checked(text, parts.and_then(|(package, name)| Some((package, name.strip_suffix('_')?))))
    }

    fn checked(text: &str, parts: Option<(&'a str, &'a str)>) -> Result<Self, TypeNameError> {
        let is_word = |word: &str| {
            word.len() <= MAX_TYPE_PART_BYTES
                && word.starts_with(|c: char| c.is_ascii_alphabetic())
                && word.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_')
        };
        match parts {
            Some((package, name)) if is_word(package) && is_word(name) => Ok(Self { package, name }),
            _ => Err(TypeNameError(text.chars().take(2 * MAX_TYPE_PART_BYTES).collect())),
        }
    }

    /// The package: `sensor_msgs`.
    pub fn package(&self) -> &'a str {
        self.package
    }

    /// The name in its package: `Image`.
    pub fn name(&self) -> &'a str {
        self.name
    }

    /// The form of DDS.
    pub fn to_dds(&self) -> String {
        format!("{}::msg::dds_::{}_", self.package, self.name)
    }
}

impl fmt::Display for TypeName<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/msg/{}", self.package, self.name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_forms_name_the_same_type() {
        let dds = TypeName::from_dds("vision_msgs::msg::dds_::Detection2DArray_").unwrap();
        assert_eq!(dds, TypeName::from_ros("vision_msgs/msg/Detection2DArray").unwrap());
        assert_eq!(dds.to_dds(), "vision_msgs::msg::dds_::Detection2DArray_");
        assert_eq!(dds.to_string(), "vision_msgs/msg/Detection2DArray");
    }

    #[test]
    fn other_texts_are_refused() {
        let dds = [
            "std_srvs::srv::dds_::Trigger_Request_",
            "sensor_msgs::msg::dds_::Image",
            "::msg::dds_::Image_",
            "sensor_msgs::msg::dds_::_",
            "*::msg::dds_::Image_",
            "a/b::msg::dds_::Image_",
            "",
        ];
        assert!(dds.iter().all(|text| TypeName::from_dds(text).is_err()));
        let ros =
            ["sensor_msgs/Image", "sensor_msgs/msg/", "sensor_msgs/msg/Image/x", "/msg/Image", "9/msg/A"];
        assert!(ros.iter().all(|text| TypeName::from_ros(text).is_err()));
        let long = format!("a/msg/{}", "b".repeat(MAX_TYPE_PART_BYTES));
        assert!(TypeName::from_ros(&long).is_ok());
        assert!(TypeName::from_ros(&format!("{long}b")).is_err());
    }
}
