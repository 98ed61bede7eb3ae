//! `/maps/{map}/gatherings`: training views gathered by a robot that drives past, and a person's
//! decision on them.

use super::{failed_gates::FailedGate, learning::Job, views::PlacementReportBody};
use serde::{Deserialize, Serialize};

/// Who gathers what.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct NewGatheringBody {
    /// A robot that stands on this map.
    pub robot: String,
    /// Only views of this landmark, which must be learnt already; absent: of whatever flat
    /// four-sided thing is none yet.
    pub landmark: Option<String>,
    /// Views of every landmark that is recognised beyond doubt, too.
    #[serde(default)]
    pub known: bool,
}

/// Views being gathered, or gathered.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Gathering {
    /// Its number, counting up over all maps.
    pub id: i64,
    /// The map.
    pub map: String,
    /// Who gathers.
    pub robot: String,
    /// The only landmark whose views are wanted.
    pub landmark: Option<String>,
    /// Whether views of recognised landmarks are wanted.
    pub known: bool,
    /// It goes on.
    pub open: bool,
    /// What became of the frames. Of a gathering that was interrupted by a restart: since then.
    pub counts: GatheringCountsBody,
    /// ms since the Unix epoch.
    pub created_ms: i64,
    /// ms since the Unix epoch.
    pub ended_ms: Option<i64>,
}

/// What became of frames and quads.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(default)]
pub struct GatheringCountsBody {
    /// Frames offered.
    pub frames: u64,
    /// Of these, dropped because others were still being followed.
    pub dropped: u64,
    /// Frames on another map.
    pub other_map: u64,
    /// Quads that were too small, cut off or blurred to have an icon.
    pub unusable: u64,
    /// Quads that are not flat on a wall of the map.
    pub not_on_wall: u64,
    /// Views kept.
    pub kept: u64,
    /// Quads that repeat a stored view.
    pub near_duplicate: u64,
    /// Quads not yet observed often enough.
    pub too_few_observations: u64,
    /// Quads of tracks that have all the views they may have.
    pub full: u64,
    /// Quads of tracks that were decided on.
    pub decided: u64,
    /// Quads that show a landmark, or may.
    pub known_landmark: u64,
    /// Quads that are no landmark, where only landmarks are wanted.
    pub not_requested: u64,
    /// Quads at the place of a track that look different.
    pub appearance_mismatch: u64,
    /// Quads beyond the number of tracks.
    pub track_limit: u64,
    /// Views that were not stored because a bound was reached or the disk is full.
    pub not_stored: u64,
}

/// Where the object of a track seems to be, in the map.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct EstimatedPlace {
    /// Centre, x.
    pub x_m: f64,
    /// Centre, y.
    pub y_m: f64,
    /// Centre, above the floor.
    pub z_m: f64,
    /// Direction of the outward normal on the floor.
    pub theta_rad: f64,
    /// Width of the rectangle on the wall.
    pub width_m: f64,
    /// Height of the rectangle on the wall.
    pub height_m: f64,
    /// Views that agree on it.
    pub views: usize,
    /// How far off the normal the camera looked: least and most.
    #[cfg_attr(feature = "openapi", schema(value_type = super::arrays::Pair))]
    pub angle_rad: [f64; 2],
}

/// A track: an object that a robot drove past, for a person to decide on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct TrackSummary {
    /// Its number in the gathering.
    pub number: u32,
    /// The landmark whose views these are; null for a thing that is none yet.
    pub landmark: Option<String>,
    /// Frames in which it was followed.
    pub sightings: u32,
    /// Of these, such in which it was taken for a landmark of the map, or nearly.
    pub known: u32,
    /// Numbers of its views; `views/{number}/icon` is the picture.
    pub views: Vec<i64>,
    /// Views beside these that do not agree on its place: another border of it was found, or
    /// something else. They are left out.
    pub inconsistent_views: usize,
    /// The view that stands best for all.
    pub best_view: Option<i64>,
    /// Smallest and largest side of the quad in the picture.
    #[cfg_attr(feature = "openapi", schema(value_type = super::arrays::Pair))]
    pub side_px: [f64; 2],
    /// How far apart the views are (the gate `visibility_confidence`).
    pub v_c: f64,
    /// Where it is by its views.
    pub place: Option<EstimatedPlace>,
    /// Why that is not known.
    pub not_placed: Option<String>,
    /// Whether a lesson of these views would pass every gate, look-alikes apart, and nothing else
    /// speaks against it.
    pub passes: bool,
    /// What speaks against it.
    pub failed_gates: Vec<FailedGate>,
    /// Other tracks that look alike or are at the same place: perhaps the same thing twice, or two
    /// of one kind.
    pub similar_tracks: Vec<u32>,
}

impl TrackSummary {
    /// What speaks against it, in words.
    pub fn details(&self) -> Vec<String> {
        self.failed_gates.iter().map(ToString::to_string).collect()
    }

    /// Where it is, in words.
    pub fn place_text(&self) -> String {
        let Some(at) = &self.place else { return "not placed".to_owned() };
        format!("{:.2} x {:.2} m at {:.2}, {:.2}", at.width_m, at.height_m, at.x_m, at.y_m)
    }
}

/// All tracks of a gathering that wait for a decision.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct TrackList {
    /// By number; those that somebody has decided on are not among them.
    pub tracks: Vec<TrackSummary>,
}

/// A track that is accepted.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct AcceptedTrackBody {
    /// Number of the track.
    pub track: u32,
    /// Name of the landmark it becomes: a new one, or one without views. Several tracks of one
    /// object may be given one name. Not needed for views of a landmark that is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
}

/// What is accepted.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct AcceptRequest {
    /// At least one.
    pub tracks: Vec<AcceptedTrackBody>,
    /// Learn these landmarks at once.
    #[serde(default = "yes")]
    pub learn: bool,
}

fn yes() -> bool {
    true
}

/// A landmark that got views.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct ExtendedLandmark {
    /// Name of the landmark.
    pub name: String,
    /// How many it got.
    pub views: u64,
    /// Whether they place it.
    pub placing: PlacementReportBody,
}

/// What an acceptance came to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct AcceptanceBody {
    /// The landmarks that got views, by name.
    pub landmarks: Vec<ExtendedLandmark>,
    /// The lesson, if one was wanted.
    pub job: Option<Job>,
}
