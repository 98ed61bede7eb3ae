//! `/robots/{robot}/recording` and `/maps/{map}/reference-runs`: recordings, and reference runs, to
//! learn which modality to trust where.

use super::modalities::ModalityStatsBody;
use serde::{Deserialize, Serialize};

/// A recording as it stands.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct RecordingStatusBody {
    /// Name of the map.
    pub map: String,
    /// Whose run.
    pub robot: String,
    /// False once it is full, or the robot's software was started again, or it went to another map,
    /// or its odometry jumped: what was recorded until then can be learnt from.
    pub active: bool,
    /// Why it is active no longer.
    pub reason: Option<String>,
    /// Way driven by odometry, metres.
    pub distance_m: f64,
    /// Time of the first and the last reading of odometry, ns of the robot's clock; absent before
    /// the first.
    #[cfg_attr(feature = "openapi", schema(value_type = Option<super::arrays::Span>))]
    pub span_ns: Option<[i64; 2]>,
    /// Readings of odometry that were kept.
    pub odometry: usize,
    /// Fixes by landmarks.
    pub landmarks: usize,
    /// Fixes by the laser.
    pub laser: usize,
}

/// Where the robot really was.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct ReferenceTrajectoryBody {
    /// Time (ns of the robot's clock, as in its messages), x and y in metres on the map, heading in
    /// radians; times rise, 2 to 200 000 (up to 112 bytes each). Nothing is learnt between two that
    /// are more than a second apart.
    pub poses: Vec<(i64, f64, f64, f64)>,
    /// Standard deviation of its positions, metres; 0.01 if absent.
    pub sigma_m: Option<f64>,
    /// Of its headings, radians; 0.005 if absent.
    pub sigma_rad: Option<f64>,
}

/// A run that was learnt from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct ReferenceRunBody {
    /// Its number, counting up over all maps.
    pub id: i64,
    /// Whose run.
    pub robot: String,
    /// ms since the Unix epoch.
    pub created_ms: i64,
    /// Way of which the path was known, metres.
    pub distance_m: f64,
    /// Square metres by heading that it tells of.
    pub cells: usize,
    /// What it showed, all of it together.
    pub statistics: Vec<ModalityStatsBody>,
}

/// Runs of a map that were learnt from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct ReferenceRuns {
    /// Oldest first; at most 200.
    pub runs: Vec<ReferenceRunBody>,
}
