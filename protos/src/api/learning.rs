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

/// Which jobs are listed, newest first.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::IntoParams))]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "openapi", into_params(parameter_in = Query))]
pub struct JobQuery {
    /// Most items; 100 by default, bounded by `limits.page`.
    pub limit: Option<usize>,
    /// The `next` of the page before; absent for the first page.
    pub cursor: Option<String>,
    /// Only those that stand so.
    pub state: Option<JobState>,
    /// Only those of this map.
    pub map: Option<String>,
}

impl JobState {
    /// The word in queries and in the database.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Queued => "queued",
            Self::Running => "running",
            Self::Done => "done",
            Self::Failed => "failed",
            Self::Cancelled => "cancelled",
        }
    }

    /// The state of a word; an unknown one counts as `queued`.
    pub fn of_word(word: &str) -> Self {
        let all = [Self::Queued, Self::Running, Self::Done, Self::Failed, Self::Cancelled];
        all.into_iter().find(|state| state.as_str() == word).unwrap_or(Self::Queued)
    }
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
    /// Name of the token that asked for it; `server` for what the server does by itself.
    #[serde(default)]
    pub by: String,
    /// When it was asked for, ms since the Unix epoch.
    #[serde(default)]
    pub created_ms: i64,
    /// When it was begun last; absent while it waits.
    pub started_ms: Option<i64>,
    /// When it ended.
    pub ended_ms: Option<i64>,
}
