//! Recordings of drives as MCAP files: written, read in the order of time, and compared.
//!
//! Comes in: messages of the wire and the content of maps, or the bytes of a file. Goes out: the
//! bytes of a file that Foxglove shows, or messages of the wire. Files are those of [`mod@write`]
//! and of rosbag2 (ROS 2, MCAP storage). Pure: the caller opens files, talks with servers and knows
//! the time.
//!
//! A recording has two kinds of channels. Our own messages (`waymark.v1`, topics are the keys of
//! the wire) are what is played again; messages of Foxglove's schemas are for viewers. A frame's
//! image stands once, in the viewers' channel.

pub mod foxglove;
pub mod message;
pub mod topics;
mod view;
pub mod write;
pub mod read;
pub mod bag;
pub mod restamp;
pub mod compare;

pub use bag::BagRobot;
pub use message::{Body, Recorded};
pub use read::{DriveReader, ReadError};
pub use view::MapContent;
pub use write::{DriveWriter, WriteError};
