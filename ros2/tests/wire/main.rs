//! The formats byte for byte: values measured with rosbags, Fast-CDR and zenoh, random messages of
//! rosbags, what holds for every message, and what a robot of ROS is to Waymark.

mod attachments;
mod bounds;
mod bridge;
mod camera_variants;
mod fields;
mod golden;
mod hex;
mod image_variants;
mod keys;
mod padding;
mod received;
mod robot;
mod rosbags;
mod round_trips;
mod scan_variants;
mod tokens;
mod trees;
