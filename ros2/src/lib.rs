//! ROS 2 on the wire: what a server needs to speak with robots over zenoh.
//!
//! In: keys, payloads, attachments and liveliness tokens, as bytes and text. Out: typed messages
//! with borrowed bytes, or a typed refusal; and the other way round. Nothing here opens a session.
//!
//! Pure: no async runtime, file, socket, clock or thread (`ros2/clippy.toml` enforces it). Modules
//! stand in reading order. Facts of the formats name their source as repository and file; the tests
//! hold them byte for byte, against values of rosbags, Fast-CDR and zenoh sessions.

pub mod cdr;
pub mod type_name;
pub mod topic_name;
pub mod messages;
pub mod rmw_zenoh;
pub mod bridge_dds;
pub mod receive;
pub mod convert;
pub mod robot;
