//! Robot SDK over zenoh and HTTP.
//!
//! [`RobotClient`] is the robot's side: frames, odometry and scans go out, answers and poses come back, over zenoh.
//! [`MapClient`] is the teacher's side: maps, landmarks, views, lessons and single recognitions, over HTTP.
//! [`named_landmarks`] lists the landmarks that an answer names, and whether each was recognised globally or guided.
//! Recognition runs at the server. `examples/` shows both sides, numbered in reading order.

pub mod capture;
pub mod error;
mod gatherings;
mod http;
pub mod lessons;
pub mod map;
pub mod named;
pub mod robot;
pub mod reference_runs;
mod transport;

pub use capture::Capture;
pub use error::ClientError;
pub use map::MapClient;
pub use named::{NamedLandmark, named, named_landmarks, quad_corners};
pub use protos::{self, v1};
pub use robot::{Delivery, RobotClient, RobotOptions};
