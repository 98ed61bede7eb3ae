//! `/maps/{map}/mapping`: the walls of a map made by a robot that drives.

use super::WallBody;
use serde::{Deserialize, Serialize};

/// Who makes the map.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct NewMapping {
    /// A robot that stands on this map; its scans must come with odometry.
    pub robot: String,
    /// Where its first pose is in the frame of the map: x, y in metres, heading in radians. If
    /// absent, the drive makes the frame: it begins at the origin, and what a survey finds is known
    /// relative to the drive as a whole.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "openapi", schema(value_type = Option<super::arrays::Triple>))]
    pub origin: Option<[f64; 3]>,
    /// Look for landmarks, too: its frames, with intrinsics and mounting, are kept until the end,
    /// and objects on walls become tracks of a gathering.
    #[serde(default)]
    pub landmarks: bool,
}

/// How far a mapping has come.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum MappingStageBody {
    /// The server was started again: the scans that were kept are mapped once more. New ones wait,
    /// as many as there is room for.
    Resuming,
    /// Scans are taken.
    Mapping,
    /// Everything is fitted once more; then the walls are held or stored.
    Finishing,
    /// The walls are held, see `walls`; the map is as before.
    Found,
    /// The walls are those of the map.
    Done,
    /// See `reason`; the map is as before.
    Failed,
}

/// An object of a drive that is no landmark.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct LeftOutBody {
    /// Its centre in the map, metres.
    pub x_m: f64,
    /// Metres.
    pub y_m: f64,
    /// Over the floor, metres.
    pub z_m: f64,
    /// Metres.
    pub width_m: f64,
    /// Metres.
    pub height_m: f64,
    /// Number of its views.
    pub views: usize,
    /// Why it is none.
    pub reason: String,
}

/// A mapping as it stands.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct MappingProgressBody {
    /// Name of the map.
    pub map: String,
    /// Whose scans.
    pub robot: String,
    /// How far it has come.
    pub stage: MappingStageBody,
    /// Scans that were taken.
    pub scans: u64,
    /// Scans that were not: the queue was full, the robot's software was started again, or there
    /// were too many.
    pub dropped: u64,
    /// Frames that were taken; absent where no landmarks are looked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frames: Option<usize>,
    /// What of the frames cannot be used: how often, and why.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frames_refused: Option<String>,
    /// Number of landmarks that are proposed, once they are found.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub landmarks: Option<usize>,
    /// What hangs there and is no landmark, and why: the 64 with the most views.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub left_out: Vec<LeftOutBody>,
    /// The gathering whose tracks these are, once the walls are stored.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gathering: Option<i64>,
    /// Way driven, metres.
    pub distance_m: f64,
    /// Where the robot is in the map so far: x, y, theta; absent before the first scan.
    #[cfg_attr(feature = "openapi", schema(value_type = Option<super::arrays::Triple>))]
    pub pose: Option<[f64; 3]>,
    /// Number of walls, once they are found.
    pub segments: Option<usize>,
    /// Loop closures, once fitted.
    pub loop_closures: Option<usize>,
    /// Why it failed, or why a finished one proposes no landmarks.
    pub reason: Option<String>,
    /// Why further scans are not kept on disk: a restart of the server would lose them. Absent
    /// while they are.
    pub journal_error: Option<String>,
    /// The walls that are held: what would replace those of the map. Absent at every other stage.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub walls: Option<Vec<WallBody>>,
}

/// What becomes of the walls of a drive that ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::IntoParams))]
#[cfg_attr(feature = "openapi", into_params(parameter_in = Query))]
#[serde(deny_unknown_fields)]
pub struct FinishMappingQuery {
    /// Hold the walls (`stage` is `found` then), so that somebody may look at them: asked once more
    /// without it, they replace those of the map; `DELETE` gives them up.
    #[serde(default)]
    pub hold: bool,
    /// Accept the proposed landmarks that pass every gate, and learn them: `MAP-01` and so on.
    #[serde(default)]
    pub accept: bool,
}
