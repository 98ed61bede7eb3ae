//! `/robots/{robot}/ros2`: what became of the messages of a robot of ROS 2.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// What became of the messages of a robot of ROS 2 since the start of the server.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Ros2Status {
    /// Whether the settings of the server name the robot; if not, all else is empty.
    pub configured: bool,
    /// Messages received, by topic.
    pub received: BTreeMap<String, u64>,
    /// Messages sent, by topic.
    pub sent: BTreeMap<String, u64>,
    /// Messages that were not used, or only in part, by topic and reason, such as `no_transform`;
    /// the log has the details. The topic is empty for what belongs to none.
    pub reasons: BTreeMap<String, BTreeMap<String, u64>>,
}
