//! `/maps/{map}/commits`, `/difference`, `/rollback`: maps as versions.

use super::{Page, Place, Size};
use serde::{Deserialize, Serialize};

/// A commit: what one request or job changed of a map.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Commit {
    /// Its number: later commits have greater ones, also across maps.
    pub id: u64,
    /// The commit of this map before it; it may be forgotten.
    pub parent: Option<u64>,
    /// ms since the Unix epoch.
    pub created_ms: i64,
    /// Name of the token, `local` for that of the server's machine, `server` for what the server
    /// does by itself. Of a job: who asked for it.
    pub author: String,
    /// The job, if one did it.
    pub job: Option<u64>,
    /// Method and path of the request, as `PATCH /maps/{map}/landmarks/{landmark}`; of a job its
    /// kind; `outside` for what another program wrote into the database.
    pub operation: String,
    /// The reason that the client gave (header `Waymark-Why`).
    pub why: Option<String>,
    /// What changed.
    pub summary: ChangeSummary,
}

/// Counts of what changed.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(default)]
pub struct ChangeSummary {
    /// Landmarks that are new.
    pub landmarks_added: u64,
    /// Landmarks that are gone.
    pub landmarks_removed: u64,
    /// Landmarks with another name, size, place, model, or other views.
    pub landmarks_changed: u64,
    /// Training views that are new.
    pub views_added: u64,
    /// Training views that are gone.
    pub views_removed: u64,
    /// Models that differ, if only by a threshold.
    pub models_changed: u64,
    /// The walls differ.
    pub walls_changed: bool,
    /// The picture under the map, or where it lies, differs.
    pub underlay_changed: bool,
    /// Reference runs that are new.
    pub reference_runs_added: u64,
    /// Reference runs that are gone.
    pub reference_runs_removed: u64,
    /// Which settings differ: `name`, `site`, `building`, `floor`, `parent`, `pipeline`
    /// (detector or decision), `learning`, `fusion_mode`, `areas`, `visibility_settings`.
    pub settings: Vec<String>,
    /// Names of the first landmarks that differ, at most 8.
    pub landmarks: Vec<String>,
}

/// What differs between a map at two commits.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Difference {
    /// The earlier commit.
    pub from_commit: u64,
    /// The later commit; the newest one for the present state.
    pub to_commit: u64,
    /// Counts of all of it.
    pub summary: ChangeSummary,
    /// How the walls differ.
    pub walls: Option<WallsDifference>,
    /// The landmarks that differ, in the order of their numbers.
    pub landmarks: Page<LandmarkDifference>,
}

/// Size and place of a landmark, as far as they are known.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct SizeAndPlace {
    /// Its size.
    pub size: Option<Size>,
    /// Where it is, in the map.
    pub place: Option<Place>,
}

/// How a landmark differs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct LandmarkDifference {
    /// Its name after the change, or before it if it is gone.
    pub name: String,
    /// Its name before, where that was another one.
    pub old_name: Option<String>,
    /// Whether it is new, gone, or differs.
    pub change: ChangeKind,
    /// Of one that stays: name, size, place, learning.
    pub fields: Vec<String>,
    /// Its size and place before; absent if it is new.
    pub before: Option<SizeAndPlace>,
    /// Its size and place after; absent if it is gone.
    pub after: Option<SizeAndPlace>,
    /// Training views that are new.
    pub views_added: u64,
    /// Training views that are gone.
    pub views_removed: u64,
    /// Its model differs, if only by a threshold.
    pub model_changed: bool,
}

/// Kind of a change.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum ChangeKind {
    /// It is new.
    Added,
    /// It is gone.
    Removed,
    /// It differs.
    Changed,
}

/// How walls differ.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct WallsDifference {
    /// Number of segments before.
    pub before: u64,
    /// Number of segments after.
    pub after: u64,
    /// Segments that are new.
    pub added: u64,
    /// Segments that are gone.
    pub removed: u64,
    /// The box round both (map frame, m): least x, least y, greatest x, greatest y.
    #[cfg_attr(feature = "openapi", schema(value_type = Option<super::arrays::Bounds>))]
    pub bounds_m: Option<[f64; 4]>,
}

/// Which states are compared.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::IntoParams))]
#[cfg_attr(feature = "openapi", into_params(parameter_in = Query))]
#[serde(deny_unknown_fields)]
pub struct DifferenceQuery {
    /// The earlier commit.
    pub from: u64,
    /// The later commit; left out, the present state.
    pub to: Option<u64>,
    /// Most landmarks of the page.
    pub limit: Option<usize>,
    /// `next` of the page before.
    pub cursor: Option<String>,
}

/// A way back.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct Rollback {
    /// The commit whose state the map gets.
    pub to: u64,
}

/// What a roll back did.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct RollbackOutcome {
    /// False if the map was so already; then no commit was made.
    pub changed: bool,
    /// The newest commit.
    pub commit: Commit,
}
