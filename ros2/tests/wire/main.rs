//! The formats byte for byte: values measured with rosbags, Fast-CDR and zenoh, random messages of rosbags, and what
//! holds for every message.

mod attachments;
mod bounds;
mod bridge;
mod fields;
mod golden;
mod hex;
mod keys;
mod padding;
mod received;
mod rosbags;
mod round_trips;
mod tokens;
mod trees;
