//! `/maps/{map}/walls`: the walls of a map.

use serde::{Deserialize, Serialize};

/// A straight piece of wall, the free side on the left of a to b.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct WallBody {
    /// First end: x, y in metres.
    pub a: [f64; 2],
    /// Second end: x, y in metres.
    pub b: [f64; 2],
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
        Self { segments: ends_m.into_iter().map(|[a, b]| WallBody { a, b }).collect() }
    }
}
