//! `/maps/{map}/modalities`: which modality is best where, as reference runs have shown; named
//! areas; what is fused.

use serde::{Deserialize, Serialize};
use std::fmt;

/// What is fused where runs have told which modality is best. Odometry carries the pose in any
/// case.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum FusionModeBody {
    /// Everything, each as sure as it proved to be.
    All,
    /// Those whose score is at most twice the best one's.
    NearBest,
    /// The best one alone.
    Best,
}

impl fmt::Display for FusionModeBody {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::All => "all",
            Self::NearBest => "near_best",
            Self::Best => "best",
        })
    }
}

/// What estimates poses by itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum ModalityBody {
    /// Odometry alone.
    Odometry,
    /// Scans and odometry.
    Laser,
    /// Recognised landmarks and odometry.
    Landmarks,
}

impl fmt::Display for ModalityBody {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Odometry => "odometry",
            Self::Laser => "laser",
            Self::Landmarks => "landmarks",
        })
    }
}

/// Whose runs an advice rests on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum StatsScopeBody {
    /// Those through the cell itself.
    Cell,
    /// Those through the cell and the eight around it.
    Neighbourhood,
    /// Those through the named area it lies in.
    Area,
    /// All of the map.
    Map,
}

/// A part of the map with a name: a room, a piece of corridor. It speaks for its square metres that
/// were hardly driven through.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct AreaBody {
    /// Unique, 1 to 64 bytes.
    pub name: String,
    /// Its corners in order, x and y in metres: 3 to 64.
    #[cfg_attr(feature = "openapi", schema(value_type = Vec<super::arrays::Pair>))]
    pub corners_m: Vec<[f64; 2]>,
}

/// What changes; a field that is absent stays.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct ModalityMapPatch {
    /// What is fused.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fusion_mode: Option<FusionModeBody>,
    /// All named areas, at most 64; where they overlap the first one counts.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub areas: Option<Vec<AreaBody>>,
}

/// What runs have shown of one modality: odometry alone, or the laser or landmarks each with
/// odometry only. Errors are robot-aligned: metres along, metres to the left, radians.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct ModalityStatsBody {
    /// `odometry`, `laser` or `landmarks`.
    pub modality: ModalityBody,
    /// Mean error of its own position.
    #[cfg_attr(feature = "openapi", schema(value_type = super::arrays::Triple))]
    pub mean: [f64; 3],
    /// Standard deviations about that.
    #[cfg_attr(feature = "openapi", schema(value_type = super::arrays::Triple))]
    pub sigma: [f64; 3],
    /// Share of the way on which it knew something lately.
    pub availability: f64,
    /// Measurements a second.
    pub rate_hz: f64,
    /// Share of them off by more than three of the standard deviations that they claim.
    pub outliers: f64,
    /// Mean squared error over availability, 0.1 rad as much as a metre; absent if it never knew
    /// anything. The lowest is best.
    pub score: Option<f64>,
    /// Steps of 5 cm that were compared.
    pub steps: u64,
    /// Measurements that were compared.
    pub measurements: u64,
}

/// What follows for a robot there.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct AdviceBody {
    /// The best modality; absent where too little is known, and everything is fused.
    pub best: Option<ModalityBody>,
    /// What is fused.
    pub used: Vec<ModalityBody>,
    /// Whose runs say so: those through the `cell`, those through it and the eight around it
    /// (`neighbourhood`), those through the named `area`, or all of the `map`.
    pub scope: StatsScopeBody,
    /// What each modality gets wrong there beyond what it claims.
    pub error_models: Vec<ErrorModelBody>,
}

/// What a modality gets wrong: along, to the left, heading.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct ErrorModelBody {
    /// `odometry`, `laser` or `landmarks`.
    pub modality: ModalityBody,
    /// Subtracted from what it says: metres, metres, radians; of odometry for each metre.
    #[cfg_attr(feature = "openapi", schema(value_type = super::arrays::Triple))]
    pub bias: [f64; 3],
    /// Added to each variance, as a share of what it claims.
    #[cfg_attr(feature = "openapi", schema(value_type = super::arrays::Triple))]
    pub variance_inflation: [f64; 3],
}

/// A pose cell: a square metre that was driven through in one of four headings.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct CellBody {
    /// Its lower left corner, x.
    pub x_m: f64,
    /// Its lower left corner, y.
    pub y_m: f64,
    /// 0, pi/2, pi or -pi/2, each for a quarter of the circle about it.
    pub heading_rad: f64,
    /// The best modality; absent where too little is known.
    pub best: Option<ModalityBody>,
    /// What is fused.
    pub used: Vec<ModalityBody>,
}

/// A named area and what is known of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct NamedAreaBody {
    /// Unique, 1 to 64 bytes.
    pub name: String,
    /// Its corners in order, x and y in metres.
    #[cfg_attr(feature = "openapi", schema(value_type = Vec<super::arrays::Pair>))]
    pub corners_m: Vec<[f64; 2]>,
    /// By heading: 0, pi/2, pi, -pi/2.
    pub headings: Vec<AreaStatsBody>,
}

/// What is known of a place.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct AreaStatsBody {
    /// What follows for a robot there.
    pub advice: AdviceBody,
    /// What runs have shown, by modality.
    pub statistics: Vec<ModalityStatsBody>,
}

/// All that is known of a map's modalities.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct ModalityMapBody {
    /// What is fused.
    pub fusion_mode: FusionModeBody,
    /// Areas with a name.
    pub areas: Vec<NamedAreaBody>,
    /// Side of the cells.
    pub cell_m: f64,
    /// Cells that were driven through; see `modalities/at` for what was found in one.
    pub cells: Vec<CellBody>,
    /// Cells that this answer has no room for.
    pub omitted_cells: usize,
    /// All of the map.
    pub map: AreaStatsBody,
}

/// Where a robot would be.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::IntoParams))]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "openapi", into_params(parameter_in = Query))]
pub struct ModalityQuery {
    /// Metres, in the map.
    pub x_m: f64,
    /// Metres, in the map.
    pub y_m: f64,
    /// Heading of the robot, radians; 0 if absent.
    #[serde(default)]
    pub theta_rad: f64,
}
