//! What robots do, and those that are not registered.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// What a robot has done since the server started.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct RobotActivity {
    /// Frames that were searched for landmarks and answered.
    pub answered: u64,
    /// Refused frames, by code.
    #[cfg_attr(feature = "openapi", schema(value_type = Object))]
    pub refused: BTreeMap<String, u64>,
    /// The last refused frame.
    pub last_refusal: Option<RefusedFrame>,
    /// Since the last message: a frame, odometry or a scan.
    pub last_message_ms: u64,
    /// Since the last frame in which a landmark was named; absent if there was none.
    pub last_recognised_ms: Option<u64>,
    /// Answered frames in a second, over the last ten whole seconds, or all since its first message.
    pub frames_per_s: f64,
}

/// A refused frame of a robot.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct RefusedFrame {
    /// The stable code.
    pub code: String,
    /// The field at fault.
    pub field: String,
    /// A sentence for a person.
    pub detail: String,
    /// Since it was refused.
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
