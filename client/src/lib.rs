//! Robot SDK over zenoh and HTTP.
//!
//! [`RobotClient`] is the robot's side: frames, odometry and scans go out, answers and poses come back, over zenoh.
//! [`MapClient`] is the teacher's side: maps, landmarks, views, lessons and single recognitions, over HTTP.
//! [`named_landmarks`] tells which landmarks an answer names, and whether the picture alone or a known pose named each.
//! Neither decides anything: no vision runs here. `examples/` shows both, numbered in reading order.

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
