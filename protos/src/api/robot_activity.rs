//! What robots do, and those that are not registered.

use serde::{Deserialize, Serialize};

/// What a robot has done since the server started.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct RobotActivity {
    /// Frames that were searched for landmarks and answered.
    pub answered: u64,
    /// What was used and what was refused, by kind; a kind of which nothing came is absent.
    pub inputs: Vec<RobotInput>,
    /// Since the last message, used or refused; absent where only connections were refused.
    pub last_message_ms: Option<u64>,
    /// Since the last frame in which a landmark was named; absent if there was none.
    pub last_recognised_ms: Option<u64>,
    /// Answered frames in a second, over the last ten whole seconds, or all since its first
    /// message.
    pub frames_per_s: f64,
}

/// What became of one kind of a robot's messages.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct RobotInput {
    /// `frame`, `odometry`, `scan`; of ROS 2 also `camera_info` and `transform`; `connection`: its
    /// links to the server.
    pub input: String,
    /// How many were used.
    pub used: u64,
    /// How many were refused, or lack what others need.
    pub refused: u64,
    /// How many of them since the last that was used: where it rises, none is used any more.
    pub refused_in_a_row: u64,
    /// Why, the last reason first.
    pub reasons: Vec<RefusalReason>,
}

/// Why messages of a robot were refused.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct RefusalReason {
    /// A stable word.
    pub code: String,
    /// The field at fault of the last one, or the topic of ROS.
    pub field: String,
    /// A sentence for a person about the last one.
    pub detail: String,
    /// What to do; empty where the sentence says it.
    pub advice: String,
    /// How many.
    pub count: u64,
    /// Since the last one.
    pub ago_ms: u64,
}

/// A robot that sends messages and is not registered.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct UnknownRobot {
    /// The name it uses.
    pub name: String,
    /// The camera of its last frame; absent if it sent none.
    pub camera: Option<String>,
    /// Its refused messages.
    pub messages: u64,
    /// Since the first of them.
    pub first_ms: u64,
    /// Since the last of them.
    pub last_ms: u64,
}

/// Robots that send messages and are not registered.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct UnknownRobots {
    /// By name; at most 64, those that were heard last.
    pub robots: Vec<UnknownRobot>,
}
