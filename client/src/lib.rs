//! Robot SDK over zenoh and HTTP.
//!
//! [`RobotClient`] is the robot's side: frames, odometry and scans go out, answers and poses come
//! back, over zenoh. [`MapClient`] is the teacher's side over HTTP: it has a method for every
//! operation of the API, with the types of [`api`]. On the server's own machine it finds its token
//! by itself; else it is given one. [`FleetListener`] hears what all robots and the server send,
//! for recordings. [`named_landmarks`] lists the landmarks that an answer names, each global or
//! guided. No vision runs in the client. `examples/` shows both sides, numbered in reading order.

pub mod capture;
pub mod error;
mod greeting;
pub mod http;
pub mod listener;
mod message_limit;
pub mod questions;
pub mod robot;
pub mod robot_file;
pub mod servers;
mod transport;

pub use capture::Capture;
pub use error::ClientError;
pub use http::{FileDownload, LandmarkRegion, MapClient, NewView, RecogniseOptions, Revised};
pub use listener::{FleetListener, ListenedMessage};
pub use protos::{
    self, api,
    named::{NamedLandmark, named, named_landmarks, quad_corners},
    v1,
};
pub use questions::{LocaliseQuery, MapVersions};
pub use robot::{Delivery, RobotClient, RobotOptions};
pub use robot_file::{ROBOT_FILE_VARIABLE, RobotFile, RobotTls};
pub use servers::ServerEvent;
