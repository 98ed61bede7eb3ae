//! `/events`: what changes on the server, as a stream that can be resumed.

use super::{backups::BackupState, learning::JobState};
use serde::{Deserialize, Serialize};

/// Which events are sent.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::IntoParams))]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "openapi", into_params(parameter_in = Query))]
pub struct EventQuery {
    /// Only those about this map.
    pub map: Option<String>,
    /// Only those of these kinds, with commas between.
    #[cfg_attr(feature = "openapi", param(value_type = Option<Vec<EventKind>>, style = Form, explode = false))]
    pub kind: Option<String>,
    /// The id of the last event that was received; the header `Last-Event-ID` says the same and
    /// counts more.
    pub last_event_id: Option<String>,
}

/// What became of a landmark.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum LandmarkChange {
    /// It is new.
    Added,
    /// Its name, size, place, health, views or model are others.
    Changed,
    /// It is gone.
    Removed,
}

/// What became of a gathering.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum GatheringChange {
    /// It has begun.
    Begun,
    /// It has ended.
    Ended,
    /// Tracks were accepted or discarded.
    Decided,
    /// It is gone.
    Deleted,
}

/// What has happened. In JSON, `kind` is the name of the variant.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum ServerEventBody {
    /// The first of every stream: the events after this one follow.
    Ready,
    /// Events are missing before this one, because the reader was away or behind for too long, or
    /// the server was started again: read anew what is shown.
    Reset,
    /// A map has a new version, or is gone.
    MapChanged {
        /// The map.
        map: String,
        /// Its version; null if it is gone.
        version: Option<u64>,
    },
    /// A landmark was added, changed or removed.
    LandmarkChanged {
        /// Its map.
        map: String,
        /// Its name.
        landmark: String,
        /// What became of it.
        change: LandmarkChange,
    },
    /// More than 100 landmarks changed at once: read the list anew.
    LandmarksChanged {
        /// Their map.
        map: String,
        /// How many.
        count: u64,
    },
    /// A job is queued, runs or has ended.
    Job {
        /// Its map.
        map: String,
        /// Its number.
        job: i64,
        /// Where it stands.
        state: JobState,
    },
    /// A robot came or went.
    Presence {
        /// The map it stands on; null for a robot that is not registered.
        map: Option<String>,
        /// The robot.
        robot: String,
        /// Whether it is there.
        present: bool,
    },
    /// A gathering began or ended, or its tracks were decided about.
    Gathering {
        /// Its map.
        map: String,
        /// Its number.
        gathering: i64,
        /// What became of it.
        change: GatheringChange,
    },
    /// A backup is being made, is complete or has failed. For administrators.
    Backup {
        /// Its name.
        backup: String,
        /// How far it is.
        state: BackupState,
    },
    /// Tokens were made or revoked. For administrators.
    TokensChanged,
}

/// A kind of events that a reader can choose, for the document: [`ServerEventBody::KINDS`].
#[cfg(feature = "openapi")]
#[derive(Debug, utoipa::ToSchema)]
#[schema(rename_all = "snake_case")]
pub enum EventKind {
    /// A map has a new version, or is gone.
    MapChanged,
    /// A landmark was added, changed or removed.
    LandmarkChanged,
    /// Many landmarks changed at once.
    LandmarksChanged,
    /// A job is queued, runs or has ended.
    Job,
    /// A robot came or went.
    Presence,
    /// A gathering began or ended, or its tracks were decided about.
    Gathering,
    /// A backup is being made, is complete or has failed.
    Backup,
    /// Tokens were made or revoked.
    TokensChanged,
}

/// A numbered event.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct ServerEvent {
    /// Its id, for `Last-Event-ID`.
    pub id: String,
    /// ms since the Unix epoch.
    pub at_ms: i64,
    /// What has happened.
    #[serde(flatten)]
    pub what: ServerEventBody,
}

impl ServerEventBody {
    /// Kinds that a reader can choose.
    pub const KINDS: [&str; 8] = [
        "map_changed",
        "landmark_changed",
        "landmarks_changed",
        "job",
        "presence",
        "gathering",
        "backup",
        "tokens_changed",
    ];

    /// The word of `kind`.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Ready => "ready",
            Self::Reset => "reset",
            Self::MapChanged { .. } => "map_changed",
            Self::LandmarkChanged { .. } => "landmark_changed",
            Self::LandmarksChanged { .. } => "landmarks_changed",
            Self::Job { .. } => "job",
            Self::Presence { .. } => "presence",
            Self::Gathering { .. } => "gathering",
            Self::Backup { .. } => "backup",
            Self::TokensChanged => "tokens_changed",
        }
    }

    /// The map it is about, if it is about one.
    pub fn map(&self) -> Option<&str> {
        match self {
            Self::MapChanged { map, .. }
            | Self::LandmarkChanged { map, .. }
            | Self::LandmarksChanged { map, .. }
            | Self::Job { map, .. }
            | Self::Gathering { map, .. } => Some(map),
            Self::Presence { map, .. } => map.as_deref(),
            Self::Ready | Self::Reset | Self::Backup { .. } | Self::TokensChanged => None,
        }
    }
}
