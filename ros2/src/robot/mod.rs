//! One robot of ROS 2 as Waymark knows robots. In: settings of a robot (its topics, frames and
//! cameras), and its decoded messages in the order in which they came. Out: `Frame`, `Odometry` and
//! `Scan` of `waymark.v1`, numbered within one epoch, and a typed reason for whatever could not be
//! made of a message.
//!
//! Knows neither transport nor clock: live robots and recordings go the same way. Times are header
//! stamps.

mod settings;
mod problem;
mod odometry;
mod camera;
mod laser;
mod adapter;

pub use adapter::{ConvertedMessage, RobotAdapter, RobotMessage};
pub use odometry::{MAX_ODOMETRY, MAX_STEP_BACK_NS, MAX_WAIT_NS};
pub use problem::{Input, MissingInput, MissingReason, Problem, advice};
pub use settings::{
    CameraSettings, ImageForm, MAX_CAMERAS, RobotSettings, SettingsError, TopicUse, absolute_topic,
};
