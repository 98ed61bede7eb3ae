//! `/maps/{map}/learn`, `/jobs`: lessons and jobs.

use serde::{Deserialize, Serialize};
use serde_json::Value;

/// How to learn one landmark.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct LandmarkLesson {
    /// Views generated from each photograph, 0 to 100; absent fills up where photographs are few.
    pub generated_views: Option<usize>,
}

/// What to learn of a map, and how.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct MapLesson {
    /// Names; absent means every landmark that has views.
    pub landmarks: Option<Vec<String>>,
    /// Views generated from each photograph, 0 to 100; absent fills up where photographs are few.
    pub generated_views: Option<usize>,
}

/// Where a job stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum JobState {
    /// Waits.
    Queued,
    /// At work.
    Running,
    /// Ended well; `result` is set.
    Done,
    /// Ended badly; `message` says why.
    Failed,
    /// Stopped on request; nothing was changed.
    Cancelled,
}

/// Long work.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Job {
    /// Its number, counting up over all maps.
    pub id: i64,
    /// `learn`.
    pub kind: String,
    /// The map it works on.
    pub map: String,
    /// Where it stands.
    pub state: JobState,
    /// 0 to 1.
    pub progress: f64,
    /// What it does, or why it failed.
    pub message: String,
    /// What came of it.
    pub result: Option<Value>,
}
