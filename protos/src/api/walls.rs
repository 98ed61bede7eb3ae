//! `/maps/{map}/walls`: the walls of a map.

use serde::{Deserialize, Serialize};

/// A straight piece of wall, the free side on the left of a to b.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct WallBody {
    /// First end: x, y in metres.
    #[cfg_attr(feature = "openapi", schema(value_type = super::arrays::Pair))]
    pub a: [f64; 2],
    /// Second end: x, y in metres.
    #[cfg_attr(feature = "openapi", schema(value_type = super::arrays::Pair))]
    pub b: [f64; 2],
    /// How well it is known, about its middle: variance of its direction (rad^2), covariance of
    /// direction and offset to its free side (rad m), variance of the offset (m^2), relative to the
    /// map frame. A map made of scans has it. Absent: measured by hand, to 1 cm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "openapi", schema(value_type = Option<super::arrays::Triple>))]
    pub covariance: Option<[f64; 3]>,
}

impl WallBody {
    /// A wall between two points (metres) that is measured by hand.
    pub fn between(a: [f64; 2], b: [f64; 2]) -> Self {
        Self { a, b, covariance: None }
    }
}

/// The walls of a map.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct WallsBody {
    /// In the order given.
    pub segments: Vec<WallBody>,
}

impl FromIterator<[[f64; 2]; 2]> for WallsBody {
    fn from_iter<I: IntoIterator<Item = [[f64; 2]; 2]>>(ends_m: I) -> Self {
        Self { segments: ends_m.into_iter().map(|[a, b]| WallBody::between(a, b)).collect() }
    }
}

/// A file whose walls are read, in its body.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::IntoParams))]
#[cfg_attr(feature = "openapi", into_params(parameter_in = Query))]
#[serde(deny_unknown_fields)]
pub struct WallFileQuery {
    /// Extension of its name: `geojson`, `svg`, `svgz`, `json` (a map of `waymark map build`, or
    /// GeoJSON) or `txt` (a vector map).
    pub kind: String,
    /// Metres of a unit of an SVG floor plan, above 0; left out, the plan's width and height in mm,
    /// cm, in or pt count.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub metres_per_unit: Option<f64>,
}

/// What was taken of a file. Nothing is stored.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct FileWalls {
    /// The walls, in the order of the file.
    pub segments: Vec<WallBody>,
    /// Their length, m.
    pub length_m: f64,
    /// What a person should know of how it was read.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub note: Option<String>,
}
